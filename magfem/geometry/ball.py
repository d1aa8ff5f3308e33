"""The solid that sphere magnets are: a ball."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import numpy as np

from magfem.fields.hull import SphereHull
from magfem.geometry.shape import ROUND, arc
from magfem.typing import ArrayLike, Booleans, Jet, Points


@dataclass(frozen=True)
class Ball:
    """A ball about the origin."""

    diameter: float  # m

    @property
    def volume(self) -> float:
        """m³."""
        return pi / 6 * self.diameter**3

    @property
    def area(self) -> float:
        """m²."""
        return pi * self.diameter**2

    @property
    def thickness(self) -> float:
        """The diameter, m."""
        return self.diameter

    @property
    def hull(self) -> SphereHull:
        """Itself."""
        return SphereHull(self.diameter)

    @property
    def corners(self) -> Points:
        """Points (n, 3) on parallels of latitude, poles included."""
        radius = self.diameter / 2
        latitudes = pi * (np.arange(ROUND // 2 + 1) / (ROUND // 2) - 0.5)
        return np.concatenate([arc(radius * cos(angle), radius * sin(angle)) for angle in latitudes])

    @property
    def bulge(self) -> float:
        """How far the ball reaches beyond the polyhedron of `corners`, m: cells are 2π/ROUND wide and high."""
        return float(self.diameter / 2 * (1 - cos(pi / ROUND) ** 2))

    @property
    def revolved(self) -> bool:
        return True

    def contains(self, points: Points) -> Booleans:
        """True (...) inside."""
        inside: Booleans = np.sum(points**2, axis=-1) < self.diameter**2 / 4
        return inside

    def build(self, occ: Any) -> list[int]:
        """Make the solid in `gmsh.model.occ`; its volume tag."""
        return [occ.addSphere(0.0, 0.0, 0.0, self.diameter / 2)]

    def build_meridian(self, occ: Any) -> list[int]:
        """Make the half disc, x = rho and y = z, in `gmsh.model.occ`; its surface tag."""
        radius = self.diameter / 2
        centre = occ.addPoint(0.0, 0.0, 0.0)
        south, east, north = (occ.addPoint(radius * x, radius * y, 0.0) for x, y in ((0, -1), (1, 0), (0, 1)))
        boundary = [
            occ.addCircleArc(south, centre, east),
            occ.addCircleArc(east, centre, north),
            occ.addLine(north, south),
        ]
        return [occ.addPlaneSurface([occ.addCurveLoop(boundary)])]

    def jet(self, points: Points, magnetisation: ArrayLike, order: int) -> Jet:
        """The closed form of `magfem.fields.uniform_sphere`."""
        from magfem.fields.uniform_sphere import sphere_jet

        return sphere_jet(points, self.diameter / 2, magnetisation, order)
