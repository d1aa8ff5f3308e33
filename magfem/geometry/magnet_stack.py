"""Stacks: equal cylinders, discs or rings on one axis, with gaps between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.geometry.card import Table
from magfem.geometry.device import header_from_card, length_text, two_digits
from magfem.geometry.limits import check_thickness
from magfem.geometry.magnetic_solids import MagneticSolids
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.part import Part
from magfem.geometry.repetition import check_count, check_gap, gap_from_card
from magfem.geometry.ring_lengths import check_ring, ring_from_card
from magfem.geometry.tube import Tube
from magfem.units import describe


@dataclass(frozen=True, kw_only=True)
class MagnetStack(MagneticSolids):
    """Equal magnets of revolution along z, the middle of the stack at the origin, all magnetised alike.

    Raises InputError when it is impossible.
    """

    kind = "magnet_stack"
    dimensions: ClassVar[tuple[str, ...]] = ("outer_diameter", "inner_diameter", "length", "gap")

    outer_diameter: float  # m
    inner_diameter: float = 0.0  # m, 0: full cylinders
    length: float  # m, of each magnet
    count: int
    gap: float = 0.0  # m, between neighbours; 0: they touch
    material: PermanentMagnet

    def __post_init__(self) -> None:
        if not isinstance(self.material, PermanentMagnet):
            raise InputError(f"{self.words}: material must be a PermanentMagnet, got {describe(self.material)}")
        self.check_header()
        check_count(self.words, "dimensions.count", self.count, 1)
        check_gap(self.words, self.gap)
        check_ring(self.words, self.outer_diameter, self.inner_diameter, self.length)
        largest = max(self.outer_diameter, self.total_length)
        check_thickness(self.words, "dimensions.length", "length", self.length, largest)
        if self.gap > 0:
            check_thickness(self.words, "dimensions.gap", "gap", self.gap, largest)
        self.check_region(largest)

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the stack that a whole card describes. Raises CardError."""
        values = header_from_card(card, "dimensions", "material")
        table = card.table("dimensions")
        if "diameter" in table:
            table.only("diameter", "length", "count", "gap")
            values |= {"outer_diameter": table.quantity("diameter", "length")}
            values |= {"length": table.quantity("length", "length")}
        else:
            table.only("outer_diameter", "inner_diameter", "length", "count", "gap")
            values |= ring_from_card(table)
        values |= {"count": table.number("count"), **gap_from_card(table)}
        with card.locating():
            return cls(**values, material=PermanentMagnet.from_card(card.table("material")))

    def tables(self) -> dict[str, Any]:
        lengths = {"outer_diameter": self.outer_diameter, "length": self.length}
        lengths |= {key: getattr(self, key) for key in ("inner_diameter", "gap") if getattr(self, key) > 0}
        sizes = {key: length_text(value) for key, value in lengths.items()}
        return {"dimensions": {**sizes, "count": int(self.count)}, "material": self.material.table()}

    @property
    def total_length(self) -> float:
        """Of all magnets and the gaps between them, m."""
        return self.count * self.length + (self.count - 1) * self.gap

    @property
    def parts(self) -> tuple[Part, ...]:
        """`magnet_1` is the lowest."""
        tube = Tube(self.outer_diameter, self.inner_diameter, self.length)
        pitch = self.length + self.gap
        return tuple(
            Part(f"magnet_{k + 1}", tube, self.material, (0.0, 0.0, (k - (self.count - 1) / 2) * pitch))
            for k in range(int(self.count))
        )

    @property
    def hull(self) -> CylinderHull:
        """The convex hull, from which distances are counted."""
        return CylinderHull(self.outer_diameter, self.total_length)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): 1/4 of the diameter, and 1.5 times the largest dimension, where loops model it.

        Other than axial magnetisation is modelled by multipoles, as all assemblies are.
        """
        if not self.axisymmetric:
            return super().default_region
        nearest = max(self.outer_diameter / 4, self.total_length / 16)
        return two_digits(nearest), two_digits(1.5 * max(self.outer_diameter, self.total_length))
