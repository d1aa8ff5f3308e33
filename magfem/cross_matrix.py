"""The matrix of a cross product."""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats, Vectors


def cross_matrix(a: Vectors) -> Floats:
    """[a]× (..., 3, 3) of vectors a (..., 3), for which [a]× b = a × b."""
    x, y, z = np.moveaxis(np.asarray(a, dtype=float), -1, 0)
    matrix = np.zeros((*x.shape, 3, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix
