"""A step of parameters towards a goal: damped, truncated, within bounds, and with what is left a second task."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.typing import Booleans, Floats


@dataclass(frozen=True, eq=False)
class Step:
    """What was found.

    change: (n,) of the parameters.  clamped: (n,) which ended at a bound.  rank: directions of the goal that the free
    parameters reach.  condition: largest over smallest singular value, of all parameters.
    """

    change: Floats
    clamped: Booleans
    rank: int
    condition: float


def bounded_step(
    J: Floats,
    wanted: Floats,
    low: Floats,
    high: Floats,
    damping: float,
    second: Floats | None = None,
    largest_condition: float = 1e5,
) -> Step:
    """The step x, low ≤ x ≤ high, with J x near `wanted` (r,); J (r, n) in units that make its columns comparable.

    x = V diag(σ / (σ² + damping²)) Uᵀ wanted, without singular values below σ₁ / largest_condition, plus the part of
    `second` (n,) that J does not see. Parameters that would leave their bounds are set to them, and the rest is solved
    again: each round fixes at least one.
    """
    n = J.shape[1]
    fixed = np.zeros(n, dtype=bool)
    x = np.zeros(n)
    rank, condition = 0, np.inf
    for round_ in range(n + 1):
        free = ~fixed
        if not free.any():
            rank = 0
            break
        U, sigma, Vt = np.linalg.svd(J[:, free], full_matrices=False)
        kept = sigma > sigma[0] / largest_condition if sigma[0] > 0 else np.zeros(sigma.size, dtype=bool)
        rank = int(np.count_nonzero(kept))
        if round_ == 0:
            condition = float(sigma[0] / sigma[-1]) if sigma[-1] > 1e-300 * sigma[0] else np.inf
        U, sigma, Vt = U[:, kept], sigma[kept], Vt[kept]
        rest = wanted - J[:, fixed] @ x[fixed]
        part = Vt.T @ (sigma / (sigma**2 + damping**2) * (U.T @ rest))
        if second is not None:
            part += second[free] - Vt.T @ (Vt @ second[free])
        x[free] = part
        beyond = free & ((x < low) | (x > high))
        if not beyond.any():
            break
        x[beyond] = np.clip(x[beyond], low[beyond], high[beyond])
        fixed |= beyond
    return Step(x, fixed, rank, condition)
