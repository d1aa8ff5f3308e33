"""Triples in cards: lengths, positions, rotations."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from magfem.errors import InputError
from magfem.geometry.card import Table
from magfem.units import describe, quantity

Vector = tuple[float, float, float]


def is_triple(value: object) -> bool:
    """Whether a value is a sequence of three."""
    return isinstance(value, list | tuple | np.ndarray) and len(value) == 3


def triple(value: Iterable[float]) -> Vector:
    """Three numbers as a tuple of floats."""
    x, y, z = map(float, value)
    return x, y, z


def three_lengths(table: Table, key: str) -> Vector:
    """Three lengths (m) at `key`, such as ["5 mm", "5 mm", "2 mm"]. Raises CardError."""
    return _three(table, key, "length", '["5 mm", "5 mm", "2 mm"]')


def three_angles(table: Table, key: str) -> Vector:
    """Three angles (rad) at `key`, such as ["0 deg", "0 deg", "30 deg"]. Raises CardError."""
    return _three(table, key, "angle", '["0 deg", "0 deg", "30 deg"]')


def three_numbers(table: Table, key: str) -> Vector:
    """Three bare numbers at `key`. Raises CardError."""
    value = table.value(key)
    if not (is_triple(value) and all(isinstance(one, int | float) and not isinstance(one, bool) for one in value)):  # type: ignore[attr-defined]
        raise table.error(f"{key} must be three numbers such as [0, 0, 1], got {_shown(value)}", key)
    try:
        x, y, z = map(float, value)  # type: ignore[call-overload]
    except OverflowError:
        raise table.error(f"{key} must be three finite numbers", key) from None
    return x, y, z


def _three(table: Table, key: str, dimension: str, example: str) -> Vector:
    value = table.value(key)
    if not isinstance(value, list) or len(value) != 3:
        raise table.error(f"{key} must be three {dimension}s such as {example}, got {_shown(value)}", key)
    try:
        x, y, z = (quantity(one, dimension) for one in value)
    except InputError as error:
        raise table.error(f"{key}: {error}", key) from None
    return x, y, z


def _shown(value: object) -> str:
    return f"a list of {len(value)}" if isinstance(value, list) else describe(value)
