"""Following live, held against the path, and against the smoother, which is another algorithm for the last window."""

from __future__ import annotations

import numpy as np
import pytest
from localization.paths import PAIR, TIMES, degrees_between, helix, root_mean_square, seen, smooth_random

from magfem.errors import InputError
from magfem.localization import Belief, ProcessNoise, Rotor, as_rotor, follow, track
from magfem.localization.orientation import orientation
from magfem.typing import Floats

NOISE = ProcessNoise(3e-9, 3e-5)


@pytest.fixture(scope="module")
def rotor() -> Rotor:
    return as_rotor("rotor_1x3")


def followed(rotor: Rotor, samples: Floats, sensors: list, **options: object) -> list[Belief]:
    belief, all_of_them = None, []
    for k, window in enumerate(samples):
        belief = follow(belief, window, TIMES, rotor, 1.0, sensors, start=2.0 * k, noise=NOISE, **options)
        all_of_them.append(belief)
    return all_of_them


def test_following_ends_where_smoothing_ends(rotor: Rotor) -> None:
    """For the last window both know the same."""
    position, axis = (whole[:40] for whole in smooth_random(100, 3))
    samples = seen(rotor, position, axis, PAIR, 1)
    last = followed(rotor, samples, PAIR)[-1]
    smoothed = track(samples, TIMES, rotor, 1.0, PAIR, starts=2.0 * np.arange(40), noise=NOISE)
    stated = smoothed.position_deviation[-1]
    # They differ by where each linearises the windows before.
    assert np.linalg.norm(last.position - smoothed.position[-1]) < 0.3 * stated
    assert degrees_between(last.axis, smoothed.axis[-1]) < 0.3 * np.degrees(smoothed.axis_deviation[-1])
    ratio = np.sqrt(np.trace(last.covariance[:3, :3])) / stated
    assert 0.9 < ratio < 1.1


def test_a_faulty_window_does_not_propagate(rotor: Rotor) -> None:
    position, axis = helix(80)
    samples = seen(rotor, position, axis, PAIR, 5)
    samples[40] += 40e-6 * np.cos(2 * np.pi * TIMES + 1.0)[:, None] * np.array([1.0, -0.5, 0.3])
    found = followed(rotor, samples, PAIR)
    assert np.flatnonzero([one.faulty for one in found]).tolist() == [40]
    off = np.linalg.norm([one.position for one in found] - position, axis=-1)
    turned = degrees_between(np.array([one.axis for one in found]), axis)
    assert root_mean_square(off[5:]) < 1.5e-3 and off[5:].max() < 4e-3
    assert root_mean_square(turned[5:]) < 8.0
    assert np.linalg.norm(found[40].pose.position - position[40]) > 10e-3  # alone it is far off


def test_an_ambiguous_start_is_kept_open(rotor: Rotor) -> None:
    """One sensor: the mirror image stays as likely for ever, so both are kept and it is said."""
    position, axis = (whole[:12] for whole in smooth_random(100, 6))
    samples = seen(rotor, position, axis, PAIR[:1], 2)
    found = followed(rotor, samples, PAIR[:1])
    assert found[-1].ambiguous
    centre = PAIR[0].pose.translation
    places = found[-1].state[:, :3]
    mirrored = np.linalg.norm(places[:, None] + places - 2 * centre, axis=-1)
    assert np.all(mirrored.min(axis=1) < 1e-3)


def test_near_decides(rotor: Rotor) -> None:
    position, axis = (whole[:12] for whole in smooth_random(100, 6))
    samples = seen(rotor, position, axis, PAIR[:1], 2)
    found = followed(rotor, samples, PAIR[:1], near=position[0])
    assert np.linalg.norm(found[-1].position - position[-1]) < 8e-3


def test_the_moment_is_known_while_following(rotor: Rotor) -> None:
    """To where it truly points at the end of the last window, within the phase's and the axis' errors."""
    position, axis = (whole[:12] for whole in smooth_random(100, 6))
    phase = np.random.default_rng(1002).uniform(-np.pi, np.pi, 12)  # as `seen` draws it
    last = followed(rotor, seen(rotor, position, axis, PAIR, 2), PAIR)[-1]
    expected = orientation(axis[-1], np.asarray(2 * np.pi * 2.0 + phase[-1]))[:, 0]
    assert degrees_between(last.moment_direction(2.0), expected) < 15.0


def test_windows_must_follow_each_other(rotor: Rotor) -> None:
    samples = seen(rotor, *helix(2), PAIR, 5)
    belief = follow(None, samples[0], TIMES, rotor, 1.0, PAIR, start=4.0, noise=NOISE)
    with pytest.raises(InputError, match="follow each other"):
        follow(belief, samples[1], TIMES, rotor, 1.0, PAIR, start=2.0, noise=NOISE)
    with pytest.raises(InputError, match="one window at a time"):
        follow(None, samples, TIMES, rotor, 1.0, PAIR, noise=NOISE)


def test_hypotheses_that_noise_does_not_tell_apart_are_one(rotor: Rotor) -> None:
    """One sensor, told where the magnet begins: hypotheses stay apart by what their deviations say, so that other ways
    along one branch do not crowd out another branch; one of them is where the magnet is.
    """
    position, axis = (whole[:40] for whole in smooth_random(100, 3))
    beliefs = followed(rotor, seen(rotor, position, axis, PAIR[:1], 3), PAIR[:1], near=position[0])
    for belief in beliefs:
        off = belief.state[:, None, :6] - belief.state[None, :, :6]
        both = belief.state_covariance[:, None, :6, :6] + belief.state_covariance[None, :, :6, :6]
        square = np.einsum("abi,abi->ab", off, np.linalg.solve(both, off[..., None])[..., 0])
        assert (square > 4.0)[~np.eye(len(square), dtype=bool)].all()
    for belief, true in zip(beliefs, np.concatenate([position, axis], axis=-1), strict=True):
        off = belief.state[:, :6] - true
        square = np.einsum("hi,hi->h", off, np.linalg.solve(belief.state_covariance[:, :6, :6], off[..., None])[..., 0])
        assert square.min() < 25
