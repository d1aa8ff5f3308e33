"""What must not matter to a rod: where the world's axes are, and in which units it is measured."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import ConvergenceError
from magfem.fields import DipoleField
from magfem.rod import FlexibleSection, MagnetSection, Rod

components = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(components, components, components).map(np.array)

DIPOLE = DipoleField([0.0, 40.0, 20.0]).at(RigidTransform.from_translation([0.02, -0.09, 0.05]))
SECTIONS = [
    FlexibleSection(length=0.03, radius=1.5e-3, youngs_modulus=5.5e6, density=1040.0, intrinsic_curvature=(4, 2, 1)),
    MagnetSection(length=5e-3, moment=(0.002, 0.0, 0.0135), mass=1e-4, field_points=2),
]


@settings(max_examples=25, deadline=None)
@given(turn=vectors, shift=vectors, force=vectors, follower=st.booleans())
def test_moving_base_field_and_gravity_moves_the_shape(turn, shift, force, follower):
    pose = RigidTransform.from_components(shift, Rotation.from_rotvec(3 * turn))
    force, moment, down = 5e-3 * force, 3e-5 * force[[2, 0, 1]], np.array([0.0, 0.0, -9.81])
    away = pose.rotation.apply
    here = Rod(SECTIONS).solve(
        field=DIPOLE, gravity=down, tip_force=force, tip_moment=moment, follower=follower, tolerance=1e-11
    )
    there = Rod(SECTIONS, pose).solve(
        field=DIPOLE.at(pose),
        gravity=away(down),
        tip_force=force if follower else away(force),
        tip_moment=moment if follower else away(moment),
        follower=follower,
        tolerance=1e-11,
    )
    assert there.positions == pytest.approx(pose.apply(here.positions), abs=1e-10)
    assert (there.rotations * (pose.rotation * here.rotations).inv()).magnitude() == pytest.approx(
        np.zeros(len(here.positions)), abs=1e-8
    )
    assert there.internal_moment == pytest.approx(away(here.internal_moment), abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(size=st.floats(0.01, 100), stiff=st.floats(0.01, 100), load=vectors)
def test_rods_of_any_size_and_stiffness_bend_alike(size, stiff, load):
    """Lengths × s and moduli × e with forces × e s², moments × e s³: the same shape, s times as large.

    Forces stay below Euler's: a moment about its axis would turn a buckled rod for ever.
    """
    force, moment = 1.5e-3 * load, 5e-5 * load[[1, 2, 0]]

    def solve(s, e):
        section = FlexibleSection(length=0.05 * s, radius=1e-3 * s, youngs_modulus=3e6 * e)
        return Rod([section]).solve(
            gravity=(0, 0, 0), tip_force=force * e * s**2, tip_moment=moment * e * s**3, tolerance=1e-11
        )

    one, other = solve(1.0, 1.0), solve(size, stiff)
    assert other.positions / size == pytest.approx(one.positions, abs=1e-10)
    assert other.energy / (stiff * size**3) == pytest.approx(one.energy, rel=1e-8, abs=1e-18)


@settings(max_examples=15, deadline=None)
@given(load=vectors, cut=st.sampled_from([0.25, 0.5, 0.75]))
def test_cutting_a_section_in_two_changes_nothing(load, cut):
    assume(np.hypot(*load[:2]) > 1e-2)  # along the axis alone, nothing tells which way to buckle

    def section(length, elements):
        return FlexibleSection(length=length, radius=1e-3, youngs_modulus=3e6, density=900.0, elements=elements)

    whole, parts = (
        Rod([section(0.06, 16)]),
        Rod([section(0.06 * cut, int(16 * cut)), section(0.06 * (1 - cut), int(16 * (1 - cut)))]),
    )
    one, other = (rod.solve(tip_force=3e-3 * load, tolerance=1e-11) for rod in (whole, parts))
    assert other.positions == pytest.approx(one.positions, abs=1e-10)


def test_a_moment_about_a_buckled_rods_axis_finds_no_rest():
    """It does work at every turn, which nothing in a round rod resists; that is said, not hidden."""
    rod = Rod([FlexibleSection(length=0.05, radius=1e-3, youngs_modulus=3e6)])
    critical = np.pi**2 / 4 * rod.sections[0].stiffness[0] / 0.05**2
    load = dict(gravity=(0, 0, 0), tip_force=(0, 0, -1.5 * critical), tip_moment=(1e-8, 0, 1e-5))
    with pytest.raises(ConvergenceError, match="did not converge"):
        rod.solve(**load)
    assert not rod.solve(**load, strict=False).stable
