"""A field sampled for ParaView and whatever else reads VTK's files: regular grids (.vti) and points (.vtu).

Points outside the region, where the field makes no promise, carry zeros and `inside` = 0, never NaN: readers,
thresholds, contours and stream lines can take them all. `inside` is the array to threshold by.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field, as_points
from magfem.fields.region_parts import bounding_box, region_points
from magfem.files import write_bytes
from magfem.fitting.about import ascii_text, facts
from magfem.typing import ArrayLike, Points

LONGEST = 61
"""Points along a grid's longest edge, unless told otherwise."""

_MOST = 50_000_000  # points of a grid: 5 GB


def write_grid(field: Field, path: str | Path, bounds: ArrayLike | None = None, longest: int = LONGEST) -> Points:
    """Sample the field on a regular grid and write it to `path` (.vti); the points (n, 3) m, x fastest.

    Parameters
    ----------
    bounds : (2, 3) m, lowest and highest corner; None: the box around the field's region.
    longest : points along the longest edge; the spacing, as near to the same as the box allows, follows from it.

    The point data is `B` (3), `B_magnitude`, `gradient` (9, row by row: dBx_dx, dBx_dy, …), in T and T/m or, for a
    field per ampere, T/A and T/m/A, and `inside` (1 in the region, else 0, and then the others are 0).
    Raises InputError for bounds that are none, a region without any, or a place that cannot be written.
    """
    import pyvista

    box = bounding_box(field.region) if bounds is None else _checked_bounds(bounds)
    shape = grid_shape(box, longest)
    spacing = (box[1] - box[0]) / (np.array(shape) - 1)
    grid = pyvista.ImageData(dimensions=shape, spacing=spacing.tolist(), origin=box[0].tolist())
    points = np.asarray(grid.points, dtype=float)
    _write(field, points, grid, Path(path), ".vti")
    return points


def write_points(field: Field, path: str | Path, points: ArrayLike | None = None) -> Points:
    """Write the field at points (n, 3) m, as `write_grid` has it, to `path` (.vtu); the points.

    points: by default 2560 of the field's region, in a shell closer together where fields are steeper. Raises
    InputError for points that are none, or a region that gives none.
    """
    import pyvista

    chosen = region_points(field.region) if points is None else as_points(points).reshape(-1, 3)
    count = len(chosen)
    cells = np.column_stack([np.ones(count, dtype=np.int64), np.arange(count)]).ravel()
    cloud = pyvista.UnstructuredGrid(cells, np.full(count, pyvista.CellType.VERTEX), chosen)
    _write(field, chosen, cloud, Path(path), ".vtu")
    return chosen


def grid_shape(box: ArrayLike, longest: int) -> tuple[int, int, int]:
    """Points along x, y, z of a grid over a box (2, 3) m, `longest` along its longest edge."""
    if isinstance(longest, bool) or not isinstance(longest, int) or longest < 2:
        raise InputError(f"a grid needs 2 points or more along its longest edge, got {longest}")
    edges = np.subtract(*np.asarray(box)[::-1])
    cells = np.maximum(1, np.rint(edges / edges.max() * (longest - 1))).astype(int)
    shape = (int(cells[0]) + 1, int(cells[1]) + 1, int(cells[2]) + 1)
    if math.prod(shape) > _MOST:
        raise InputError(f"a grid of {' × '.join(map(str, shape))} points is too large: at most {_MOST:.0e} in all")
    return shape


def _checked_bounds(bounds: ArrayLike) -> Points:
    box = as_points(bounds)
    if box.shape != (2, 3) or not np.all(box[0] < box[1]):
        raise InputError("bounds are two corners of three coordinates in m, the lowest first")
    return box


def _write(field: Field, points: Points, mesh: Any, path: Path, ending: str) -> None:
    """Put the field's values on the points of `mesh` and write it."""
    if path.suffix.lower() != ending:
        raise InputError(f"expected a file that ends in {ending} [{path}]")
    inside = field.region.contains(points)
    B, gradient = np.zeros((len(points), 3)), np.zeros((len(points), 9))
    B[inside], slopes = field.jet(points[inside], 1)
    gradient[inside] = slopes.reshape(-1, 9)
    if not (np.isfinite(B).all() and np.isfinite(gradient).all()):
        raise InputError("the field is infinite at a point within its region: choose other bounds or points")
    mesh.point_data["B"] = B
    mesh.point_data["B_magnitude"] = np.linalg.norm(B, axis=1)
    mesh.point_data["gradient"] = gradient
    mesh.point_data["inside"] = inside.astype(np.uint8)
    mesh.set_active_vectors("B")
    for key, text in {**facts(field), "unit": field.unit}.items():
        mesh.field_data[key.replace(" ", "_")] = [ascii_text(text)]
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / f"draft{ending}"
        mesh.save(draft)
        write_bytes(path, draft.read_bytes())
