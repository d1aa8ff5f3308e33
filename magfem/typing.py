"""Names for the arrays that travel through magfem. Shapes are conventions, not checked types."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Complexes: TypeAlias = NDArray[np.complex128]
Booleans: TypeAlias = NDArray[np.bool_]

Points: TypeAlias = Floats  # (..., 3) m
Vectors: TypeAlias = Floats  # (..., 3), T for a field
Tensors: TypeAlias = Floats  # (..., 3, 3), [..., i, j] = dB_i/dx_j
Hessians: TypeAlias = Floats  # (..., 3, 3, 3), [..., i, j, k] = d2B_i/dx_j dx_k
Jet: TypeAlias = tuple[Floats, ...]  # (B, gradient[, hessian])

Outside: TypeAlias = Literal["raise", "nan", "extrapolate"]

__all__ = [
    "ArrayLike",
    "Booleans",
    "Complexes",
    "Floats",
    "Hessians",
    "Integers",
    "Jet",
    "Outside",
    "Points",
    "Tensors",
    "Vectors",
]
