"""Rectangular spiral coils, flat or rolled on a cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from magfem.geometry.foil_coil import FoilCoil, Winding
from magfem.geometry.limits import InvalidValue
from magfem.geometry.polyline_track import CrampedTrack, polyline_track, spiral_points, with_room_for_a_via
from magfem.units import format_quantity


@dataclass(frozen=True, kw_only=True)
class RectangularCoil(FoilCoil):
    """A rectangular spiral: longitudinal strands along y, transverse ones along x, corners mitred.

    The track begins at the corner of least x and y and ends on a longitudinal strand, where the next turn would begin
    (before that when there are so few turns that vias and return strip have no room).

    length, width: of the outer edge, along y and x. Strands of the same direction have gaps of their own.
    """

    kind = "rectangular_coil"
    dimensions: ClassVar[tuple[str, ...]] = (
        "length",
        "width",
        "strand_width",
        "longitudinal_gap",
        "transverse_gap",
        "thickness",
    )

    length: float  # m, along y; z when rolled
    width: float  # m, along x; around when rolled
    turns: int
    strand_width: float  # m
    longitudinal_gap: float  # m, between strands along y
    transverse_gap: float  # m, between strands along x

    def check_shape(self) -> None:
        for across, gap, strands in (
            ("width", "longitudinal_gap", "longitudinal"),
            ("length", "transverse_gap", "transverse"),
        ):
            taken, space = self._taken(getattr(self, gap)), getattr(self, across)
            if taken > space * (1 + 1e-9):
                shown_taken, shown_space = (format_quantity(value, "length") for value in (taken, space))
                raise InvalidValue(
                    f"{self.words}: the winding does not fit its window: {strands} strands of {self.turns:g} turns "
                    f"take {shown_taken} of {across}, which is {shown_space}; at most {self._most()} turns fit",
                    "dimensions.turns",
                )
        object.__setattr__(self, "turns", int(self.turns))
        try:
            _ = self.winding
        except CrampedTrack:
            raise InvalidValue(
                f"{self.words}: the innermost strands of {self.turns} turns are too short for corners of their width",
                "dimensions.turns",
            ) from None

    def _taken(self, gap: float) -> float:
        """By the strands on both sides and a gap between the innermost, m."""
        return 2 * self.turns * (self.strand_width + gap) - gap

    def _most(self) -> int:
        spaces = ((self.width, self.longitudinal_gap), (self.length, self.transverse_gap))
        return max(0, min(int((space + gap) / (2 * (self.strand_width + gap)) + 1e-9) for space, gap in spaces))

    @property
    def track_width(self) -> float:
        return self.strand_width

    @property
    def smallest_gap(self) -> float:
        """Between neighbouring strands, m."""
        return min(self.longitudinal_gap, self.transverse_gap)

    @cached_property
    def winding(self) -> Winding:
        x, y = 0.5 * self.width, 0.5 * self.length
        outline = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
        pitches = self.strand_width + np.array([self.transverse_gap, self.longitudinal_gap] * 2)
        points = spiral_points(outline, pitches, self.strand_width, int(self.turns))
        points = with_room_for_a_via(points, float(pitches[0]), self.strand_width, int(self.turns))
        pieces, length = polyline_track(points, self.strand_width)
        return Winding(pieces, length, (self.width, self.length))
