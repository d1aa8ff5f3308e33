"""Which column of a file holds a quantity, and in what unit; or which constant stands for it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from magfem.errors import InputError
from magfem.typing import Floats
from magfem.units import DIMENSIONS, quantity, quoted, shortened

FLUX_DENSITIES = ("flux density", "flux density per current")

_EXAMPLES = {"length": "mm", "flux density": "mT", "current": "mA", "time": "ms"}
_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))")
_ALIASES = {"x": ("x", "px"), "y": ("y", "py"), "z": ("z", "pz")}
_CURRENT = re.compile(r"i(0|[1-9][0-9]*)")
_OTHERS = ("sigma", "sx", "sy", "sz")
_RECORDED = ("t", "sensor")  # of recordings alone


class Named(Protocol):
    """What has columns with names: a `Table`, or a grid."""

    @property
    def path(self) -> Path: ...
    @property
    def header(self) -> Sequence[str]: ...
    @property
    def header_line(self) -> int: ...


@dataclass(frozen=True)
class Column:
    """A column of a file (`index`), or a constant in SI (`index` None)."""

    name: str  # as the file has it, or the constant's text
    index: int | None
    dimension: str  # of its unit; empty when the header states none: it is in SI
    scale: float = 1.0  # SI units in one of the column's
    sign: float = 1.0
    constant: float = 0.0

    def in_si(self, cells: Floats) -> Floats:
        """The SI values of the column's cells. A division by 1000 rounds once, a product with 0.001 twice."""
        if self.index is None:
            return np.full(len(cells), self.constant)
        divisor = round(1 / self.scale) if self.scale < 1 else 0
        divides = divisor > 0 and abs(divisor * self.scale - 1) < 1e-15
        return self.sign * (cells / divisor if divides else cells * self.scale)


def canonical(name: str) -> str | None:
    """The name that magfem gives to a column it knows, or None: px is x, bx is Bx, I0 is i0, time is t."""
    lower = name.lower()
    if lower == "time":
        return "t"
    for axis, aliases in _ALIASES.items():
        if lower in aliases:
            return axis
        if lower == f"b{axis}":
            return f"B{axis}"
    return lower if lower in (*_OTHERS, *_RECORDED) or _CURRENT.fullmatch(lower) else None


def parse_columns(texts: Iterable[str], recorded: bool = False) -> dict[str, str]:
    """The mapping of columns that texts `NAME=COLUMN` state, as a command line has them.

    `x=magnet_x_mm`, `x=-stage [mm]` (negated), `y==0 mm` (a constant). recorded: whether they are of a recording, with
    t and sensor instead of points. Raises InputError for texts of another form, names that no such samples have, and a
    name given twice.
    """
    columns: dict[str, str] = {}
    for text in texts:
        name, equals, column = (part.strip() for part in text.partition("="))
        if not name or not equals or not column:
            raise InputError(
                f"expected NAME=COLUMN, such as x=magnet_x_mm, or a constant, such as y==0 mm, got {quoted(text)}"
            )
        known = _known(name, recorded)
        if known in columns:
            raise InputError(f"column {known} is given twice: as {quoted(columns[known])} and as {quoted(column)}")
        columns[known] = column
    return columns


def check_columns(columns: Mapping[str, str] | None, recorded: bool = False) -> dict[str, str]:
    """A mapping with canonical names; raises InputError for names that no samples have, or that are one."""
    checked: dict[str, str] = {}
    for name, column in (columns or {}).items():
        if not isinstance(name, str) or not isinstance(column, str):
            raise InputError('columns map names to texts, such as {"x": "magnet_x_mm"}')
        known = _known(name, recorded)
        if known in checked:
            raise InputError(f"column {known} is given twice")
        checked[known] = column
    return checked


def column_names(named: Named) -> set[str]:
    """The canonical names among a header's columns."""
    found = (canonical(_own_parts(cell)[0]) for cell in named.header)
    return {name for name in found if name}


def find_column(
    named: Named, name: str, dimensions: Sequence[str], columns: Mapping[str, str] | None = None
) -> Column | None:
    """Where a quantity stands, or None.

    Parameters
    ----------
    named : the file.
    name : canonical. `name`, `name_unit`, `name [unit]` and `name (unit)` are its headers.
    dimensions : keys of `units.DIMENSIONS` that its unit may have; a header without a unit is in SI.
    columns : what stands for what, by canonical name: a column of the file, with a - before it if negated, with its
        unit in square brackets after it if its name does not end in one; or = and a constant with its unit.

    Raises InputError that names the file, the header's line and the mend: for a column that is there more than once,
    or is not there though the mapping names it; for a unit of another kind, and for a mapped column without one.
    """
    if columns and name in columns:
        return _mapped(named, name, columns[name].strip(), dimensions)
    found: list[Column] = []
    wrong: list[str] = []
    for index, cell in enumerate(named.header):
        base, unit = _own_parts(cell)
        if canonical(base) != name:
            continue
        if not unit:
            found.append(Column(cell, index, ""))
        elif (column := _in_unit(cell, index, unit, dimensions)) is not None:
            found.append(column)
        else:
            wrong.append(cell)
    if len(found) > 1:
        cells = ", ".join(quoted(column.name) for column in found)
        raise InputError(f"column {name} is there {len(found)} times: {cells} {_where(named)}")
    if wrong and not found:
        raise _no_unit(named, wrong[0], dimensions)
    return found[0] if found else None


def missing(named: Named, name: str, expected: str) -> InputError:
    """The error for a column that is not there."""
    got = quoted(",".join(named.header)) if named.header else "an empty file"
    return InputError(f"column {name} is missing: expected {expected}, got {got} {_where(named)}")


def split_unit(cell: str) -> tuple[str, str]:
    """A header's name, and its unit in square or round brackets if it has one."""
    match = _BRACKETS.fullmatch(cell.strip())
    if match is None:
        return cell.strip(), ""
    return match[1], (match[2] if match[2] is not None else match[3]).strip()


def _known(name: str, recorded: bool) -> str:
    known = canonical(name)
    if recorded and known not in (*_RECORDED, "Bx", "By", "Bz"):
        raise InputError(f"recordings have no column {quoted(name)}: expected t, sensor, bx, by or bz")
    if known is None or (known in _RECORDED and not recorded):
        raise InputError(
            f"samples have no column {quoted(name)}: expected x, y, z, Bx, By, Bz, sigma, sx, sy, sz, or i0, i1, ... "
            "for a coil system"
        )
    return known


def _own_parts(cell: str) -> tuple[str, str]:
    """Name and unit of a header in magfem's own habit: none of its names has an underscore."""
    base, unit = split_unit(cell)
    if unit or base != cell.strip():
        return base, unit
    base, _, unit = base.partition("_")
    return base, unit


def _mapped(named: Named, name: str, text: str, dimensions: Sequence[str]) -> Column:
    if text.startswith("=") and text not in named.header:
        return _constant(name, text[1:].strip(), dimensions)
    for sign, wanted in ((1.0, text), (-1.0, text[1:].strip() if text.startswith("-") else "")):
        if not wanted:
            continue
        base, unit = split_unit(wanted)
        for cell, stated in ((wanted, ""), (base, unit)):
            count = list(named.header).count(cell)
            if count > 1:
                raise InputError(f"column {quoted(cell)} is there {count} times {_where(named)}")
            if count == 1:
                return _of_cell(named, list(named.header).index(cell), stated, sign, dimensions)
    raise _unknown(named, name, text, dimensions)


def _of_cell(named: Named, index: int, unit: str, sign: float, dimensions: Sequence[str]) -> Column:
    """A column that a mapping names: its unit is stated there, or in brackets in the header, or ends the header."""
    cell = named.header[index]
    base, bracketed = split_unit(cell)
    unit = unit or bracketed
    if not unit and canonical(base):
        return Column(cell, index, "", sign=sign)
    column = _in_unit(cell, index, unit or cell.rpartition("_")[2], dimensions, sign)
    if column is None and unit:
        raise _no_unit(named, f"{base} [{unit}]", dimensions)
    if column is None:
        example = _EXAMPLES[dimensions[0]]
        raise InputError(
            f"column {quoted(cell)} does not end in a unit of {DIMENSIONS[dimensions[0]].noun}: "
            f'state it, such as "{shortened(cell)} [{example}]" {_where(named)}'
        )
    return column


def _constant(name: str, text: str, dimensions: Sequence[str]) -> Column:
    if name.startswith("B") or name in _RECORDED:
        what = "B" if name.startswith("B") else name
        raise InputError(f"column {name} cannot be a constant: {what} is what was measured, got {quoted('=' + text)}")
    dimension = next((kind for kind in dimensions if _is_quantity(text, kind)), dimensions[0])
    try:
        return Column(f"={text}", None, dimension, constant=quantity(text, dimension))
    except InputError as error:
        raise InputError(f"column {name}: {error}") from None


def _in_unit(cell: str, index: int, unit: str, dimensions: Sequence[str], sign: float = 1.0) -> Column | None:
    for dimension in dimensions:
        try:
            return Column(cell, index, dimension, quantity(f"1 {unit}", dimension), sign)
        except InputError:
            continue
    return None


def _is_quantity(text: str, dimension: str) -> bool:
    try:
        quantity(text, dimension)
    except InputError:
        return False
    return True


def _unknown(named: Named, name: str, text: str, dimensions: Sequence[str]) -> InputError:
    near = difflib.get_close_matches(split_unit(text.lstrip("-"))[0], named.header, n=1)
    hint = f"the nearest is {quoted(near[0])}" if near else f"the columns are {quoted(','.join(named.header))}"
    if any(_is_quantity(text, dimension) for dimension in dimensions):
        hint = f'a constant is written "={shortened(text)}"'
    return InputError(f"there is no column {quoted(text)} for {name}: {hint} {_where(named)}")


def _no_unit(named: Named, cell: str, dimensions: Sequence[str]) -> InputError:
    kind = DIMENSIONS[dimensions[0]].noun
    return InputError(
        f"column {quoted(cell)} does not end in a unit of {kind} such as {_EXAMPLES[dimensions[0]]} {_where(named)}"
    )


def _where(named: Named) -> str:
    return f"[{named.path}: line {named.header_line}]"
