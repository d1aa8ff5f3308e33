"""Cylinder magnets: rods and pins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from magfem.geometry.magnet_of_revolution import MagnetOfRevolution
from magfem.geometry.tube import Tube


@dataclass(frozen=True, kw_only=True)
class CylinderMagnet(MagnetOfRevolution):
    """A full cylinder: axis along z, centre at the origin. Raises InputError when it is impossible."""

    kind = "cylinder_magnet"
    dimensions: ClassVar[tuple[str, ...]] = ("diameter", "length")

    diameter: float  # m
    length: float  # m, along z

    @property
    def shape(self) -> Tube:
        return Tube(self.diameter, 0.0, self.length)
