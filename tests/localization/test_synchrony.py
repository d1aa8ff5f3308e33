"""Rotors in step, slipping and locked, by dipoles written out."""

from __future__ import annotations

import numpy as np
import pytest
from localization.dipole_field import dipole_samples

from magfem.errors import InputError
from magfem.localization import synchrony

TIMES = np.arange(600) / 20
PLACE, AXIS = np.array([0.0, 0.01, 0.025]), np.array([0.0, 0.6, 0.8])


@pytest.mark.parametrize("frequency", range(1, 10))
def test_in_step_at_every_frequency_of_the_figure(frequency: int) -> None:
    """1 to 9 Hz at 20 Hz; 10 Hz, half the rate, cannot be seen by any sensor."""
    rng = np.random.default_rng(frequency)
    samples = dipole_samples(PLACE, AXIS, TIMES, float(frequency)) + 3e-6 * rng.normal(size=(600, 3))
    found = synchrony(samples, TIMES, float(frequency))
    assert found.outcome == "in step" and abs(found.frequency - frequency) < 5 * found.deviation < 0.01
    still = dipole_samples(PLACE, AXIS, np.linspace(0, 1, 361), 1.0)
    assert found.strength == pytest.approx(np.linalg.norm(still, axis=1).max(), rel=0.05)
    assert 0.5 < found.share <= 1.0


def test_slipping_and_locked_rotors_are_told() -> None:
    rng = np.random.default_rng(0)
    noise = 3e-6 * rng.normal(size=(600, 3)) + 2e-5
    slipping = synchrony(dipole_samples(PLACE, AXIS, TIMES, 0.9) + noise, TIMES, 1.0)
    assert slipping.outcome == "out of step" and slipping.frequency == pytest.approx(0.9, abs=1e-3)
    for seed in range(20):
        quiet = 3e-6 * np.random.default_rng(seed).normal(size=(600, 3)) + 2e-5
        locked = synchrony(quiet, TIMES, 1.0)
        assert locked.outcome == "locked" and np.isnan(locked.frequency)
    assert synchrony(np.full((600, 3), 2e-5), TIMES, 1.0).outcome == "locked"


def test_one_record_at_a_time() -> None:
    with pytest.raises(InputError, match="one record"):
        synchrony(np.zeros((2, 600, 3)), TIMES, 1.0)
