"""Meanders: strands side by side, the current going up one and down the next."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from magfem.geometry.foil_coil import FoilCoil, Winding
from magfem.geometry.limits import ROUNDING, InvalidValue
from magfem.geometry.polyline_track import SHORTEST_STRAND, polyline_track
from magfem.units import format_quantity


@dataclass(frozen=True, kw_only=True)
class MeanderCoil(FoilCoil):
    """A serpentine track: strands along y, corners mitred.

    Positive current goes up (+y) in the strand of largest x and on towards −x: right-handed about +z in the first
    loop, left-handed in the second, and so on.
    """

    kind = "meander_coil"
    dimensions: ClassVar[tuple[str, ...]] = ("length", "strand_width", "gap", "thickness")
    counts: ClassVar[tuple[str, ...]] = ("strands",)

    length: float  # m, along y, outer edges
    strands: int
    strand_width: float  # m
    gap: float  # m

    def check_shape(self) -> None:
        if self.strands < 2:
            raise InvalidValue(f"{self.words}: strands must be at least 2, got {self.strands:g}", "dimensions.strands")
        object.__setattr__(self, "strands", int(self.strands))
        narrowest = SHORTEST_STRAND * self.strand_width
        if self.gap < narrowest * (1 - ROUNDING):
            raise InvalidValue(
                f"{self.words}: gap must be at least {format_quantity(narrowest, 'length')} for the mitred corners "
                f"between strands of this width, got {format_quantity(self.gap, 'length')}",
                "dimensions.gap",
            )
        shortest = (2 + SHORTEST_STRAND) * self.strand_width
        if self.length < shortest:
            raise InvalidValue(
                f"{self.words}: length must be at least {format_quantity(shortest, 'length')} for strands of this "
                f"width, got {format_quantity(self.length, 'length')}",
                "dimensions.length",
            )

    @property
    def track_width(self) -> float:
        return self.strand_width

    @property
    def smallest_gap(self) -> float:
        """Between neighbouring strands, m."""
        return self.gap

    @property
    def width(self) -> float:
        """Of all strands, along x, m."""
        return int(self.strands) * (self.strand_width + self.gap) - self.gap

    @cached_property
    def winding(self) -> Winding:
        first, step = 0.5 * (self.width - self.strand_width), self.strand_width + self.gap
        x = first - step * np.repeat(np.arange(int(self.strands)), 2)
        turning = 0.5 * (self.length - self.strand_width)
        y = turning * np.array([-1, 1, 1, -1])[np.arange(len(x)) % 4]
        y[[0, -1]] = 0.5 * self.length * np.sign(y[[0, -1]])
        pieces, length = polyline_track(np.stack([x, y], axis=1), self.strand_width)
        return Winding(pieces, length, (self.width, self.length))
