"""Readings, single measured components of B, one by one: the `[[measurement]]` tables of recipes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.geometry.limits import InvalidValue
from magfem.typing import Floats
from magfem.units import describe


@dataclass(frozen=True, eq=False)
class Reading:
    """One component of B, measured at one place in the device's frame."""

    position: Floats  # (3,) m
    direction: Floats  # (3,) unit vector: the component that was measured
    value: float  # T
    uncertainty: float | None  # T, half width; None when not known
    source: str


def check_readings(readings: Sequence[Reading]) -> None:
    """Raise InvalidValue where nothing says how sure a factor made of them is."""
    known = [one.uncertainty is not None for one in readings]
    for number, one in enumerate(readings):
        key = f"measurement[{number}].uncertainty"
        if not known[number] and len(readings) == 1:
            raise InvalidValue("a scale from a single measurement needs its uncertainty", key)
        if not known[number] and any(known):
            raise InvalidValue("either all measurements have an uncertainty or none: they cannot be weighed else", key)
        if not known[number] and one.value == 0:
            raise InvalidValue("a measurement of zero needs an uncertainty: it cannot be weighed by its size", key)


def readings_from_table(table: Table) -> tuple[Reading, ...]:
    """The readings of a recipe, which may have none. Raises CardError."""
    return tuple(_reading(entry) for entry in table.tables("measurement")) if "measurement" in table else ()


def _reading(entry: Table) -> Reading:
    entry.only("position", "direction", "value", "uncertainty", "source")
    direction = np.array([_number(entry, "direction", part) for part in _three(entry, "direction")])
    if not 0 < np.linalg.norm(direction) < np.inf:
        raise entry.error("direction must not be the zero vector", "direction")
    uncertainty = entry.quantity("uncertainty", "flux density") if "uncertainty" in entry else None
    if uncertainty is not None and uncertainty <= 0:
        raise entry.error("uncertainty must be positive", "uncertainty")
    return Reading(
        position=np.array([_length(entry, part) for part in _three(entry, "position")]),
        direction=direction / np.linalg.norm(direction),
        value=entry.quantity("value", "flux density"),
        uncertainty=uncertainty,
        source=entry.text("source"),
    )


def _three(entry: Table, key: str) -> list[object]:
    value = entry.value(key)
    if not isinstance(value, list) or len(value) != 3:
        count = f" of {len(value)}" if isinstance(value, list) else ""
        example = '["10 mm", "0 mm", "0 mm"]' if key == "position" else "[1, 0, 0]"
        raise entry.error(f"{key} must be a list of three such as {example}, got {describe(value)}{count}", key)
    return value


def _number(entry: Table, key: str, part: object) -> float:
    if isinstance(part, bool) or not isinstance(part, int | float) or not np.isfinite(part):
        raise entry.error(f"{key} must hold finite bare numbers, got {describe(part)}", key)
    return float(part)


def _length(entry: Table, part: object) -> float:
    return Table(entry.origin, {"position": part}, entry.path).quantity("position", "length")
