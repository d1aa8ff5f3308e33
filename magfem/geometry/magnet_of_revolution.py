"""What ring, cylinder and disc magnets share: one tube about z."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from magfem.fields.hull import CylinderHull
from magfem.geometry.device import two_digits
from magfem.geometry.single_magnet import SingleMagnet
from magfem.geometry.tube import Tube


@dataclass(frozen=True, kw_only=True)
class MagnetOfRevolution(SingleMagnet):
    """One tube about z with its centre at the origin. A kind gives its `shape`."""

    @property
    @abstractmethod
    def shape(self) -> Tube:
        """The solid."""

    @property
    def hull(self) -> CylinderHull:
        """The convex hull, from which distances are counted."""
        return self.shape.hull

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m), rounded to two digits.

        The extent is 1.5 times the largest dimension, and the clearance 1/8 of the outer diameter or 1/16 of the
        length, whichever is larger (0.5 mm to 6 mm for a ring of 4 mm): nearer, a model of few terms cannot follow
        the field. Other than axial magnetisation is modelled by multipoles about the centre, which want the region
        to begin at 1.5 times the radius of the ball around the magnet.
        """
        tube = self.shape
        nearest = max(tube.outer_diameter / 8, tube.length / 16)
        if not self.axisymmetric:
            nearest = max(nearest, 1.5 * self.hull.radius - min(tube.outer_diameter, tube.length) / 2)
        return two_digits(nearest), two_digits(1.5 * max(tube.outer_diameter, tube.length))
