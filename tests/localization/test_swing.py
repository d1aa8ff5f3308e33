"""Rotors that turn unevenly: their swing found, and poses as if they turned evenly."""

from __future__ import annotations

import numpy as np
import pytest
from localization.paths import PAIR

from magfem.errors import InputError
from magfem.fields import DipoleField
from magfem.localization import Sensor, demodulate, find_frequency, localize
from magfem.localization.orientation import orientation
from magfem.typing import Floats

MOMENT = 2.6e-3
DIPOLE = DipoleField([MOMENT, 0, 0])
TIMES = np.arange(600) / 20
POSITION, AXIS = np.array([12e-3, -5e-3, 22e-3]), np.array([0.48, 0.6, 0.64])
SWING, WHEN, START = 0.065, 1.0, 0.3


def turned(times: Floats, frequency: float = 1.0) -> Floats:
    """rad: even turning and a swing of 3.7° twice a turn."""
    theta = 2 * np.pi * frequency * times
    return theta + SWING * np.cos(2 * theta + WHEN) + START


def seen(angle: Floats, sensor: Floats) -> Floats:
    """(n, 3) T of the dipole at these angles, by its formula."""
    m = MOMENT * orientation(AXIS, angle)[..., 0]
    r = sensor - POSITION
    d = np.linalg.norm(r)
    return 1e-7 * (3 * r * (m @ r)[:, None] / d**5 - m / d**3)


@pytest.mark.parametrize("frequency", [1.0, None], ids=["known", "unknown"])
def test_the_swing_is_found_and_undone(frequency: float | None) -> None:
    """Exactly, without noise; taken for even turning, the same samples are degrees off."""
    samples = seen(turned(TIMES), np.zeros(3)) + np.array([2e-5, 0.0, 1e-5])
    pose = localize(samples, TIMES, DIPOLE, frequency, near=POSITION, swing=True)
    np.testing.assert_allclose(pose.position, POSITION, atol=1e-9)
    np.testing.assert_allclose(pose.axis, AXIS, atol=1e-7)
    assert np.linalg.norm(pose.turning.swing) == pytest.approx(SWING, rel=1e-7)
    for time in (0.0, 0.37, 11.1):
        expected = orientation(AXIS, turned(np.array([time])))[0, :, 0]
        np.testing.assert_allclose(pose.moment_direction(time), expected, atol=1e-6)
    even = localize(samples, TIMES, DIPOLE, frequency, near=POSITION)
    assert np.degrees(np.arccos(even.axis @ AXIS)) > 3.0


def test_covariance_counts_what_the_swing_costs() -> None:
    """χ² per degree of freedom about one, with one sensor; with two, which share one swing, not far from it."""
    rng = np.random.default_rng(1)
    for sensors, low, high in (([Sensor(noise=3e-6)], 0.9, 1.1), (PAIR, 0.8, 1.2)):
        clean = np.stack([seen(turned(TIMES), one.pose.translation) for one in sensors])
        samples = clean + 3e-6 * rng.normal(size=(1000, *clean.shape))
        pose = localize(samples, TIMES, DIPOLE, 1.0, sensors, near=POSITION, swing=True)
        error = pose.position - POSITION
        squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(pose.covariance[:, :3, :3]), error) / 3
        assert low < squared.mean() < high
        size = np.linalg.norm(pose.turning.swing, axis=-1)
        stated = np.sqrt(np.einsum("nii->n", pose.turning.swing_covariance) / 2)
        assert (size - SWING).std() == pytest.approx(stated.mean(), rel=0.15)


def test_how_quadratures_answer_to_the_swing() -> None:
    """By differences: the same samples, demodulated by rotations whose swing is a little larger."""
    samples = seen(turned(TIMES), np.zeros(3))
    found = demodulate(samples, TIMES, 1.0, noise=1e-9, swing=True)
    assert found.turning.swing is not None and found.turning.swing_covariance is not None
    from dataclasses import replace

    step, columns = 1e-5, []
    for k in range(2):
        sides = []
        for sign in (1, -1):
            swing = found.turning.swing + sign * step * np.eye(2)[k]
            other = demodulate(samples, TIMES, replace(found.turning, swing=swing, swing_covariance=None), noise=1e-9)
            # Both told from the middle of the record, where the phase is not what the swing turns back by.
            sides.append(np.concatenate([other.cosine, other.sine]))
        columns.append((sides[0] - sides[1]) / (2 * step))
    by = np.stack(columns, axis=1)
    with_swing = (
        found.covariance
        - demodulate(samples, TIMES, replace(found.turning, swing_covariance=None), noise=1e-9).covariance
    )
    # A change of the swing also turns time zero seen from the middle: a common turn of C and S, which is the phase's.
    C, S = found.cosine, found.sine
    turn = np.concatenate([S, -C]) / np.linalg.norm(np.concatenate([C, S]))
    across = np.eye(6) - np.outer(turn, turn)
    expected = across @ by @ found.turning.swing_covariance @ by.T @ across
    ours = across @ with_swing @ across
    np.testing.assert_allclose(ours, expected, atol=2e-3 * np.abs(expected).max())


def test_known_needs_a_frequency() -> None:
    with pytest.raises(InputError, match="state the known frequency"):
        find_frequency(seen(turned(TIMES), np.zeros(3)), TIMES, known=True, swing=True)
