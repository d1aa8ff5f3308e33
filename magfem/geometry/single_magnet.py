"""What the kinds with one body share: a shape of one material about the origin."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Self

from magfem.errors import InputError
from magfem.fields.hull import Hull
from magfem.geometry.card import Table
from magfem.geometry.device import header_from_card, length_text, lengths_from_card
from magfem.geometry.magnetic_solids import MagneticSolids
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.part import Part
from magfem.geometry.shape import Shape
from magfem.units import describe


@dataclass(frozen=True, kw_only=True)
class SingleMagnet(MagneticSolids):
    """One permanent magnet. A kind gives its `shape`; its lengths stand in `dimensions` unless it reads them itself.

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
        values = header_from_card(card, "dimensions", "material") | cls.dimensions_from_card(card)
        with card.locating():
            return cls(**values, material=PermanentMagnet.from_card(card.table("material")))

    @classmethod
    def dimensions_from_card(cls, card: Table) -> dict[str, Any]:
        """The fields that a card's [dimensions] states. Raises CardError."""
        return dict(lengths_from_card(card, cls.dimensions))

    def dimensions_table(self) -> dict[str, Any]:
        """The [dimensions] table that reads back to this."""
        return {key: length_text(getattr(self, key)) for key in self.dimensions}

    def tables(self) -> dict[str, Any]:
        return {"dimensions": self.dimensions_table(), "material": self.material.table()}

    @property
    @abstractmethod
    def shape(self) -> Shape:
        """The solid, its frame the device's."""

    @property
    def parts(self) -> tuple[Part, ...]:
        """The one body, called `magnet`."""
        return (Part("magnet", self.shape, self.material),)

    @property
    def hull(self) -> Hull:
        """The convex hull, from which distances are counted."""
        return self.shape.hull
