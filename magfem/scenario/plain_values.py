"""Whole numbers and switches in recipes."""

from __future__ import annotations

from magfem.geometry.card import Table
from magfem.units import describe

_MOST = 1_000_000


def whole_number(table: Table, key: str, default: int, least: int, most: int = _MOST) -> int:
    """The whole number at `key`, or `default`. Raises CardError for anything but one from `least` to `most`."""
    value = table.value(key) if key in table else default
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        limits = f"from {least} on" if most == _MOST else f"from {least} to {most}"
        raise table.error(f"{key} must be a whole number {limits}, got {describe(value)}", key)
    return value


def switch(table: Table, key: str) -> bool:
    """True or false at `key`; false when it is not there. Raises CardError for anything else."""
    value = table.value(key) if key in table else False
    if not isinstance(value, bool):
        raise table.error(f"{key} must be true or false, got {describe(value)}", key)
    return value
