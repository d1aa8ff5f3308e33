"""What all permanent magnets share, single ones and assemblies: solids in their places, each of one material."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.geometry.body import Body
from magfem.geometry.device import Device, two_digits
from magfem.geometry.part import Part
from magfem.typing import Floats, Points


@dataclass(frozen=True, kw_only=True)
class MagneticSolids(Device):
    """Permanent magnets. A kind gives its `parts` and its `hull`."""

    @property
    @abstractmethod
    def parts(self) -> tuple[Part, ...]:
        """The solids in their places, each under a name of its own. They may touch, not overlap."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """What mesh and solver need to know of each part."""
        return tuple(part.body for part in self.parts)

    @property
    def volume(self) -> float:
        """Of all parts, closed form, m³."""
        return sum(part.shape.volume for part in self.parts)

    @property
    def area(self) -> float:
        """Whole surfaces of all parts, those that touch included, closed form, m²."""
        return sum(part.shape.area for part in self.parts)

    @property
    def moment(self) -> Floats:
        """Magnetic moment if magnetised rigidly, remanence·volume/µ₀ summed over the parts, (3,) A·m².

        With a recoil permeability above 1 a magnet demagnetises itself a little and the true moment,
        which a solution gives, is smaller.
        """
        total: Floats = np.sum([part.moment for part in self.parts], axis=0)
        return total

    @property
    def feature_size(self) -> float:
        """The smallest thickness of any part, m."""
        return min(part.shape.thickness for part in self.parts)

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution: coaxial bodies of revolution, magnetised along +z or -z."""
        return all(part.axisymmetric for part in self.parts)

    @property
    def corners(self) -> Points:
        """Points (n, 3) m whose convex hull is that of all parts, but for the bulge of curved ones."""
        return np.concatenate([part.corners for part in self.parts])

    @property
    def ball(self) -> tuple[Floats, float]:
        """Centre (3,) m and radius (m) of a ball that holds all parts; near the smallest one."""
        corners = self.corners
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
        centre[np.abs(centre) < 1e-9 * np.ptp(corners)] = 0.0
        radius = np.linalg.norm(corners - centre, axis=1).max() + max(part.shape.bulge for part in self.parts)
        return centre, float(radius)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m), rounded to two digits.

        Multipoles about the centre of the ball around them, which model most such magnets, want the region to begin
        at 1.5 times that ball's radius. The extent is 1.5 times the largest dimension, at least twice the clearance.
        """
        centre, radius = self.ball
        nearest = max(1.5 * radius - _depth(self.corners, centre), radius / 8)
        return two_digits(nearest), two_digits(max(3 * radius, 2 * nearest))

    def build(self, occ: Any) -> dict[str, list[int]]:
        """Make the solids in `occ`, which is `gmsh.model.occ`; volume tags by body name, not synchronised."""
        return {part.name: part.build(occ) for part in self.parts}

    def build_meridian(self, occ: Any) -> dict[str, list[int]]:
        """Make the half section, x = rho and y = z; surface tags by body name, not synchronised."""
        return {part.name: part.build_meridian(occ) for part in self.parts}


def _depth(corners: Points, centre: Floats) -> float:
    """Radius of the largest ball about `centre` (3,) in the convex hull of `corners` (n, 3); negative outside."""
    from scipy.spatial import ConvexHull

    faces = ConvexHull(corners).equations
    return float((-faces[:, :3] @ centre - faces[:, 3]).min())
