"""Points and fields as CSV files."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from magfem.errors import InputError
from magfem.typing import Floats, Points
from magfem.units import quantity, quoted

AXES = ("x", "y", "z")


def read_points(path: Path) -> Points:
    """Points (n, 3) m of a file with the columns x, y, z in m, or x_mm and so on; other columns are ignored.

    Raises InputError that names file, line and column.
    """
    rows = csv.reader(io.StringIO(_text(path), newline=""), strict=True)
    try:
        header = [cell.strip() for cell in next(rows, [])]
        columns = [_column(path, header, axis) for axis in AXES]
        coordinates = [
            [_number(path, rows.line_num, header[index], row[index]) * scale for index, scale in columns]
            for row in _full_rows(path, rows, len(header))
        ]
    except csv.Error as error:
        raise InputError(f"not valid CSV: {error} [{path}: line {rows.line_num}]") from None
    return np.array(coordinates, dtype=float).reshape(-1, 3)


def field_text(points: Points, B: Floats, gradient: Floats | None = None) -> str:
    """CSV of points (n, 3) m, B (n, 3) and, if given, gradient (n, 3, 3) row by row; every bit is kept."""
    header = [*AXES, *(f"B{axis}" for axis in AXES)]
    values = [points, B]
    if gradient is not None:
        header += [f"dB{i}_d{j}" for i in AXES for j in AXES]
        values.append(gradient.reshape(-1, 9))
    lines = [",".join(map(repr, row)) for row in np.hstack(values).tolist()]
    return "\n".join([",".join(header), *lines, ""])


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"no such file [{path}]") from None
    except IsADirectoryError:
        raise InputError(f"expected a CSV file, got a directory [{path}]") from None
    except UnicodeDecodeError:
        raise InputError(f"not UTF-8 text [{path}]") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error} [{path}]") from None


def _column(path: Path, header: Sequence[str], axis: str) -> tuple[int, float]:
    """Where a coordinate stands, and the metres in one of its units."""
    found = [name for name in header if name == axis or name.startswith(f"{axis}_")]
    where = f"[{path}: line 1]"
    if not found:
        got = quoted(",".join(header)) if header else "an empty file"
        raise InputError(
            f"column {axis} is missing: expected the header x,y,z (m) or x_mm,y_mm,z_mm, got {got} {where}"
        )
    if len(found) > 1:
        raise InputError(f"column {axis} is there {len(found)} times: {', '.join(map(quoted, found))} {where}")
    _, _, unit = found[0].partition("_")
    try:
        scale = quantity(f"1 {unit}", "length") if unit else 1.0
    except InputError:
        raise InputError(f"column {quoted(found[0])} does not end in a unit of length such as mm {where}") from None
    return header.index(found[0]), scale


def _full_rows(path: Path, rows: Iterator[list[str]], width: int) -> Iterator[list[str]]:
    """The rows that are not blank, each as wide as the header."""
    for row in rows:
        if len(row) == width:
            yield row
        elif any(cell.strip() for cell in row):
            line = rows.line_num  # type: ignore[attr-defined]
            raise InputError(f"expected {width} cells as in the header, got {len(row)} [{path}: line {line}]")


def _number(path: Path, line: int, column: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"expected a finite number, got {quoted(cell)} [{path}: line {line}, column {column}]")
    return value
