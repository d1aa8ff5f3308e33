"""How a tracked magnet moves between its poses: with nearly constant velocities, and Gaussian statistics of that.

The state of a track is (p, a, ṗ, ω), twelve numbers: position, axis, velocity, and the angular velocity that turns the
axis, ȧ = ω × a. White noise drives ṗ and ω, so that an axis that keeps turning about anything needs none. The axis is a
vector in space; that it has length one is a measurement, taken with every pose. The motion of the axis is linearised
about the track that is known so far.

Poses enter as what the samples say near a point x₀ = (p₀, a₀), a quadratic log likelihood

    ℓ(x) = −½ χ² − gᵀ(x − x₀) − ½ (x − x₀)ᵀ Λ (x − x₀),

whose Λ may be singular: one sensor near β = 0, a window without samples. So updates never invert Λ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.localization.orientation import rotation_matrix
from magfem.typing import Floats, Vectors

DIFFUSE = np.repeat([0.2, 1.0, 0.02, 0.1], 3) ** 2
"""Variances of position (m²), axis, velocity (m²/s²) and angular velocity (rad²/s²) before anything was measured."""


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Spectral densities (...) of the accelerations that drive a track: position, m²/s³; axis, rad²/s³.

    After a time t at rest they have moved a magnet by about √(position t³/3) in every direction, and turned its axis by
    about √(axis t³/3) either way.
    """

    position: Floats | float
    axis: Floats | float


@dataclass(frozen=True, eq=False)
class Dynamics:
    """From each of w times to the next: x → F x + c, F (w − 1, 12, 12), c (w − 1, 12).

    position, axis: (w − 1, 12, 12), what noise of density one adds to the covariance.
    """

    F: Floats
    c: Floats
    position: Floats
    axis: Floats

    def diffusion(self, noise: ProcessNoise, step: int) -> Floats:
        """(..., 12, 12) what `noise` adds in one step."""
        densities = (np.asarray(one, dtype=float)[..., None, None] for one in (noise.position, noise.axis))
        return np.asarray(
            sum(d * unit for d, unit in zip(densities, (self.position[step], self.axis[step]), strict=True))
        )


def dynamics(durations: Floats, axis: Vectors, spin: Vectors) -> Dynamics:
    """The motion over `durations` (k,) s, near axes (k, 3) that turn with `spin` (k, 3) rad/s when each begins."""
    count, t = len(durations), durations[:, None, None]
    turn = rotation_matrix(durations[:, None] * spin)
    after = np.einsum("kij,kj->ki", turn, axis)
    lever = -cross_matrix(after) @ _left_jacobian(durations[:, None] * spin)  # d(after) of a small turn
    F = np.tile(np.eye(12), (count, 1, 1))
    F[:, :3, 6:9] = t * np.eye(3)
    F[:, 3:6, 3:6] = turn
    F[:, 3:6, 9:] = t * lever
    c = np.zeros((count, 12))
    c[:, 3:6] = -durations[:, None] * np.einsum("kij,kj->ki", lever, spin)
    position, turning = np.zeros((count, 12, 12)), np.zeros((count, 12, 12))
    one = np.broadcast_to(np.eye(3), (count, 3, 3))
    for Q, rows, rates, G in (
        (position, slice(0, 3), slice(6, 9), one),
        (turning, slice(3, 6), slice(9, 12), -cross_matrix(after)),
    ):
        Q[:, rows, rows] = t**3 / 3 * (G @ np.swapaxes(G, -1, -2))
        Q[:, rows, rates] = t**2 / 2 * G
        Q[:, rates, rows] = t**2 / 2 * np.swapaxes(G, -1, -2)
        Q[:, rates, rates] = t * one
    return Dynamics(F, c, position, turning)


def _left_jacobian(vector: Vectors) -> Floats:
    """(..., 3, 3) what a change of a rotation vector (..., 3) turns by: ∫₀¹ exp(s [v]×) ds."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    K = cross_matrix(vector)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    second = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * K + second * (K @ K))


@dataclass(frozen=True, eq=False)
class Likelihoods:
    """ℓ above for w windows: place x₀, gradient g (..., w, 6), information Λ (..., w, 6, 6), χ² (..., w)."""

    place: Floats
    gradient: Floats
    information: Floats
    misfit: Floats


@dataclass(frozen=True, eq=False)
class Smoothed:
    """States (..., w, 12), their covariances (..., w, 12, 12), and each window's log evidence (..., w)."""

    state: Floats
    covariance: Floats
    log_evidence: Floats


def update(
    state: Floats, covariance: Floats, place: Floats, gradient: Floats, information: Floats, misfit: Floats
) -> tuple[Floats, Floats, Floats]:
    """State (..., 12) and covariance after a measurement, and its log evidence (...), ∫ e^ℓ under the prior."""
    S = covariance[..., :6, :6]
    gain = np.eye(6) + information @ S  # I + ΛS
    difference = state[..., :6] - place
    slope: Floats = gradient + _times(information, difference)  # −∂ℓ/∂x at the prediction
    right: Floats = np.empty((*slope.shape, 7))
    right[..., :6], right[..., 6] = information, slope
    weighted: Floats = np.asarray(np.linalg.solve(gain, right))
    solved, pull = weighted[..., :6], weighted[..., 6]  # (I + ΛS)⁻¹Λ and (I + ΛS)⁻¹ slope
    PH = covariance[..., :, :6]
    evidence = (
        -0.5 * misfit
        - np.einsum("...i,...i->...", gradient, difference)
        - 0.5 * np.einsum("...i,...ij,...j->...", difference, information, difference)
        + 0.5 * np.einsum("...i,...ij,...j->...", slope, S, pull)
        - 0.5 * np.linalg.slogdet(gain)[1]
    )
    after = covariance - PH @ solved @ np.swapaxes(PH, -1, -2)
    moved: Floats = state - _times(PH, pull)
    return moved, 0.5 * (after + np.swapaxes(after, -1, -2)), np.asarray(evidence)


@dataclass(frozen=True, eq=False)
class Filtered:
    """States and covariances before and after each of w measurements, lists over them, and log evidences (..., w)."""

    state_before: list[Floats]
    covariance_before: list[Floats]
    state: list[Floats]
    covariance: list[Floats]
    log_evidence: Floats


def kalman_filter(measured: Likelihoods, motion: Dynamics, noise: ProcessNoise) -> Filtered:
    """The states given all measurements up to each time, from a diffuse prior about the first."""
    lead = np.broadcast_shapes(measured.misfit.shape[:-1], np.shape(noise.position))
    m = np.zeros((*lead, 12))
    m[..., :6] = measured.place[..., 0, :]
    P = np.broadcast_to(np.diag(DIFFUSE), (*lead, 12, 12))
    before_m, before_P, after_m, after_P, evidences = [], [], [], [], []
    for k in range(measured.misfit.shape[-1]):
        if k:
            F = motion.F[k - 1]
            m, P = _times(F, m) + motion.c[k - 1], F @ P @ F.T + motion.diffusion(noise, k - 1)
        before_m.append(m)
        before_P.append(P)
        m, P, evidence = update(
            m,
            P,
            measured.place[..., k, :],
            measured.gradient[..., k, :],
            measured.information[..., k, :, :],
            measured.misfit[..., k],
        )
        evidences.append(np.broadcast_to(evidence, lead))
        after_m.append(m)
        after_P.append(P)
    return Filtered(before_m, before_P, after_m, after_P, np.stack(evidences, axis=-1))


def smooth(measured: Likelihoods, motion: Dynamics, noise: ProcessNoise) -> Smoothed:
    """The states given all measurements, before and after (Rauch, Tung and Striebel)."""
    forward = kalman_filter(measured, motion, noise)
    m, P = forward.state[-1], forward.covariance[-1]
    states, covariances = [m], [P]
    for k in range(len(forward.state) - 2, -1, -1):
        # G = P Fᵀ P₋⁻¹, by a solve with the symmetric P₋.
        G = np.swapaxes(np.linalg.solve(forward.covariance_before[k + 1], motion.F[k] @ forward.covariance[k]), -1, -2)
        m = forward.state[k] + _times(G, m - forward.state_before[k + 1])
        P = forward.covariance[k] + G @ (P - forward.covariance_before[k + 1]) @ np.swapaxes(G, -1, -2)
        states.append(m)
        covariances.append(P)
    return Smoothed(np.stack(states[::-1], axis=-2), np.stack(covariances[::-1], axis=-3), forward.log_evidence)


def _times(A: Floats, x: Floats) -> Floats:
    return np.asarray((A @ x[..., None])[..., 0])
