"""Wrenches: two small loops as dipoles, energy, Maxwell's equations, differences, and the published matrices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.actuation import CoilSystem, SystemCoil
from magfem.actuation.wrench import dipole_wrench, eight_numbers, field_to_wrench
from magfem.constants import MU_0
from magfem.errors import InputError, OutsideRegionError
from magfem.fields.coaxial_inductance import loops_mutual_inductance
from magfem.fields.terms import harmonics, loops, uniform

RNG = np.random.default_rng(2)
CURRENTS = np.array([3.0, -2.0, 5.0, 1.0, -4.0, 6.0])
JOINTS = np.array([0.4, -0.9])
POSES = RigidTransform.from_components(RNG.uniform(-0.03, 0.03, (4, 3)), Rotation.random(4, rng=RNG))
MOMENT = np.array([0.01, -0.02, 0.05])


@pytest.fixture(scope="module")
def bigmag():
    return magfem.load_system("bigmag")


def test_matrix_is_the_published_one():
    """Eqs 2.14 and 2.15, the torque first there: M(µ) as printed, though 2.15 had to be derived to trust its signs."""
    x, y, z = 2.0, 3.0, 5.0
    matrix = field_to_wrench([x, y, z])
    np.testing.assert_array_equal(matrix[:3, 3:], [[x, y, z, 0, 0], [0, x, 0, y, z], [-z, 0, x, -z, y]])
    np.testing.assert_array_equal(matrix[3:, :3], [[0, -z, y], [z, 0, -x], [-y, x, 0]])
    assert not matrix[:3, :3].any() and not matrix[3:, 3:].any()


def test_matrix_is_the_gradient_of_the_energy_in_any_field_in_air():
    """f = ∇(m·B) from the nine entries of a gradient that is symmetric and free of trace, as in air."""
    gradient = RNG.normal(size=(5, 3, 3))
    gradient = gradient + gradient.swapaxes(1, 2)
    gradient -= np.trace(gradient, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    B, moment = RNG.normal(size=(5, 3)), RNG.normal(size=(5, 3))
    found = (field_to_wrench(moment) @ eight_numbers(B, gradient)[..., None])[..., 0]
    np.testing.assert_allclose(found[:, :3], np.einsum("nj,nji->ni", moment, gradient), rtol=1e-12)
    np.testing.assert_allclose(found[:, 3:], np.cross(moment, B), rtol=1e-12)


def test_force_between_coaxial_loops():
    """Two small loops attract with −I₁ I₂ dM/dz of Maxwell's mutual inductance, and with 3 µ₀ m₁ m₂ / (2π z⁴)."""
    radius, distance, current = 1e-3, 0.1, 7.0
    system = CoilSystem("one loop", (SystemCoil("a", loops(np.zeros(3), 2e-3, 1.0)),))
    moment = [0, 0, np.pi * radius**2]  # of a loop at 1 A
    force, torque = system.wrench(moment, RigidTransform.from_translation([0, 0, distance]), [current])
    step = 1e-4
    mutual = [float(loops_mutual_inductance(2e-3, radius, distance + sign * step)) for sign in (1, -1)]
    assert force[2] == pytest.approx(current * (mutual[0] - mutual[1]) / (2 * step), rel=1e-3)
    assert force[2] == pytest.approx(-3 * MU_0 * current * np.pi**2 * 4e-12 / (2 * np.pi * distance**4), rel=2e-3)
    np.testing.assert_allclose([*force[:2], *torque], 0, atol=1e-20)


def test_force_and_torque_are_minus_the_energys_derivatives(bigmag):
    """U = −m·B: f = −∂U/∂x, and a virtual turn about e does the work e·torque."""
    force, torque = bigmag.wrench(MOMENT, POSES, CURRENTS, JOINTS)

    def energy(poses):
        return -np.sum(poses.rotation.apply(MOMENT) * bigmag.B(poses.translation, CURRENTS, JOINTS), axis=-1)

    step = 1e-5
    for k, axis in enumerate(np.eye(3)):
        move = [RigidTransform.from_translation(sign * step * axis) for sign in (1, -1)]
        slope = (energy(move[0] * POSES) - energy(move[1] * POSES)) / (2 * step)
        np.testing.assert_allclose(force[:, k], -slope, rtol=1e-6)
        turns = [Rotation.from_rotvec(sign * step * axis) for sign in (1, -1)]
        ends = [RigidTransform.from_components(POSES.translation, turn * POSES.rotation) for turn in turns]
        slope = (energy(ends[0]) - energy(ends[1])) / (2 * step)
        np.testing.assert_allclose(torque[:, k], -slope, rtol=1e-6, atol=1e-12)


def test_action_is_reaction():
    """Two dipoles: opposite forces, and torques that with r × f add up to nothing."""
    a, b, place = np.array([1.0, 2, 3]), np.array([-2.0, 1, 0.5]), np.array([0.03, -0.02, 0.05])

    def dipole(moment):
        per_moment = MU_0 / (4 * np.pi) / 1e-6  # T of each coefficient, reference radius 10 mm
        x, y, z = moment * per_moment
        return harmonics(0.01, [1, 1, 1], [1, 1, 0], [False, True, False], [x, y, z])

    forces, torques = [], []
    for source, body, offset in ((a, b, place), (b, a, -place)):
        B, gradient = dipole(source).jet(offset[None], 1)
        force, torque = dipole_wrench(body, B[0], gradient[0])
        forces.append(force)
        torques.append(torque)
    np.testing.assert_allclose(forces[0], -forces[1], rtol=1e-12)
    np.testing.assert_allclose(
        torques[0] + torques[1] + np.cross(place, forces[0]), 0, atol=1e-9 * abs(torques[0]).max()
    )


def test_uniform_field_turns_and_does_not_pull():
    system = CoilSystem("background", (), uniform([0, 0, 0.1]))
    force, torque = system.wrench([1, 0, 0], RigidTransform.identity(), [])
    np.testing.assert_allclose(force, 0, atol=1e-18)
    np.testing.assert_allclose(torque, [0, -0.1, 0], rtol=1e-15)


def test_map_and_its_derivatives_are_differences(bigmag):
    """All columns against central differences of `wrench`, which the other tests hold to laws."""
    system = CoilSystem("with background", bigmag.coils, uniform([1e-3, 2e-3, -3e-3]), joints=bigmag.joints)
    found = system.wrench_map(MOMENT, POSES, CURRENTS, JOINTS)

    def wrench(currents=CURRENTS, joints=JOINTS, poses=POSES, moment=MOMENT):
        return np.concatenate(system.wrench(moment, poses, currents, joints, outside="extrapolate"), axis=-1)

    np.testing.assert_allclose(found.wrench, wrench(), rtol=1e-12)
    np.testing.assert_allclose(found.background, wrench(currents=np.zeros(6)), atol=1e-14)
    np.testing.assert_allclose(found.background + found.by_current @ CURRENTS, found.wrench, rtol=1e-11)
    np.testing.assert_array_equal(found.wrench, np.concatenate([found.force, found.torque], axis=-1))

    def turned(step):
        return RigidTransform.from_components(POSES.translation, Rotation.from_rotvec(step) * POSES.rotation)

    ways = {
        "by_current": (lambda step: wrench(currents=CURRENTS + step), 6),
        "by_joint": (lambda step: wrench(joints=JOINTS + step), 2),
        "by_point": (lambda step: wrench(poses=RigidTransform.from_translation(step) * POSES), 3),
        "by_rotation": (lambda step: wrench(poses=turned(step)), 3),
        "by_moment": (lambda step: wrench(moment=MOMENT + step), 3),
    }
    for name, (way, count) in ways.items():
        step = 1e-6 if name == "by_point" else 1e-5
        columns = [(way(step * axis) - way(-step * axis)) / (2 * step) for axis in np.eye(count)]
        expected = np.stack(columns, axis=-1)
        ours = getattr(found, name)
        assert ours.shape == (4, 6, count)
        for rows in (slice(0, 3), slice(3, 6)):
            size = np.abs(expected[:, rows]).max()
            np.testing.assert_allclose(ours[:, rows], expected[:, rows], atol=1e-7 * size, err_msg=name)


def test_torque_along_the_moment_is_impossible(bigmag):
    """So that a magnet has at most five wrench components (Petruska & Nelson 2015, doi:10.1109/TRO.2015.2424051)."""
    found = bigmag.wrench_map(MOMENT, POSES, CURRENTS, JOINTS)
    axes = POSES.rotation.apply(MOMENT)
    np.testing.assert_allclose(np.einsum("ni,nic->nc", axes, found.by_current[:, 3:]), 0, atol=1e-18)
    assert np.linalg.matrix_rank(field_to_wrench(MOMENT)) == 5


def test_shapes_and_broadcasting(bigmag):
    one = bigmag.wrench(MOMENT, POSES[0], CURRENTS, JOINTS)
    many = bigmag.wrench(np.tile(MOMENT, (4, 1)), POSES, CURRENTS, JOINTS)
    assert one[0].shape == (3,) and many[1].shape == (4, 3)
    np.testing.assert_allclose(one, [part[0] for part in many], rtol=1e-12)
    several = bigmag.wrench(np.tile(MOMENT, (5, 1)), POSES[0], np.tile(CURRENTS, (5, 1)), JOINTS)
    np.testing.assert_allclose(several[0], np.tile(one[0], (5, 1)), rtol=1e-12)
    assert bigmag.wrench_map(MOMENT, POSES[0], CURRENTS).by_joint.shape == (6, 2)


def test_outside_is_announced(bigmag):
    far = RigidTransform.from_translation([[0, 0, 0], [0, 0, 0.06]])
    with pytest.raises(OutsideRegionError):
        bigmag.wrench_map(MOMENT, far, CURRENTS)
    found = bigmag.wrench_map(MOMENT, far, CURRENTS, outside="nan")
    for part in (found.wrench, found.by_current, found.by_joint, found.by_point, found.by_rotation, found.by_moment):
        assert np.isfinite(part[0]).all() and np.isnan(part[1]).all()


@pytest.mark.parametrize(
    ("moment", "pose", "complaint"),
    [
        ([1, 2], RigidTransform.identity(), "a magnet's moment is three finite numbers"),
        ([1, 2, np.nan], RigidTransform.identity(), "a magnet's moment is three finite numbers"),
        ("big", RigidTransform.identity(), "a magnet's moment is three finite numbers"),
        (MOMENT, [0, 0, 0], "a magnet's pose is a scipy.spatial.transform.RigidTransform, got list"),
        (np.ones((3, 3)), POSES, r"moments \(3, 3\) do not go with poses \(4,\)"),
    ],
)
def test_what_is_no_magnet_is_one_sentence(bigmag, moment, pose, complaint):
    for call in (bigmag.wrench, bigmag.wrench_map):
        with pytest.raises(InputError, match=complaint):
            call(moment, pose, CURRENTS)
