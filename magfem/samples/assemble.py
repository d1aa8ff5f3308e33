"""From the columns of a file to samples."""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Literal, Protocol

import numpy as np

from magfem.errors import InputError
from magfem.samples.columns import FLUX_DENSITIES, Column, Named, check_columns, column_names, find_column, missing
from magfem.samples.samples import AXES, Samples, SystemSamples
from magfem.typing import Booleans, Floats
from magfem.units import quoted

log = logging.getLogger("magfem")

_HEADER = "the header x,y,z,Bx,By,Bz (m, T; or x_mm, Bx_mT), or a column that stands for it, such as x=stage_mm"
_SYSTEM_HEADER = "the header px,py,pz,i0,...,iN,bx,by,bz (m, A, T; or px_mm, i0_mA, bx_mT)"


class Source(Named, Protocol):
    """Numbers in columns with names: a `Table`, or a grid."""

    def numbers(self, columns: Sequence[int], gaps: Collection[int] = ()) -> Floats:
        """The columns (n, len(columns)) with these indices; NaN only in those that are `gaps`."""
        ...

    def line(self, row: int) -> int:
        """The line of the file for a row."""
        ...


def assemble(
    source: Source,
    columns: Mapping[str, str] | None = None,
    sigma: float | None = None,
    outside: Literal["raise", "drop"] = "raise",
) -> Samples | SystemSamples:
    """Samples from the columns of a file; of a coil system if it has the columns i0, i1, …

    columns, sigma: as in `read_samples`.
    outside: what to do with rows in which no component of B is a number: an error, or leave them out and log how many.

    Raises InputError that names the file, the line and the column.
    """
    mapping = check_columns(columns)
    coils = _coils(source, mapping)
    expected = _SYSTEM_HEADER if coils else _HEADER
    places = [_required(source, axis, ("length",), mapping, expected) for axis in AXES]
    currents = [_required(source, f"i{k}", ("current",), mapping, expected) for k in range(coils)]
    field = [find_column(source, f"B{axis}", FLUX_DENSITIES, mapping) for axis in AXES]
    if not any(field) or (coils and not all(field)):
        raise missing(
            source, next(f"B{axis}" for axis, column in zip(AXES, field, strict=True) if not column), expected
        )
    deviations = _deviation_columns(source, mapping, field) if sigma is None else [None] * 3
    unit = _unit(source, field, deviations)

    used = [column for column in (*places, *currents, *field, *deviations) if column is not None]
    indices = list(dict.fromkeys(column.index for column in used if column.index is not None))
    may_be_gaps = () if coils else [c.index for c in (*field, *deviations) if c is not None and c.index is not None]
    cells = source.numbers(indices, may_be_gaps)
    if len(cells) == 0:
        raise InputError(f"there are no rows under the header [{source.path}: line {source.header_line}]")

    def si(column: Column | None) -> Floats:
        if column is None:
            return np.full(len(cells), np.nan)
        return column.in_si(cells[:, indices.index(column.index)] if column.index is not None else cells[:, 0])

    points, B = (np.stack([si(column) for column in group], axis=1) for group in (places, field))
    kept = _measured_rows(source, B, outside)
    given = _deviations(source, deviations, [si(column) for column in deviations], B, kept, sigma)
    if coils:
        flow = np.stack([si(column) for column in currents], axis=1)
        if unit != "T":
            raise InputError(f"samples of a coil system must be in T, got {unit} [{source.path}]")
        return SystemSamples(points, flow, B, given, source.path.name)
    return Samples(points[kept], B[kept], None if given is None else given[kept], unit, source.path.name)


def _required(
    source: Source, name: str, dimensions: Sequence[str], mapping: Mapping[str, str], expected: str
) -> Column:
    column = find_column(source, name, dimensions, mapping)
    if column is None:
        raise missing(source, name, expected)
    return column


def _coils(source: Source, mapping: Mapping[str, str]) -> int:
    """How many coils the columns i0, i1, … are for; none may be left out."""
    names = {name for name in column_names(source) | set(mapping) if name.startswith("i")}
    count = max((int(name[1:]) + 1 for name in names), default=0)
    left_out = next((k for k in range(count) if f"i{k}" not in names), None)
    if left_out is not None:
        raise missing(source, f"i{left_out}", "a current for every coil from i0 on")
    return count


def _deviation_columns(
    source: Source, mapping: Mapping[str, str], field: Sequence[Column | None]
) -> list[Column | None]:
    """The columns of the three standard deviations; one `sigma` for all, or none at all."""
    common = find_column(source, "sigma", FLUX_DENSITIES, mapping)
    own = [find_column(source, f"s{axis}", FLUX_DENSITIES, mapping) for axis in AXES]
    where = f"[{source.path}: line {source.header_line}]"
    if common is None:
        lacking = [a for a, column, B in zip(AXES, own, field, strict=True) if B is not None and column is None]
        if any(own) and lacking:
            raise InputError(
                f"column s{lacking[0]} is missing: every component that was measured has its standard deviation, or "
                f"none has {where}"
            )
        return own
    if any(own):
        raise InputError(f"columns sigma and sx, sy, sz are both there: one of them says the same {where}")
    return [common] * 3


def _unit(source: Source, field: Sequence[Column | None], deviations: Sequence[Column | None]) -> Literal["T", "T/A"]:
    """The unit of B; deviations without a unit are in the same."""
    kinds: dict[str, str] = {}
    for column in field:
        if column is not None:
            kinds.setdefault(column.dimension or FLUX_DENSITIES[0], column.name)
    for column in deviations:
        if column is not None and column.dimension:
            kinds.setdefault(column.dimension, column.name)
    if len(kinds) > 1:
        names = " and ".join(quoted(kinds[kind]) for kind in FLUX_DENSITIES)
        raise InputError(
            f"B and its deviations must be all in T or all in T/A, got {names} "
            f"[{source.path}: line {source.header_line}]"
        )
    return "T/A" if FLUX_DENSITIES[1] in kinds else "T"


def _measured_rows(source: Source, B: Floats, outside: Literal["raise", "drop"]) -> Booleans:
    """Which rows (n,) hold a component of B."""
    kept: Booleans = np.asarray(~np.isnan(B).all(axis=1))
    if kept.all():
        return kept
    first = int(np.flatnonzero(~kept)[0])
    if outside == "raise" or not kept.any():
        what = "no component of B was measured" if outside == "raise" else "B is NaN at every point"
        raise InputError(f"{what}: one at least is needed [{source.path}: line {source.line(first)}]")
    log.info("%s: %d of %d points are outside the geometry, left out", source.path.name, (~kept).sum(), len(B))
    return kept


def _deviations(
    source: Source,
    columns: Sequence[Column | None],
    values: Sequence[Floats],
    B: Floats,
    kept: Booleans,
    sigma: float | None,
) -> Floats | None:
    """Standard deviations (n, 3), NaN where B is."""
    if sigma is not None:
        if not (math.isfinite(sigma) and sigma > 0):
            raise InputError(f"sigma must be a positive number, in the unit of B, got {sigma!r}")
        return np.where(np.isnan(B), np.nan, sigma)
    if not any(columns):
        return None
    for axis, column in enumerate(columns):
        if column is None:
            continue
        wrong = np.flatnonzero(kept & ~np.isnan(B[:, axis]) & ~(values[axis] > 0))
        if wrong.size:
            where = f"[{source.path}: line {source.line(int(wrong[0]))}, column {column.name}]"
            raise InputError(f"a standard deviation must be positive, got {values[axis][wrong[0]]:g} {where}")
    return np.where(np.isnan(B), np.nan, np.stack(list(values), axis=1))
