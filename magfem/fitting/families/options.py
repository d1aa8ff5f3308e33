"""What the options of families may be: one rule for each name, for recipes in Python and in files alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np

from magfem.fields.terms import HIGHEST_DEGREE
from magfem.units import describe

MOST = 40
"""Sources, discs, sets or rings: more take minutes and no longer help."""

SYMMETRIES = ("none", "axial", "diametric", "plane_x", "plane_y", "plane_z")
"""Which harmonics families for samples keep: `free.selected`."""


@dataclass(frozen=True)
class Rule:
    """What an option must be.

    holds: whether a value is that.  sentence: what was expected.  length: whether it is one, m: a text with its
    unit in recipe files.
    """

    holds: Callable[[Any], bool]
    sentence: str
    length: bool = False


def is_whole(value: Any, low: float, high: float = math.inf) -> bool:
    """Whether a value is a finite whole number between two limits; 3.0 is one, true is none."""
    return is_number(value) and low <= value <= high and value == int(value)


def is_number(value: Any) -> bool:
    """Whether a value is a finite real number; true and false are none."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False


def shown(value: Any) -> str:
    """What was given instead, on one line; short lists of plain values as they are."""
    if isinstance(value, list | tuple) and len(value) <= 6 and all(isinstance(one, str | Real) for one in value):
        return f"[{', '.join(describe(one) for one in value)}]"
    return "None" if value is None else describe(value)


def several(numbers: Sequence[int] | int) -> tuple[int, ...]:
    """One number to try, or several."""
    return (int(numbers),) if isinstance(numbers, Integral) else tuple(map(int, numbers))  # type: ignore[arg-type]


def _count(value: Any, most: int) -> bool:
    return isinstance(value, Integral) and is_whole(value, 1, most)


def _counts(value: Any, most: int) -> bool:
    """Whether a value is a number from 1 to `most`, or a list of such numbers that is not empty."""
    if isinstance(value, list | tuple | range | np.ndarray):
        return len(np.shape(value)) == 1 and len(value) > 0 and all(_count(one, most) for one in value)
    return _count(value, most)


def _one(name: str, most: int) -> Rule:
    return Rule(lambda value: _count(value, most), f"{name} must be a whole number from 1 to {most}")


def _some(name: str, most: int) -> Rule:
    return Rule(
        lambda value: _counts(value, most), f"{name} must be a whole number from 1 to {most}, or a list of such numbers"
    )


def _is_point(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray) and len(value) == 3 and all(map(is_number, value))


def _are_points(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray) and 0 < len(value) <= MOST and all(map(_is_point, value))


OPTIONS: dict[str, Rule] = {
    "poles": _one("poles", HIGHEST_DEGREE),
    "height": Rule(is_number, "height must be a finite number of metres", length=True),
    "sources": _some("sources", MOST),
    "orders": _some("orders", HIGHEST_DEGREE),
    "shared": Rule(lambda value: isinstance(value, bool), "shared must be true or false"),
    "sets": _one("sets", MOST),
    "discs": _some("discs", MOST),
    "degrees": _some("degrees", HIGHEST_DEGREE),
    "rings": _some("rings", MOST),
    "centre": Rule(_is_point, "centre must be three finite numbers of metres", length=True),
    "centres": Rule(_are_points, f"centres must be 1 to {MOST} triples of finite numbers of metres", length=True),
    "radius": Rule(
        lambda value: is_number(value) and value > 0, "radius must be a positive number of metres", length=True
    ),
    "symmetry": Rule(
        lambda value: isinstance(value, str) and value in SYMMETRIES, f"symmetry must be one of {', '.join(SYMMETRIES)}"
    ),
    "circuit": Rule(
        lambda value: isinstance(value, str) and bool(value.strip()), "circuit must be the name of a circuit"
    ),
}
"""By the option's name, which means the same in every family that has it."""
