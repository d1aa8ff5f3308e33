"""Smoothing of tracks, held against the same Gaussian algebra written out for all times at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magfem.localization.motion import DIFFUSE, Dynamics, Likelihoods, ProcessNoise, dynamics, kalman_filter, smooth
from magfem.typing import Floats

TIMES = np.array([0.0, 2.0, 3.0, 7.0, 8.5])
NOISE = ProcessNoise(2e-7, 3e-3)


def turning(seed: int) -> Dynamics:
    rng = np.random.default_rng(seed + 100)
    axis = rng.normal(size=(TIMES.size - 1, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    return dynamics(np.diff(TIMES), axis, 0.2 * rng.normal(size=axis.shape))


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


def all_at_once(measured: Likelihoods, motion: Dynamics) -> tuple[Floats, Floats, float]:
    """Mean (w, 12) and covariance (12w, 12w) of all states, and the log evidence, from one Gaussian of 12 w numbers."""
    count = TIMES.size
    size = 12 * count
    mean = np.zeros(size)
    mean[:6] = measured.place[0]
    covariance = np.zeros((size, size))
    covariance[:12, :12] = np.diag(DIFFUSE)
    for k in range(1, count):
        now, last = slice(12 * k, 12 * k + 12), slice(12 * k - 12, 12 * k)
        F = motion.F[k - 1]
        mean[now] = F @ mean[last] + motion.c[k - 1]
        covariance[now, : 12 * k] = F @ covariance[last, : 12 * k]
        covariance[: 12 * k, now] = covariance[now, : 12 * k].T
        covariance[now, now] = F @ covariance[last, last] @ F.T + motion.diffusion(NOISE, k - 1)
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
    motion = turning(seed)
    mean, covariance, evidence = all_at_once(measured, motion)
    found = smooth(measured, motion, NOISE)
    deviation = np.sqrt(np.diag(covariance)).reshape(mean.shape)
    assert np.abs((found.state - mean) / deviation).max() < 1e-6
    blocks = np.array([covariance[12 * k : 12 * k + 12, 12 * k : 12 * k + 12] for k in range(TIMES.size)])
    scale = deviation[:, :, None] * deviation[:, None, :]
    assert np.abs((found.covariance - blocks) / scale).max() < 1e-6
    assert found.log_evidence.sum() == pytest.approx(evidence, abs=1e-6)


AXIS, SPIN = np.array([0.48, -0.6, 0.64]), np.array([0.3, -0.2, 0.5])


def after(state: Floats, duration: float) -> Floats:
    """The state later, the axis turned by SciPy's rotation."""
    turn = Rotation.from_rotvec(duration * state[9:])
    return np.concatenate([state[:3] + duration * state[6:9], turn.apply(state[3:6]), state[6:]])


def test_dynamics_are_a_turning_axis_linearised() -> None:
    motion = dynamics(np.array([1.7]), AXIS[None], SPIN[None])
    state = np.concatenate([[0.01, 0.0, 0.02], AXIS, [1e-3, 2e-3, 0.0], SPIN])
    np.testing.assert_allclose(motion.F[0] @ state + motion.c[0], after(state, 1.7), atol=1e-12)
    step = 1e-5
    columns = [(after(state + step * e, 1.7) - after(state - step * e, 1.7)) / (2 * step) for e in np.eye(12)]
    np.testing.assert_allclose(motion.F[0], np.transpose(columns), atol=1e-9)


def test_diffusion_is_that_of_many_small_kicks() -> None:
    """Of velocity, and of angular velocity of an axis at rest, each with the time left to act."""
    motion = dynamics(np.array([4.0]), AXIS[None], np.zeros((1, 3)))
    steps = 20000
    each = 4.0 / steps
    total: Floats = np.zeros((12, 12))
    across = np.cross(np.eye(3), AXIS).T  # ω × a, column by column
    moments = [(each * (4.0 - (np.arange(steps) + 0.5) * each) ** power).sum() for power in (0, 1, 2)]
    for rows, rates, lever, density in ((0, 6, np.eye(3), NOISE.position), (3, 9, across, NOISE.axis)):
        p, v = slice(rows, rows + 3), slice(rates, rates + 3)
        total[p, p] = density * moments[2] * lever @ lever.T
        total[p, v] = density * moments[1] * lever
        total[v, p] = total[p, v].T
        total[v, v] = density * moments[0] * np.eye(3)
    np.testing.assert_allclose(motion.diffusion(NOISE, 0), total, rtol=1e-6, atol=1e-18)


def test_many_noises_at_once_are_each_alone() -> None:
    measured, motion = drawn(5), turning(5)
    several = np.array([1e-9, 2e-7]), np.array([1e-5, 3e-3])
    together = kalman_filter(measured, motion, ProcessNoise(*several)).log_evidence.sum(axis=-1)
    alone = [
        float(kalman_filter(measured, motion, ProcessNoise(a, b)).log_evidence.sum())
        for a, b in zip(*(one.tolist() for one in several), strict=True)
    ]
    np.testing.assert_allclose(together, alone, rtol=1e-12)
