"""Halbach arrays: a row of blocks whose magnetisation turns from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import Any, ClassVar, Self

from magfem.errors import InputError
from magfem.fields.hull import BoxHull
from magfem.geometry.block_magnet import check_size
from magfem.geometry.box import Box
from magfem.geometry.card import Table
from magfem.geometry.device import header_from_card, length_text
from magfem.geometry.limits import InvalidValue, check_number, check_thickness
from magfem.geometry.magnetic_solids import MagneticSolids
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.part import Part
from magfem.geometry.repetition import check_count, check_gap, gap_from_card
from magfem.geometry.vectors import Vector, three_lengths
from magfem.units import describe, format_quantity


@dataclass(frozen=True, kw_only=True)
class HalbachArray(MagneticSolids):
    """Equal blocks in a row along x, its middle at the origin.

    The material's direction is that of the middle of the row; from block to block towards +x it turns by `step`
    about +y. With z magnetised in the middle and a step of 90 deg the strong side is that of -z, with -90 deg +z.
    Raises InputError when it is impossible.
    """

    kind = "halbach_array"
    dimensions: ClassVar[tuple[str, ...]] = ("width", "depth", "height", "gap")  # of one block: the card's `size`

    size: tuple[float, float, float]  # m, of one block along x, y, z
    count: int
    step: float = pi / 2  # rad, about +y
    gap: float = 0.0  # m, between neighbours; 0: they touch
    material: PermanentMagnet

    def __post_init__(self) -> None:
        if not isinstance(self.material, PermanentMagnet):
            raise InputError(f"{self.words}: material must be a PermanentMagnet, got {describe(self.material)}")
        self.check_header()
        object.__setattr__(self, "size", check_size(self.words, self.size))
        check_count(self.words, "dimensions.count", self.count, 1)
        check_gap(self.words, self.gap)
        check_number(self.words, "dimensions.step", self.step)
        if abs(self.step) > 2 * pi:
            raise InvalidValue(
                f"{self.words}: step must lie within ±360°, got {format_quantity(self.step, 'angle')}",
                "dimensions.step",
            )
        largest = max(self.total_size)
        check_thickness(self.words, "dimensions.size", "every length of size", min(self.size), largest)
        if self.gap > 0:
            check_thickness(self.words, "dimensions.gap", "gap", self.gap, largest)
        self.check_region(largest)

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the array that a whole card describes. Raises CardError."""
        values = header_from_card(card, "dimensions", "material")
        table = card.table("dimensions")
        table.only("size", "count", "step", "gap")
        values |= {"size": three_lengths(table, "size"), "count": table.number("count"), **gap_from_card(table)}
        if "step" in table:
            values["step"] = table.quantity("step", "angle")
        with card.locating():
            return cls(**values, material=PermanentMagnet.from_card(card.table("material")))

    def tables(self) -> dict[str, Any]:
        dimensions: dict[str, Any] = {"size": [length_text(length) for length in self.size], "count": int(self.count)}
        dimensions["step"] = f"{self.step!r} rad"
        if self.gap > 0:
            dimensions["gap"] = length_text(self.gap)
        return {"dimensions": dimensions, "material": self.material.table()}

    @property
    def width(self) -> float:
        """Of one block along x, m."""
        return self.size[0]

    @property
    def depth(self) -> float:
        """Of one block along y, m."""
        return self.size[1]

    @property
    def height(self) -> float:
        """Of one block along z, m."""
        return self.size[2]

    @property
    def total_size(self) -> Vector:
        """Of the whole row along x, y, z, m."""
        return self.count * self.width + (self.count - 1) * self.gap, self.depth, self.height

    @property
    def parts(self) -> tuple[Part, ...]:
        """`block_1` is the one at lowest x."""
        return tuple(self._part(k) for k in range(int(self.count)))

    @property
    def hull(self) -> BoxHull:
        """The convex hull, from which distances are counted."""
        return BoxHull(self.total_size)

    def _part(self, k: int) -> Part:
        place = k - (self.count - 1) / 2
        x, y, z = self.material.magnetisation
        angle = place * self.step
        turned = (x * cos(angle) + z * sin(angle), y, z * cos(angle) - x * sin(angle))
        material = replace(self.material, magnetisation=turned)
        return Part(f"block_{k + 1}", Box(self.size), material, (place * (self.width + self.gap), 0.0, 0.0))
