"""Conjugate gradients with an open boundary against a dense solve, and the promise about convergence."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.errors import ConvergenceError
from magfem.fem.linear_solver import solve_open, two_level
from magfem.fem.open_boundary import sphere
from magfem.fem.stiffness import assemble
from magfem.mesh.generate import generate
from magfem.mesh.sizes import Sizes, Wanted


@pytest.fixture(scope="module")
def system(rotor):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("magfem.mesh.generate.element_sizes", lambda *_: Wanted({"magnet": Sizes(2e-4, 2e-4)}, 1e-3))
        mesh = generate(rotor, 3)
    one = np.ones(mesh.cells.shape[0])
    stiffness, load, _ = assemble(mesh, one, np.where(mesh.body[:, None] >= 0, [1.0, 2.0, 3.0], 0.0))
    return mesh, stiffness, load, sphere(mesh)


def test_iteration_matches_dense_solve(system):
    mesh, stiffness, load, boundary = system
    result = solve_open(stiffness, boundary, load, two_level((stiffness + boundary.preconditioner).tocsr(), mesh))
    dense = (stiffness + boundary.sparse).toarray()
    excess = boundary.radius * (boundary.degree - boundary.degree.max() - 1.0)
    at = np.ix_(boundary.nodes, boundary.nodes)
    dense[at] += boundary.harmonics * excess @ boundary.harmonics.T
    exact = np.linalg.solve(dense, load)
    assert result.converged and result.iterations < 40
    assert np.linalg.norm(result.values - exact) <= 1e-8 * np.linalg.norm(exact)


def test_not_converged_raises_unless_asked_otherwise(system):
    _, stiffness, load, boundary = system
    with pytest.raises(ConvergenceError, match="residual"):
        solve_open(stiffness, boundary, load, lambda r: r, limit=3)
    result = solve_open(stiffness, boundary, load, lambda r: r, limit=3, strict=False)
    assert not result.converged and result.iterations == 3 and result.residual > 1e-10


def test_boundary_operator_answers_each_harmonic_with_its_degree(system):
    """Outside, ψ = Y_l has the energy R(l + 1)∮Y² dΩ = R(l + 1): exact for kept degrees, so for 1/r and dipoles."""
    mesh, _, _, boundary = system
    x, y, z = mesh.points.T
    r = np.linalg.norm(mesh.points, axis=1)
    for degree, harmonic in (
        (0, np.full(r.size, np.sqrt(1 / (4 * np.pi)))),
        (1, np.sqrt(3 / (4 * np.pi)) * x / np.maximum(r, 1e-9)),
        (2, np.sqrt(15 / (4 * np.pi)) * y * z / np.maximum(r, 1e-9) ** 2),
    ):
        answer = boundary.sparse @ harmonic
        boundary.add_low_rank(harmonic, answer)
        assert harmonic @ answer == pytest.approx(boundary.radius * (degree + 1), rel=2e-3)
