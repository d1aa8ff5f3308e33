"""What ring and cylinder magnets share: one magnetised body of revolution."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Self

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.geometry.body import Body
from magfem.geometry.card import Table
from magfem.geometry.device import Device, header_from_card, length_text, lengths_from_card, two_digits
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.tube import Tube
from magfem.typing import Floats
from magfem.units import describe


@dataclass(frozen=True, kw_only=True)
class MagnetOfRevolution(Device):
    """One permanent magnet, a body of revolution about z with its centre at the origin.

    A kind gives its `tube`.
    Raises InputError when a value is of the wrong type, not finite, impossible, or beyond what can be meshed.
    """

    material: PermanentMagnet

    def __post_init__(self) -> None:
        if not isinstance(self.material, PermanentMagnet):
            raise InputError(f"{self.words}: material must be a PermanentMagnet, got {describe(self.material)}")
        self.check_header()
        self.check_region(self.check_lengths())

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the magnet that a whole card describes. Raises CardError."""
        values = header_from_card(card, "dimensions", "material") | lengths_from_card(card, cls.dimensions)
        with card.locating():
            return cls(**values, material=PermanentMagnet.from_card(card.table("material")))

    def tables(self) -> dict[str, Any]:
        return {
            "dimensions": {key: length_text(getattr(self, key)) for key in self.dimensions},
            "material": self.material.table(),
        }

    @property
    @abstractmethod
    def tube(self) -> Tube:
        """The solid."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The one body, called `magnet`."""
        return (Body("magnet", self.material, self.volume, self.area),)

    @property
    def volume(self) -> float:
        """Closed form, m³."""
        return self.tube.volume

    @property
    def area(self) -> float:
        """Whole surface, closed form, m²."""
        return self.tube.area

    @property
    def moment(self) -> Floats:
        """Magnetic moment if magnetised rigidly, remanence·volume/µ₀, (3,) A·m².

        With a recoil permeability above 1 the magnet demagnetises itself a little and the true moment,
        which a solution gives, is smaller.
        """
        return self.material.remanence_vector * (self.volume / MU_0)

    @property
    def hull(self) -> CylinderHull:
        """The convex hull, from which distances are counted."""
        return self.tube.hull

    @property
    def feature_size(self) -> float:
        """The smallest thickness that a mesh must resolve, m."""
        return min(self.tube.wall, self.tube.length)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m), rounded to two digits.

        The extent is 1.5 times the largest dimension, and the clearance 1/8 of the outer diameter or 1/16 of the
        length, whichever is larger (0.5 mm to 6 mm for a ring of 4 mm): nearer, a model of few terms cannot follow
        the field. Other than axial magnetisation is modelled by multipoles about the centre, which want the region
        to begin at 1.5 times the radius of the ball around the magnet.
        """
        tube = self.tube
        nearest = max(tube.outer_diameter / 8, tube.length / 16)
        if not self.axisymmetric:
            nearest = max(nearest, 1.5 * self.hull.radius - min(tube.outer_diameter, tube.length) / 2)
        return two_digits(nearest), two_digits(1.5 * max(tube.outer_diameter, tube.length))

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution: magnetised along +z or -z."""
        x, y, _ = self.material.magnetisation
        return math.hypot(x, y) < 1e-12  # a direction that was rotated there is off by rounding

    def build(self, occ: Any) -> dict[str, list[int]]:
        """Make the solid in `occ`, which is `gmsh.model.occ`; volume tags by body name, not synchronised."""
        return {"magnet": self.tube.build(occ)}

    def build_meridian(self, occ: Any) -> dict[str, list[int]]:
        """Make the half section, x = rho and y = z; surface tags by body name, not synchronised."""
        return {"magnet": self.tube.build_meridian(occ)}
