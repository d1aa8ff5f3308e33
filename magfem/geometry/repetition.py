"""Counts and gaps of devices that repeat one magnet."""

from __future__ import annotations

from magfem.geometry.card import Table
from magfem.geometry.limits import InvalidValue, check_number, name_of
from magfem.units import format_quantity

MOST = 200
"""Magnets in one device; the meshes of more do not fit into memory."""


def check_count(words: str, key: str, value: float, least: int, most: int = MOST) -> None:
    """Raise InvalidValue unless `value` is a whole number from `least` to `most`."""
    check_number(words, key, value)
    if value != int(value) or not least <= value <= most:
        raise InvalidValue(
            f"{words}: {name_of(key)} must be a whole number from {least} to {most}, got {value:g}",
            key,
        )


def check_gap(words: str, gap: float) -> None:
    """Raise InvalidValue unless `gap` (m) is a length, 0 for magnets that touch."""
    key = "dimensions.gap"
    check_number(words, key, gap)
    if gap < 0:
        raise InvalidValue(
            f"{words}: gap must be positive, or left out for magnets that touch, got {format_quantity(gap, 'length')}",
            key,
        )


def gap_from_card(table: Table) -> dict[str, float]:
    """The gap (m) that a [dimensions] table states, if any. Raises CardError unless it is positive."""
    if "gap" not in table:
        return {}
    gap = table.quantity("gap", "length")
    if gap <= 0:
        raise table.error(
            f"gap must be positive, or left out for magnets that touch, got {format_quantity(gap, 'length')}", "gap"
        )
    return {"gap": gap}
