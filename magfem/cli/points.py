"""Points and fields as CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from magfem.samples.columns import find_column, missing
from magfem.samples.samples import AXES
from magfem.samples.table import parse_table, read_text, table_text
from magfem.typing import Floats, Points


def read_points(path: Path) -> Points:
    """Points (n, 3) m of a file with the columns x, y, z in m, or x_mm and so on; other columns are ignored.

    Raises InputError that names file, line and column.
    """
    table = parse_table(path, read_text(path))
    columns = []
    for axis in AXES:
        column = find_column(table, axis, ["length"])
        if column is None or column.index is None:
            raise missing(table, axis, "the header x,y,z (m) or x_mm,y_mm,z_mm")
        columns.append((column, column.index))
    cells = table.numbers([index for _, index in columns])
    return np.stack([column.in_si(cells[:, k]) for k, (column, _) in enumerate(columns)], axis=1)


def field_text(points: Points, B: Floats, gradient: Floats | None = None) -> str:
    """CSV of points (n, 3) m, B (n, 3) and, if given, gradient (n, 3, 3) row by row; every bit is kept."""
    header = [*AXES, *(f"B{axis}" for axis in AXES)]
    values = [points, B]
    if gradient is not None:
        header += [f"dB{i}_d{j}" for i in AXES for j in AXES]
        values.append(gradient)
    return table_text(header, values)
