"""Tracks of many windows, held against the paths that the samples were made of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from localization.paths import (
    PAIR,
    TIMES,
    cube,
    degrees_between,
    helix,
    root_mean_square,
    seen,
    sinusoid,
    smooth_random,
    unit,
)

from magfem.errors import InputError
from magfem.localization import ProcessNoise, Rotor, as_rotor, track, windows
from magfem.localization.motion import dynamics
from magfem.typing import Points, Vectors

COUNT = 120


@pytest.fixture(scope="module")
def rotor() -> Rotor:
    return as_rotor("rotor_1x3")


def random_path(seed: int) -> Callable[[int], tuple[Points, Vectors]]:
    return lambda count: smooth_random(count, seed)


@pytest.mark.parametrize(
    "path",
    [helix, sinusoid, cube, random_path(1), random_path(2)],
    ids=["helix", "sinusoid", "cube", "random1", "random2"],
)
def test_smoothed_tracks_follow_the_path(rotor: Rotor, path: Callable[[int], tuple[Points, Vectors]]) -> None:
    """Two sensors 20 mm apart, 3 µT of noise, windows of 2 s, no prior: 1 mm and 3°, and no wrong branch."""
    position, axis = path(COUNT)
    found = track(seen(rotor, position, axis, PAIR, 3), TIMES, rotor, 1.0, PAIR, starts=2.0 * np.arange(COUNT))
    off, turned = np.linalg.norm(found.position - position, axis=-1), degrees_between(found.axis, axis)
    assert root_mean_square(off) < 1e-3 and off.max() < 3e-3
    assert root_mean_square(turned) < 3.0 and turned.max() < 20.0
    assert not found.ambiguous and found.converged
    # Alone, the same windows are worse by a factor of two or more.
    assert root_mean_square(np.linalg.norm(found.poses.position - position, axis=-1)) > 2 * root_mean_square(off)
    assert 0.5 < root_mean_square(off) / root_mean_square(found.position_deviation) < 2.0


def drawn_path(noise: ProcessNoise, seed: int) -> tuple[Points, Vectors]:
    """A path that white acceleration of this density makes."""
    rng = np.random.default_rng(seed)
    state = np.zeros(12)
    state[:6] = 0.0, 0.002, 0.026, 0.6, 0.3, 0.74
    places = []
    for _ in range(150):
        places.append(state[:6].copy())
        motion = dynamics(np.array([2.0]), state[None, 3:6], state[None, 9:])
        state = rng.multivariate_normal(motion.F[0] @ state + motion.c[0], motion.diffusion(noise, 0), method="svd")
        state[3:6] /= np.linalg.norm(state[3:6])
        state[6:9] -= 0.15 * state[6:9] + 0.02 * (state[:3] - [0.0, 0.0, 0.026])  # or it would leave
    both = np.array(places)
    return both[:, :3], unit(both[:, 3:])


@pytest.mark.parametrize("seed", range(2))
def test_process_noise_is_found(rotor: Rotor, seed: int) -> None:
    """That of a path drawn with a known one, within what a hundred and fifty windows can tell."""
    noise = ProcessNoise(3e-8, 1e-6)
    position, axis = drawn_path(noise, seed)
    found = track(seen(rotor, position, axis, PAIR, seed), TIMES, rotor, 1.0, PAIR, starts=2.0 * np.arange(150))
    assert abs(np.log10(found.noise.position / noise.position)) < 0.6
    assert abs(np.log10(found.noise.axis / noise.axis)) < 1.0
    error = found.position - position
    squared = np.einsum("wi,wij,wj->w", error, np.linalg.inv(found.covariance[:, :3, :3]), error) / 3
    assert 0.7 < squared.mean() < 1.4


def test_a_faulty_window_is_named_and_moves_nothing(rotor: Rotor) -> None:
    position, axis = helix(COUNT)
    samples = seen(rotor, position, axis, PAIR, 5)
    good = track(samples, TIMES, rotor, 1.0, PAIR, starts=2.0 * np.arange(COUNT))
    samples[50] += 40e-6 * np.cos(2 * np.pi * TIMES + 1.0)[:, None] * np.array([1.0, -0.5, 0.3])
    found = track(samples, TIMES, rotor, 1.0, PAIR, starts=2.0 * np.arange(COUNT), noise=good.noise)
    np.testing.assert_array_equal(np.flatnonzero(found.faulty), [50])
    assert np.linalg.norm(found.position[50] - position[50]) < 3e-3
    assert np.linalg.norm(found.poses.position[50] - position[50]) > 10e-3  # alone it is far off
    assert np.linalg.norm(found.position - good.position, axis=-1).max() < 0.5 * good.position_deviation.max()


def test_one_sensor_cannot_tell_a_track_from_its_mirror_image(rotor: Rotor) -> None:
    # Past the sensor with β between 40 and 60°: where β meets 0 or 90° a track could change to another branch as well.
    along = np.linspace(-6e-3, 6e-3, 60)
    position = np.stack([along - 0.01, 0 * along + 4e-3, 0 * along + 25e-3], axis=-1)
    axis = np.tile(unit(np.array([0.3, 0.5, 0.8])), (60, 1))
    samples = seen(rotor, position, axis, PAIR[:1], 2)
    starts = 2.0 * np.arange(60)
    sensor = PAIR[0]
    for sign in (1.0, -1.0):
        about = sensor.pose.translation + sign * (position[0] - sensor.pose.translation)
        found = track(samples, TIMES, rotor, 1.0, [sensor], starts=starts, near=about, strict=False)
        assert found.ambiguous
        assert np.linalg.norm(found.position[0] - about) < 8e-3
        other = found.alternatives[0]
        assert other.log_evidence == pytest.approx(found.log_evidence, abs=0.1)
        mirrored = 2 * sensor.pose.translation - other.position
        assert np.linalg.norm(mirrored - found.position, axis=-1).max() < 1e-4


def test_windows_without_samples_are_left_out(rotor: Rotor) -> None:
    position, axis = helix(60)
    samples = seen(rotor, position, axis, PAIR, 5)
    samples[20:23] = np.nan
    samples[30, 1, :37] = np.nan
    found = track(samples, TIMES, rotor, 1.0, PAIR, starts=2.0 * np.arange(60))
    assert found.times.size == 56
    kept = np.delete(np.arange(60), [20, 21, 22, 30])
    np.testing.assert_allclose(found.times, 2.0 * kept + TIMES.mean())
    assert root_mean_square(np.linalg.norm(found.position - position[kept], axis=-1)) < 1e-3


def test_windows_of_a_record() -> None:
    times = 5.0 + np.arange(100) / 20
    record = np.arange(600.0).reshape(2, 100, 3)
    cut, within, starts = windows(record, times, 2.0, 1.0)
    assert cut.shape == (4, 2, 40, 3)
    np.testing.assert_allclose(starts, [5.0, 6.0, 7.0, 8.0])
    np.testing.assert_allclose(within, np.arange(40) / 20)
    np.testing.assert_array_equal(cut[1], record[:, 20:60])


def test_what_is_no_track_is_told(rotor: Rotor) -> None:
    samples = np.zeros((4, 2, 40, 3))
    with pytest.raises(InputError, match="three windows"):
        track(samples[:2], TIMES, rotor, 1.0, PAIR, starts=[0.0, 2.0])
    with pytest.raises(InputError, match="increase"):
        track(samples, TIMES, rotor, 1.0, PAIR, starts=[0.0, 2.0, 2.0, 4.0])
    with pytest.raises(InputError, match="windows need samples"):
        track(samples, TIMES, rotor, 1.0, PAIR, starts=[0.0, 2.0, 4.0])
    with pytest.raises(InputError, match="evenly sampled"):
        windows(np.zeros((5, 3)), [0.0, 1.0, 2.0, 4.0, 5.0], 2.0)
    with pytest.raises(InputError, match="fits the record"):
        windows(np.zeros((5, 3)), np.arange(5.0), 20.0)
