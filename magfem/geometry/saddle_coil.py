"""Saddle coils: windings bent onto a cylinder, alone or in pairs that face each other."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

from magfem.fields.hull import CylinderHull
from magfem.geometry.circuit import Stations, SweptWinding
from magfem.geometry.device import two_digits
from magfem.geometry.limits import ROUNDING, InvalidValue, check_thickness
from magfem.geometry.ribbons import RolledSurface, WalledWinding, wall_count
from magfem.geometry.rounded_rectangle import (
    ELEMENTS_PER_CORNER,
    ELEMENTS_PER_STRAIGHT,
    RoundedRectangle,
    element_count,
)
from magfem.geometry.winding_window import WindingWindow
from magfem.geometry.wound_coil import WoundCoil
from magfem.units import format_quantity

LARGEST_STEP = pi / 18  # of an element around the cylinder at resolution 1


@dataclass(frozen=True, kw_only=True)
class SaddleCoil(WoundCoil):
    """A winding on a cylinder about z, its middle on the +x side: a flat racetrack bent about z.

    Positive current turns right-handed about +x, so that its field on the z axis points along +x, as that of a
    diametric magnet. `arc_angle` and `length` are those of the outermost turn, `breadth` is the winding's width on
    the mean cylinder, `bend_radius` that of the innermost turn's corners there. A pair has the mirror image on the
    −x side in series, its field along +x as well. Raises InputError when the coil is impossible.
    """

    kind = "saddle_coil"
    dimensions: ClassVar[tuple[str, ...]] = ("inner_diameter", "outer_diameter", "length", "breadth", "bend_radius")
    angles: ClassVar[tuple[str, ...]] = ("arc_angle",)
    switches: ClassVar[tuple[str, ...]] = ("pair",)

    inner_diameter: float  # m, of the cylinder that the winding lies on
    outer_diameter: float  # m
    length: float  # m, along z
    breadth: float  # m
    bend_radius: float  # m
    arc_angle: float  # rad, about z
    pair: bool = False  # `turns` are those of each

    def check_shape(self, largest: float) -> None:
        if self.inner_diameter >= self.outer_diameter:
            raise InvalidValue(
                f"{self.words}: inner_diameter must be smaller than outer_diameter "
                f"({format_quantity(self.outer_diameter, 'length')}), "
                f"got {format_quantity(self.inner_diameter, 'length')}",
                "dimensions.inner_diameter",
            )
        check_thickness(self.words, "dimensions.inner_diameter", "the winding", self.window.build, largest)
        widest = pi if self.pair else 2 * pi
        if not 0 < self.arc_angle < widest:
            raise InvalidValue(
                f"{self.words}: arc_angle must lie between 0 and {format_quantity(widest, 'angle')}"
                f"{', where the coils of a pair meet' if self.pair else ''}, "
                f"got {format_quantity(self.arc_angle, 'angle')}",
                "dimensions.arc_angle",
            )
        needed = 2 * (self.breadth + self.bend_radius)
        for key, size in (("length", self.length), ("arc_angle", self.arc_angle * self.mean_radius)):
            if needed > size * (1 + ROUNDING):
                raise InvalidValue(
                    f"{self.words}: twice breadth and bend_radius ({format_quantity(needed, 'length')}) must fit into "
                    f"{key}, {format_quantity(size, 'length')} on the mean cylinder",
                    f"dimensions.{key}",
                )

    @property
    def mean_radius(self) -> float:
        """Of the cylinder in the middle of the winding, m."""
        return 0.25 * (self.inner_diameter + self.outer_diameter)

    @property
    def window(self) -> WindingWindow:
        return WindingWindow(0.5 * (self.outer_diameter - self.inner_diameter), self.breadth)

    @property
    def path(self) -> RoundedRectangle:
        """The innermost turn on the mean cylinder, unrolled: u around it, v along z."""
        margin = 2 * (self.breadth + self.bend_radius)
        around = max(0.0, self.arc_angle * self.mean_radius - margin)
        return RoundedRectangle(around, max(0.0, self.length - margin), self.bend_radius)

    @property
    def parts(self) -> tuple[SweptWinding, ...]:
        """The winding at +x, and that at −x of a pair."""
        return tuple(
            SweptWinding(
                layers=layers,
                window=(self.window.build, self.breadth),
                turns=self.turns,
                wire_length=self.turns * self.path.length(0.5 * self.breadth),
                wire_area=self.wire_area,
            )
            for layers in (self._layers, self._mirrored_layers)[: 2 if self.pair else 1]
        )

    def _layers(self, resolution: float, mirrored: bool = False) -> tuple[tuple[Stations, float], ...]:
        path = self.path
        surface = RolledSurface(self.mean_radius, mirrored)
        walls = wall_count(resolution, self.region.clearance, self.breadth)
        winding = WalledWinding(path, surface, self.breadth, self.window.build, self.turns)
        around = max(ELEMENTS_PER_STRAIGHT, path.straight_u / self.mean_radius / LARGEST_STEP)
        counts = (around, ELEMENTS_PER_STRAIGHT, ELEMENTS_PER_CORNER)
        u, v, corner = (element_count(resolution, count) for count in counts)
        return winding.layers((u, v, corner), walls)

    def _mirrored_layers(self, resolution: float) -> tuple[tuple[Stations, float], ...]:
        return self._layers(resolution, mirrored=True)

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution about z."""
        return False

    @property
    def hull(self) -> CylinderHull:
        """The whole cylinder that holds the winding, from which distances are counted."""
        return CylinderHull(self.outer_diameter, self.length)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance 1/8 of the outer diameter or 1/16 of the length; extent 1.5 times the larger of them (m)."""
        nearest = max(self.outer_diameter / 8, self.length / 16)
        return two_digits(nearest), two_digits(1.5 * max(self.outer_diameter, self.length))
