"""Lengths that rings, cylinders, their segments and their stacks have in common."""

from __future__ import annotations

from magfem.geometry.card import Table
from magfem.geometry.limits import InvalidValue, check_length, check_number, check_thickness
from magfem.units import format_quantity


def ring_from_card(table: Table) -> dict[str, float]:
    """Outer diameter, length, and the inner diameter where a [dimensions] table states one, m. Raises CardError."""
    keys = ("outer_diameter", "length", *(("inner_diameter",) if "inner_diameter" in table else ()))
    return {key: table.quantity(key, "length") for key in keys}


def check_ring(words: str, outer: float, inner: float, length: float) -> float:
    """The larger of outer diameter and length, m; InvalidValue for lengths (m) that no ring or cylinder can have.

    An inner diameter of 0 means none.
    """
    sizes = {"outer_diameter": outer, "length": length}
    for key, value in sizes.items():
        check_length(words, f"dimensions.{key}", value)
    largest = max(outer, length)
    for key, value in sizes.items():
        check_thickness(words, f"dimensions.{key}", key, value, largest)
    key = "dimensions.inner_diameter"
    check_number(words, key, inner)
    if inner == 0:
        return largest
    check_length(words, key, inner)
    if inner >= outer:
        raise InvalidValue(
            f"{words}: inner_diameter must be smaller than outer_diameter ({format_quantity(outer, 'length')}), "
            f"got {format_quantity(inner, 'length')}",
            key,
        )
    check_thickness(words, key, key.partition(".")[2], inner, largest)
    check_thickness(words, key, "the wall", (outer - inner) / 2, largest)
    return largest
