"""Conjugate gradients for a sparse matrix plus an open boundary, and the preconditioners that make it quick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from magfem.errors import ConvergenceError
from magfem.fem.open_boundary import OpenBoundary
from magfem.mesh.mesh import Mesh
from magfem.typing import Floats, Integers

Apply = Callable[[Floats], Floats]


@dataclass(frozen=True)
class LinearResult:
    """Solution (n,) of a linear system, its relative residual and the steps it took."""

    values: Floats
    residual: float
    iterations: int
    converged: bool


def solve_open(
    stiffness: csr_matrix,
    boundary: OpenBoundary,
    load: Floats,
    precondition: Apply,
    tolerance: float = 1e-10,
    limit: int = 300,
    strict: bool = True,
) -> LinearResult:
    """Solve (stiffness + boundary) x = load by preconditioned conjugate gradients.

    `precondition` applies a symmetric positive approximation of the inverse. Raises ConvergenceError when the
    residual is above `tolerance` after `limit` steps, unless `strict` is false.
    """
    sparse = (stiffness + boundary.sparse).tocsr()
    x = np.zeros_like(load)
    r = load.copy()
    z = precondition(r)
    p = z.copy()
    rz = r @ z
    scale = np.linalg.norm(load)
    residual = 1.0
    for step in range(1, limit + 1):
        Ap = sparse @ p
        boundary.add_low_rank(p, Ap)
        a = rz / (p @ Ap)
        x += a * p
        r -= a * Ap
        residual = float(np.linalg.norm(r) / scale)
        if residual <= tolerance:
            return LinearResult(x, residual, step, True)
        z = precondition(r)
        rz, before = r @ z, rz
        p = z + rz / before * p
    if strict:
        raise ConvergenceError(
            f"the linear solver stopped after {limit} steps at a relative residual of {residual:.1e} "
            f"(wanted {tolerance:.0e}): the mesh is probably distorted"
        )
    return LinearResult(x, residual, limit, False)


def two_level(matrix: csr_matrix, mesh: Mesh) -> Apply:
    """One multigrid cycle: Gauss–Seidel on the quadratic elements, algebraic multigrid on the linear ones."""
    from pyamg import ruge_stuben_solver
    from pyamg.relaxation.relaxation import gauss_seidel

    prolong = _linear_to_quadratic(mesh)
    restrict = prolong.T.tocsr()
    coarse = ruge_stuben_solver((restrict @ matrix @ prolong).tocsr(), max_coarse=200)
    coarse_cycle = coarse.aspreconditioner(cycle="V")

    def cycle(r: Floats) -> Floats:
        x = np.zeros_like(r)
        gauss_seidel(matrix, x, r, sweep="forward")
        x += prolong @ coarse_cycle.matvec(restrict @ (r - matrix @ x))
        gauss_seidel(matrix, x, r, sweep="backward")
        return x

    return cycle


def _linear_to_quadratic(mesh: Mesh) -> csr_matrix:
    """Interpolation (n, v) from corner values to all nodes: corners keep theirs, mid-edge nodes take the mean."""
    corners: Integers = np.unique(mesh.cells[:, :4])
    number = np.full(mesh.points.shape[0], -1, dtype=np.int64)
    number[corners] = np.arange(corners.size)
    ends = mesh.cells[:, [0, 1, 1, 2, 0, 2, 0, 3, 1, 3, 2, 3]].reshape(-1, 2)
    middle, first = np.unique(mesh.cells[:, 4:].ravel(), return_index=True)
    ends = ends[first]
    rows = np.concatenate([corners, middle, middle])
    columns = np.concatenate([number[corners], number[ends[:, 0]], number[ends[:, 1]]])
    values = np.concatenate([np.ones(corners.size), np.full(2 * middle.size, 0.5)])
    return csr_matrix((values, (rows, columns)), shape=(mesh.points.shape[0], corners.size))
