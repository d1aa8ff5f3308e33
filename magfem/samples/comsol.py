"""Samples from COMSOL's text exports.

The formats are those of the COMSOL Multiphysics Programming Reference Manual, "Data Formats": spreadsheet and grid.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from magfem.errors import InputError
from magfem.samples.assemble import assemble
from magfem.samples.columns import check_columns, split_unit
from magfem.samples.samples import AXES, Samples
from magfem.samples.table import Table, delimiter_of, is_number, read_text
from magfem.typing import Floats
from magfem.units import quoted

_ENTRY = re.compile(r"%\s*([A-Za-z ]+?)\s*[:,]\s*(.*?)\s*")
_HEADER = re.compile(r"%\s*(Model|Version|Dimension|Nodes|Expressions|Length unit)\s*[:,]|%\s*Grid\s*$")
# A name, its unit in round brackets, the solution it belongs to.
_HEADING = re.compile(r"\S+(?: \([^()]*\))?(?: @ \S+)?")
_COMPONENTS = {"Bx": "Bx", "By": "By", "Bz": "Bz"}
_AXISYMMETRIC = {"Br": "Bx", "Bphi": "By", "Bz": "Bz"}


def read_comsol(
    path: str | PathLike[str], columns: Mapping[str, str] | None = None, sigma: float | None = None
) -> Samples:
    """Field data that COMSOL exported as text, with its header.

    Read are
    - *spreadsheets*: lines that begin with %, the last of which has the columns, such as `% x y z mf.Bx (T) mf.By (T)
      mf.Bz (T)`, then a row for every point, its cells separated by white space, commas, semicolons or tabs;
    - *grids*: after the line `% Grid` a line of coordinates for every axis, then for every expression the line
      `% Data`, a line with its name and unit, and its values: along a row x varies, from row to row y, then z.
    Coordinates are in the unit of the line `% Length unit`. The components of B are those of any physics interface
    (`mf.Bx`, `mfnc.Bx`, `comp1.mf.Bx`); other expressions are ignored. An axisymmetric export (r, z; Br, Bz, Bphi)
    gives points on the half plane y = 0, x = r, and its components there: Br is Bx, Bphi is By. Points outside the
    geometry, where COMSOL writes NaN, are left out, and a log line says how many.

    Parameters
    ----------
    columns : as for `read_samples`, where the names are not the usual ones: `{"Bx": "aveop1(mf.Bx) (T)"}`; and
        `{"z": "=2 mm"}` for a plane, whose third coordinate is not in the file.
    sigma : standard deviation of every component, T.

    Raises
    ------
    InputError : in one sentence with file, line and column; also for a file with several solutions, and for a
        sectionwise export.
    """
    path = Path(path)
    text = read_text(path)
    if not is_comsol(text):
        raise InputError(
            f"not an export of COMSOL: expected its header, lines that begin with %, then numbers [{path}]"
        )
    return comsol_samples(path, text, columns, sigma)


def is_comsol(text: str) -> bool:
    """Whether a file's text begins with COMSOL's header, and has numbers right after it."""
    head = []
    for line in text.split("\n"):
        if line.startswith("%"):
            head.append(line)
        elif line.strip():
            return any(map(_HEADER.match, head)) and is_number(re.split(r"[\s,;]", line.strip())[0])
    return False


def comsol_samples(path: Path, text: str, columns: Mapping[str, str] | None, sigma: float | None) -> Samples:
    """The samples of a COMSOL file's text; otherwise as `read_comsol`."""
    lines = text.split("\n")
    start = next(k for k, line in enumerate(lines) if line.strip() and not line.startswith("%"))
    heads = [line for line in lines[:start] if line.startswith("%")]
    if any(line.replace(" ", "") == "%Coordinates" for line in heads):
        raise InputError(f"sectionwise exports are not read: export as a spreadsheet or on a grid [{path}]")
    grid = any(line.replace(" ", "").rstrip() == "%Grid" for line in heads)
    source = _grid(path, lines, start) if grid else _spreadsheet(path, lines, start)
    mapping = _usual_columns(source, _length_unit(path, heads)) | check_columns(columns)
    samples = assemble(source, mapping, sigma, outside="drop")
    if not isinstance(samples, Samples):
        raise InputError(f"a COMSOL export is of one source: columns for currents do not apply [{path}]")
    return samples


@dataclass(frozen=True, eq=False)
class Grid:
    """The points of a grid as a table: coordinates, then the expressions, which begin at `starts`."""

    path: Path
    header: tuple[str, ...]
    header_line: int
    values: Floats  # (n, len(header))

    def numbers(self, columns: Sequence[int], gaps: Collection[int] = ()) -> Floats:
        """The columns (n, len(columns)); those that are not `gaps` are coordinates, and finite."""
        return self.values[:, list(columns)]

    def line(self, row: int) -> int:
        """The line where the grid begins: its points have none of their own."""
        return self.header_line


def _spreadsheet(path: Path, lines: list[str], start: int) -> Table:
    line = next(k for k in range(start - 1, -1, -1) if lines[k].startswith("%"))
    heading = lines[line].lstrip("%").strip()
    delimiter = delimiter_of(lines[start])
    if delimiter is not None:
        width = lines[start].count(delimiter) + 1
        headings = [[cell.strip() for cell in heading.split(delimiter)]]
    else:
        width = len(lines[start].split())
        headings = [re.split(r"\s{2,}|\t", heading), _HEADING.findall(heading)]
    names = next((names for names in headings if len(names) == width), None)
    if names is None:
        raise InputError(
            f"expected names for the {width} columns below, got {quoted(heading)} [{path}: line {line + 1}]"
        )
    header = _one_solution(path, line + 1, names)
    return Table(path, header, line + 1, lines[start:], start + 1, delimiter)


def _grid(path: Path, lines: list[str], start: int) -> Grid:
    """Blocks of rows with the lines that begin with % before each: the axes, then one block for every expression."""
    (_, first, rows), *expressions = _blocks(lines, start)
    axes = [_cells(path, [row], first + k, "of coordinates")[0] for k, row in enumerate(rows)]
    if not 1 <= len(axes) <= 3 or not all(np.isfinite(axis).all() for axis in axes):
        raise InputError(f"expected one to three lines of coordinates after % Grid [{path}: line {first}]")
    if not expressions:
        raise InputError(f"there are no values on the grid: expected a line % Data [{path}: line {first}]")
    shape = [len(axis) for axis in reversed(axes)]
    count = int(np.prod(shape[:-1]))
    values = [*reversed(np.meshgrid(*reversed(axes), indexing="ij"))]
    for name, line, rows in expressions:
        cells = _cells(path, rows, line, name)
        if cells.shape != (count, shape[-1]):
            raise InputError(
                f"expected {count} rows of {shape[-1]} values on this grid, got {len(cells)} of {cells.shape[1]} "
                f"[{path}: line {line}, column {name}]"
            )
        values.append(cells)
    names = _one_solution(path, first, [name for name, *_ in expressions])
    axisymmetric = len(axes) == 2 and any(_leaf(name) == "Br" for name in names)
    header = (*(("r", "z") if axisymmetric else AXES[: len(axes)]), *names)
    return Grid(path, header, first, np.stack([value.ravel() for value in values], axis=1))


def _blocks(lines: list[str], start: int) -> list[tuple[str, int, list[str]]]:
    """The blocks of rows between lines that begin with %: the name there, the first row's line, the rows."""
    blocks: list[tuple[str, int, list[str]]] = []
    name, fresh = "", True
    for number, line in enumerate(lines[start:], start=start + 1):
        text = line.strip()
        if text.startswith("%"):
            heading = text.lstrip("%").strip()
            name = heading if heading.lower() != "data" else (name if fresh else "")
            fresh = True
        elif text and fresh:
            blocks.append((name or "Data", number, [text]))
            fresh = False
        elif text:
            blocks[-1][2].append(text)
    return blocks


def _cells(path: Path, rows: list[str], line: int, name: str) -> Floats:
    """The numbers (rows, cells) of a block that begins on `line`; NaN is allowed."""
    delimiter = delimiter_of(rows[0])
    width = len(rows[0].split(delimiter))
    return Table(path, (name,) * width, line, rows, line, delimiter).numbers(range(width), range(width))


def _one_solution(path: Path, line: int, names: Sequence[str]) -> tuple[str, ...]:
    """The names without what COMSOL says after @; InputError if that differs among those of B."""
    parts = [[part.strip() for part in name.split(" @ ", 1)] for name in names]
    solutions = {at[0] for name, *at in parts if at and _leaf(name) in _COMPONENTS | _AXISYMMETRIC}
    if len(solutions) > 1:
        raise InputError(
            f"the file holds several solutions ({', '.join(map(quoted, sorted(solutions)))}): export one of them "
            f"[{path}: line {line}]"
        )
    return tuple(name for name, *_ in parts)


def _leaf(name: str) -> str:
    """Bx of `comp1.mf.Bx (T)`."""
    return split_unit(name)[0].rpartition(".")[2]


def _usual_columns(source: Table | Grid, length_unit: str) -> dict[str, str]:
    """Which columns hold coordinates and components of B."""
    axes = {name.lower(): name for name in source.header if name.lower() in ("x", "y", "z", "r")}
    axisymmetric = "r" in axes and "x" not in axes
    if axisymmetric:
        axes = {"x": axes["r"]} | ({"z": axes["z"]} if "z" in axes else {})
    found = {axis: f"{name} [{length_unit}]" for axis, name in axes.items() if axis != "r"}
    if axisymmetric:
        found["y"] = "=0 m"
    components = _AXISYMMETRIC if axisymmetric else _COMPONENTS
    found |= {
        components[_leaf(name)]: name
        for name in source.header
        if _leaf(name) in components and not name.startswith("-")
    }
    return found


def _length_unit(path: Path, heads: Sequence[str]) -> str:
    for line in heads:
        match = _ENTRY.fullmatch(line)
        if match and match[1].lower() == "length unit":
            return match[2].strip('" ,;')
    raise InputError(f"the line % Length unit is missing: export with the full header [{path}]")
