"""Helmholtz pairs: two equal windings on one axis."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

from magfem.geometry.circuit import CoaxialWinding
from magfem.geometry.coaxial_coil import CoaxialCoil
from magfem.geometry.limits import InvalidValue
from magfem.units import format_quantity


@dataclass(frozen=True, kw_only=True)
class HelmholtzPair(CoaxialCoil):
    """Two windings about z in series, the origin halfway between them; `turns`, `layers` and `length` are of each.

    Opposed ones have the lower winding reversed: no field at the origin but a gradient (a Maxwell pair).
    Raises InputError when the pair is impossible.
    """

    kind = "helmholtz_pair"
    dimensions: ClassVar[tuple[str, ...]] = ("inner_diameter", "outer_diameter", "length")
    optional: ClassVar[tuple[str, ...]] = ("spacing",)
    switches: ClassVar[tuple[str, ...]] = ("opposed",)

    spacing: float | None = None  # m, between the windings' centres; None: see `distance`
    opposed: bool = False

    def check_shape(self, largest: float) -> None:
        super().check_shape(largest)
        if self.distance < self.length:
            raise InvalidValue(
                f"{self.words}: spacing, between the centres of the windings, must be at least their length "
                f"({format_quantity(self.length, 'length')}) or they overlap, "
                f"got {format_quantity(self.distance, 'length')}",
                "dimensions.spacing" if self.spacing is not None else "dimensions.length",
            )

    @property
    def distance(self) -> float:
        """Between the windings' centres, m: as stated, else the mean radius, which makes the field most even.

        Opposed windings are √3 mean radii apart by default, which makes the gradient most even.
        """
        if self.spacing is not None:
            return self.spacing
        radius = 0.25 * (self.inner_diameter + self.outer_diameter)
        return sqrt(3) * radius if self.opposed else radius

    @property
    def height(self) -> float:
        return self.distance + self.length

    @property
    def parts(self) -> tuple[CoaxialWinding, ...]:
        """The lower and the upper winding."""
        half = 0.5 * self.distance
        return self.winding(-half, -self.turns if self.opposed else self.turns), self.winding(half, self.turns)
