"""The shortest vector under linear inequalities, exactly: least distance programming by non-negative least squares.

Source: Lawson & Hanson, Solving Least Squares Problems, 1974, chapter 23.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from magfem.typing import Floats

TOLERANCE = 1e-9
"""How far an inequality, whose rows are of order one, may be missed."""


def least_distance(G: Floats, h: Floats) -> Floats | None:
    """The shortest z (n,) with G z ≥ h, for G (m, n) and h (m,); None when there is no such z."""
    m, n = G.shape
    if not np.any(h > 0):
        return np.zeros(n)
    if n == 0:
        return None if np.any(h > TOLERANCE) else np.zeros(0)
    lengths = np.linalg.norm(G, axis=1)
    lengths = np.where(lengths > 0, lengths, 1.0)
    size = float((h / lengths).max())  # a length of z that is right to the order: NNLS works on numbers of order one
    rows, bounds = G / lengths[:, None], h / lengths / size
    try:
        u, _ = nnls(np.vstack([rows.T, bounds]), np.append(np.zeros(n), 1.0), maxiter=30 * (m + n))
    except RuntimeError:  # too many iterations: seen on infeasible problems alone
        return None
    residual = np.vstack([rows.T, bounds]) @ u - np.append(np.zeros(n), 1.0)
    if -residual[n] < 1e-14:
        return None
    z: Floats = -residual[:n] / residual[n]
    if np.any(rows @ z < bounds - TOLERANCE * max(1.0, np.abs(z).max())):
        return None
    return z * size
