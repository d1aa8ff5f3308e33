"""The solid that cylinder segments are: a part of a tube between two half planes through its axis."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin
from typing import Any

import numpy as np

from magfem.fields.hull import PolytopeHull
from magfem.geometry.shape import arc, sagitta
from magfem.geometry.tube import Tube
from magfem.typing import ArrayLike, Booleans, Jet, Points


@dataclass(frozen=True)
class Sector:
    """A part of a tube about z, from azimuth `start` to `end`; the origin is the middle of the tube's axis."""

    outer_diameter: float  # m
    inner_diameter: float  # m, 0: a wedge
    length: float  # m
    start: float  # rad
    end: float  # rad, above start by less than a full turn

    @property
    def angle(self) -> float:
        """From start to end, rad."""
        return self.end - self.start

    @property
    def volume(self) -> float:
        """m³."""
        outer, inner = self.outer_diameter, self.inner_diameter
        return self.angle / 8 * (outer - inner) * (outer + inner) * self.length

    @property
    def area(self) -> float:
        """Walls, sides and faces, m²."""
        outer, inner = self.outer_diameter, self.inner_diameter
        walls = self.angle / 2 * (outer + inner) * self.length
        return walls + (outer - inner) * self.length + self.angle / 4 * (outer - inner) * (outer + inner)

    @property
    def thickness(self) -> float:
        """The smallest of wall, length, and width half way between the walls, m."""
        width = (self.outer_diameter + self.inner_diameter) / 2 * sin(min(self.angle, pi) / 2)
        return min((self.outer_diameter - self.inner_diameter) / 2, self.length, width)

    @property
    def hull(self) -> PolytopeHull:
        """The convex hull of `corners`, which lies up to `bulge` inside the true one."""
        return PolytopeHull(tuple(map(tuple, self.corners.tolist())))

    @property
    def corners(self) -> Points:
        """Points (n, 3) of the outer rims, and the ends of the inner ones (or of the axis)."""
        inner = [
            [self.inner_diameter / 2 * np.cos(angle), self.inner_diameter / 2 * np.sin(angle), side * self.length / 2]
            for side in (-1, 1)
            for angle in ((self.start, self.end) if self.inner_diameter > 0 else (0.0,))
        ]
        outer = [arc(self.outer_diameter / 2, side * self.length / 2, self.start, self.end) for side in (-1, 1)]
        return np.concatenate([*outer, np.array(inner)])

    @property
    def bulge(self) -> float:
        """How far the outer wall reaches beyond the polyhedron of `corners`, m."""
        return sagitta(self.outer_diameter / 2)

    @property
    def revolved(self) -> bool:
        return False

    def contains(self, points: Points) -> Booleans:
        """True (...) inside."""
        azimuth = np.mod(np.arctan2(points[..., 1], points[..., 0]) - self.start, 2 * pi)
        rho = np.hypot(points[..., 0], points[..., 1])
        slack = 1e-9 * self.outer_diameter / np.maximum(rho, 1e-3 * self.outer_diameter)  # sides touch neighbours
        inside: Booleans = (
            (np.abs(points[..., 2]) < self.length / 2)
            & (rho < self.outer_diameter / 2)
            & (rho > self.inner_diameter / 2)
            & (azimuth > slack)
            & (azimuth < self.angle - slack)
        )
        return inside

    def build(self, occ: Any) -> list[int]:
        """Make the solid in `gmsh.model.occ`; its volume tags."""
        solid = occ.addCylinder(
            0.0, 0.0, -self.length / 2, 0.0, 0.0, self.length, self.outer_diameter / 2, angle=self.angle
        )
        occ.rotate([(3, solid)], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, self.start)
        if self.inner_diameter == 0:
            return [solid]
        bore = Tube(self.inner_diameter, 0.0, self.length).build(occ)
        remaining, _ = occ.cut([(3, solid)], [(3, tag) for tag in bore])
        return [tag for _, tag in remaining]

    def build_meridian(self, occ: Any) -> list[int]:
        raise NotImplementedError("a part of a tube is no body of revolution")

    def jet(self, points: Points, magnetisation: ArrayLike, order: int) -> Jet:
        """The closed form of `magfem.fields.uniform_cylinder_segment`."""
        from magfem.fields.uniform_cylinder_segment import cylinder_segment_jet

        inner, outer = self.inner_diameter / 2, self.outer_diameter / 2
        return cylinder_segment_jet(points, inner, outer, self.length, self.start, self.end, magnetisation, order)
