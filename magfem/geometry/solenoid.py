"""Solenoids."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from magfem.geometry.circuit import CoaxialWinding
from magfem.geometry.coaxial_coil import CoaxialCoil


@dataclass(frozen=True, kw_only=True)
class Solenoid(CoaxialCoil):
    """One winding about z, its centre at the origin. Raises InputError when it is impossible."""

    kind = "solenoid"
    dimensions: ClassVar[tuple[str, ...]] = ("inner_diameter", "outer_diameter", "length")

    @property
    def height(self) -> float:
        return self.length

    @property
    def parts(self) -> tuple[CoaxialWinding, ...]:
        """The one winding."""
        return (self.winding(0.0, self.turns),)
