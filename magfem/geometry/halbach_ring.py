"""Halbach rings: segments of a ring whose magnetisation turns from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import asin, cos, log, pi, sin
from typing import Any, ClassVar, Self

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.geometry.card import Table
from magfem.geometry.device import header_from_card, length_text, lengths_from_card, two_digits
from magfem.geometry.limits import InvalidValue, check_thickness
from magfem.geometry.magnetic_solids import MagneticSolids
from magfem.geometry.material import DIAMETRIC, PermanentMagnet
from magfem.geometry.part import Part
from magfem.geometry.repetition import check_count, check_gap, gap_from_card
from magfem.geometry.ring_lengths import check_ring
from magfem.geometry.sector import Sector
from magfem.units import describe, format_quantity, quoted

FIELDS = {"dipole": 1, "quadrupole": 2, "sextupole": 3, "octupole": 4}
"""Pole pairs of the field in the bore, by name."""


@dataclass(frozen=True, kw_only=True)
class HalbachRing(MagneticSolids):
    """Equal cylinder segments about z, centre at the origin; the first segment is centred on +x.

    In the segment at azimuth φ the magnetisation has the azimuth (pole_pairs + 1)·φ: the field gathers in the bore,
    for one pole pair along +x. With many segments, and long, that field is remanence·ln(outer/inner radius) for one
    pole pair (Halbach, Nucl. Instrum. Methods 169, 1 (1980)). The hull is the enclosing cylinder, slits filled.
    Raises InputError when the ring is impossible.
    """

    kind = "halbach_ring"
    dimensions: ClassVar[tuple[str, ...]] = ("outer_diameter", "inner_diameter", "length", "gap")

    outer_diameter: float  # m
    inner_diameter: float  # m
    length: float  # m, along z
    segments: int
    pole_pairs: int = 1
    gap: float = 0.0  # m, width of the slits between segments at the inner wall, where they are narrowest
    material: PermanentMagnet  # its direction is of no account: the ring turns it

    def __post_init__(self) -> None:
        if not isinstance(self.material, PermanentMagnet):
            raise InputError(f"{self.words}: material must be a PermanentMagnet, got {describe(self.material)}")
        object.__setattr__(self, "material", replace(self.material, magnetisation=DIAMETRIC))
        self.check_header()
        check_count(self.words, "dimensions.segments", self.segments, 2)
        check_count(self.words, "dimensions.pole_pairs", self.pole_pairs, 1, 20)
        check_gap(self.words, self.gap)
        largest = check_ring(self.words, self.outer_diameter, self.inner_diameter, self.length)
        if self.inner_diameter == 0:
            raise InvalidValue(f"{self.words}: inner_diameter must be positive, got 0 m", "dimensions.inner_diameter")
        if self.gap > 0:
            check_thickness(self.words, "dimensions.gap", "gap", self.gap, largest)
        room = self.inner_diameter * sin(pi / self.segments)  # chord that one segment and one slit share
        if self.gap > 0.9 * room:
            raise InvalidValue(
                f"{self.words}: gap must leave room for the segments: at most {format_quantity(0.9 * room, 'length')}, "
                f"got {format_quantity(self.gap, 'length')}",
                "dimensions.gap",
            )
        check_thickness(self.words, "dimensions.segments", "the width of a segment", self._sector(0).thickness, largest)
        self.check_region(largest)

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the ring that a whole card describes. Raises CardError."""
        keys = ("outer_diameter", "inner_diameter", "length")
        values = header_from_card(card, "dimensions", "material")
        values |= lengths_from_card(card, keys, ("segments", "pole_pairs", "field", "gap"))
        table = card.table("dimensions")
        values |= {"segments": table.number("segments"), **gap_from_card(table)}
        if "field" in table:
            if "pole_pairs" in table:
                raise table.error("state field or pole_pairs, not both", "field")
            name = table.text("field")
            if name not in FIELDS:
                raise table.error(f"field must be one of {', '.join(map(quoted, FIELDS))}, got {quoted(name)}", "field")
            values["pole_pairs"] = FIELDS[name]
        elif "pole_pairs" in table:
            values["pole_pairs"] = table.number("pole_pairs")
        with card.locating():
            return cls(**values, material=PermanentMagnet.from_card(card.table("material"), DIAMETRIC))

    def tables(self) -> dict[str, Any]:
        keys = ("outer_diameter", "inner_diameter", "length", *(("gap",) if self.gap > 0 else ()))
        counts = {"segments": int(self.segments), "pole_pairs": int(self.pole_pairs)}
        lengths = {key: length_text(getattr(self, key)) for key in keys}
        return {"dimensions": lengths | counts, "material": self.material.table(directed=False)}

    @property
    def parts(self) -> tuple[Part, ...]:
        """`segment_1` is centred on +x, the others follow right-handed about +z."""
        return tuple(self._part(k) for k in range(int(self.segments)))

    @property
    def hull(self) -> CylinderHull:
        """The enclosing cylinder, from which distances are counted."""
        return CylinderHull(self.outer_diameter, self.length)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): as for all assemblies, but only as far out as the ring is wide.

        The stray field falls off fast, and what several bodies leave of it is small against each one's field.
        """
        nearest, _ = super().default_region
        return nearest, two_digits(max(self.outer_diameter, self.length, 1.5 * nearest))

    @property
    def ideal_field(self) -> float:
        """B (T) in the bore of an endless dipole ring of this many touching segments, at recoil permeability 1.

        B_r ln(R_o/R_i) sin(2π/n)/(2π/n), n segments (Halbach 1980).
        """
        turn = 2 * pi / self.segments
        return self.material.working_remanence * log(self.outer_diameter / self.inner_diameter) * sin(turn) / turn

    def _part(self, k: int) -> Part:
        angle = 2 * pi * k / self.segments * (self.pole_pairs + 1)
        material = replace(self.material, magnetisation=(cos(angle), sin(angle), 0.0))
        return Part(f"segment_{k + 1}", self._sector(k), material)

    def _sector(self, k: int) -> Sector:
        middle = 2 * pi * k / self.segments
        half = pi / self.segments - asin(self.gap / self.inner_diameter)
        return Sector(self.outer_diameter, self.inner_diameter, self.length, middle - half, middle + half)
