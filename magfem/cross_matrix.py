"""The matrix of a cross product."""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats, Vectors

# Row k holds [e_k]×: all of them, weighted, are one small product, several times faster than filling in six entries.
_UNITS = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], dtype=float
)


def cross_matrix(a: Vectors) -> Floats:
    """[a]× (..., 3, 3) of vectors a (..., 3), for which [a]× b = a × b."""
    given = np.asarray(a, dtype=float)
    return np.asarray((given @ _UNITS).reshape(*given.shape, 3))


def cross(a: Vectors, b: Vectors) -> Vectors:
    """a × b (..., 3), for a few vectors several times faster than NumPy's."""
    return np.asarray((cross_matrix(a) @ np.asarray(b, dtype=float)[..., None])[..., 0])
