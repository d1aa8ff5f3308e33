"""Cameras of scenarios: without noise they see what is there, with noise in proportion to it, and by their seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import magfem
from magfem.errors import ConvergenceError
from magfem.scenario import load_scenario
from magfem.scenario.angles import angles_of_rotation, axes_of_rotation, between, planar_angles, turned_from_z
from magfem.scenario.sensing import Cameras, in_plane


@pytest.fixture(scope="module")
def cameras():
    found = load_scenario("steer_planar").sensing
    assert isinstance(found, Cameras)
    return found


@pytest.fixture(scope="module")
def shape():
    rod = load_scenario("steer_planar").rod
    return rod.solve((magfem.load_system("bigmag"), [1.0, -2.0, 2.0, 1.0, -1.5, 0.5]))


def off(seen, shape):
    return np.degrees(between(in_plane(seen).frames[:, :, 2], shape.magnet_frames[:, :, 2]))


def test_without_noise_cameras_see_where_the_magnets_are(cameras, shape):
    seen = replace(cameras, noise=0.0, outliers=0.0, pictures=1).see(shape, np.random.default_rng(0), None)
    assert off(seen, shape).max() < 0.05
    np.testing.assert_allclose(seen.positions, shape.magnet_positions, atol=2e-5)


def test_noise_counts_in_proportion_and_pictures_by_their_root(cameras, shape):
    def spread(noise, pictures):
        one = replace(cameras, noise=noise, outliers=0.0, pictures=pictures)
        rng, seen, found = np.random.default_rng(1), None, []
        for _ in range(40):
            seen = one.see(shape, rng, seen)
            found.append(planar_angles(in_plane(seen).frames[:, :, 2]))
        return np.std(found, axis=0)

    base = spread(0.2, 1)
    np.testing.assert_allclose(spread(0.4, 1) / base, 2, rtol=0.4)
    np.testing.assert_allclose(spread(0.2, 9) / base, 1 / 3, rtol=0.4)


def test_pictures_of_something_else_are_refused(cameras, shape):
    with pytest.raises(ConvergenceError):
        replace(cameras, noise=60.0, outliers=0.4, pictures=1, points=30).see(shape, np.random.default_rng(0), None)


def test_angles_of_directions():
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    angles, axes = angles_of_rotation(directions), axes_of_rotation(directions)
    np.testing.assert_allclose(np.cos(angles), directions[:, 2], atol=1e-15)
    np.testing.assert_allclose(np.sum(axes * directions, axis=1), 0, atol=1e-15)  # turned about it: normal to it
    np.testing.assert_allclose(turned_from_z(axes, angles), directions, atol=1e-15)
    assert np.degrees(planar_angles(np.array([1.0, 0, 0]))) == 90
    assert between(np.array([0, 0, 1.0]), np.array([0, 1e-9, 1.0])) == pytest.approx(1e-9)
