"""The matrix of a cross product."""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats


def cross_matrix(a: Floats) -> Floats:
    """[a]× (3, 3), for which [a]× b = a × b."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
