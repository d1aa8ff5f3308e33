"""Planes by least absolute deviations: against every corner that there is."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from magfem.localization.plane_fit import least_absolute_normal, perpendicular_pair


def directions(seed, count=40, noise=0.3):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, count)
    points = np.column_stack([2 * np.cos(angle), np.sin(angle), np.zeros(count)]) + rng.normal(0, noise, (count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def total(normal, given):
    return np.abs(given @ normal).sum()


@pytest.mark.parametrize("seed", range(12))
def test_no_corner_holds_less(seed):
    """The least of all lies perpendicular to two of the directions: all pairs are tried."""
    given = directions(seed)
    pairs = np.array(list(itertools.combinations(range(len(given)), 2)))
    corners = np.cross(given[pairs[:, 0]], given[pairs[:, 1]])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    least = np.abs(corners @ given.T).sum(axis=1).min()
    assert total(least_absolute_normal(given), given) == pytest.approx(least, rel=1e-12)


def test_nothing_near_is_less():
    given = directions(3, 600)
    normal = least_absolute_normal(given)
    assert np.linalg.norm(normal) == pytest.approx(1.0, rel=1e-14)
    for size in (1e-1, 1e-3, 1e-6):
        for step in np.random.default_rng(2).normal(0, size, (200, 3)):
            beside = (normal + step) / np.linalg.norm(normal + step)
            assert total(beside, given) >= total(normal, given) - 1e-12


def test_a_few_wild_directions_do_not_move_it():
    """What sets least absolute deviations apart from least squares."""
    rng = np.random.default_rng(4)
    angle = rng.uniform(0, 2 * np.pi, 100)
    given = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(100)])
    given[:10] = [0, 0.6, 0.8]
    assert abs(least_absolute_normal(given)[2]) == pytest.approx(1.0, abs=1e-14)


def test_a_plane_without_noise_repeated_samples_and_zeros():
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    angle = np.tile(np.arange(20) * np.pi / 10, 30)
    given = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(600)]) @ turn.T
    given[7] = given[100] = 0.0
    assert abs(least_absolute_normal(given) @ turn[:, 2]) == pytest.approx(1.0, abs=1e-14)


def test_many_at_once_are_one_by_one():
    many = np.stack([directions(seed) for seed in range(6)]).reshape(2, 3, 40, 3)
    together = least_absolute_normal(many)
    alone = np.stack([least_absolute_normal(one) for one in many.reshape(6, 40, 3)]).reshape(2, 3, 3)
    np.testing.assert_allclose(together, alone, atol=1e-13)


def test_pairs_are_right_handed_frames():
    vectors = directions(6)
    first, second = perpendicular_pair(vectors)
    np.testing.assert_allclose(np.cross(first, second), vectors, atol=1e-14)
    np.testing.assert_allclose((first * second).sum(axis=1), 0, atol=1e-14)
