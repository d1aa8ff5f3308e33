"""Numbers as a user gives them, as arrays."""

from __future__ import annotations

import numpy as np

from magfem.errors import InputError
from magfem.typing import ArrayLike, Floats

SAMPLES = "samples must be real numbers (..., n, 3) in T"
TIMES = "times must be real numbers (n,) in s"


def real_numbers(given: ArrayLike, expected: str) -> Floats:
    """`given` as an array of real numbers, whatever its shape; what is masked becomes NaN.

    Raises InputError for what is something else, in words that begin with what was `expected`.
    """
    try:
        array = np.asarray(given)
        if array.dtype.kind in "biufO":
            if isinstance(given, np.ma.MaskedArray):
                return np.asarray(np.ma.filled(given.astype(float), np.nan))
            return np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        pass
    shown = repr(given)
    raise InputError(f"{expected}, got {shown if len(shown) < 60 else type(given).__name__}")
