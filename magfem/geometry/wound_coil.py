"""What coils wound from wire share: turns that fill a rectangular window, a wire, a metal, one circuit."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

from magfem.errors import InputError
from magfem.geometry.card import Table
from magfem.geometry.circuit import Circuit, CircuitPart
from magfem.geometry.conductor import Conductor
from magfem.geometry.device import Device, header_from_card, length_text
from magfem.geometry.limits import InvalidValue, check_length, check_number
from magfem.geometry.winding_window import WindingWindow
from magfem.geometry.wire import Wire
from magfem.units import describe


@dataclass(frozen=True, kw_only=True)
class WoundCoil(Device):
    """A coil of wire in air. A kind adds its dimensions, and gives `window` and `parts`.

    Lengths in `optional` may be None: the kind knows what follows then from the others.
    Raises InputError when a value is of the wrong type, not finite, impossible, or the turns do not fit.
    """

    optional: ClassVar[tuple[str, ...]] = ()
    angles: ClassVar[tuple[str, ...]] = ()  # that a card's [dimensions] holds besides, rad
    switches: ClassVar[tuple[str, ...]] = ()  # true or false, at the card's top; false when not stated

    turns: float
    layers: int | None = None  # None: not stated
    wire: Wire = field(default_factory=Wire)
    conductor: Conductor = field(default_factory=Conductor)

    def __post_init__(self) -> None:
        for key, kind in (("wire", Wire), ("conductor", Conductor)):
            if not isinstance(getattr(self, key), kind):
                raise InputError(f"{self.words}: {key} must be a {kind.__name__}, got {describe(getattr(self, key))}")
        self.check_header()
        largest = self.check_lengths()
        for key in self.optional:
            if getattr(self, key) is not None:
                check_length(self.words, f"dimensions.{key}", getattr(self, key))
        for key in self.switches:
            if not isinstance(getattr(self, key), bool):
                raise InvalidValue(
                    f"{self.words}: {key} must be true or false, got {describe(getattr(self, key))}", key
                )
        for key in self.angles:
            check_number(self.words, f"dimensions.{key}", getattr(self, key))
        self.check_shape(largest)
        self.window.check(self.words, self.turns, self.layers, self.wire)
        if self.layers is not None:
            object.__setattr__(self, "layers", int(self.layers))
        self.check_region(largest)

    @abstractmethod
    def check_shape(self, largest: float) -> None:
        """Raise InvalidValue for lengths that do not go together; `largest` of them, m."""

    @property
    @abstractmethod
    def window(self) -> WindingWindow:
        """The winding's section."""

    @property
    @abstractmethod
    def parts(self) -> tuple[CircuitPart, ...]:
        """The windings, in series."""

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the coil that a whole card describes. Raises CardError."""
        if "core" in card:
            raise card.error(
                f"{cls.kind.replace('_', ' ')}: iron cores are not supported yet, only coils in air", "core"
            )
        values = header_from_card(card, "dimensions", "wire", "conductor", *cls.switches)
        values |= {key: card.value(key) for key in cls.switches if key in card}
        with card.locating():
            return cls(
                **values,
                **cls.dimensions_from_card(card.table("dimensions")),
                wire=Wire.from_card(card),
                conductor=Conductor.from_card(card),
            )

    @classmethod
    def dimensions_from_card(cls, dimensions: Table) -> dict[str, Any]:
        """The fields that a card's [dimensions] states. Raises CardError."""
        dimensions.only(*cls.dimensions, *cls.optional, *cls.angles, "turns", "layers")
        values: dict[str, Any] = {key: dimensions.quantity(key, "length") for key in cls.dimensions}
        values |= {key: dimensions.quantity(key, "length") for key in cls.optional if key in dimensions}
        values |= {key: dimensions.quantity(key, "angle") for key in cls.angles}
        values["turns"] = dimensions.number("turns")
        if "layers" in dimensions:
            values["layers"] = dimensions.number("layers")
        return values

    def dimensions_table(self) -> dict[str, Any]:
        """The [dimensions] table that reads back to this."""
        lengths = (*self.dimensions, *(key for key in self.optional if getattr(self, key) is not None))
        table: dict[str, Any] = {key: length_text(getattr(self, key)) for key in lengths}
        table |= {key: f"{getattr(self, key)!r} rad" for key in self.angles}
        table["turns"] = self.turns
        if self.layers is not None:
            table["layers"] = self.layers
        return table

    def tables(self) -> dict[str, Any]:
        tables: dict[str, Any] = {key: getattr(self, key) for key in self.switches}
        tables |= {"dimensions": self.dimensions_table(), "conductor": self.conductor.table()}
        return tables | ({"wire": self.wire.table()} if self.wire.table() else {})

    @property
    def wire_area(self) -> float:
        """Of the metal in one turn's section, m²."""
        return self.window.wire_area(self.wire, self.turns)

    @property
    def circuits(self) -> tuple[Circuit, ...]:
        """The one circuit, called `coil`."""
        return (Circuit("coil", self.parts),)

    @property
    def volume(self) -> float:
        """Of the metal, m³."""
        return sum(circuit.volume for circuit in self.circuits)
