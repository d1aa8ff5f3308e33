"""Disc magnets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from magfem.geometry.magnet_of_revolution import MagnetOfRevolution
from magfem.geometry.tube import Tube


@dataclass(frozen=True, kw_only=True)
class DiscMagnet(MagnetOfRevolution):
    """A flat cylinder: axis along z, centre at the origin. Raises InputError when it is impossible."""

    kind = "disc_magnet"
    dimensions: ClassVar[tuple[str, ...]] = ("diameter", "thickness")

    diameter: float  # m
    thickness: float  # m, along z

    @property
    def shape(self) -> Tube:
        return Tube(self.diameter, 0.0, self.thickness)
