"""Arrays of equal coils on one foil, each driven on its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from magfem.errors import InputError
from magfem.fields.hull import BoxHull
from magfem.geometry.card import Table
from magfem.geometry.circuit import Circuit
from magfem.geometry.conductor import Conductor
from magfem.geometry.device import Device, header_from_card, length_text, two_digits
from magfem.geometry.foil_coil import FoilCoil
from magfem.geometry.foil_ribbon import Placed
from magfem.geometry.limits import InvalidValue, check_length, check_number
from magfem.geometry.meander_coil import MeanderCoil
from magfem.geometry.planar_spiral_coil import PlanarSpiralCoil
from magfem.geometry.rectangular_coil import RectangularCoil
from magfem.units import describe, format_quantity, quoted

MOST_COILS = 400
COILS: dict[str, type[FoilCoil]] = {coil.kind: coil for coil in (PlanarSpiralCoil, RectangularCoil, MeanderCoil)}
"""What an array may be made of, by kind."""


@dataclass(frozen=True, kw_only=True)
class CoilArray(Device):
    """Rows and columns of a flat coil in the plane z = 0, the array's middle at the origin.

    Circuit `r_c` is row r, column c: rows are counted towards +y, columns towards +x, from 1. No two coils touch,
    return strips included.

    Raises InputError when a value is of the wrong type, not finite or impossible.
    """

    kind = "coil_array"
    dimensions: ClassVar[tuple[str, ...]] = ("pitch",)

    coil: FoilCoil  # its name, source and region are the array's
    rows: int
    columns: int
    pitch: float  # m, from column to column
    row_pitch: float | None = None  # m, from row to row; None: as from column to column

    def __post_init__(self) -> None:
        if not isinstance(self.coil, FoilCoil):
            raise InputError(f"{self.words}: coil must be a coil of foil, got {describe(self.coil)}")
        if self.coil.rolled_radius is not None:
            raise InvalidValue(f"{self.words}: its coils must be flat", "coil.rolled")
        bare = replace(self.coil, name="", source="", clearance=None, extent=None, origin=None)
        object.__setattr__(self, "coil", bare)
        self.check_header()
        for key in ("rows", "columns"):
            value = getattr(self, key)
            check_number(self.words, f"dimensions.{key}", value)
            if value != int(value) or value < 1:
                raise InvalidValue(
                    f"{self.words}: {key} must be a whole number from 1, got {describe(value)}", f"dimensions.{key}"
                )
            object.__setattr__(self, key, int(value))
        if self.rows * self.columns > MOST_COILS:
            raise InvalidValue(
                f"{self.words}: at most {MOST_COILS} coils, got {self.rows * self.columns}", "dimensions.rows"
            )
        for key, count, axis in (("pitch", self.columns, 0), ("row_pitch", self.rows, 1)):
            if getattr(self, key) is not None:
                check_length(self.words, f"dimensions.{key}", getattr(self, key))
            if count > 1:
                self._check_touching(key if getattr(self, key) is not None else "pitch", axis)
        self.check_region(max(self.size))

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the array that a whole card describes. Raises CardError."""
        values = header_from_card(card, "dimensions", "coil")
        dimensions = card.table("dimensions")
        dimensions.only("rows", "columns", "pitch", "row_pitch")
        values |= {key: dimensions.number(key) for key in ("rows", "columns")}
        values["pitch"] = dimensions.quantity("pitch", "length")
        if "row_pitch" in dimensions:
            values["row_pitch"] = dimensions.quantity("row_pitch", "length")
        coil = _coil_from_card(card.table("coil"))
        with card.locating():
            return cls(**values, coil=coil)

    def tables(self) -> dict[str, Any]:
        dimensions: dict[str, Any] = {"rows": self.rows, "columns": self.columns, "pitch": length_text(self.pitch)}
        if self.row_pitch is not None:
            dimensions["row_pitch"] = length_text(self.row_pitch)
        return {"dimensions": dimensions, "coil": {"kind": self.coil.kind, **self.coil.tables()}}

    @property
    def pitches(self) -> tuple[float, float]:
        """From column to column and from row to row, m."""
        return self.pitch, self.pitch if self.row_pitch is None else self.row_pitch

    @property
    def size(self) -> tuple[float, float, float]:
        """Of the block that holds all turns, m."""
        x, y = self.coil.winding.size
        across, up = self.pitches
        return x + (self.columns - 1) * across, y + (self.rows - 1) * up, self.coil.height

    @property
    def conductor(self) -> Conductor:
        """The metal of all coils."""
        return self.coil.conductor

    @property
    def axisymmetric(self) -> bool:
        """Never."""
        return False

    @property
    def hull(self) -> BoxHull:
        """The block that holds all turns, without leads."""
        return BoxHull(self.size)

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): a coil's clearance, half the largest dimension to two digits."""
        near = self.coil.default_region[0]
        return near, max(two_digits(0.5 * max(self.size)), 2 * near)

    @property
    def volume(self) -> float:
        """Of the metal of all coils, without leads, m³."""
        return self.rows * self.columns * self.coil.volume

    @cached_property
    def circuits(self) -> tuple[Circuit, ...]:
        """One for each coil, row by row: `1_1`, `1_2`, …"""
        tracks = self.coil.tracks()
        across, up = self.pitches
        circuits = []
        for row in range(self.rows):
            for column in range(self.columns):
                shift = ((column - 0.5 * (self.columns - 1)) * across, (row - 0.5 * (self.rows - 1)) * up, 0.0)
                moved = tuple(replace(track, stations=Placed(track.stations, shift)) for track in tracks)
                circuits.append(Circuit(f"{row + 1}_{column + 1}", moved))
        return tuple(circuits)

    def _check_touching(self, key: str, axis: int) -> None:
        """Raise InvalidValue when neighbours along an axis, 0 or 1, touch."""
        tracks = [track.stations(0.5) for track in self.coil.tracks()]
        edges = np.concatenate([edge[:, axis] for track in tracks for edge in (track.left, track.right)])
        extent = float(edges.max() - edges.min())
        if self.pitches[axis] <= extent * (1 + 1e-9):
            raise InvalidValue(
                f"{self.words}: {key} must exceed {format_quantity(extent, 'length')}, a coil with its return strip, "
                f"for neighbours not to touch, got {format_quantity(self.pitches[axis], 'length')}",
                f"dimensions.{key}",
            )


def _coil_from_card(table: Table) -> FoilCoil:
    """The coil of a [coil] table, a card in itself but for name, source and region. Raises CardError."""
    kind = table.text("kind")
    if kind not in COILS:
        nearest = get_close_matches(kind, COILS, n=1)
        advice = f"did you mean {quoted(nearest[0])}?" if nearest else f"known: {', '.join(COILS)}"
        raise table.error(f"an array has no coils of kind {quoted(kind)}; {advice}", "kind")
    make: Callable[..., FoilCoil] = COILS[kind]
    table.only("kind", *COILS[kind].tables_of_card())
    with table.locating():
        return make(**COILS[kind].values_from_card(table))
