"""How far data scatter and which of them to trust: Tukey's biweight for residuals of one, two or three coordinates."""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats

MEDIAN_LENGTH = {1: 0.674490, 2: 1.177410, 3: 1.538172}
"""Median length of a residual of so many coordinates, each normal with deviation 1 (root of the χ² median)."""

TUNING = {1: 4.685, 2: 5.12, 3: 5.49}
"""Tukey's constant that keeps about 95 % efficiency on normal data; residuals beyond it count nothing."""


def scale_of(lengths: Floats, coordinates: int) -> float:
    """Standard deviation of one coordinate, from the median length (n,) of residuals: half of the data may be wrong."""
    return float(np.median(lengths)) / MEDIAN_LENGTH[coordinates]


def biweight(lengths: Floats, limit: float) -> Floats:
    """Tukey's weights (n,): (1 − (r/limit)²)², zero beyond the limit."""
    inside: Floats = np.maximum(1 - (lengths / limit) ** 2, 0.0)
    return inside**2


def biweight_spread(lengths: Floats, limit: float, coordinates: int) -> tuple[float, float]:
    """A = E[ψ²] per coordinate and B = E[div ψ] per coordinate, of ψ(r) = weight(|r|) r, over data within the limit.

    The covariance of an M-estimate is A/B² (JᵀJ)⁻¹ (Huber, Robust Statistics, 1981, § 7.6); for normal data the noise
    is σ² = E[ψ·r]/(coordinates · B), exactly, by Stein's identity.
    """
    kept = lengths[lengths < limit]
    if np.isinf(limit):
        return float(np.mean(kept**2)) / coordinates, 1.0
    share = (kept / limit) ** 2
    weight = (1 - share) ** 2
    bend = weight - 4 * share * (1 - share) / coordinates
    return float(np.mean((weight * kept) ** 2)) / coordinates, float(np.mean(bend))
