"""What a device's numbers must satisfy before it may be born: finite, physical, and possible to mesh."""

from __future__ import annotations

import math
from numbers import Real

from magfem.errors import InputError
from magfem.units import describe, format_quantity

SHORTEST = 1e-6  # m
LONGEST = 10.0  # m
ASPECT_RATIO = 1000  # largest over smallest dimension that a mesh still resolves
ROUNDING = 1e-9  # relative; a value typed as the limit itself passes


class InvalidValue(InputError):
    """A value no device can have; `key` is where a device card states it, for example `dimensions.length`."""

    def __init__(self, message: str, key: str) -> None:
        self.key = key
        super().__init__(message)


def check_number(subject: str, key: str, value: object) -> None:
    """Raise InvalidValue unless `value` is a finite real number.

    `key` is the dotted key of the card; sentences begin with `subject`, such as "ring magnet".
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InvalidValue(f"{subject}: {name_of(key)} must be a number, got {describe(value)}", key)
    if not is_finite(value):
        raise InvalidValue(f"{subject}: {name_of(key)} must be finite, got {describe(value)}", key)


def check_positive_length(subject: str, key: str, value: float) -> None:
    """Raise InvalidValue unless `value` is a finite length above zero, m."""
    check_number(subject, key, value)
    if value <= 0:
        raise InvalidValue(f"{subject}: {name_of(key)} must be positive, got {format_quantity(value, 'length')}", key)


def check_length(subject: str, key: str, value: float) -> None:
    """Raise InvalidValue unless `value`, m, is a length that a device can have: 1 µm to 10 m."""
    check_positive_length(subject, key, value)
    if not SHORTEST * (1 - ROUNDING) <= value <= LONGEST * (1 + ROUNDING):
        raise InvalidValue(
            f"{subject}: {name_of(key)} must lie between {format_quantity(SHORTEST, 'length')} "
            f"and {format_quantity(LONGEST, 'length')}, got {format_quantity(value, 'length')}",
            key,
        )


def check_thickness(subject: str, key: str, words: str, value: float, largest: float) -> None:
    """Raise InvalidValue when `value`, m, is too thin for a mesh that holds the `largest` dimension, m.

    `words` name the length in the sentence: a dimension, or something that follows from several.
    """
    if value < largest / ASPECT_RATIO * (1 - ROUNDING):
        raise InvalidValue(
            f"{subject}: {words} must be at least 1/{ASPECT_RATIO} of the largest dimension "
            f"({format_quantity(largest, 'length')}) for a mesh to resolve it, "
            f"got {format_quantity(value, 'length')}",
            key,
        )


def is_finite(value: Real) -> bool:
    """Whether `value` is a finite float; an integer beyond all floats is not."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def name_of(key: str) -> str:
    """The last part of a dotted key: `length` of `dimensions.length`."""
    return key.rpartition(".")[2]
