"""Meshes: volumes, closed surfaces, orientation, files."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

from magfem.errors import InputError, MeshError
from magfem.fem.stiffness import assemble
from magfem.geometry import load_geometry
from magfem.mesh.export import write_mesh
from magfem.mesh.generate import BALL, generate
from magfem.mesh.mesh import check_volumes


@pytest.fixture(scope="module")
def ring():
    return load_geometry("ring_magnet_4x1.5x1")


@pytest.fixture(scope="module")
def ball(ring):
    return generate(ring, 3, 0.5)


@pytest.fixture(scope="module")
def disc(ring):
    return generate(ring, 2, 0.5)


def test_volumes_are_those_of_body_and_ball(ring, ball):
    one = np.ones(ball.cells.shape[0])
    _, _, volume = assemble(ball, one, np.zeros((one.size, 3)))
    assert volume[ball.body == 0].sum() == pytest.approx(ring.volume, rel=1e-4)
    assert volume.sum() == pytest.approx(4 / 3 * np.pi * (BALL * ring.hull.radius) ** 3, rel=1e-3)


def test_body_surface_is_closed_and_outward(ring, ball):
    """∮ n dS = 0 and ∮ x·n dS = 3V over the oriented facets (corners' triangles suffice for the first)."""
    facets, owner = ball.body_facets(0)
    a, b, c = (ball.points[facets[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a) / 2
    assert np.abs(normal.sum(axis=0)).max() <= 1e-12 * np.abs(normal).sum()
    assert np.sum(normal * (a + b + c) / 3) == pytest.approx(3 * ring.volume, rel=2e-2)
    assert np.all(ball.body[owner] == 0)


def test_outer_nodes_lie_on_the_sphere(ball, disc):
    for mesh in (ball, disc):
        distance = np.linalg.norm(mesh.points[mesh.outer_facets], axis=-1)
        assert np.allclose(distance, mesh.radius, rtol=1e-9, atol=0)


def test_meridian_edges_run_counter_clockwise(ring, disc):
    """∮ ρ² dz over the body's boundary, travelled with the body on the left, is its volume over π."""
    facets, _ = disc.body_facets(0)
    start, end = disc.points[facets[:, 0]], disc.points[facets[:, 1]]
    middle = disc.points[facets[:, 2]]
    rho2 = (start[:, 0] ** 2 + 4 * middle[:, 0] ** 2 + end[:, 0] ** 2) / 6  # Simpson, exact here
    assert np.pi * np.sum(rho2 * (end[:, 1] - start[:, 1])) == pytest.approx(ring.volume, rel=1e-12, abs=0)


def test_same_geometry_same_mesh(ring, ball):
    again = generate(ring, 3, 0.5)
    assert np.array_equal(again.points, ball.points) and np.array_equal(again.cells, ball.cells)


def test_every_node_belongs_to_an_element(ball, disc):
    for mesh in (ball, disc):
        assert np.array_equal(np.unique(mesh.cells), np.arange(len(mesh.points)))


@pytest.mark.parametrize("ending", [".vtu", ".msh", ".xdmf", ".vtk"])
def test_files_read_back_with_bodies(ball, tmp_path, ending):
    path = tmp_path / f"ring{ending}"
    write_mesh(ball, path)
    content = meshio.read(path)
    assert content.cells[0].type == "tetra10"
    assert np.array_equal(np.concatenate(content.cell_data["body"]).ravel(), ball.body)
    assert np.allclose(content.points, ball.points)
    assert not list(tmp_path.glob(".*"))


def test_unknown_ending_is_refused(ball, tmp_path):
    with pytest.raises(InputError, match="ending"):
        write_mesh(ball, tmp_path / "ring.docx")
    with pytest.raises(InputError, match="no folder"):
        write_mesh(ball, tmp_path / "nowhere" / "ring.vtu")


def test_lost_volume_is_an_error():
    with pytest.raises(MeshError, match="'magnet'"):
        check_volumes(np.array([0.99]), np.array([1.0]), ("magnet",), 1e-3)
    with pytest.raises(MeshError):
        check_volumes(np.array([np.nan]), np.array([1.0]), ("magnet",), 1e-3)
