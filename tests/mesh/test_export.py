"""Mesh files: every ending of meshio writes what can be read again, or is refused in one line."""

from __future__ import annotations

import warnings

import meshio
import numpy as np
import pytest

from magfem.errors import InputError
from magfem.mesh.export import FORMATS, write_cells, write_mesh
from magfem.mesh.mesh import Mesh

_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


@pytest.fixture(scope="module")
def two_tetrahedra():
    """A body called `rotor` and a tetrahedron of air on its back."""
    points = [np.array(p, dtype=float) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1))]
    cells, middles = [], {}
    for corners in ((0, 1, 2, 3), (1, 2, 3, 4)):
        row = list(corners)
        for i, j in _EDGES:
            key = (min(corners[i], corners[j]), max(corners[i], corners[j]))
            if key not in middles:
                middles[key] = len(points)
                points.append((points[key[0]] + points[key[1]]) / 2)
            row.append(middles[key])
        cells.append(row)
    return Mesh(np.array(points), np.array(cells), np.array([0, -1]), ("rotor",), 2.0)


def reads(path, ending):
    with warnings.catch_warnings(action="ignore"):  # meshio reads the length of a binary STL from an ASCII one
        return meshio.read(path, file_format="gmsh" if ending == ".msh" else None)


@pytest.mark.parametrize("ending", sorted(meshio.extension_to_filetypes))
def test_every_ending_reads_back_or_is_refused(two_tetrahedra, tmp_path, ending):
    path = tmp_path / f"part{ending}"
    try:
        write_mesh(two_tetrahedra, path)
    except InputError as error:
        assert "\n" not in str(error) and ending in str(error) and ".vtu" in str(error)
        assert not list(tmp_path.iterdir())
        return
    content = reads(path, ending)
    (block,) = [block for block in content.cells if block.type.startswith("tetra")]
    assert block.type == ("tetra10" if "tetra10" in FORMATS[ending].cells else "tetra")
    corners = two_tetrahedra.points[two_tetrahedra.cells[:, :4]]
    assert np.allclose(content.points[block.data[:, :4]], corners)
    if block.type == "tetra10":
        assert np.allclose(content.points[block.data], two_tetrahedra.points[two_tetrahedra.cells])


@pytest.mark.parametrize("kind", ["triangle", "quad"])
@pytest.mark.parametrize("ending", sorted(FORMATS))
def test_surfaces_read_back_or_are_refused(tmp_path, kind, ending):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0.0]])
    cells = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5]] if kind == "triangle" else [[0, 1, 2, 3], [1, 4, 5, 2]])
    path = tmp_path / f"coil{ending}"
    try:
        write_cells(path, points, {kind: cells}, {kind: np.zeros(len(cells), dtype=int)}, ("coil",))
    except InputError as error:
        assert ending in str(error)
        return
    content = reads(path, ending)
    found = np.concatenate([block.data for block in content.cells if block.type == kind])
    assert np.allclose(content.points[found][..., :2], points[cells][..., :2])


def test_data_goes_along_where_the_format_keeps_it(two_tetrahedra, tmp_path, caplog):
    B = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0]])
    write_mesh(two_tetrahedra, tmp_path / "part.vtu", cell_data={"B": B})
    assert np.array_equal(meshio.read(tmp_path / "part.vtu").cell_data["B"][0], B)
    with caplog.at_level("WARNING", "magfem"):
        write_mesh(two_tetrahedra, tmp_path / "part.mesh", cell_data={"B": B})
    assert "straight" in caplog.text and "left out: B" in caplog.text
