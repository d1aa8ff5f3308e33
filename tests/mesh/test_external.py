"""Bodies from external meshes, meshed in air: the same field as the shapes they stand for."""

from __future__ import annotations

import itertools
from dataclasses import replace

import meshio
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from magfem.constants import MU_0
from magfem.fem import scalar_potential
from magfem.fem.stiffness import assemble
from magfem.fields.norms import relative_errors
from magfem.fields.uniform_block import block_jet
from magfem.geometry import load_geometry
from magfem.geometry.body_surfaces import BodySurfaces
from magfem.mesh.export import write_mesh
from magfem.mesh.external import BALL, mesh_in_air
from magfem.mesh.generate import generate
from magfem.mesh.session import gmsh_session

MILLI = 1e-3


def block(size, centre=(0.0, 0.0, 0.0), inside_out=False):
    """Corners and twelve triangles of a block."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    hull = ConvexHull(corners)
    outward = np.cross(corners[hull.simplices[:, 1]] - corners[hull.simplices[:, 0]],
                       corners[hull.simplices[:, 2]] - corners[hull.simplices[:, 0]])  # fmt: skip
    turn = (np.einsum("fi,fi->f", outward, hull.equations[:, :3]) < 0) != inside_out
    facets = np.where(turn[:, None], hull.simplices[:, [0, 2, 1]], hull.simplices)
    return corners * np.array(size) + np.array(centre), facets.astype(np.int64)


def surfaces_of(*blocks, names=None):
    """Bodies that do not touch; each is a list of blocks."""
    points, facets, inner, count = [], [], [], 0
    for index, parts in enumerate(blocks):
        for corners, triangles in parts:
            points.append(corners)
            facets.append(triangles + count)
            inner.append(np.full(len(triangles), index))
            count += len(corners)
    names = names or tuple(f"body{n}" for n in range(len(blocks)))
    owner = np.concatenate(inner)
    return BodySurfaces.flat(names, np.vstack(points), np.vstack(facets), owner, np.full(len(owner), -1))


def volumes(mesh):
    one = np.ones(len(mesh.cells))
    _, _, volume = assemble(mesh, one, np.zeros((one.size, 3)))
    return np.array([volume[mesh.body == index].sum() for index in range(-1, len(mesh.names))])


def layers(reach):
    """Points (3, 200, 3) m around the origin, at 1.3, 2 and 3 times `reach`."""
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(3, 200, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return directions * reach * np.array([1.3, 2.0, 3.0])[:, None, None]


@pytest.fixture(scope="module")
def cube():
    return surfaces_of([block((2 * MILLI,) * 3)])


def test_cube_has_the_field_of_the_closed_form(cube):
    """At recoil permeability 1 the currents are those of the facets: twelve of them make an exact cube."""
    mesh = mesh_in_air(cube, 1 * MILLI, np.sqrt(3) * MILLI, 0.5)
    magnetisation = np.array([0.3, -0.2, 1.0]) / MU_0
    solved = scalar_potential.solve(mesh, np.ones(1), magnetisation[None])
    assert solved.volume[0] == pytest.approx(8e-9, rel=1e-12, abs=0)
    points = layers(np.sqrt(3) * MILLI)
    exact = block_jet(points.reshape(-1, 3), np.full(3, 2 * MILLI), magnetisation, 1)
    found = solved.currents.jet(points.reshape(-1, 3), 1)
    for one, other in zip(found, exact, strict=True):
        assert np.abs(one - other).max() <= 1e-6 * np.abs(other).max()


def test_two_resolutions_close_in_at_recoil_permeability_above_one(cube):
    """Each doubling of the resolution changes the field by less."""
    fields = []
    points = layers(np.sqrt(3) * MILLI)
    for resolution in (0.25, 0.5, 1.0):
        mesh = mesh_in_air(cube, 1 * MILLI, np.sqrt(3) * MILLI, resolution)
        solved = scalar_potential.solve(mesh, np.full(1, 1.5), np.array([[0, 0, 1 / MU_0]]))
        fields.append(solved.currents.jet(points.reshape(-1, 3), 0)[0].reshape(points.shape))
    first, second = (relative_errors(a, b).max() for a, b in itertools.pairwise(fields))
    assert second < first and second < 2e-3


def test_regions_nested_in_each_other_are_told_apart(cube):
    """A box with a cavity, a block in the cavity, and a block beside: four separate regions of body and air."""
    box = [block((8, 8, 8)), block((6, 6, 6), inside_out=True)]
    nested = surfaces_of(box, [block((3, 3, 3))], [block((2, 2, 2), (7, 0, 0))])
    nested = replace(nested, points=nested.points * MILLI)
    nested.check()
    nested.check_apart()
    mesh = mesh_in_air(nested, 2 * MILLI, 10 * MILLI, 0.5)
    found = volumes(mesh)
    assert found[1:] == pytest.approx(np.array([512 - 216, 27, 8]) * 1e-9, rel=1e-12, abs=0)
    assert found.sum() == pytest.approx(4 / 3 * np.pi * (10 * MILLI * BALL) ** 3, rel=1e-3)
    outer = np.linalg.norm(mesh.points[mesh.outer_facets], axis=-1)
    assert np.allclose(outer, mesh.radius, rtol=1e-9, atol=0)


@pytest.fixture(scope="module")
def ring():
    return load_geometry("ring_magnet_4x1.5x1")


@pytest.fixture(scope="module")
def ring_field(ring):
    return solved_jet(generate(ring, 3, 0.5), ring, layers(2.1 * MILLI))


def solved_jet(mesh, device, points):
    material = device.bodies[0].material
    solved = scalar_potential.solve(
        mesh, np.array([material.recoil_permeability]), material.remanence_vector[None] / MU_0
    )
    B, gradient = solved.currents.jet(points.reshape(-1, 3), 1)
    return B.reshape(points.shape), gradient.reshape(*points.shape, 3)


def ring_mesh(ring, path, order, dimension=3):
    """The ring by Gmsh, in mm, with the physical group `rotor`, as another program would give it."""
    with gmsh_session() as gmsh:
        tags = ring.build(gmsh.model.occ)["magnet"]
        gmsh.model.occ.dilate([(3, tag) for tag in tags], 0, 0, 0, 1000, 1000, 1000)
        gmsh.model.occ.synchronize()
        if dimension == 3:
            gmsh.model.addPhysicalGroup(3, tags, name="rotor")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
        gmsh.model.mesh.generate(dimension)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    return path


def card_of(path, name):
    card = path.parent / "card.toml"
    card.write_text(
        f'kind = "meshed_magnets"\n[mesh]\nfile = "{path.name}"\nunit = "mm"\n[bodies.{name}]\nremanence = "1.35 T"\n'
        'recoil_permeability = 1.05\nmagnetisation = "axial"\n'
    )
    return load_geometry(card)


@pytest.mark.parametrize(
    ("file", "order", "volume", "field"),
    [("ring.msh", 2, 1e-4, 1e-3), ("ring.msh", 1, 1e-3, 4e-3), ("ring.stl", 1, 1e-3, 4e-3)],
)
def test_ring_has_the_field_of_its_card(ring, ring_field, tmp_path, file, order, volume, field):
    """Within the volume that flat facets cut off; curved ones cut off next to nothing."""
    path = ring_mesh(ring, tmp_path / file, order, 2 if file.endswith("stl") else 3)
    meshed = card_of(path, "rotor")
    assert meshed.volume == pytest.approx(ring.volume, rel=volume)
    mesh = mesh_in_air(meshed.surfaces, meshed.feature_size, meshed.hull.radius, 0.5)
    assert volumes(mesh)[1] == pytest.approx(meshed.volume, rel=1e-9, abs=0)
    B, _ = solved_jet(mesh, meshed, layers(2.1 * MILLI))
    lost = abs(meshed.volume / ring.volume - 1)
    assert relative_errors(B, ring_field[0]).max() < 2 * lost + field


@pytest.mark.parametrize("file", ["ring.msh", "ring.vtu", "ring.vtk", "ring.xdmf", "ring.med", "ring.inp", "ring.dat"])
def test_written_meshes_read_back_with_their_names(ring, tmp_path, file):
    mesh = generate(ring, 3, 0.5)
    write_mesh(mesh, tmp_path / file)
    card = card_of(tmp_path / file, "magnet")
    text = (tmp_path / "card.toml").read_text().replace('"mm"', '"m"')
    (tmp_path / "card.toml").write_text(text)
    card = load_geometry(tmp_path / "card.toml")
    curved = meshio.read(tmp_path / file, file_format="gmsh" if file.endswith("msh") else None).cells[0].type
    assert card.volume == pytest.approx(ring.volume, rel=1e-4 if curved == "tetra10" else 1e-2)
    assert card.surfaces.names == ("magnet",)
