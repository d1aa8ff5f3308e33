"""The norm in which magfem states errors."""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats

FLOOR = 0.01
"""Where the field nearly vanishes, errors count against this share of the largest value at the same distance."""


def relative_errors(found: Floats, reference: Floats, layered: bool = True) -> Floats:
    """Relative error of B or of its gradient at every point.

    found, reference: (l, p, 3) or (l, p, 3, 3), where the p points of a layer share one hull distance (as made
    by `Shell.layers`); (p, 3…) with `layered` false, for one layer. Returns (l, p) or (p,):
    |found − reference| / max(|reference|, FLOOR · the largest |reference| of the layer), with the Frobenius
    norm for gradients.
    """
    axes = tuple(range(2 if layered else 1, reference.ndim))
    size = np.sqrt(np.sum(reference**2, axis=axes))
    difference = np.sqrt(np.sum((found - reference) ** 2, axis=axes))
    largest = size.max(axis=-1, keepdims=True)
    floor = np.maximum(size, FLOOR * largest)
    errors: Floats = np.divide(difference, floor, out=np.zeros_like(difference), where=floor > 0)
    return errors
