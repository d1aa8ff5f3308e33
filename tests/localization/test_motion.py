"""Smoothing of tracks, held against the same Gaussian algebra written out for all times at once."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.localization.motion import DIFFUSE, Likelihoods, ProcessNoise, diffusion, kalman_filter, smooth, transition
from magfem.typing import Floats

TIMES = np.array([0.0, 2.0, 3.0, 7.0, 8.5])
NOISE = ProcessNoise(np.asarray(2e-7), np.asarray(3e-3))


def drawn(seed: int) -> Likelihoods:
    """Quadratic log likelihoods at five times; that of the third says nothing of one direction, the fourth nothing."""
    rng = np.random.default_rng(seed)
    count = TIMES.size
    scale = np.repeat([3e-3, 0.1], 3)
    A = (2 * np.eye(6) + 0.5 * rng.normal(size=(count, 6, 6))) / scale
    information = np.swapaxes(A, -1, -2) @ A
    values, vectors = np.linalg.eigh(information[2])
    information[2] = (vectors[:, 1:] * values[1:]) @ vectors[:, 1:].T
    information[3] = 0.0
    place = rng.normal(size=(count, 6)) * np.repeat([0.02, 0.5], 3)
    gradient = np.einsum("wij,wj->wi", information, rng.normal(size=(count, 6)) * scale)
    return Likelihoods(place, gradient, information, rng.uniform(1, 9, count))


def all_at_once(measured: Likelihoods) -> tuple[Floats, Floats, float]:
    """Mean (w, 12) and covariance (12w, 12w) of all states, and the log evidence, from one Gaussian of 12 w numbers."""
    count = TIMES.size
    size = 12 * count
    mean = np.zeros(size)
    mean[:6] = measured.place[0]
    covariance = np.zeros((size, size))
    covariance[:12, :12] = np.diag(DIFFUSE)
    for k in range(1, count):
        now, last = slice(12 * k, 12 * k + 12), slice(12 * k - 12, 12 * k)
        F = transition(TIMES[k] - TIMES[k - 1])
        mean[now] = F @ mean[last]
        covariance[now, : 12 * k] = F @ covariance[last, : 12 * k]
        covariance[: 12 * k, now] = covariance[now, : 12 * k].T
        covariance[now, now] = F @ covariance[last, last] @ F.T + diffusion(NOISE, TIMES[k] - TIMES[k - 1])
    rows = np.concatenate([12 * k + np.arange(6) for k in range(count)])
    Lambda = np.zeros((size, size))
    slope = np.zeros(size)
    constant = 0.0
    for k in range(count):
        own = rows[6 * k : 6 * k + 6]
        Lambda[np.ix_(own, own)] = measured.information[k]
        off = mean[own] - measured.place[k]
        slope[own] = measured.gradient[k] + measured.information[k] @ off
        constant += -0.5 * measured.misfit[k] - measured.gradient[k] @ off - 0.5 * off @ measured.information[k] @ off
    inner = np.linalg.inv(np.eye(size) + covariance @ Lambda)
    posterior = inner @ covariance
    evidence = constant + 0.5 * slope @ posterior @ slope + 0.5 * np.linalg.slogdet(inner)[1]
    return (mean - posterior @ slope).reshape(count, 12), posterior, float(evidence)


@pytest.mark.parametrize("seed", range(3))
def test_smoother_is_the_gaussian_of_all_times(seed: int) -> None:
    measured = drawn(seed)
    mean, covariance, evidence = all_at_once(measured)
    found = smooth(TIMES, measured, NOISE)
    deviation = np.sqrt(np.diag(covariance)).reshape(mean.shape)
    assert np.abs((found.state - mean) / deviation).max() < 1e-6
    blocks = np.array([covariance[12 * k : 12 * k + 12, 12 * k : 12 * k + 12] for k in range(TIMES.size)])
    scale = deviation[:, :, None] * deviation[:, None, :]
    assert np.abs((found.covariance - blocks) / scale).max() < 1e-6
    assert found.log_evidence.sum() == pytest.approx(evidence, abs=1e-6)


def test_diffusion_is_that_of_white_acceleration() -> None:
    """In two steps as in one, and as many small kicks make it."""
    first, second = diffusion(NOISE, 1.5), diffusion(NOISE, 2.5)
    F = transition(2.5)
    np.testing.assert_allclose(F @ first @ F.T + second, diffusion(NOISE, 4.0), rtol=1e-12, atol=1e-30)
    steps = 4000
    left = 4.0 - (np.arange(steps) + 0.5) * 4.0 / steps  # time that a kick has to act
    position = np.sum(left**2) * float(NOISE.position) * 4.0 / steps
    assert diffusion(NOISE, 4.0)[0, 0] == pytest.approx(position, rel=1e-6)


def test_many_noises_at_once_are_each_alone() -> None:
    measured = drawn(5)
    several = ProcessNoise(np.array([1e-9, 2e-7]), np.array([1e-5, 3e-3]))
    together = kalman_filter(TIMES, measured, several).log_evidence.sum(axis=-1)
    alone = [
        float(kalman_filter(TIMES, measured, ProcessNoise(np.asarray(a), np.asarray(b))).log_evidence.sum())
        for a, b in zip(several.position, several.axis, strict=True)
    ]
    np.testing.assert_allclose(together, alone, rtol=1e-12)
