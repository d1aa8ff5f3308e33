"""Cylinder segment magnets: parts of rings and of cylinders, as motors and Halbach rings have them."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

from magfem.fields.hull import Hull
from magfem.geometry.card import Table
from magfem.geometry.device import length_text
from magfem.geometry.limits import InvalidValue, check_number, check_thickness
from magfem.geometry.ring_lengths import check_ring, ring_from_card
from magfem.geometry.sector import Sector
from magfem.geometry.single_magnet import SingleMagnet
from magfem.units import format_quantity

SMALLEST_ANGLE = pi / 180  # rad, of a segment, and of what it lacks to a full turn: no mesh resolves a thinner slit
_ROUNDING = 1e-9  # rad


@dataclass(frozen=True, kw_only=True)
class CylinderSegmentMagnet(SingleMagnet):
    """A part of a ring, or of a full cylinder, between two azimuths.

    The origin is the middle of the ring's axis, not of the segment. Raises InputError when it is impossible.
    """

    kind = "cylinder_segment_magnet"
    dimensions: ClassVar[tuple[str, ...]] = ("outer_diameter", "inner_diameter", "length")

    outer_diameter: float  # m
    inner_diameter: float = 0.0  # m, 0: a wedge
    length: float  # m, along z
    start_angle: float  # rad, azimuth from +x
    end_angle: float  # rad, above start_angle by less than a full turn

    @property
    def shape(self) -> Sector:
        return Sector(self.outer_diameter, self.inner_diameter, self.length, self.start_angle, self.end_angle)

    @property
    def hull(self) -> Hull:
        return self.shape.hull

    def check_lengths(self) -> float:
        largest = check_ring(self.words, self.outer_diameter, self.inner_diameter, self.length)
        for key in ("start_angle", "end_angle"):
            check_number(self.words, f"dimensions.{key}", getattr(self, key))
        key, angle = "dimensions.end_angle", self.end_angle - self.start_angle
        if angle > 2 * pi - SMALLEST_ANGLE + _ROUNDING:
            raise InvalidValue(
                f"{self.words}: end_angle must exceed start_angle by at most 359°, less than a full turn, which is a "
                f"ring or cylinder magnet, got {format_quantity(angle, 'angle')} between them",
                key,
            )
        if angle < SMALLEST_ANGLE - _ROUNDING:
            raise InvalidValue(
                f"{self.words}: end_angle must exceed start_angle by at least 1°, got "
                f"{format_quantity(angle, 'angle')} between them",
                key,
            )
        if abs(self.start_angle) > 2 * pi:
            raise InvalidValue(
                f"{self.words}: start_angle must lie within ±360°, got {format_quantity(self.start_angle, 'angle')}",
                "dimensions.start_angle",
            )
        check_thickness(self.words, key, "the width of the segment", self.shape.thickness, largest)
        return largest

    @classmethod
    def dimensions_from_card(cls, card: Table) -> dict[str, Any]:
        table = card.table("dimensions")
        table.only("outer_diameter", "inner_diameter", "length", "start_angle", "end_angle", "angle")
        values = ring_from_card(table)
        if "angle" not in table:
            return values | {key: table.quantity(key, "angle") for key in ("start_angle", "end_angle")}
        for key in ("start_angle", "end_angle"):
            if key in table:
                raise table.error("state angle, which is centred on +x, or start_angle and end_angle, not both", key)
        angle = table.quantity("angle", "angle")
        if not SMALLEST_ANGLE - _ROUNDING <= angle <= 2 * pi - SMALLEST_ANGLE + _ROUNDING:
            raise table.error(
                "angle must lie between 1° and 359°; a full turn is a ring or cylinder magnet, "
                f"got {format_quantity(angle, 'angle')}",
                "angle",
            )
        return values | {"start_angle": -angle / 2, "end_angle": angle / 2}

    def dimensions_table(self) -> dict[str, Any]:
        lengths = {key: length_text(getattr(self, key)) for key in self.dimensions}
        return lengths | {key: f"{getattr(self, key)!r} rad" for key in ("start_angle", "end_angle")}
