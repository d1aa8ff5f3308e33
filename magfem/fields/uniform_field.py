"""The same field everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.typing import ArrayLike, Floats, Jet, Points

if TYPE_CHECKING:
    from magfem.fields.terms import Terms


class UniformField(Evaluated):
    """B (3,) T at every point. Raises InputError for anything but three finite numbers."""

    region: Region = Everywhere()
    unit: Unit = "T"

    def __init__(self, B: ArrayLike) -> None:
        vector = np.asarray(B, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise InputError(f"a uniform field is three finite numbers in T, got {B!r}")
        self.vector: Floats = vector

    def __repr__(self) -> str:
        return f"UniformField({self.vector.tolist()})"

    @property
    def lowered(self) -> Terms:
        """As sources far away."""
        from magfem.fields.terms import uniform

        return uniform(self.vector)

    def evaluate(self, points: Points, order: int) -> Jet:
        n = len(points)
        return (np.tile(self.vector, (n, 1)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3, 3)))[: order + 1]
