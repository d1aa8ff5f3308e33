"""What a fit of samples found besides coefficients, as people read it."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10
from typing import Any, NamedTuple

from magfem.fitting.alignment import AXES, dimension_of
from magfem.units import DIMENSIONS, format_quantity


class Found(NamedTuple):
    """One parameter: `centre x`, `1.13 mm ± 12 µm`, and what is to be said about it, mostly nothing."""

    name: str
    value: str
    note: str


def found_parameters(measurement: Mapping[str, Any]) -> list[Found]:
    """Free parameters, remanence or current, and background, of a model report's `measurement`."""
    rows = []
    for name, one in measurement["free"].items():
        notes = ["at the limit of its bounds"] if one["at_bound"] else []
        if one["deviation"] is None:
            notes.append("cannot be told from the coefficients")
        rows.append(Found(name.replace("_", " "), _with_deviation(one, dimension_of(name)), ", ".join(notes)))
    for name, dimension in (("remanence", "flux density"), ("current", "current")):
        if name in measurement:
            rows.append(Found(name, _with_deviation(measurement[name], dimension), ""))
    if "background" in measurement:
        values, deviations = measurement["background"]["value"], measurement["background"]["deviation"]
        for axis, value, deviation in zip(AXES, values, deviations, strict=True):
            one = {"value": value, "deviation": deviation}
            rows.append(Found(f"background, {axis}", _with_deviation(one, "flux density"), ""))
    return rows


def _with_deviation(one: Mapping[str, float | None], dimension: str) -> str:
    """The value, to the second digit of its deviation; alone where no deviation is known."""
    scale = DIMENSIONS[dimension].scale if dimension else 1.0
    value, deviation = one["value"], one["deviation"]
    assert value is not None
    if not deviation:
        return _shown(value, dimension)
    digits = 1 - floor(log10(deviation / scale))
    return " ± ".join(_shown(round(number / scale, digits) * scale, dimension) for number in (value, deviation))


def _shown(value: float, dimension: str) -> str:
    return format_quantity(value, dimension) if dimension else f"{value:.6g}"
