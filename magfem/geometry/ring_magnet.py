"""Ring magnets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from magfem.geometry.limits import InvalidValue, check_thickness
from magfem.geometry.magnet_of_revolution import MagnetOfRevolution
from magfem.geometry.tube import Tube
from magfem.units import format_quantity


@dataclass(frozen=True, kw_only=True)
class RingMagnet(MagnetOfRevolution):
    """A ring: axis along z, centre at the origin. Raises InputError when the ring is impossible."""

    kind = "ring_magnet"
    dimensions: ClassVar[tuple[str, ...]] = ("outer_diameter", "inner_diameter", "length")

    outer_diameter: float  # m
    inner_diameter: float  # m, > 0; a full cylinder is a CylinderMagnet
    length: float  # m, along z

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inner_diameter >= self.outer_diameter:
            raise InvalidValue(
                f"{self.words}: inner_diameter must be smaller than outer_diameter "
                f"({format_quantity(self.outer_diameter, 'length')}), "
                f"got {format_quantity(self.inner_diameter, 'length')}",
                "dimensions.inner_diameter",
            )
        largest = max(self.outer_diameter, self.length)
        check_thickness(self.words, "dimensions.inner_diameter", "the wall", self.shape.wall, largest)

    @property
    def shape(self) -> Tube:
        return Tube(self.outer_diameter, self.inner_diameter, self.length)
