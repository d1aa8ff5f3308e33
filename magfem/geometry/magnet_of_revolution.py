"""What ring and cylinder magnets share: one magnetised body of revolution and the region around it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Shell
from magfem.geometry.body import Body
from magfem.geometry.card import CardOrigin, Table
from magfem.geometry.limits import (
    ROUNDING,
    InvalidValue,
    check_length,
    check_positive_length,
    check_thickness,
)
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.tube import Tube
from magfem.typing import Floats
from magfem.units import describe, format_quantity

FARTHEST = 1000  # largest extent over the largest dimension
NEAREST = 1e-5  # smallest clearance over the largest dimension


@dataclass(frozen=True, kw_only=True)
class MagnetOfRevolution(ABC):
    """One permanent magnet, a body of revolution about z with its centre at the origin.

    A kind adds its dimensions as fields, names them in `dimensions`, and gives its `tube`.
    Fields are SI numbers, given by keyword; equality ignores `origin`.
    Raises InputError when a value is of the wrong type, not finite, impossible, or beyond what can be meshed.
    """

    kind: ClassVar[str]
    dimensions: ClassVar[tuple[str, ...]]  # the fields that a card's [dimensions] holds, all lengths in m

    material: PermanentMagnet
    name: str = ""  # empty: the kind in words
    source: str = ""  # where the numbers come from
    clearance: float | None = None  # m, smallest hull distance of interest; None: see `region`
    extent: float | None = None  # m, largest hull distance of interest; None: see `region`
    origin: CardOrigin | None = field(default=None, compare=False, repr=False)  # None when made in Python

    def __post_init__(self) -> None:
        if not isinstance(self.material, PermanentMagnet):
            raise InputError(f"{self.words}: material must be a PermanentMagnet, got {describe(self.material)}")
        for key in ("name", "source"):
            if not isinstance(getattr(self, key), str):
                raise InputError(f"{self.words}: {key} must be a text, got {describe(getattr(self, key))}")
        if not self.name:
            object.__setattr__(self, "name", self.words)
        for key in self.dimensions:
            check_length(self.words, f"dimensions.{key}", getattr(self, key))
        largest = max(getattr(self, key) for key in self.dimensions)
        for key in self.dimensions:
            check_thickness(self.words, f"dimensions.{key}", key, getattr(self, key), largest)
        self._check_region(largest)

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the magnet that a whole card describes. Raises CardError."""
        card.only("kind", "name", "source", "dimensions", "material", "region")
        dimensions = card.table("dimensions")
        dimensions.only(*cls.dimensions)
        values: dict[str, Any] = {key: dimensions.quantity(key, "length") for key in cls.dimensions}
        values |= {key: card.text(key) for key in ("name", "source") if key in card}
        if "region" in card:
            region = card.table("region")
            region.only("clearance", "extent")
            values |= {key: region.quantity(key, "length") for key in region.values}
        with card.locating():
            material = PermanentMagnet.from_card(card.table("material"))
            return cls(**values, material=material, origin=card.origin)

    @property
    @abstractmethod
    def tube(self) -> Tube:
        """The solid."""

    @property
    def words(self) -> str:
        """The kind as sentences name it: `ring magnet`."""
        return self.kind.replace("_", " ")

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
    def region(self) -> Shell:
        """Where a model of this magnet must hold.

        Unless stated, the extent is 1.5 times the largest dimension, and the clearance 1/8 of the outer
        diameter or 1/16 of the length, whichever is larger (0.5 mm to 6 mm for a ring of 4 mm): nearer, a model
        of few terms cannot follow the field. Other than axial magnetisation is modelled by multipoles about the
        centre, which want the region to begin at 1.5 times the radius of the ball around the magnet. Both are
        rounded to two digits.
        """
        tube = self.tube
        nearest = max(tube.outer_diameter / 8, tube.length / 16)
        if not self.axisymmetric:
            nearest = max(nearest, 1.5 * self.hull.radius - min(tube.outer_diameter, tube.length) / 2)
        clearance = _two_digits(nearest) if self.clearance is None else self.clearance
        extent = _two_digits(1.5 * max(tube.outer_diameter, tube.length)) if self.extent is None else self.extent
        return Shell(self.hull, clearance, extent)

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

    def _check_region(self, largest: float) -> None:
        for key in ("clearance", "extent"):
            if getattr(self, key) is not None:
                check_positive_length(self.words, f"region.{key}", getattr(self, key))
        near, far = self.region.clearance, self.region.extent
        shown_near, shown_far, size = (format_quantity(value, "length") for value in (near, far, largest))
        if near >= far and self.clearance is None:
            raise InvalidValue(
                f"{self.words}: extent must be larger than the default clearance ({shown_near}), got {shown_far}",
                "region.extent",
            )
        if near >= far:
            raise InvalidValue(
                f"{self.words}: clearance must be smaller than extent ({shown_far}), got {shown_near}",
                "region.clearance",
            )
        if near < NEAREST * largest:
            raise InvalidValue(
                f"{self.words}: clearance must be at least 1/{1 / NEAREST:.0f} of the largest dimension "
                f"({size}), got {shown_near}",
                "region.clearance",
            )
        if far > FARTHEST * largest * (1 + ROUNDING):
            raise InvalidValue(
                f"{self.words}: extent must be at most {FARTHEST} times the largest dimension ({size}), "
                f"got {shown_far}",
                "region.extent",
            )


def _two_digits(length: float) -> float:
    return float(f"{length:.2g}")
