"""The 3D formulation on a sphere, whose reaction field is known: orders of convergence and the open boundary."""

from __future__ import annotations

import numpy as np
import pytest
from fem.sphere_device import Sphere

from magfem.fem import scalar_potential
from magfem.mesh import generate as generation
from magfem.mesh.generate import generate
from magfem.mesh.shape_functions import tetrahedron_rule
from magfem.mesh.sizes import Sizes, Wanted


def solve(sphere, size, monkeypatch, ball=1.35):
    monkeypatch.setattr(generation, "element_sizes", lambda *_: Wanted({"magnet": Sizes(size, size)}, size))
    monkeypatch.setattr(generation, "BALL", ball)
    mesh = generate(sphere, 3)
    magnetisation = np.array([[0.0, 0.0, 1.0]])
    return scalar_potential.solve(mesh, np.array([sphere.permeability]), magnetisation)


def potential_error(discrete, sphere):
    """Root-mean-square error of φ over the ball, by quadrature inside every element."""
    local, weights = tetrahedron_rule(4)
    first = 1 - local.sum(axis=1)
    L = np.column_stack([first, local])
    shapes = np.hstack([L * (2 * L - 1), 4 * L[:, [0, 1, 0, 0, 1, 2]] * L[:, [1, 2, 2, 3, 3, 3]]])
    mesh = discrete.mesh
    points = np.einsum("qa,eai->eqi", shapes, mesh.points[mesh.cells])
    found = np.einsum("qa,ea->eq", shapes, discrete.potential[mesh.cells])
    corners = mesh.points[mesh.cells[:, :4]]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    return np.sqrt(np.sum((found - sphere.potential(points)) ** 2 * weights * volume[:, None]))


def test_potential_converges_with_order_three(monkeypatch):
    sphere = Sphere(permeability=3.0)
    sizes = np.array([0.5, 0.35, 0.25])
    errors = [potential_error(solve(sphere, size, monkeypatch), sphere) for size in sizes]
    order = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert 2.6 <= order <= 4.0


def test_exterior_field_converges_faster_than_the_potential(monkeypatch):
    """The integrated sources converge with the order of a functional, not of a derivative."""
    sphere = Sphere(permeability=3.0)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200, 3))
    points *= (1.5 + rng.random((200, 1))) / np.linalg.norm(points, axis=1, keepdims=True)
    sizes, errors = np.array([0.5, 0.35, 0.25, 0.18]), []
    for size in sizes:
        B = solve(sphere, size, monkeypatch).currents.jet(points, 0)[0]
        truth = sphere.B(points)
        errors.append(np.max(np.linalg.norm(B - truth, axis=1) / np.linalg.norm(truth, axis=1)))
    order = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert 3.0 <= order <= 6.0
    assert errors[-1] <= 2e-4


@pytest.mark.parametrize("ball", [1.25, 1.6])
def test_open_boundary_takes_an_eccentric_source(ball, monkeypatch):
    """Off its centre the ball sees every degree of harmonics: an inexact boundary would show at once."""
    sphere = Sphere(permeability=3.0, offset=(0.2, -0.1, 0.15))
    discrete = solve(sphere, 0.18, monkeypatch, ball)
    points = sphere.offset + 1.2 * np.eye(3)
    assert np.allclose(discrete.currents.jet(points, 0)[0], sphere.B(points), rtol=0, atol=5e-4 * 2e-7)
    assert np.linalg.norm(np.array(discrete.quantities["boundary_moment"]) - [0, 0, sphere.moment]) <= 3e-4 * (
        sphere.moment
    )


def test_field_inside_the_sphere_is_uniform(monkeypatch):
    sphere = Sphere(permeability=1.5)
    discrete = solve(sphere, 0.2, monkeypatch)
    points = np.random.default_rng(1).normal(size=(100, 3))
    points *= 0.95 * np.random.default_rng(2).random((100, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    B = discrete.currents.jet(points, 0)[0]
    assert np.abs(B - sphere.B(points)).max() <= 5e-4 * np.abs(sphere.B(points)).max()
