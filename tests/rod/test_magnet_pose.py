"""Magnet poses from centrelines: rotations on the group, and the published forward difference beside the derivative."""

from __future__ import annotations

import numpy as np
import pytest
from rod.curves import LENGTH, circle
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.rod import fit_centreline, magnet_poses
from magfem.rod.magnet_pose import forward_difference
from magfem.rod.moving_frame import smallest_turn

S = np.linspace(0, LENGTH, 101)
BEND = 1.2
CURVE = fit_centreline(circle(S, BEND)[0], LENGTH, (0, 0, 0), arc_lengths=S, degree=10, robust=False)
MAGNETS = np.array([0.02, 0.045])


def test_axis_and_angle_on_a_circle():
    """Eq. 2.10: the magnet at s is turned by κ s about the normal of the circle's plane."""
    poses = magnet_poses(CURVE, MAGNETS)
    assert np.allclose(poses.positions, circle(MAGNETS, BEND)[0], atol=1e-9)
    expected = np.stack([0 * MAGNETS, BEND / LENGTH * MAGNETS, 0 * MAGNETS], -1)
    assert np.allclose(poses.rotations.as_rotvec(), expected, atol=1e-6)
    assert np.allclose(poses.rotations.apply([0, 0, 1]), poses.directions, atol=1e-12)


def test_small_angles_keep_their_digits():
    """The arc-cosine of eq. 2.10 gives zero below 1e-8 rad; the half-angle form does not."""
    angle = 1e-9
    direction = np.array([np.sin(angle), 0.0, np.cos(angle)])
    assert Rotation.from_quat(smallest_turn(direction)).magnitude() == pytest.approx(angle, rel=1e-6)
    assert np.arccos(direction[2]) == 0.0


def test_smallest_turn_of_any_two_directions():
    rng = np.random.default_rng(1)
    a, b = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in rng.standard_normal((2, 200, 3)))
    b[0], b[1] = a[0], -a[1]
    turn = Rotation.from_quat(smallest_turn(b, a))
    assert np.allclose(turn.apply(a), b, atol=1e-12)
    assert np.allclose(turn.magnitude(), np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, -1)))


def test_reference_keeps_the_turn_about_the_axis():
    """A model that knows the twist hands it on: the measured frame differs by a turn across the axis only."""
    twisted = Rotation.from_rotvec([0, 0.4, 0]) * Rotation.from_rotvec([0, 0, 0.9])
    poses = magnet_poses(CURVE, MAGNETS, reference=twisted)
    assert np.allclose(poses.rotations.apply([0, 0, 1]), poses.directions, atol=1e-12)
    change = (poses.rotations * twisted.inv()).as_rotvec()
    assert np.allclose(change @ twisted.apply([0, 0, 1]), 0, atol=1e-12)
    own = magnet_poses(CURVE, MAGNETS, reference=poses.rotations)
    assert np.allclose((own.rotations * poses.rotations.inv()).magnitude(), 0, atol=1e-7)


def test_forward_difference_is_off_by_half_a_step_of_curvature():
    """On a circle the chord points κ δs/2 ahead, exactly; the derivative of the polynomial does not."""
    exact = circle(MAGNETS, BEND)[1]
    poses = magnet_poses(CURVE, MAGNETS)
    for step in (1e-3, 2e-3, 4e-3):
        away = np.linalg.norm(np.cross(forward_difference(CURVE, MAGNETS, step), exact), axis=-1)
        assert np.allclose(away, np.sin(BEND / LENGTH * step / 2), rtol=1e-4)
    assert np.linalg.norm(np.cross(poses.directions, exact), axis=-1).max() < 1e-6


def test_covariances_are_of_position_and_direction():
    rng = np.random.default_rng(3)
    cloud = circle(S, BEND)[0] + 1e-4 * rng.standard_normal((101, 3))
    poses = magnet_poses(fit_centreline(cloud, LENGTH, (0, 0, 0), arc_lengths=S), MAGNETS)
    values = np.linalg.eigvalsh(poses.direction_covariance)
    assert np.all(np.abs(values[:, 0]) < 1e-9 * values[:, 1]) and np.all(values[:, 1] > 0)
    assert np.allclose(np.einsum("nij,nj->ni", poses.direction_covariance, poses.directions), 0, atol=1e-15)
    assert np.all(np.linalg.eigvalsh(poses.position_covariance) > 0)


def test_what_makes_no_pose_is_refused():
    with pytest.raises(InputError, match="between 0 and the rod's length"):
        magnet_poses(CURVE, [0.06])
    with pytest.raises(InputError, match="one for every magnet"):
        magnet_poses(CURVE, [[0.01], [0.02]])
    with pytest.raises(InputError, match="need one reference or 2"):
        magnet_poses(CURVE, MAGNETS, Rotation.identity(3))
    with pytest.raises(InputError, match="step of a difference"):
        forward_difference(CURVE, MAGNETS, 0.0)
    with pytest.raises(InputError, match="between 0 and the rod's length"):
        forward_difference(CURVE, [LENGTH], 1e-3)
