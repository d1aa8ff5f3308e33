"""Ribbons that stand for a winding of many turns: walls at Gauss's points of its thickness."""

from __future__ import annotations

from dataclasses import dataclass
from math import asinh, ceil, log
from typing import Protocol

import numpy as np

from magfem.geometry.circuit import Stations
from magfem.geometry.rounded_rectangle import RoundedRectangle
from magfem.typing import Floats

ACCURACY = 1e-8  # of the field at the clearance, as far as walls decide it, at resolution 1; at half of it 1e-4
FEWEST, MOST = 2, 64  # walls, the latter at resolution 1


class Surface(Protocol):
    """Where the plane (u, v) of a path lies in space."""

    def places(self, points: Floats, height: float) -> Floats:
        """The places (n, 3) m at a `height` (m) above points (n, 2) m of the plane."""
        ...

    def directions(self, points: Floats, vectors: Floats) -> Floats:
        """Unit vectors (n, 2) of the plane at its points (n, 2) m as vectors (n, 3) in space."""
        ...

    @property
    def mirrored(self) -> bool:
        """Whether (u, v, height) is left-handed in space."""
        ...


@dataclass(frozen=True)
class FlatSurface:
    """u along x, v along y, the height along z."""

    mirrored: bool = False

    def places(self, points: Floats, height: float) -> Floats:
        return np.column_stack([points, np.full(len(points), height)])

    def directions(self, points: Floats, vectors: Floats) -> Floats:
        return np.column_stack([vectors, np.zeros(len(vectors))])


@dataclass(frozen=True)
class RolledSurface:
    """u around the z axis from +x on, at a radius (m) where its lengths are true; v along z, the height outwards.

    mirrored: in the plane x = 0. What turns right-handed about +x does so on either side.
    """

    radius: float
    mirrored: bool

    def places(self, points: Floats, height: float) -> Floats:
        angle = points[:, 0] / self.radius
        x = self._side * (self.radius + height) * np.cos(angle)
        return np.column_stack([x, (self.radius + height) * np.sin(angle), points[:, 1]])

    def directions(self, points: Floats, vectors: Floats) -> Floats:
        angle = points[:, 0] / self.radius
        x = -self._side * vectors[:, 0] * np.sin(angle)
        return np.column_stack([x, vectors[:, 0] * np.cos(angle), vectors[:, 1]])

    @property
    def _side(self) -> float:
        return -1.0 if self.mirrored else 1.0


def wall_count(resolution: float, clearance: float, thickness: float) -> int:
    """How many walls stand for a winding `thickness` (m) thick, to be seen from `clearance` (m) and further.

    Gauss's rule with n places on [−1, 1] errs as ρ^(−2n) where ρ is the sum of the half axes of the largest ellipse
    about ±1 within which the integrand is analytic; over the middle of the winding it has poles at ±2i
    clearance/thickness. Source: Trefethen, Approximation Theory and Approximation Practice, theorem 19.3.
    """
    needed = -log(ACCURACY) / (2 * asinh(2 * clearance / thickness))
    return max(FEWEST, ceil(min(needed, MOST) * resolution * (1 - 1e-9)))


@dataclass(frozen=True)
class WalledWinding:
    """A winding as walls: parallels of a path, upright on its surface, one outside the other."""

    path: RoundedRectangle  # the innermost
    surface: Surface
    thickness: float  # m, outwards from the path
    height: float  # m, half of it below the surface
    turns: float

    def layers(self, counts: tuple[int, int, int], walls: int) -> tuple[tuple[Stations, float], ...]:
        """The walls, each with its share of the turns: Gauss's weights.

        counts: elements of a side along u, along v, and of a corner. Normals point outwards.
        """
        skeleton, outward = self.path.stations(*counts)
        levels, weights = np.polynomial.legendre.leggauss(walls)
        found = []
        for level, weight in zip(levels, weights, strict=True):
            middle = skeleton + (self.path.radius + 0.5 * self.thickness * (1 + level)) * outward
            edges = [self.surface.places(middle, side * 0.5 * self.height) for side in (1, -1)]
            left, right = edges[::-1] if self.surface.mirrored else edges
            normal = self.surface.directions(middle, outward)
            lead = np.zeros(len(middle) // 2, dtype=np.bool_)
            found.append((Stations(left, right, normal, lead), 0.5 * float(weight) * self.turns))
        return tuple(found)
