"""Quadratures from samples, held against sinusoids written out, statistics, and known bounds."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.errors import InputError
from magfem.localization import demodulate, demodulate_several, find_frequency, spectrum
from magfem.typing import Floats

TIMES = 3.0 + np.arange(600) / 20
STATIC, COSINE, SINE = np.array([[18e-6, 2e-6, -45e-6], [10e-6, -4e-6, 3e-6], [2e-6, 8e-6, 5e-6]])


def signal(times: Floats = TIMES, frequency: float = 1.0, drift: float = 0.0) -> Floats:
    angle = (2 * np.pi * (frequency * times + 0.5 * drift * times**2))[:, None]
    return STATIC + COSINE * np.cos(angle) + SINE * np.sin(angle)


def test_exact_sinusoids_come_back() -> None:
    found = demodulate(signal(), TIMES, 1.0)
    for value, true in ((found.static, STATIC), (found.cosine, COSINE), (found.sine, SINE)):
        np.testing.assert_allclose(value, true, atol=1e-16)
    assert found.strength == pytest.approx(np.linalg.svd(np.stack([COSINE, SINE], axis=1))[1][0])


def test_uneven_times_and_parts_of_turns_are_no_harm() -> None:
    times = np.sort(np.random.default_rng(0).uniform(0, 1.3, 50))
    found = demodulate(signal(times), times, 1.0)
    np.testing.assert_allclose(found.cosine, COSINE, atol=1e-15)


def test_gaps_and_full_readings_are_left_out() -> None:
    """With readings missing, and others clipped, the rest still says the same, exactly without noise."""
    b = signal() - [0.0, 0.0, STATIC[2]]
    b[np.random.default_rng(1).uniform(size=b.shape) < 0.2] = np.nan
    clipped = np.clip(b, -20e-6, 20e-6)  # the x axis swings from 8 to 28 µT
    found = demodulate(clipped, TIMES, 1.0, saturation=20e-6)
    assert found.saturated[0] == np.count_nonzero(b[:, 0] >= 20e-6) > 100
    assert found.saturated[1] == found.saturated[2] == 0
    assert found.count[1] == np.count_nonzero(np.isfinite(b[:, 1])) < 520
    np.testing.assert_allclose(found.cosine, COSINE, atol=1e-15)
    np.testing.assert_allclose(found.static, STATIC * [1, 1, 0], atol=1e-15)
    naive = demodulate(clipped, TIMES, 1.0)
    assert abs(naive.cosine[0] - COSINE[0]) > 1e-6


def test_covariance_is_what_noise_makes_of_it() -> None:
    """Six numbers of 3000 noisy records: χ² per degree of freedom within 1 ± 0.05, noise stated or found, per axis."""
    rng = np.random.default_rng(2)
    sigma = np.array([1e-6, 3e-6, 2e-6])
    times = TIMES[:45]  # not a whole number of turns: C and S are correlated
    b = signal(times) + sigma * rng.normal(size=(3000, 45, 3))
    for noise in (sigma, None):
        found = demodulate(b, times, 1.0, noise=noise)
        error = np.concatenate([found.cosine - COSINE, found.sine - SINE], axis=-1)
        squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error) / 6
        assert 0.95 < squared.mean() < 1.05
    np.testing.assert_allclose(found.noise.mean(axis=0), sigma, rtol=0.02)
    assert abs(np.corrcoef((found.cosine - COSINE)[:, 0], (found.sine - SINE)[:, 0])[0, 1]) > 0.02


def test_rounding_adds_its_share() -> None:
    """Steps of one deviation of the noise: the error grows by √(1 + 1/12), as is stated."""
    rng = np.random.default_rng(3)
    step = 3e-6
    b = step * np.round((signal() + 3e-6 * rng.normal(size=(800, 600, 3))) / step)
    found = demodulate(b, TIMES, 1.0, noise=3e-6, resolution=step)
    ratio = (found.cosine - COSINE).std() / np.sqrt(found.covariance[0, 0, 0])
    assert ratio == pytest.approx(1.0, abs=0.05)
    assert found.noise[0, 0] == pytest.approx(3e-6 * np.sqrt(1 + 1 / 12))


def test_an_unknown_frequency_is_found_at_its_bound() -> None:
    """var f = 6 σ² / (π² A² n T²) summed over axes: Rife and Boorstyn's bound for a sinusoid of many turns."""
    rng = np.random.default_rng(4)
    sigma = 3e-6
    b = signal(frequency=1.037) + sigma * rng.normal(size=(300, 600, 3))
    found = demodulate(b, TIMES, noise=sigma)
    power = np.sum(COSINE**2 + SINE**2)
    bound = np.sqrt(6 * sigma**2 / (np.pi**2 * power * 600 * 30.0**2))
    assert (found.frequency - 1.037).std() == pytest.approx(bound, rel=0.15)
    assert found.turning.deviation.mean() == pytest.approx(bound, rel=0.02)
    assert abs((found.frequency - 1.037).mean()) < 4 * bound / np.sqrt(300)


@pytest.mark.parametrize(("frequency", "drift"), [(1.0, 0.03), (2.5, -0.05), (0.7, 0.0)])
def test_a_drifting_frequency_is_followed(frequency: float, drift: float) -> None:
    times = np.arange(600) / 20
    found = demodulate(signal(times, frequency, drift), times, drift=True)
    assert found.frequency == pytest.approx(frequency, abs=1e-10)
    assert found.turning.drift == pytest.approx(drift, abs=1e-11)
    np.testing.assert_allclose(found.cosine, COSINE, atol=1e-13)
    near = demodulate(signal(times, frequency, drift), times, frequency, drift=True)
    assert near.turning.drift == pytest.approx(drift, abs=1e-11)


def test_several_motors_at_once() -> None:
    second = COSINE[::-1] * np.cos(2 * np.pi * 1.3 * TIMES)[:, None]
    found = demodulate_several(signal() + second, TIMES, [1.0, 1.3])
    np.testing.assert_allclose(found[0].cosine, COSINE, atol=1e-15)
    np.testing.assert_allclose(found[1].cosine, COSINE[::-1], atol=1e-15)
    np.testing.assert_allclose(found[1].sine, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("frequencies", "words"),
    [
        ([1.0, 1.001], "cannot tell the frequencies"),
        ([1.0, 19.0], "mirrored at half the rate"),
        ([0.002], "most of a turn"),
        ([10.0], "half the rate"),
        ([-1.0], "positive number in Hz"),
        ([], "list of numbers"),
    ],
)
def test_what_cannot_be_told_apart_is_refused(frequencies: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        demodulate_several(signal(), TIMES, frequencies)


def test_spectrum_shows_the_rotation() -> None:
    """Fig. 6.3h–i: the peak is at the frequency that turns, its height the mean square of the sinusoid.

    Lines are a quarter of 1/T apart: the nearest is at most an eighth off, where sinc² has fallen by 5 %.
    """
    for frequency in range(1, 10):
        found = spectrum(signal(frequency=float(frequency)), TIMES)
        assert found.peak == pytest.approx(frequency, abs=0.02)
        assert found.power.max() == pytest.approx(0.5 * np.sum(COSINE**2 + SINE**2), rel=0.055)


def test_no_frequency_in_noise() -> None:
    with pytest.raises(InputError, match="no rotation frequency stands out"):
        find_frequency(np.zeros((100, 3)), np.arange(100) / 20)


@pytest.mark.parametrize(
    ("samples", "times", "words"),
    [
        (np.zeros((5, 2)), np.arange(5), r"\(\.\.\., n, 3\)"),
        (np.zeros((5, 3)), np.arange(4), "times"),
        (np.zeros((5, 3)), [0, 1, 2, 3, np.nan], "finite"),
        (np.zeros((5, 3)), np.ones(5), "different times"),
        (np.zeros((3, 3)), np.arange(3), "do not determine"),
        (np.full((9, 3), np.nan), np.arange(9) / 4.5, "do not determine"),
        (np.full((9, 3), np.inf), np.arange(9) / 4.5, "missing are NaN"),
        ([["a", "b", "c"]], [0.0], "real numbers"),
    ],
)
def test_bad_samples_are_told(samples: object, times: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        demodulate(samples, times, 1.0)  # type: ignore[arg-type]
