"""Exact derivatives of the whole shape against central differences of solved shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import InputError
from magfem.fields import DipoleField, UniformField
from magfem.rod import FlexibleSection, MagnetSection, Rod

FIELD = DipoleField([0.0, 40.0, 20.0]).at(RigidTransform.from_translation([0.02, -0.09, 0.05]))
BASE = RigidTransform.from_components([-0.03, 0.0, 0.01], Rotation.from_rotvec([0.2, 1.3, -0.1]))


def flexible(length, **changes):
    given = dict(length=length, radius=1.5e-3, youngs_modulus=5.5e6, density=1040.0, shear_modulus=1.9e6)
    return FlexibleSection(**(given | changes))


MAGNET = MagnetSection(length=5e-3, moment=(0.003, -0.004, 0.0135), mass=1e-4, field_points=3)
PLAIN = (flexible(0.035, intrinsic_curvature=(6.0, -3.0, 4.0)), MAGNET, flexible(0.03), MAGNET)
HARD = (
    flexible(0.035, force_per_length=(0.02, 0.05, 0.0), magnetic_moment_per_length=(0.1, 0, 0.3), elements=12),
    MAGNET,
    flexible(0.03, moment_per_length=(2e-4, 1e-4, -3e-4), elements=8),
)
TIP = dict(tip_force=(2e-3, -1e-3, 1e-3), tip_moment=(3e-5, 2e-5, -4e-5))
# Sections, whether magnets act on each other, loads.
CASES = {
    "field and weight": (PLAIN, False, {}),
    "dead wrench": (PLAIN, False, TIP),
    "follower wrench": (PLAIN, False, TIP | {"follower": True}),
    "magnets among themselves": (PLAIN, True, {"tip_force": (2e-3, -1e-3, 1e-3)}),
    "all at once": (PLAIN, True, TIP),
    "hard-magnetic": (HARD, False, {}),
}
PARAMETERS = ("base", "youngs_modulus", "shear_modulus", "density", "moment", "tip_force", "tip_moment")
STEP = {  # of differences; of a modulus and a moment relative to a typical one
    "base": 1e-5,
    "youngs_modulus": 5.5e6 * 1e-4,
    "shear_modulus": 1.9e6 * 1e-4,
    "density": 1.0,
    "moment": 1e-6,
    "tip_force": 1e-6,
    "tip_moment": 2e-8,
}


def moved(parameter, column, step, sections, base, loads):
    """Sections, base and loads with one parameter moved."""
    sections, loads = list(sections), dict(loads)
    flexible_ones = [k for k, one in enumerate(sections) if isinstance(one, FlexibleSection)]
    if parameter == "base":
        shift, turn = np.zeros(3), np.zeros(3)
        (shift if column < 3 else turn)[column % 3] = step
        base = RigidTransform.from_components(base.translation + shift, Rotation.from_rotvec(turn) * base.rotation)
    elif parameter == "moment":
        k = [n for n, one in enumerate(sections) if isinstance(one, MagnetSection)][column // 3]
        moment = sections[k].moment_vector.copy()
        moment[column % 3] += step
        sections[k] = replace(sections[k], moment=moment)
    elif parameter in ("tip_force", "tip_moment"):
        vector = np.array(loads.get(parameter, (0, 0, 0)), float)
        vector[column] += step
        loads[parameter] = vector
    else:
        k = flexible_ones[column]
        sections[k] = replace(sections[k], **{parameter: getattr(sections[k], parameter) + step})
    return sections, base, loads


def difference(values, step):
    """Of order four, from values at −2, −1, 1 and 2 steps."""
    return (8 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12 * step)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("parameter", PARAMETERS)
def test_derivatives_of_the_shape(case, parameter):
    sections, interacting, loads = CASES[case]
    magnets = sum(isinstance(one, MagnetSection) for one in sections)
    fields = [None] * magnets if interacting else None
    state = Rod(sections, BASE, fields).solve(field=FIELD, tolerance=1e-13, **loads)
    if interacting and parameter == "moment":
        with pytest.raises(InputError, match="moments are not there"):
            state.sensitivity("moment")
        return
    exact = state.sensitivity(parameter)
    count = len(exact.parameters)
    assert exact.positions.shape == exact.rotations.shape == (len(state.positions), 3, count)
    for column in range(count):
        shapes = {}
        for steps in (1, -1, 2, -2):
            changed, base, others = moved(parameter, column, steps * STEP[parameter], sections, BASE, loads)
            shapes[steps] = Rod(changed, base, fields).solve(field=FIELD, guess=state, tolerance=1e-13, **others)
        shift = difference({steps: one.positions for steps, one in shapes.items()}, STEP[parameter])
        back = state.rotations.inv()
        turn = difference({steps: (one.rotations * back).as_rotvec() for steps, one in shapes.items()}, STEP[parameter])
        assert exact.positions[..., column] == pytest.approx(shift, rel=0, abs=1e-6 * np.abs(shift).max())
        assert exact.rotations[..., column] == pytest.approx(turn, rel=0, abs=1e-6 * np.abs(turn).max() + 1e-12)


def test_a_modulus_that_follows_from_poissons_ratio_moves_with_youngs():
    """G = E / 2(1 + ν): the derivative by E includes G's; stated G stays."""
    for changes in (dict(shear_modulus=None, poisson_ratio=0.45), dict(shear_modulus=1e6)):
        section = flexible(0.04, **changes)
        load = dict(tip_force=(2e-3, 0, 0), field=FIELD, tolerance=1e-13)
        rods = [Rod([replace(section, youngs_modulus=5.5e6 + step), MAGNET]) for step in (0.0, 500.0, -500.0)]
        state, one, other = (rod.solve(**load) for rod in rods)
        expected = (one.positions - other.positions) / 1000
        found = state.sensitivity("youngs_modulus").positions[..., 0]
        assert found == pytest.approx(expected, rel=0, abs=1e-6 * np.abs(expected).max())


def test_a_stiffer_rod_under_a_small_load_moves_as_its_compliance():
    """∂(PL³/3EI)/∂E = −w/E, and w/P by the force, in closed form."""
    section = FlexibleSection(length=0.1, radius=1e-3, youngs_modulus=1e8, shear_modulus=1e14)
    P, EI = 1e-8, 1e8 * np.pi * 1e-12 / 4
    state = Rod([section]).solve(gravity=(0, 0, 0), tip_force=(P, 0, 0), tolerance=1e-14)
    w = P * 1e-3 / (3 * EI)
    assert state.sensitivity("youngs_modulus").positions[-1, 0, 0] == pytest.approx(-w / 1e8, rel=1e-6)
    assert state.sensitivity("tip_force").positions[-1, 0, 0] == pytest.approx(w / P, rel=1e-6)
    assert state.sensitivity("tip_moment").rotations[-1, 1, 1] == pytest.approx(0.1 / EI, rel=1e-6)


def test_names_say_which_parameter_a_column_is_of():
    state = Rod(PLAIN, BASE).solve(field=FIELD)
    assert state.sensitivity("density").parameters == ("section 0", "section 2")
    assert state.sensitivity("moment").parameters[3:] == ("magnet 1, x", "magnet 1, y", "magnet 1, z")
    assert state.sensitivity("base").parameters[3] == "turn about x"


def test_what_cannot_be_differentiated_is_said():
    state = Rod(PLAIN, BASE).solve(field=UniformField([0, 0, 1e-3]))
    with pytest.raises(InputError, match="sensitivities are with respect to currents, joints"):
        state.sensitivity("length")
    for wanted in ("currents", "joints"):
        with pytest.raises(InputError, match=r"field=\(system, currents, joints\)"):
            state.sensitivity(wanted)
    with pytest.raises(InputError, match=r"field=\(system, currents, joints\)"):
        _ = state.jacobian
