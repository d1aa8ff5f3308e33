"""Sphere magnets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from magfem.geometry.ball import Ball
from magfem.geometry.device import two_digits
from magfem.geometry.single_magnet import SingleMagnet


@dataclass(frozen=True, kw_only=True)
class SphereMagnet(SingleMagnet):
    """A ball about the origin. Raises InputError when it is impossible."""

    kind = "sphere_magnet"
    dimensions: ClassVar[tuple[str, ...]] = ("diameter",)

    diameter: float  # m

    @property
    def shape(self) -> Ball:
        return Ball(self.diameter)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): 1/8 and 1.5 times the diameter. Outside, the field is a dipole's."""
        return two_digits(self.diameter / 8), two_digits(1.5 * self.diameter)
