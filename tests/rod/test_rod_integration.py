"""Rods in three dimensions against the Cosserat equations integrated at 1e-12."""

from __future__ import annotations

import numpy as np
import pytest
from rod.cosserat_integration import Problem, shoot
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.fields import DipoleField, UniformField
from magfem.rod import FlexibleSection, MagnetSection, Rod

BASE = RigidTransform.from_components([-0.0375, 0, 0], Rotation.from_euler("y", 90, degrees=True))
MICRON, TURN = 1e-7, np.radians(1e-4)  # what a tip may be wrong by


def rod_of(field_points=1, moment=0.0135, base=BASE, **changes):
    """Two flexible sections, each with a magnet at its end: the size of the dissertation's manipulator."""

    def flexible(length):
        given = dict(length=length, radius=1.5e-3, youngs_modulus=5.5e6, density=1040.0, poisson_ratio=0.5)
        return FlexibleSection(**(given | changes))

    magnet = MagnetSection(length=5e-3, moment=moment, mass=1e-4, field_points=field_points)
    return Rod([flexible(0.035), magnet, flexible(0.03), magnet], base)


def at_a_point(field):
    """What the integration asks for."""
    return lambda point: tuple(part for part in field.jet(point, 1, outside="extrapolate"))


def assert_same(state, problem):
    """Tip and magnets where the integration has them."""
    R, p, centres = shoot(problem, state.internal_force[0], state.internal_moment[0])
    frames = [(state.frames[-1], R), *zip(state.magnet_frames, [one[0] for one in centres], strict=True)]
    places = [(state.positions[-1], p), *zip(state.magnet_positions, [one[1] for one in centres], strict=True)]
    for ours, theirs in places:
        assert np.linalg.norm(ours - theirs) < MICRON
    for ours, theirs in frames:
        assert Rotation.from_matrix(ours @ theirs.T).magnitude() < TURN


NEAR_DIPOLE = DipoleField([0.0, 40.0, 20.0]).at(RigidTransform.from_translation([0.02, -0.08, 0.05]))
FIELDS = {
    "none": None,
    "uniform": UniformField([0.004, 0.010, 0.012]),
    "against the magnets": UniformField([-0.012, 0.004, 0.002]),
    "a dipole's": NEAR_DIPOLE,
    "fitted": 8.0
    * magfem.load_model("bigmag_iron").at(
        RigidTransform.from_components([0.01, -0.085, 0.03], Rotation.from_euler("x", -70, degrees=True))
    ),
}


@pytest.mark.parametrize("name", FIELDS)
def test_two_magnets_hang_as_integrated(name):
    rod, field = rod_of(), FIELDS[name]
    state = rod.solve(field=field, outside="extrapolate")
    assert state.stable
    assert_same(state, Problem(rod, field=None if field is None else at_a_point(field)))


LOADS = {
    "dead force": dict(tip_force=(3e-3, -4e-3, 5e-3)),
    "dead moment": dict(tip_moment=(4e-5, -6e-5, 5e-5)),
    "dead wrench": dict(tip_force=(3e-3, -4e-3, 5e-3), tip_moment=(4e-5, -6e-5, 5e-5)),
    "follower force": dict(tip_force=(2e-3, -1e-3, 1e-3), follower=True),
    "follower moment": dict(tip_moment=(4e-5, -6e-5, 5e-5), follower=True),
    "follower wrench": dict(tip_force=(2e-3, -1e-3, 1e-3), tip_moment=(4e-5, -6e-5, 5e-5), follower=True),
}


@pytest.mark.parametrize("name", LOADS)
def test_end_wrenches_as_integrated(name):
    rod, field = rod_of(), FIELDS["uniform"]
    state = rod.solve(field=field, **LOADS[name])
    assert_same(state, Problem(rod, field=at_a_point(field), **LOADS[name]))


def helical_rest(s):
    """(n, 3) 1/m, of a coiled and twisted rod."""
    return np.stack([8 + 100 * s, 12 * np.cos(60 * s), 10 + 0 * s], axis=1)


@pytest.mark.parametrize(
    "changes",
    [
        dict(intrinsic_curvature=(9.0, -6.0, 12.0)),
        dict(intrinsic_curvature=helical_rest),
        dict(intrinsic_strain=(0.05, -0.03, 1.1)),
        dict(force_per_length=(0.05, -0.08, 0.04)),
        dict(moment_per_length=(5e-4, -8e-4, 5e-4)),
        dict(poisson_ratio=0.3),
        dict(shear_modulus=1e6),
    ],
    ids=lambda one: ", ".join(one) + (" varying" if callable(next(iter(one.values()))) else ""),
)
def test_every_property_of_a_section_as_integrated(changes):
    rod, field = rod_of(**changes), FIELDS["uniform"]
    force = (1e-3, -2e-3, 1e-3)
    state = rod.solve(field=field, tip_force=force)
    assert_same(state, Problem(rod, field=at_a_point(field), tip_force=force))


def test_long_magnets_take_the_field_along_their_length():
    """A moment spread over the magnet, of which four points tell as much as twelve; the centre alone does not."""
    rod, field = rod_of(field_points=4, moment=(0.004, -0.003, 0.012)), NEAR_DIPOLE
    state = rod.solve(field=field)
    assert_same(state, Problem(rod, field=at_a_point(field)))
    centre = rod_of(moment=(0.004, -0.003, 0.012)).solve(field=field)
    assert np.linalg.norm(centre.positions[-1] - state.positions[-1]) > 10 * MICRON


def test_a_soft_rod_that_curls_up_as_integrated():
    """A magnet turned by more than a right angle, on a rod ten times softer."""
    rod = rod_of(youngs_modulus=5.5e5, elements=64, base=RigidTransform.identity())
    field = UniformField([0.008, 0.003, -0.012])
    state = rod.solve(field=field, gravity=(0, 0, 0))
    assert state.stable and state.magnet_frames[1, 2, 2] < -0.5
    assert_same(state, Problem(rod, field=at_a_point(field), gravity=(0, 0, 0)))
