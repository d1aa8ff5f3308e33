"""The potential on surfaces from its sources: against closed forms of a sphere and of charged rectangles."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from fem.sphere_device import Sphere

from magfem.fem.surface_potential import surface_potential
from magfem.geometry import BlockMagnet, HalbachArray, PermanentMagnet
from magfem.mesh import generate as generation
from magfem.mesh.generate import generate
from magfem.mesh.mesh import Mesh
from magfem.mesh.sizes import Sizes, Wanted
from magfem.typing import Floats, Points


def surfaces(mesh: Mesh, magnetisation: Floats, susceptibility: float) -> tuple[Floats, Floats, Floats]:
    facets = [mesh.body_facets(index)[0] for index in range(len(mesh.names))]
    nodes = np.concatenate(facets)
    return nodes, np.broadcast_to(magnetisation, (len(nodes), 3)), np.full(len(nodes), susceptibility)


def rms(values: Floats) -> float:
    """Root-mean-square: the mesh of a sphere has a few slivers at its poles, of whose nodes nothing is claimed."""
    return float(np.sqrt(np.mean(values**2)))


@pytest.fixture(scope="module")
def ball() -> Mesh:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generation, "element_sizes", lambda *_: Wanted({"magnet": Sizes(0.15, 0.15)}, 0.4))
        return generate(Sphere(permeability=3.0), 3)  # type: ignore[arg-type]


@pytest.mark.parametrize("chi", [0.05, 2.0])
def test_the_solution_is_kept(ball: Mesh, chi: float) -> None:
    """φ of the magnetised sphere in closed form goes in and comes out."""
    truth = Sphere(permeability=1 + chi).potential(ball.points)
    facets, M, susceptibility = surfaces(ball, np.array([0, 0, 1.0]), chi)
    found = surface_potential(ball.points, facets, truth, M, susceptibility)
    assert rms(found[np.unique(facets)] - truth[np.unique(facets)]) <= 5e-5 * truth.max()


@pytest.mark.parametrize("degree", [1, 2])
def test_errors_shrink_by_the_spectrum_of_the_sphere(ball: Mesh, degree: int) -> None:
    """On a sphere an error that is a harmonic of degree l comes out times −χ/((2 + χ)(2l + 1)), sign turned.

    The dipole layer's own value on the wall is −Y/(2(2l + 1)): jump relations of r^l Y and Y/r^(l + 1).
    """
    chi = 0.5
    x, _, z = ball.points.T
    error = z if degree == 1 else x * z
    facets, M, susceptibility = surfaces(ball, np.zeros(3), chi)
    found = surface_potential(ball.points, facets, error, M, susceptibility)
    wall = np.unique(facets)
    expected = chi / ((2 + chi) * (2 * degree + 1)) * error[wall]
    assert rms(found[wall] - expected) <= 5e-5 * np.abs(error[wall]).max()


def test_rigid_part_is_exact_along_rims_and_faces_that_touch() -> None:
    """Two touching blocks magnetised along z, without reaction: the potential of two charged rectangles."""
    size = (2.0, 1.0, 0.8)
    rigid = PermanentMagnet(1.0, 1.0)
    for magnets in (
        BlockMagnet(size=size, material=rigid),
        HalbachArray(size=(size[0] / 2, *size[1:]), count=2, step=0.0, material=rigid),
    ):
        mesh = generate(magnets, 3, 0.5)
        facets, M, susceptibility = surfaces(mesh, np.array([0, 0, 1.0]), 1e-13)  # so little that nothing reacts
        found = surface_potential(mesh.points, facets, np.zeros(len(mesh.points)), M, susceptibility)
        wall = np.unique(facets[np.abs(mesh.points[facets[:, :3], 0]).min(axis=1) > 1e-9])
        points = mesh.points[wall] + 1e-9  # off the planes of the faces, where the formula is 0·∞
        truth = sum(sign * rectangle(points - [0, 0, sign * size[2] / 2], size[0], size[1]) for sign in (1, -1))
        assert np.abs(found[wall] - truth).max() <= 1e-4 * np.abs(truth).max()


def rectangle(points: Points, width: float, depth: float) -> Floats:
    """1/4π ∫ dS/r over a rectangle about the origin in the plane z = 0 (Durand, Électrostatique I, 1964)."""
    total: Floats = np.zeros(len(points))
    for i, j in product((1, -1), repeat=2):
        x, y, z = i * width / 2 - points[:, 0], j * depth / 2 - points[:, 1], points[:, 2]
        r = np.sqrt(x**2 + y**2 + z**2)
        # arcsinh in place of ln(y + r): they differ by what cancels between the corners
        total += i * j * (x * np.arcsinh(y / np.hypot(x, z)) + y * np.arcsinh(x / np.hypot(y, z)))
        total -= i * j * np.abs(z) * np.arctan2(x * y, np.abs(z) * r)
    return total / (4 * np.pi)
