"""Stators: two rectangular coils rolled one inside the other, a quarter turn apart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi
from typing import Any, ClassVar, NamedTuple, Self

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.geometry.card import Table
from magfem.geometry.circuit import Circuit
from magfem.geometry.conductor import Conductor
from magfem.geometry.device import Device, header_from_card, length_text, two_digits
from magfem.geometry.leads import Leads
from magfem.geometry.limits import InvalidValue, check_length, check_number
from magfem.geometry.rectangular_coil import RectangularCoil
from magfem.units import describe, format_quantity


class Bore(NamedTuple):
    """The free cylinder within a stator, about z, its middle at the origin; m."""

    diameter: float
    length: float


@dataclass(frozen=True)
class Strands:
    """A stator's rectangular coil before it is rolled: `RectangularCoil` but for its foil; m."""

    length: float
    width: float
    turns: int
    strand_width: float
    longitudinal_gap: float
    transverse_gap: float

    lengths: ClassVar[tuple[str, ...]] = ("length", "width", "strand_width", "longitudinal_gap", "transverse_gap")

    @classmethod
    def from_card(cls, table: Table) -> Strands:
        """Read an [inner] or [outer] table. Raises CardError."""
        table.only(*cls.lengths, "turns")
        turns: Any = table.number("turns")
        return cls(turns=turns, **{key: table.quantity(key, "length") for key in cls.lengths})

    def table(self) -> dict[str, Any]:
        """The table that reads back to this."""
        return {key: length_text(getattr(self, key)) for key in self.lengths} | {"turns": self.turns}


@dataclass(frozen=True, kw_only=True)
class Stator(Device):
    """An inner and an outer rectangular coil, laid on each other with tape between them and rolled into a tube.

    z is the tube's axis, the origin its middle. Both foils have their copper outside: from the tube inwards come
    copper, adhesive and polyimide of the outer coil, tape, and the same of the inner one. The inner coil's middle lies
    on +x; that of the outer one is turned about z by `angle`, which is what its `offset` before rolling comes to at
    the tape's middle. Positive currents turn right-handed about the outward normals there.

    The circuits are `inner` and `outer`. Their return strips, which stand for soldered leads, run inside the inner
    foil's polyimide, and in the middle of the tape.

    Raises InputError when a value is of the wrong type, not finite or impossible, or a coil does not fit around.
    """

    kind = "stator"
    dimensions: ClassVar[tuple[str, ...]] = (
        "tube_inner_diameter",
        "offset",
        "copper",
        "adhesive",
        "polyimide",
        "tape",
    )

    tube_inner_diameter: float  # m
    offset: float  # m, from the inner coil's middle to the outer one's, around, before rolling
    copper: float  # m, thickness, as all the following
    adhesive: float
    polyimide: float
    tape: float
    inner: Strands
    outer: Strands
    conductor: Conductor = field(default_factory=Conductor)

    def __post_init__(self) -> None:
        for key, kind in (("inner", Strands), ("outer", Strands), ("conductor", Conductor)):
            if not isinstance(getattr(self, key), kind):
                raise InputError(f"{self.words}: {key} must be a {kind.__name__}, got {describe(getattr(self, key))}")
        self.check_header()
        for key in self.dimensions:
            if key == "offset":
                check_number(self.words, "dimensions.offset", self.offset)
            else:
                check_length(self.words, f"dimensions.{key}", getattr(self, key))
        if self.tape <= self.copper:
            raise InvalidValue(
                f"{self.words}: tape must be thicker than the copper ({format_quantity(self.copper, 'length')}) for "
                f"the outer coil's return strip to fit in it, got {format_quantity(self.tape, 'length')}",
                "dimensions.tape",
            )
        if self.bore.diameter <= 0:
            raise InvalidValue(
                f"{self.words}: tube_inner_diameter leaves no bore within foils and tape, "
                f"got {format_quantity(self.tube_inner_diameter, 'length')}",
                "dimensions.tube_inner_diameter",
            )
        for name in ("inner", "outer"):
            strands = getattr(self, name)
            with self._about(name):
                turns = self._flat(name).turns  # checked there, and a whole number from now on
            object.__setattr__(self, name, replace(strands, turns=turns))
            self._check_fit(name)
            with self._about(name):
                _ = self._rolled[name]
        self.check_region(max(self.inner.length, self.outer.length, self.tube_inner_diameter))

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the stator that a whole card describes. Raises CardError."""
        values = header_from_card(card, "dimensions", "inner", "outer", "conductor")
        dimensions = card.table("dimensions")
        dimensions.only(*cls.dimensions)
        lengths: dict[str, Any] = {key: dimensions.quantity(key, "length") for key in cls.dimensions}
        with card.locating():
            return cls(
                **values,
                **lengths,
                inner=Strands.from_card(card.table("inner")),
                outer=Strands.from_card(card.table("outer")),
                conductor=Conductor.from_card(card),
            )

    def tables(self) -> dict[str, Any]:
        return {
            "dimensions": {key: length_text(getattr(self, key)) for key in self.dimensions},
            "inner": self.inner.table(),
            "outer": self.outer.table(),
            "conductor": self.conductor.table(),
        }

    @property
    def radii(self) -> dict[str, float]:
        """Of the middle of the `inner` and `outer` coil's copper, m."""
        outer = 0.5 * (self.tube_inner_diameter - self.copper)
        return {"inner": outer - self._foil - self.tape, "outer": outer}

    @property
    def angle(self) -> float:
        """From the inner coil's middle to the outer one's, about z, rad."""
        return self.offset / (0.5 * (self.tube_inner_diameter - self.tape) - self._foil)

    @property
    def bore(self) -> Bore:
        """What foils and the inner return strip leave free."""
        radius = self.radii["inner"] - self._depths["inner"] - 0.5 * self.copper
        return Bore(2 * radius, max(self.inner.length, self.outer.length))

    @property
    def axisymmetric(self) -> bool:
        """Never."""
        return False

    @property
    def hull(self) -> CylinderHull:
        """The full cylinder that fits the tube, as long as the longer coil; leads excluded."""
        return CylinderHull(self.tube_inner_diameter, self.bore.length)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): twice the strands' width, half the largest dimension; two digits. `bore` has none
        of it."""
        near = two_digits(2 * max(self.inner.strand_width, self.outer.strand_width))
        return near, max(two_digits(0.5 * max(self.hull.length, self.hull.diameter)), 2 * near)

    @property
    def volume(self) -> float:
        """Of the copper of both coils, without leads, m³."""
        return sum(coil.volume for coil in self._rolled.values())

    @cached_property
    def circuits(self) -> tuple[Circuit, ...]:
        """`inner` and `outer`."""
        angles = {"inner": 0.0, "outer": self.angle}
        return tuple(Circuit(name, coil.tracks(angles[name])) for name, coil in self._rolled.items())

    @cached_property
    def _rolled(self) -> dict[str, RectangularCoil]:
        return {name: replace(self._flat(name), rolled_radius=radius) for name, radius in self.radii.items()}

    def _flat(self, name: str) -> RectangularCoil:
        strands: Strands = getattr(self, name)
        values = {key: getattr(strands, key) for key in (*strands.lengths, "turns")}
        leads = Leads(depth=self._depths[name])
        return RectangularCoil(**values, thickness=self.copper, leads=leads, conductor=self.conductor)

    @property
    def _foil(self) -> float:
        return self.copper + self.adhesive + self.polyimide

    @property
    def _depths(self) -> dict[str, float]:
        """Of the return strips below their coils' copper, m."""
        return {"inner": self._foil, "outer": self._foil + 0.5 * (self.tape - self.copper)}

    def _check_fit(self, name: str) -> None:
        radius, width = self.radii[name], getattr(self, name).width
        around = 2 * pi * radius
        if width < around:
            return
        shown = [format_quantity(value, "length") for value in (width, around, radius)]
        thinner = self.tape - (width - around) / (2 * pi)
        advice = (
            f"; tape thinner than {format_quantity(thinner, 'length')} would let it fit"
            if name == "inner" and thinner > self.copper
            else ""
        )
        raise InvalidValue(
            f"{self.words}: the {name} coil is {shown[0]} wide and does not fit the {shown[1]} around at its "
            f"radius {shown[2]}{advice}",
            f"{name}.width",
        )

    @contextmanager
    def _about(self, name: str) -> Iterator[None]:
        """Within it, a coil's refusals name the stator's coil and its table."""
        try:
            yield
        except InvalidValue as error:
            text = str(error).partition(": ")[2]
            key = error.key.rpartition(".")[2]
            table = "dimensions" if key in ("thickness", "radius", "depth") else name
            raise InvalidValue(f"{self.words}: {name} coil: {text}", f"{table}.{key}") from None
