"""Grids and points for ParaView, read back by VTK's own readers, which are ParaView's."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchange.exchanged_fields import FIELDS, KINDS, POSE, SHELL, TermsField
from scipy.spatial.transform import RigidTransform, Rotation
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLUnstructuredGridReader

import magfem
from magfem.errors import InputError
from magfem.exchange import write_grid, write_points
from magfem.exchange.vtk_grid import grid_shape
from magfem.fields import Everywhere, Field, Shell
from magfem.fields.region import Intersection, PlacedRegion, Region
from magfem.fields.region_parts import bounding_box
from magfem.fields.workspace_region import Ball, Box

QUARTER = RigidTransform.from_rotation(Rotation.from_euler("z", 90, degrees=True))
BOUNDS = np.array([[-3e-3, -2e-3, 1.5e-3], [3e-3, 4e-3, 4.5e-3]])


@pytest.fixture(scope="module")
def ring() -> Field:
    return magfem.load_model("ring_magnet_4x1.5x1")


def read(path: Path) -> Any:
    reader = {".vti": vtkXMLImageDataReader, ".vtu": vtkXMLUnstructuredGridReader}[path.suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput()


def array(data: Any, name: str) -> np.ndarray:
    return vtk_to_numpy(data.GetPointData().GetArray(name))


def test_grid_holds_the_field_in_vtks_order(ring: Field, tmp_path: Path) -> None:
    """At index (i, j, k) of VTK's own numbering stand the values of the point there; x is fastest."""
    points = write_grid(ring, tmp_path / "ring.vti", BOUNDS, longest=13)
    data = read(tmp_path / "ring.vti")
    assert data.GetDimensions() == (13, 13, 7)
    assert np.allclose(data.GetBounds(), BOUNDS.T.ravel(), rtol=1e-14, atol=0)
    B, gradient = array(data, "B"), array(data, "gradient")
    assert B.shape == (13 * 13 * 7, 3) and gradient.shape == (13 * 13 * 7, 9)
    for i, j, k in ((0, 0, 0), (12, 0, 0), (0, 12, 0), (0, 0, 6), (4, 7, 2)):
        index = data.ComputePointId([i, j, k])
        where = BOUNDS[0] + 0.5e-3 * np.array([i, j, k])
        assert index == i + 13 * (j + 13 * k)
        assert np.allclose(data.GetPoint(index), where, rtol=0, atol=1e-15)
        assert np.allclose(points[index], where, rtol=0, atol=1e-15)
        assert np.allclose(B[index], ring.B(where), rtol=1e-12, atol=0)
        assert np.allclose(gradient[index].reshape(3, 3), ring.gradient(where), rtol=1e-9, atol=0)
    assert np.allclose(array(data, "B_magnitude"), np.linalg.norm(B, axis=1), rtol=1e-15, atol=0)
    assert np.all(array(data, "inside") == 1)


def test_gradient_is_the_slope_of_b_on_the_grid(ring: Field, tmp_path: Path) -> None:
    """VTK's own derivatives of B on a fine grid are the gradient's columns, whatever we believe of their order."""
    write_grid(ring, tmp_path / "ring.vti", [[1e-3, 1e-3, 2e-3], [1.2e-3, 1.2e-3, 2.2e-3]], longest=21)
    data = read(tmp_path / "ring.vti")
    spacing = data.GetSpacing()
    B = array(data, "B").reshape(21, 21, 21, 3)  # z, y, x
    gradient = array(data, "gradient").reshape(21, 21, 21, 3, 3)[10, 10, 10]
    for axis in range(3):
        slope = np.gradient(B, spacing[axis], axis=2 - axis)[10, 10, 10]
        assert np.allclose(gradient[:, axis], slope, rtol=1e-3, atol=1e-3 * np.abs(gradient).max())


def test_points_outside_are_marked_and_zero(ring: Field, tmp_path: Path) -> None:
    """The whole region, with the magnet in its midst."""
    points = write_grid(ring, tmp_path / "ring.vti", longest=31)
    data = read(tmp_path / "ring.vti")
    inside, B = array(data, "inside"), array(data, "B")
    assert np.allclose(data.GetBounds(), [-8e-3, 8e-3, -8e-3, 8e-3, -6.5e-3, 6.5e-3])
    expected = ring.region.contains(points)
    assert np.array_equal(inside, expected) and 0.3 < expected.mean() < 0.9
    for name in ("B", "gradient", "B_magnitude"):
        values = array(data, name)
        assert np.isfinite(values).all() and not values[inside == 0].any() and values[inside == 1].all(axis=-1).any()
    assert np.array_equal(B[inside == 1], ring.B(points[expected]))


def test_files_say_what_they_hold(ring: Field, tmp_path: Path) -> None:
    write_grid(ring, tmp_path / "ring.vti", longest=5)
    field_data = read(tmp_path / "ring.vti").GetFieldData()
    assert field_data.GetAbstractArray("name").GetValue(0) == ring.name.replace("×", "x")
    assert field_data.GetAbstractArray("unit").GetValue(0) == "T"
    write_grid(TermsField(KINDS["loops"], unit="T/A"), tmp_path / "coil.vti", longest=5)
    assert read(tmp_path / "coil.vti").GetFieldData().GetAbstractArray("unit").GetValue(0) == "T/A"


def test_points_of_the_region(ring: Field, tmp_path: Path) -> None:
    points = write_points(ring, tmp_path / "ring.vtu")
    data = read(tmp_path / "ring.vtu")
    assert data.GetNumberOfPoints() == data.GetNumberOfCells() == len(points) == 2560
    assert np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), points)
    assert np.array_equal(array(data, "B"), ring.B(points))
    assert np.array_equal(array(data, "gradient").reshape(-1, 3, 3), ring.gradient(points))
    assert np.all(array(data, "inside") == 1)


def test_points_of_a_placed_region_are_its_own(tmp_path: Path) -> None:
    placed = TermsField(KINDS["loops"]).at(POSE)
    points = write_points(placed, tmp_path / "placed.vtu")
    assert placed.region.contains(points).all() and not SHELL.contains(points).all()


def test_points_of_a_users_own(ring: Field, tmp_path: Path) -> None:
    chosen = np.array([[0, 0, 3e-3], [0, 0, 0.1]])
    write_points(ring, tmp_path / "two.vtu", chosen)
    data = read(tmp_path / "two.vtu")
    assert np.array_equal(array(data, "B"), [ring.B(chosen[0]), [0, 0, 0]])
    assert array(data, "inside").tolist() == [1, 0]


@pytest.mark.parametrize("name", FIELDS)
def test_every_kind_is_sampled(name: str, tmp_path: Path) -> None:
    points = write_grid(FIELDS[name], tmp_path / "field.vti", BOUNDS, longest=6)
    values = FIELDS[name].B(points, outside="nan")
    assert np.array_equal(array(read(tmp_path / "field.vti"), "B"), np.nan_to_num(values))


def test_box_of_a_placed_region_holds_it() -> None:
    placed = TermsField(KINDS["loops"]).at(POSE)
    low, high = bounding_box(placed.region)
    points = POSE.apply(SHELL.layers(np.random.default_rng(6)).reshape(-1, 3))
    assert np.all(points >= low) and np.all(points <= high)
    both = placed + TermsField(KINDS["loops"])
    smaller = bounding_box(both.region)
    assert np.all(smaller[0] >= low) and np.all(smaller[1] <= high)
    points = points[both.region.contains(points)]
    assert len(points) > 100 and np.all(points >= smaller[0]) and np.all(points <= smaller[1])


FRONT = Shell(SHELL.hull, 0.5e-3, 6e-3, z=(1e-3, 6e-3), rho=(0.0, 5e-3))
BALL, BOX = Ball((1e-3, -0.5e-3, 2e-3), 5e-3), Box((-3e-3, -4e-3, 0.5e-3), (5e-3, 2e-3, 6e-3))


@pytest.mark.parametrize(
    ("region", "expected"),
    [
        (FRONT, [[-5e-3, -5e-3, 1e-3], [5e-3, 5e-3, 6e-3]]),
        (Shell(SHELL.hull, 0.0, 6e-3, z=(-math.inf, 2e-3)), [[-8e-3, -8e-3, -6.5e-3], [8e-3, 8e-3, 2e-3]]),
        (BALL, [[-4e-3, -5.5e-3, -3e-3], [6e-3, 4.5e-3, 7e-3]]),
        (
            PlacedRegion(BALL, RigidTransform.from_translation([1e-3, 2e-3, 3e-3])),
            [[-3e-3, -3.5e-3, 0], [7e-3, 6.5e-3, 1e-2]],
        ),
        (PlacedRegion(BALL, QUARTER), [[-4.5e-3, -4e-3, -3e-3], [5.5e-3, 6e-3, 7e-3]]),
        (BOX, [[-3e-3, -4e-3, 0.5e-3], [5e-3, 2e-3, 6e-3]]),
        (PlacedRegion(BOX, QUARTER), [[-2e-3, -3e-3, 0.5e-3], [4e-3, 5e-3, 6e-3]]),
        (Intersection((FRONT, BOX)), [[-3e-3, -4e-3, 1e-3], [5e-3, 2e-3, 6e-3]]),
    ],
)
def test_boxes_of_windows_balls_and_boxes(region: Region, expected: list[list[float]]) -> None:
    """By hand; a quarter turn about z takes (x, y) to (−y, x)."""
    assert np.allclose(bounding_box(region), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    "region", [FRONT, BALL, BOX, Intersection((FRONT, PlacedRegion(BALL, POSE))), Intersection((BALL, BOX))]
)
@pytest.mark.parametrize("pose", [RigidTransform.identity(), POSE], ids=["as it is", "placed"])
def test_points_of_every_region_lie_in_it(region: Region, pose: RigidTransform, tmp_path: Path) -> None:
    """All of them, also after a way through the file, and within the bounding box; they come near to its ends."""
    model = TermsField(KINDS["uniform"], PlacedRegion(region, pose))
    write_points(model, tmp_path / "points.vtu")
    data = read(tmp_path / "points.vtu")
    points = vtk_to_numpy(data.GetPoints().GetData())
    assert len(points) == len(np.unique(points, axis=0)) == 2560
    assert np.all(array(data, "inside") == 1) and model.region.contains(points).all()
    low, high = bounding_box(model.region)
    assert np.all(points >= low - 1e-12) and np.all(points <= high + 1e-12)
    if not isinstance(region, Intersection) and pose is not POSE:
        assert np.all(points.min(axis=0) < low + 0.1 * (high - low))
        assert np.all(points.max(axis=0) > high - 0.1 * (high - low))


def test_a_grid_of_a_window_fills_it(tmp_path: Path) -> None:
    """The share of the grid's points that are inside is the share of the volume: a cylinder's in its box, π/4."""
    tube = Shell(SHELL.hull, 0.5e-3, 1.0, z=(2e-3, 4e-3), rho=(0.0, 3e-3))
    points = write_grid(TermsField(KINDS["loops"], tube), tmp_path / "tube.vti", longest=101)
    inside = array(read(tmp_path / "tube.vti"), "inside")
    assert np.array_equal(inside, tube.contains(points))
    assert inside.mean() == pytest.approx(np.pi / 4, rel=0.03)  # of cells; the outermost points count in full


def test_shapes_follow_the_box() -> None:
    assert grid_shape([[0, 0, 0], [2, 1, 0.5]], 21) == (21, 11, 6)
    assert grid_shape([[0, 0, 0], [1, 1, 1e-9]], 3) == (3, 3, 2)


NOWHERE = Shell(SHELL.hull, 0.5e-3, 6e-3, z=(8e-3, 9e-3))
APART = Intersection((BALL, PlacedRegion(BOX, RigidTransform.from_translation([0.1, 0, 0]))))


def test_what_cannot_be_sampled(ring: Field, tmp_path: Path) -> None:
    path = tmp_path / "field.vti"
    for call, words in (
        (lambda: write_grid(ring, path, [[0, 0, 0], [1, 0, 1]]), "lowest first"),
        (lambda: write_grid(ring, path, [0, 0, 0]), "two corners"),
        (lambda: write_grid(ring, path, longest=1), "2 points or more"),
        (lambda: write_grid(ring, path, longest=5000), "too large"),
        (lambda: write_grid(ring, tmp_path / "field.vtk"), "ends in .vti"),
        (lambda: write_points(ring, tmp_path / "field.vtk"), "ends in .vtu"),
        (lambda: write_grid(TermsField(KINDS["loops"], Everywhere()), path), "bounds"),
        (lambda: write_points(TermsField(KINDS["loops"], Everywhere()), tmp_path / "f.vtu"), "say which"),
        (lambda: write_grid(TermsField(KINDS["loops"], NOWHERE), path), "empty"),
        (lambda: write_grid(TermsField(KINDS["loops"], APART), path), "empty"),
        (lambda: write_points(TermsField(KINDS["loops"], NOWHERE), tmp_path / "f.vtu"), "hardly any point"),
        (lambda: write_points(TermsField(KINDS["loops"], APART), tmp_path / "f.vtu"), "hardly any point"),
        (lambda: write_grid(ring, tmp_path / "nowhere" / "field.vti", longest=5), "cannot write"),
    ):
        with pytest.raises(InputError, match=words):
            call()
    centre = TermsField(KINDS["axial harmonics"], Everywhere())
    with pytest.raises(InputError, match="infinite"):
        write_grid(centre, path, [[-1e-3] * 3, [1e-3] * 3], longest=3)
    assert not list(tmp_path.iterdir())
