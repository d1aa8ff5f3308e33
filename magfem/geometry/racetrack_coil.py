"""Racetrack coils: windings along a rectangle with round corners, such as two straights and two half circles."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import ClassVar

from magfem.fields.hull import PolytopeHull
from magfem.geometry.circuit import Stations, SweptWinding
from magfem.geometry.device import two_digits
from magfem.geometry.limits import ROUNDING, InvalidValue, check_thickness
from magfem.geometry.ribbons import FlatSurface, WalledWinding, wall_count
from magfem.geometry.rounded_rectangle import (
    ELEMENTS_PER_CORNER,
    ELEMENTS_PER_STRAIGHT,
    RoundedRectangle,
    element_count,
)
from magfem.geometry.winding_window import WindingWindow
from magfem.geometry.wound_coil import WoundCoil
from magfem.units import format_quantity

HULL_STEPS = 6  # flats around a corner of the hull


@dataclass(frozen=True, kw_only=True)
class RacetrackCoil(WoundCoil):
    """A winding about z around an opening `inner_length` (x) by `inner_width` (y), its centre at the origin.

    Positive current turns right-handed about +z. Layers lie outside one another. Raises InputError when the coil is
    impossible.
    """

    kind = "racetrack_coil"
    dimensions: ClassVar[tuple[str, ...]] = ("inner_length", "inner_width", "build", "height")
    optional: ClassVar[tuple[str, ...]] = ("bend_radius",)

    inner_length: float  # m, of the opening along x
    inner_width: float  # m, of the opening along y
    build: float  # m, of the winding, outwards
    height: float  # m, of the winding, along z
    bend_radius: float | None = None  # m, of the opening's corners; None: half circles at the ends

    def check_shape(self, largest: float) -> None:
        half = 0.5 * min(self.inner_length, self.inner_width)
        if self.bend_radius is not None and self.bend_radius > half * (1 + ROUNDING):
            raise InvalidValue(
                f"{self.words}: bend_radius must be at most half the narrower side of the opening "
                f"({format_quantity(half, 'length')}), got {format_quantity(self.bend_radius, 'length')}",
                "dimensions.bend_radius",
            )
        if self.bend_radius is not None:
            check_thickness(self.words, "dimensions.bend_radius", "bend_radius", self.bend_radius, largest)

    @property
    def window(self) -> WindingWindow:
        return WindingWindow(self.build, self.height)

    @property
    def path(self) -> RoundedRectangle:
        """The opening's outline."""
        radius = 0.5 * min(self.inner_length, self.inner_width)
        if self.bend_radius is not None:
            radius = min(radius, self.bend_radius)
        return RoundedRectangle(self.inner_length - 2 * radius, self.inner_width - 2 * radius, radius)

    @property
    def parts(self) -> tuple[SweptWinding, ...]:
        """The one winding."""
        return (
            SweptWinding(
                layers=self._layers,
                window=(self.height, self.build),
                turns=self.turns,
                wire_length=self.turns * self.path.length(0.5 * self.build),
                wire_area=self.wire_area,
            ),
        )

    def _layers(self, resolution: float) -> tuple[tuple[Stations, float], ...]:
        walls = wall_count(resolution, self.region.clearance, self.build)
        winding = WalledWinding(self.path, FlatSurface(), self.build, self.height, self.turns)
        straight = element_count(resolution, ELEMENTS_PER_STRAIGHT)
        return winding.layers((straight, straight, element_count(resolution, ELEMENTS_PER_CORNER)), walls)

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution about z."""
        return False

    @property
    def hull(self) -> PolytopeHull:
        """The convex hull, from which distances are counted; flats around the corners stick out by at most 1 %."""
        path = self.path
        half = 0.5 * pi / HULL_STEPS / 2
        radius = (path.radius + self.build) / cos(half)
        corner = [(radius * cos(k * half), radius * sin(k * half)) for k in range(1, 2 * HULL_STEPS, 2)]
        vertices = tuple(
            (right * (0.5 * path.straight_u + x), up * (0.5 * path.straight_v + y), 0.5 * face * self.height)
            for x, y in corner
            for right in (-1, 1)
            for up in (-1, 1)
            for face in (-1, 1)
        )
        return PolytopeHull(vertices)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m), to two digits.

        The extent is 1.5 times the largest dimension, the clearance 1/8 of the width or 1/16 of the height, whichever
        is larger.
        """
        sides = [side + 2 * self.build for side in (self.inner_length, self.inner_width)]
        nearest = max(min(sides) / 8, self.height / 16)
        return two_digits(nearest), two_digits(1.5 * max(*sides, self.height))
