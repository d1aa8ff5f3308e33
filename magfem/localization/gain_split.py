"""A reading matrix as a gain and a rotation: what one three-axis sensor tells is their product alone.

M = P U with P symmetric and U a rotation (polar decomposition): of all mountings the one nearest to the axes that the
sensor reads along. P's diagonal holds the sensitivities, the rest how far its axes are from perpendicular. For a sensor
whose axes are left-handed P is negative definite.
"""

from __future__ import annotations

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.typing import Floats


def split_gain(matrix: Floats) -> tuple[Floats, Floats]:
    """P (..., 3, 3) and U (..., 3, 3) of matrices (..., 3, 3)."""
    left, size, right = np.linalg.svd(matrix)
    sign = np.sign(np.linalg.det(matrix))[..., None, None]
    gain = sign * (left * size[..., None, :]) @ np.swapaxes(left, -1, -2)
    return gain, sign * left @ right


def split_derivatives(gain: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """How P (9, row by row) and the mounting change with M: (..., 9, 9) and (..., 3, 9) rad.

    The mounting's change is a small turn about the sensor's own axes: U becomes exp(−[δ]×) U. With X = dM Uᵀ the
    antisymmetric part of dP = X + P [δ]× must vanish, and P [δ]× + [δ]× P = [(tr P − P) δ]×.
    """
    unit = np.eye(9).reshape(9, 3, 3)
    X = unit @ np.swapaxes(turn, -1, -2)[..., None, :, :]  # (..., 9, 3, 3)
    odd = X - np.swapaxes(X, -1, -2)
    vector = np.stack([odd[..., 2, 1], odd[..., 0, 2], odd[..., 1, 0]], axis=-1)  # (..., 9, 3)
    trace = np.einsum("...ii->...", gain)[..., None, None]
    delta = -np.linalg.solve(trace * np.eye(3) - gain, np.swapaxes(vector, -1, -2))  # (..., 3, 9)
    d_gain = X + gain[..., None, :, :] @ cross_matrix(np.swapaxes(delta, -1, -2))
    return np.swapaxes(d_gain.reshape(*d_gain.shape[:-2], 9), -1, -2), delta
