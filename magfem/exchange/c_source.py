"""A field model as one C header: its numbers, and the functions that evaluate them.

The functions are C files in `magfem/exchange/c`; a header gets those that its terms need. In all of them `MODEL_`
stands where the model's own name comes.
"""

from __future__ import annotations

import math
import re
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fields.hull import BoxHull, CylinderHull, Hull, SphereHull
from magfem.fields.region import Region, Shell
from magfem.fields.region_parts import RegionPart, region_parts
from magfem.fields.solid_harmonics import interior_scale, schmidt_scale
from magfem.fields.term_kinds import CHARGE_DISC, HARMONIC, INTERIOR, LOOP, NAMES, OBLATE, PATH
from magfem.fields.terms import Terms
from magfem.fields.workspace_region import Ball, Box
from magfem.fitting.about import facts, terms_of
from magfem.units import quoted

_PIECES = {
    LOOP: ("axisymmetric.h", "ring.h", "loop.h"),
    HARMONIC: ("complex.h", "solid_harmonics.h", "harmonics.h"),
    INTERIOR: ("complex.h", "solid_harmonics.h", "interior.h"),
    OBLATE: ("axisymmetric.h", "complex.h", "oblate.h"),
    PATH: ("path.h",),
    CHARGE_DISC: ("axisymmetric.h", "ring.h", "charge_disc.h"),
}
"""The files that evaluate a kind of source, in the order in which C needs them."""


def c_header(field: Field, name: str = "magnet") -> str:
    """A C99 and C++ header, alone, with `NAME_field(p, B, gradient)` and `NAME_inside(p)`.

    field: a fitted model, or placed, scaled and summed ones.  name: a C identifier, the prefix of all that the header
    defines. Numbers keep all their bits. Raises InputError for another name, or a field that has no terms.
    """
    text: str = _template(c_name(name)).render(_context(field))
    return text


def c_name(name: str) -> str:
    """`name` if it can begin C identifiers; InputError says what can."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError(f"a C name has letters, digits and _ and begins with a letter, got {quoted(name)}")
    return name


def as_c_name(text: str) -> str:
    """The C name nearest to a text, such as a file's name: `ring_4x1_5` of "ring 4x1.5"."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
    return name if re.match(r"[A-Za-z]", name) else f"model_{name}".rstrip("_")


@cache
def _source(file: str) -> str:
    return files("magfem.exchange").joinpath("c", file).read_text(encoding="utf-8")


def _template(name: str) -> Any:
    loader = FunctionLoader(lambda file: _source(file).replace("MODEL_", f"{name}_"))
    environment = Environment(
        loader=loader, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, undefined=StrictUndefined
    )
    return environment.get_template("header.h.j2")


def _context(field: Field) -> dict[str, Any]:
    """What the template reads."""
    terms = terms_of(field, "a C header")
    kinds = [kind for kind in NAMES if kind in terms.kind]
    harmonics, ranges = _harmonics(terms)
    tabled = np.isin(terms.kind[terms.owner], (HARMONIC, INTERIOR))
    rows = int(terms.degree[tabled].max()) + 3 if tabled.any() else 0
    columns = min(rows, int(terms.order[tabled].max()) + 3) if tabled.any() else 0
    parts = region_parts(field.region)
    return {
        "facts": {key: _comment(text) for key, text in facts(field).items()},
        "per_ampere": ", for 1 A" if field.unit == "T/A" else "",
        "kinds": [NAMES[kind] for kind in kinds],
        "pieces": list(dict.fromkeys(piece for kind in kinds for piece in _PIECES[kind])),
        "mu_0_over_4pi": repr(MU_0 / (4.0 * math.pi)),
        "sources": [_one_source(terms, k, ranges) for k in range(terms.kind.size)],
        "harmonics": harmonics,
        "rows": rows,
        "columns": columns,
        "nodes": [_numbers(node) for node in terms.nodes],
        "parts": [_part(part) for part in parts] if all(_is_told(part.region) for part in parts) else None,
    }


def _harmonics(terms: Terms) -> tuple[list[tuple[int, int, str, str]], list[tuple[int, int]]]:
    """Degree, order and complex coefficient of every harmonic; for every source the first and the end of its own."""
    found: list[tuple[int, int, str, str]] = []
    ranges = []
    for k, kind in enumerate(terms.kind):
        first = len(found)
        if kind in (HARMONIC, INTERIOR, OBLATE):
            scaling = interior_scale if kind == INTERIOR else schmidt_scale
            for i in range(int(terms.start[k]), int(terms.start[k + 1])):
                degree, order = int(terms.degree[i]), int(terms.order[i])
                value = scaling(degree, order) * float(terms.coefficient[i])
                re, im = (0.0, -value) if terms.sine[i] else (value, 0.0)
                found.append((degree, order, repr(re), repr(im)))
        ranges.append((first, len(found)))
    return found, ranges


def _one_source(terms: Terms, k: int, ranges: list[tuple[int, int]]) -> dict[str, Any]:
    kind, (first, end), value = int(terms.kind[k]), ranges[k], 0.0
    if kind == PATH:
        first, end = int(terms.node_start[k]), int(terms.node_start[k + 1])
    if kind in (LOOP, PATH, CHARGE_DISC):
        value = float(terms.coefficient[terms.start[k] : terms.start[k + 1]].sum())
    return {
        "kind": NAMES[kind],
        "centre": _numbers(terms.centre[k]),
        "frame": _numbers(terms.frame[k].ravel()),
        "radius": repr(float(terms.radius[k])),
        "value": repr(value),
        "first": first,
        "end": end,
    }


_HULLS = {CylinderHull: "cylinder", BoxHull: "box", SphereHull: "sphere"}
"""The hulls whose distance the header can tell."""

_SLACK = 1e-12  # of the size, as `contains` of every region has it: points made to lie on a limit are inside


def _is_told(region: Region) -> bool:
    """Whether the header can say who is in the region."""
    return isinstance(region, Ball | Box) or (isinstance(region, Shell) and isinstance(region.hull, tuple(_HULLS)))


def _part(part: RegionPart) -> dict[str, Any]:
    """A part of the region: where its own frame is, and its limits."""
    rotation, origin = part.pose.rotation.as_matrix(), part.pose.translation
    moved = np.any(rotation != np.eye(3)) or np.any(origin != 0)
    return {
        "words": _comment(part.region.describe()),
        "origin": _numbers(origin),
        "frame": _numbers(rotation.ravel()) if moved else None,
        **_limits(part.region),
    }


def _limits(region: Region) -> dict[str, Any]:
    """What the template compares with, slack included. Intervals without an end have None there."""
    if isinstance(region, Ball):
        return {"kind": "ball", "centre": _numbers(region.centre), "farthest": repr(region.radius * (1 + _SLACK))}
    if isinstance(region, Box):
        slack = _SLACK * max(map(abs, (*region.low, *region.high)))
        intervals = [_interval((low, high), slack) for low, high in zip(region.low, region.high, strict=True)]
        return {"kind": "box", "intervals": list(zip("xyz", intervals, strict=True))}
    assert isinstance(region, Shell)
    slack = _SLACK * region.extent
    window = {"z": _interval(region.z, slack), "rho": _interval(region.rho, slack)}
    if region.rho[0] <= 0:
        window["rho"] = (None, window["rho"][1])
    return {
        "kind": "shell",
        "hull": _HULLS[type(region.hull)],
        "hull_words": _comment(region.hull.describe()),
        "half": [repr(length / 2) for length in _size(region.hull)],
        "nearest": repr(region.clearance - slack),
        "farthest": repr(region.extent + slack),
        "window": window,
    }


def _interval(pair: tuple[float, float], slack: float) -> tuple[str | None, str | None]:
    low, high = pair
    return repr(low - slack) if math.isfinite(low) else None, repr(high + slack) if math.isfinite(high) else None


def _size(hull: Hull) -> tuple[float, float, float]:
    """Lengths along x, y, z, m."""
    if isinstance(hull, BoxHull):
        return hull.size
    if isinstance(hull, CylinderHull):
        return hull.diameter, hull.diameter, hull.length
    assert isinstance(hull, SphereHull)
    return hull.diameter, hull.diameter, hull.diameter


def _numbers(array: Any) -> list[str]:
    """The shortest decimals that give back every bit."""
    return [repr(value) for value in np.asarray(array, dtype=float).tolist()]


def _comment(text: str) -> str:
    """A text that cannot end a C comment, nor begin one within it."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").rstrip("\\")
