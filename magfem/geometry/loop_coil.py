"""Loops: one turn of wire."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import Any, ClassVar, Self

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.geometry.card import Table
from magfem.geometry.circuit import Circuit, CoaxialWinding
from magfem.geometry.conductor import Conductor
from magfem.geometry.device import Device, header_from_card, length_text, lengths_from_card, two_digits
from magfem.geometry.limits import InvalidValue, check_length
from magfem.geometry.wire import THINNEST
from magfem.units import describe, format_quantity

THICKEST = 0.2  # of the loop's diameter, as in `magfem.fields.coaxial_inductance`, a wire


@dataclass(frozen=True, kw_only=True)
class LoopCoil(Device):
    """One turn about z in the plane z = 0, the current in the middle of the wire. Positive: right-handed about +z.

    Raises InputError when it is impossible.
    """

    kind = "loop_coil"
    dimensions: ClassVar[tuple[str, ...]] = ("diameter", "wire_diameter")

    diameter: float  # m, of the circle in the middle of the wire
    wire_diameter: float  # m, of the bare metal
    conductor: Conductor = field(default_factory=Conductor)

    def __post_init__(self) -> None:
        if not isinstance(self.conductor, Conductor):
            raise InputError(f"{self.words}: conductor must be a Conductor, got {describe(self.conductor)}")
        self.check_header()
        for key in self.dimensions:  # thin wires are welcome: nothing here needs a mesh
            check_length(self.words, f"dimensions.{key}", getattr(self, key))
        wire = format_quantity(self.wire_diameter, "length")
        key = "dimensions.wire_diameter"
        if self.wire_diameter >= self.diameter:
            size = format_quantity(self.diameter, "length")
            raise InvalidValue(f"{self.words}: wire_diameter must be smaller than diameter ({size}), got {wire}", key)
        if self.wire_diameter > THICKEST * self.diameter:
            most = format_quantity(THICKEST * self.diameter, "length")
            raise InvalidValue(
                f"{self.words}: wire_diameter must be at most {most}, {THICKEST:g} of the diameter, for the formula of "
                f"its inductance to hold, got {wire}; a thicker turn is a solenoid",
                key,
            )
        if self.wire_diameter < THINNEST:
            least = format_quantity(THINNEST, "length")
            raise InvalidValue(f"{self.words}: wire_diameter must be at least {least}, got {wire}", key)
        self.check_region(self.diameter)

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the loop that a whole card describes. Raises CardError."""
        values = header_from_card(card, "dimensions", "conductor") | lengths_from_card(card, cls.dimensions)
        with card.locating():
            return cls(**values, conductor=Conductor.from_card(card))

    def tables(self) -> dict[str, Any]:
        lengths = {key: length_text(getattr(self, key)) for key in self.dimensions}
        return {"dimensions": lengths, "conductor": self.conductor.table()}

    @property
    def circuits(self) -> tuple[Circuit, ...]:
        """The one circuit, called `coil`."""
        radius = 0.5 * self.diameter
        turn = CoaxialWinding(
            inner_radius=radius,
            outer_radius=radius,
            length=0.0,
            centre=0.0,
            turns=1.0,
            wire_area=pi / 4 * self.wire_diameter**2,
        )
        return (Circuit("coil", (turn,)),)

    @property
    def volume(self) -> float:
        """Of the metal, m³."""
        return sum(circuit.volume for circuit in self.circuits)

    @property
    def axisymmetric(self) -> bool:
        """Whether the field is one of revolution about z."""
        return True

    @property
    def hull(self) -> CylinderHull:
        """The cylinder that holds the wire, from which distances are counted."""
        return CylinderHull(self.diameter + self.wire_diameter, self.wire_diameter)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance 1/8 and extent 1.5 times the diameter (m), to two digits."""
        return two_digits(self.diameter / 8), two_digits(1.5 * self.diameter)
