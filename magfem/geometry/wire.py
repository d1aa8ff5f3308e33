"""The wire that coils are wound from: a round one of stated diameter, or whatever fills a share of the window."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

from magfem.geometry.card import Table
from magfem.geometry.device import length_text
from magfem.geometry.limits import InvalidValue, check_number, check_positive_length
from magfem.units import format_quantity

FILL_FACTOR = 0.6  # of metal in the window where a card states no wire: round enamelled wire, orderly wound
THINNEST = 1e-5  # m, the finest enamelled copper wire that IEC 60317 knows has 10 to 20 µm

_SUBJECT = "wire"


@dataclass(frozen=True)
class Wire:
    """Round wire with its insulation, or, without a diameter, wire whose metal fills a share of the window.

    Raises InputError when a value is not finite or not physical.
    """

    diameter: float | None = None  # m, of the bare metal
    insulation: float = 0.0  # m, thickness of the enamel, all round
    fill_factor: float | None = None  # metal over window; None and no diameter: FILL_FACTOR

    def __post_init__(self) -> None:
        if self.diameter is not None:
            self._check_round(self.diameter)
            return
        if self.insulation != 0:
            raise InvalidValue(f"{_SUBJECT}: insulation needs a diameter, that of the bare metal", "wire.insulation")
        if self.fill_factor is not None:
            check_number(_SUBJECT, "wire.fill_factor", self.fill_factor)
            if not 0 < self.fill_factor <= 1:
                raise InvalidValue(
                    f"{_SUBJECT}: fill_factor must lie above 0 and at most at 1, got {self.fill_factor:g}",
                    "wire.fill_factor",
                )

    def _check_round(self, diameter: float) -> None:
        if self.fill_factor is not None:
            raise InvalidValue(f"{_SUBJECT}: state diameter or fill_factor, not both", "wire.fill_factor")
        check_positive_length(_SUBJECT, "wire.diameter", diameter)
        if diameter < THINNEST:
            raise InvalidValue(
                f"{_SUBJECT}: diameter must be at least {format_quantity(THINNEST, 'length')}, "
                f"got {format_quantity(diameter, 'length')}",
                "wire.diameter",
            )
        check_number(_SUBJECT, "wire.insulation", self.insulation)
        if self.insulation < 0:
            raise InvalidValue(
                f"{_SUBJECT}: insulation must not be negative, got {format_quantity(self.insulation, 'length')}",
                "wire.insulation",
            )

    @classmethod
    def from_card(cls, card: Table) -> Wire:
        """Read the [wire] table of a whole card; without one FILL_FACTOR holds. Raises CardError."""
        if "wire" not in card:
            return cls()
        table = card.table("wire")
        table.only("diameter", "insulation", "fill_factor")
        values = {key: table.quantity(key, "length") for key in ("diameter", "insulation") if key in table}
        if "fill_factor" in table:
            values["fill_factor"] = table.number("fill_factor")
        return cls(**values)

    def table(self) -> dict[str, Any]:
        """The [wire] table that reads back to this; empty where nothing is stated."""
        if self.diameter is not None:
            return {"diameter": length_text(self.diameter), "insulation": length_text(self.insulation)}
        return {} if self.fill_factor is None else {"fill_factor": self.fill_factor}

    @property
    def insulated_diameter(self) -> float | None:
        """With the enamel, m; None when only a share of the window is known."""
        return None if self.diameter is None else self.diameter + 2 * self.insulation

    def area(self, window_area: float, turns: float) -> float:
        """Of the metal in one turn's section, m²; `turns` of them fill a window of `window_area` (m²)."""
        if self.diameter is not None:
            return pi / 4 * self.diameter**2
        return (FILL_FACTOR if self.fill_factor is None else self.fill_factor) * window_area / turns
