"""How a tracked magnet moves between its poses: with nearly constant velocities, and Gaussian statistics of that.

The state of a track is (p, a, ṗ, ȧ), twelve numbers: position and axis, and their rates. White acceleration drives
both. The axis is a vector in space; that it has length one is a measurement, taken with every pose.

Poses enter as what the samples say near a point x₀ = (p₀, a₀), a quadratic log likelihood

    ℓ(x) = −½ χ² − gᵀ(x − x₀) − ½ (x − x₀)ᵀ Λ (x − x₀),

whose Λ may be singular: one sensor near β = 0, a window without samples. So updates never invert Λ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.typing import Floats

DIFFUSE = np.repeat([0.2, 1.0, 0.02, 0.1], 3) ** 2
"""Variances of position (m²), axis, velocity (m²/s²) and rate (1/s²) before anything was measured."""


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Spectral densities (...) of the acceleration that drives a track: position, m²/s³; axis, rad²/s³.

    After a time t at rest they have moved a magnet by about √(position t³/3) in every direction.
    """

    position: Floats
    axis: Floats


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


def transition(duration: float) -> Floats:
    """(12, 12) from one time to another `duration` s later."""
    return np.eye(12) + duration * np.eye(12, k=6)


def diffusion(noise: ProcessNoise, duration: float) -> Floats:
    """(..., 12, 12) what white acceleration adds to the covariance in `duration` s."""
    t = duration
    rates = np.stack([noise.position] * 3 + [noise.axis] * 3, axis=-1)  # (..., 6)
    block = np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
    Q = np.einsum("ij,...k,kl->...ikjl", block, rates, np.eye(6))
    return np.asarray(Q.reshape(*rates.shape[:-1], 12, 12))


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


def kalman_filter(times: Floats, measured: Likelihoods, noise: ProcessNoise) -> Filtered:
    """The states given all measurements up to each time, at `times` (w,) s, from a diffuse prior about the first."""
    lead = np.broadcast_shapes(measured.misfit.shape[:-1], np.shape(noise.position))
    m = np.zeros((*lead, 12))
    m[..., :6] = measured.place[..., 0, :]
    P = np.broadcast_to(np.diag(DIFFUSE), (*lead, 12, 12))
    before_m, before_P, after_m, after_P, evidences = [], [], [], [], []
    for k in range(times.size):
        if k:
            duration = float(times[k] - times[k - 1])
            F = transition(duration)
            m, P = _times(F, m), F @ P @ F.T + diffusion(noise, duration)
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


def smooth(times: Floats, measured: Likelihoods, noise: ProcessNoise) -> Smoothed:
    """The states given all measurements, before and after (Rauch, Tung and Striebel)."""
    forward = kalman_filter(times, measured, noise)
    m, P = forward.state[-1], forward.covariance[-1]
    states, covariances = [m], [P]
    for k in range(times.size - 2, -1, -1):
        F = transition(float(times[k + 1] - times[k]))
        # G = P Fᵀ P₋⁻¹, by a solve with the symmetric P₋.
        G = np.swapaxes(np.linalg.solve(forward.covariance_before[k + 1], F @ forward.covariance[k]), -1, -2)
        m = forward.state[k] + _times(G, m - forward.state_before[k + 1])
        P = forward.covariance[k] + G @ (P - forward.covariance_before[k + 1]) @ np.swapaxes(G, -1, -2)
        states.append(m)
        covariances.append(P)
    return Smoothed(np.stack(states[::-1], axis=-2), np.stack(covariances[::-1], axis=-3), forward.log_evidence)


def _times(A: Floats, x: Floats) -> Floats:
    return np.asarray((A @ x[..., None])[..., 0])
