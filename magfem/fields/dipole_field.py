"""The field of a point dipole at the origin."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.typing import ArrayLike, Floats, Jet, Points

if TYPE_CHECKING:
    from magfem.fields.terms import Terms


class DipoleField(Evaluated):
    """Of a moment (3,) A·m²; infinite at the origin. Raises InputError for anything but three finite numbers."""

    region: Region = Everywhere()
    unit: Unit = "T"

    def __init__(self, moment: ArrayLike) -> None:
        vector = np.asarray(moment, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise InputError(f"a dipole's moment is three finite numbers in A·m², got {moment!r}")
        self.moment: Floats = vector

    def __repr__(self) -> str:
        return f"DipoleField({self.moment.tolist()})"

    @cached_property
    def lowered(self) -> Terms:
        """As harmonics of degree 1."""
        from magfem.fields.terms import harmonics

        return harmonics(1.0, [1, 1, 1], [1, 1, 0], [False, True, False], MU_0 / (4 * np.pi) * self.moment)

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.lowered.jet(points, order)
