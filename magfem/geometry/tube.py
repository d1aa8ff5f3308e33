"""The solid that rings, cylinders and discs are: a rectangle turned about the z axis."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from magfem.fields.hull import CylinderHull
from magfem.geometry.shape import arc, sagitta
from magfem.typing import ArrayLike, Booleans, Jet, Points


@dataclass(frozen=True)
class Tube:
    """A tube about z, its centre at the origin; a full cylinder when `inner_diameter` is zero."""

    outer_diameter: float  # m
    inner_diameter: float  # m
    length: float  # m

    @property
    def volume(self) -> float:
        """m³."""
        outer, inner = self.outer_diameter, self.inner_diameter
        return pi / 4 * (outer - inner) * (outer + inner) * self.length

    @property
    def area(self) -> float:
        """Whole surface, walls and both faces, m²."""
        outer, inner = self.outer_diameter, self.inner_diameter
        return pi * (outer + inner) * self.length + pi / 2 * (outer - inner) * (outer + inner)

    @property
    def wall(self) -> float:
        """Thickness of the wall, m; for a full cylinder the diameter."""
        return (self.outer_diameter - self.inner_diameter) / (2 if self.inner_diameter > 0 else 1)

    @property
    def thickness(self) -> float:
        """The smaller of wall and length, m."""
        return min(self.wall, self.length)

    @property
    def hull(self) -> CylinderHull:
        """The convex hull: bore filled."""
        return CylinderHull(self.outer_diameter, self.length)

    @property
    def corners(self) -> Points:
        """Points (n, 3) of both outer rims."""
        return np.concatenate([arc(self.outer_diameter / 2, side * self.length / 2) for side in (-1, 1)])

    @property
    def bulge(self) -> float:
        """How far the wall reaches beyond the polyhedron of `corners`, m."""
        return sagitta(self.outer_diameter / 2)

    @property
    def revolved(self) -> bool:
        return True

    def contains(self, points: Points) -> Booleans:
        """True (...) inside."""
        rho = np.hypot(points[..., 0], points[..., 1])
        inside: Booleans = (
            (np.abs(points[..., 2]) < self.length / 2)
            & (rho < self.outer_diameter / 2)
            & ((rho > self.inner_diameter / 2) | (self.inner_diameter == 0))
        )
        return inside

    def build(self, occ: Any) -> list[int]:
        """Make the solid in `gmsh.model.occ`; its volume tags. Synchronising is left to the caller."""
        solid = self._cylinder(occ, self.outer_diameter)
        if self.inner_diameter == 0:
            return [solid]
        remaining, _ = occ.cut([(3, solid)], [(3, self._cylinder(occ, self.inner_diameter))])
        return [tag for _, tag in remaining]

    def build_meridian(self, occ: Any) -> list[int]:
        """Make the half section, x = rho and y = z, in `gmsh.model.occ` and return its surface tags."""
        width = (self.outer_diameter - self.inner_diameter) / 2
        return [occ.addRectangle(self.inner_diameter / 2, -self.length / 2, 0.0, width, self.length)]

    def jet(self, points: Points, magnetisation: ArrayLike, order: int) -> Jet:
        """The closed form of `magfem.fields.uniform_cylinder`."""
        from magfem.fields.uniform_cylinder import cylinder_jet, ring_jet

        outer, inner = self.outer_diameter / 2, self.inner_diameter / 2
        if inner > 0:
            return ring_jet(points, inner, outer, self.length, magnetisation, order)
        return cylinder_jet(points, outer, self.length, magnetisation, order)

    def _cylinder(self, occ: Any, diameter: float) -> int:
        tag: int = occ.addCylinder(0.0, 0.0, -self.length / 2, 0.0, 0.0, self.length, diameter / 2)
        return tag
