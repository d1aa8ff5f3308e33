"""What carries a coil's current: tracks of foil, and windings of wire, in series.

Every part is closed, or its ends meet those of its neighbours: an open path has no magnetic field of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from typing import TypeAlias

from magfem.typing import Booleans, Floats


@dataclass(frozen=True)
class Stations:
    """A ribbon, by pairs of edge points along it; element n of the ribbon spans stations 2n, 2n + 1, 2n + 2.

    left, right: (2n+1, 3) m, seen along the current with the normal upwards; halfway between them runs the
    centreline. The first and the last pair are the same place: ribbons are closed.
    normal: (2n+1, 3), across the ribbon's thickness; at a fold it leans and is longer, so that layers at either side
    stay parallel.
    lead: (n,), which elements belong to leads, not to the coil itself.
    """

    left: Floats
    right: Floats
    normal: Floats
    lead: Booleans


@dataclass(frozen=True)
class FoilTrack:
    """A track etched from foil: a closed ribbon of solid metal, in which the current finds its own way.

    stations: of a resolution, the ribbon; elements get half as long when the resolution doubles.
    length, area: of the ribbon without leads, closed forms along and across the centreline, m and m².
    """

    stations: Callable[[float], Stations]
    width: float  # m, the narrowest
    thickness: float  # m
    length: float
    area: float
    lead_length: float  # m, return strip and vias
    curvature: float = 0.0  # 1/m, of the cylinder that the foil is rolled on

    @property
    def volume(self) -> float:
        """Of the metal without leads, m³."""
        return self.area * self.thickness


@dataclass(frozen=True)
class CoaxialWinding:
    """Turns of wire about the z axis that fill a rectangular window evenly; a loop when the window is a point.

    Positive turns go right-handed about +z, negative ones left-handed.
    """

    inner_radius: float  # m
    outer_radius: float  # m
    length: float  # m, along z
    centre: float  # m, on the z axis
    turns: float
    wire_area: float  # m², of the metal in one turn's section

    @property
    def wire_length(self) -> float:
        """m"""
        return abs(self.turns) * pi * (self.inner_radius + self.outer_radius)

    @property
    def volume(self) -> float:
        """Of the metal, m³."""
        return self.wire_length * self.wire_area


@dataclass(frozen=True)
class SweptWinding:
    """Turns of wire that fill a rectangular window, carried along a closed path.

    layers: of a resolution, ribbons that stand for the winding, each with its share of the turns; their width is the
    window's. The current is spread evenly over the width: the turns force it to be.
    """

    layers: Callable[[float], tuple[tuple[Stations, float], ...]]
    window: tuple[float, float]  # m, width of the layers, and build
    turns: float
    wire_length: float  # m, mean turn times turns
    wire_area: float  # m², of the metal in one turn's section

    @property
    def volume(self) -> float:
        """Of the metal, m³."""
        return self.wire_length * self.wire_area


CircuitPart: TypeAlias = FoilTrack | CoaxialWinding | SweptWinding


@dataclass(frozen=True)
class Circuit:
    """Parts in series, driven by one current."""

    name: str  # unique within its device
    parts: tuple[CircuitPart, ...]

    @property
    def volume(self) -> float:
        """Of the metal, m³."""
        return sum(part.volume for part in self.parts)
