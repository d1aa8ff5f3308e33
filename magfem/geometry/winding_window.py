"""The rectangular window that a winding fills, and whether its turns fit."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, pi, sqrt

from magfem.geometry.limits import ROUNDING, InvalidValue, check_number
from magfem.geometry.wire import THINNEST, Wire
from magfem.units import format_quantity

DENSEST = pi / (2 * sqrt(3))  # share of a plane that equal circles can cover: 0.907, side by side in hexagons


@dataclass(frozen=True)
class WindingWindow:
    """The section of a winding: `layers` lie over one another through `build`, the turns of each along `breadth`."""

    build: float  # m
    breadth: float  # m

    @property
    def area(self) -> float:
        """m²"""
        return self.build * self.breadth

    def wire_area(self, wire: Wire, turns: float) -> float:
        """Of the metal in one turn's section, m²."""
        return wire.area(self.area, turns)

    def check(self, subject: str, turns: float, layers: int | None, wire: Wire) -> None:
        """Raise InvalidValue, which says what would fit, unless `turns` of `wire` fit in `layers` (None: any number).

        Turns in stated layers lie above one another, each in a square of its own; in any number of layers they may
        nestle into each other's gaps. `subject` begins the sentence.
        """
        check_number(subject, "dimensions.turns", turns)
        if turns < 1:
            raise InvalidValue(f"{subject}: turns must be at least 1, got {turns:g}", "dimensions.turns")
        if layers is not None:
            _check_layers(subject, turns, layers, wire)
        diameter = wire.insulated_diameter
        if diameter is None:
            self._check_fineness(subject, turns, wire)
        elif diameter > min(self.build, self.breadth) * (1 + ROUNDING):
            raise InvalidValue(
                f"{subject}: a wire of {_length(diameter)} with its insulation does not fit its window, "
                f"{self.words}; at most {_length(min(self.build, self.breadth))} fits",
                "wire.diameter",
            )
        elif layers is None:
            self._check_packing(subject, turns, diameter)
        else:
            self._check_rows(subject, turns, layers, diameter)

    @property
    def words(self) -> str:
        """`12 mm by 60 mm`"""
        return f"{_length(self.build)} by {_length(self.breadth)}"

    def _check_fineness(self, subject: str, turns: float, wire: Wire) -> None:
        thinnest = pi / 4 * THINNEST**2
        if self.wire_area(wire, turns) < thinnest:
            most = self.wire_area(wire, 1.0) / thinnest
            raise InvalidValue(
                f"{subject}: {turns:.12g} turns do not fit their window, {self.words}: at most {most:.0f} do, "
                f"of a wire of {_length(THINNEST)}, the finest there is",
                "dimensions.turns",
            )

    def _check_packing(self, subject: str, turns: float, diameter: float) -> None:
        one = pi / 4 * diameter**2
        if turns * one > DENSEST * self.area * (1 + ROUNDING):
            raise InvalidValue(
                f"{subject}: {turns:.12g} turns of a wire of {_length(diameter)} with its insulation do not fit their "
                f"window, {self.words}: at most {floor(DENSEST * self.area / one)} do, or a wire of "
                f"{_length(sqrt(DENSEST * self.area / (turns * pi / 4)))}",
                "dimensions.turns",
            )

    def _check_rows(self, subject: str, turns: float, layers: int, diameter: float) -> None:
        if layers * diameter > self.build * (1 + ROUNDING):
            raise InvalidValue(
                f"{subject}: {layers} layers of a wire of {_length(diameter)} with its insulation do not fit into "
                f"{_length(self.build)}: at most {floor(self.build / diameter * (1 + ROUNDING))} do",
                "dimensions.layers",
            )
        row = ceil(turns / layers * (1 - ROUNDING))
        if row * diameter > self.breadth * (1 + ROUNDING):
            most = floor(self.breadth / diameter * (1 + ROUNDING))
            raise InvalidValue(
                f"{subject}: {row} turns in a layer of a wire of {_length(diameter)} with its insulation do not fit "
                f"into {_length(self.breadth)}: at most {most} do, {most * layers} in {layers} layers",
                "dimensions.turns",
            )


def _check_layers(subject: str, turns: float, layers: int, wire: Wire) -> None:
    check_number(subject, "dimensions.layers", layers)
    if layers != int(layers) or not 1 <= layers <= turns:
        raise InvalidValue(
            f"{subject}: layers must be a whole number from 1 to the turns ({turns:.12g}), got {layers:g}",
            "dimensions.layers",
        )
    if wire.diameter is None:
        raise InvalidValue(
            f"{subject}: layers need the diameter of the wire that lies in them: state [wire] with its diameter",
            "dimensions.layers",
        )


def _length(value: float) -> str:
    return format_quantity(value, "length")
