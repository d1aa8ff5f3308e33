"""What the devices of every kind share: a name, where their numbers come from, and the region around them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

from magfem.errors import InputError
from magfem.fields.hull import Hull
from magfem.fields.region import Shell
from magfem.geometry.card import CardOrigin, Table
from magfem.geometry.limits import ROUNDING, InvalidValue, check_length, check_positive_length, check_thickness
from magfem.units import describe, format_quantity

FARTHEST = 1000  # largest extent over the largest dimension
NEAREST = 1e-5  # smallest clearance over the largest dimension

HEADER = ("kind", "name", "source", "region")
"""The keys that cards of every kind may have."""


@dataclass(frozen=True, kw_only=True)
class Device(ABC):
    """A device in its source frame. Fields are SI numbers, given by keyword; equality ignores `origin`.

    A kind adds its dimensions as fields and names the lengths among them in `dimensions`.
    """

    kind: ClassVar[str]
    dimensions: ClassVar[tuple[str, ...]]  # the lengths that a card's [dimensions] holds, m

    name: str = ""  # empty: the kind in words
    source: str = ""  # where the numbers come from
    clearance: float | None = None  # m, smallest hull distance of interest; None: see `region`
    extent: float | None = None  # m, largest hull distance of interest; None: see `region`
    origin: CardOrigin | None = field(default=None, compare=False, repr=False)  # None when made in Python

    @property
    def words(self) -> str:
        """The kind as sentences name it: `ring magnet`."""
        return self.kind.replace("_", " ")

    @property
    @abstractmethod
    def hull(self) -> Hull:
        """The convex hull, from which distances are counted."""

    @property
    @abstractmethod
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m) where the card states none."""

    @abstractmethod
    def tables(self) -> dict[str, Any]:
        """The card's tables but [region], ready for TOML: what `from_card` reads, lengths as text in m."""

    @property
    def region(self) -> Shell:
        """Where a model of this device must hold: what the card states, else `default_region`."""
        clearance, extent = self.default_region
        return Shell(
            self.hull,
            clearance if self.clearance is None else self.clearance,
            extent if self.extent is None else self.extent,
        )

    def check_header(self) -> None:
        """Raise InputError unless name and source are texts; an empty name becomes the kind in words."""
        for key in ("name", "source"):
            if not isinstance(getattr(self, key), str):
                raise InputError(f"{self.words}: {key} must be a text, got {describe(getattr(self, key))}")
        if not self.name:
            object.__setattr__(self, "name", self.words)

    def check_lengths(self) -> float:
        """The largest of `dimensions`, m; InvalidValue for one that no device can have or no mesh resolves."""
        for key in self.dimensions:
            check_length(self.words, f"dimensions.{key}", getattr(self, key))
        largest: float = max(getattr(self, key) for key in self.dimensions)
        for key in self.dimensions:
            check_thickness(self.words, f"dimensions.{key}", key, getattr(self, key), largest)
        return largest

    def check_region(self, largest: float) -> None:
        """Raise InvalidValue for a region that is empty or out of proportion to the `largest` dimension, m."""
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


def header_from_card(card: Table, *tables: str) -> dict[str, Any]:
    """The fields of `Device` that a whole card states; CardError for keys that are neither HEADER nor `tables`."""
    card.only(*HEADER, *tables)
    values: dict[str, Any] = {key: card.text(key) for key in ("name", "source") if key in card}
    if "region" in card:
        region = card.table("region")
        region.only("clearance", "extent")
        values |= {key: region.quantity(key, "length") for key in region.values}
    return values | {"origin": card.origin}


def lengths_from_card(card: Table, keys: tuple[str, ...], others: tuple[str, ...] = ()) -> dict[str, float]:
    """The lengths `keys` of a card's [dimensions], which may also hold `others`. Raises CardError."""
    dimensions = card.table("dimensions")
    dimensions.only(*keys, *others)
    return {key: dimensions.quantity(key, "length") for key in keys}


def length_text(value: float) -> str:
    """A length (m) as cards write it, every digit kept."""
    return f"{value!r} m"


def two_digits(length: float) -> float:
    """A length rounded to two significant digits."""
    return float(f"{length:.2g}")
