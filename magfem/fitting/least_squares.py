"""Linear least squares with scaled columns and a stated condition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.typing import Floats


@dataclass(frozen=True)
class LeastSquares:
    """Parameters (p,), their covariance (p, p), and the condition number of the scaled columns."""

    parameters: Floats
    covariance: Floats
    condition: float


def solve_least_squares(matrix: Floats, target: Floats) -> LeastSquares:
    """Minimise |matrix·x − target|, matrix (n, p), target (n,), by SVD of the columns scaled to length one.

    Nothing is truncated: what the data cannot tell shows in the condition, not in a silent zero. The
    covariance takes the residual's variance as that of every row.
    """
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1.0
    u, s, vt = np.linalg.svd(matrix / scale, full_matrices=False)
    s = np.maximum(s, np.finfo(float).tiny)
    parameters = vt.T @ ((u.T @ target) / s) / scale
    rows, columns = matrix.shape
    variance = np.sum((matrix @ parameters - target) ** 2) / max(rows - columns, 1)
    root = vt.T / s / scale[:, None]
    return LeastSquares(parameters, variance * root @ root.T, float(s[0] / s[-1]))
