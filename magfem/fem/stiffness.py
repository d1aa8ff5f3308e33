"""Stiffness and load of the scalar potential on curved second-order tetrahedra, compiled.

The same forms as `permeability_energy` and `remanence_load` below, which are stock scikit-fem and hold this
assembly to rounding in the tests: element by element it does the same sums, many times faster.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from magfem.compiled import kernel
from magfem.errors import MeshError
from magfem.mesh.mesh import Mesh
from magfem.mesh.shape_functions import shape_gradients, tetrahedron_rule
from magfem.typing import Floats, Integers

_CURVED_ORDER = 5  # quadrature degree on curved elements; straight ones are integrated exactly by degree 2


def reference_forms() -> tuple[Any, Any]:
    """The two weak forms as scikit-fem forms; `w.mu` is the relative permeability, `w.m` remanence/µ₀ in A/m."""
    from skfem import BilinearForm, LinearForm
    from skfem.helpers import dot, grad

    @BilinearForm
    def permeability_energy(phi, psi, w):  # type: ignore[no-untyped-def]
        """∫ µ ∇φ·∇ψ, w.mu in units of µ₀."""
        return w.mu * dot(grad(phi), grad(psi))

    @LinearForm
    def remanence_load(psi, w):  # type: ignore[no-untyped-def]
        """∫ M₀·∇ψ, M₀ = remanence/µ₀."""
        return dot(w.m, grad(psi))

    return permeability_energy, remanence_load


def assemble(mesh: Mesh, permeability: Floats, magnetisation: Floats) -> tuple[csr_matrix, Floats, Floats]:
    """Stiffness (n, n), load (n,) A and the volume (e,) m³ of every cell of a tetrahedral mesh.

    permeability: (e,) relative.  magnetisation: (e, 3) A/m, remanence/µ₀.
    Raises MeshError when an element is turned inside out.
    """
    count = mesh.cells.shape[0]
    stiffness = np.empty((count, 10, 10))
    load = np.empty((count, 10))
    volume = np.empty(count)
    straight = _straight(mesh)
    for chosen, order in ((straight, 2), (~straight, _CURVED_ORDER)):
        points, weights = tetrahedron_rule(order)
        shapes = shape_gradients(points)
        worst = _elements(
            mesh.points,
            mesh.cells,
            np.flatnonzero(chosen),
            permeability,
            magnetisation,
            shapes,
            weights,
            stiffness,
            load,
            volume,
        )
        if worst <= 0.0:
            raise MeshError("the mesh has elements turned inside out; a finer resolution avoids them")
    n = mesh.points.shape[0]
    rows = np.repeat(mesh.cells, 10, axis=1).ravel().astype(np.int32)
    columns = np.tile(mesh.cells, (1, 10)).ravel().astype(np.int32)
    matrix = coo_matrix((stiffness.ravel(), (rows, columns)), shape=(n, n)).tocsr()
    total: Floats = np.bincount(mesh.cells.ravel(), load.ravel(), minlength=n).astype(float)
    return matrix, total, volume


def _straight(mesh: Mesh) -> Any:
    """(e,) true for elements whose edge nodes lie half-way: their map is affine."""
    corners = mesh.points[mesh.cells[:, :4]]
    middle = 0.5 * (corners[:, [0, 1, 0, 0, 1, 2]] + corners[:, [1, 2, 2, 3, 3, 3]])
    bend = np.abs(mesh.points[mesh.cells[:, 4:]] - middle).max(axis=(1, 2))
    return bend < 1e-14 * mesh.radius


@kernel
def _elements(
    points: Floats,
    cells: Integers,
    chosen: Integers,
    permeability: Floats,
    magnetisation: Floats,
    shapes: Floats,
    weights: Floats,
    stiffness: Floats,
    load: Floats,
    volume: Floats,
) -> float:
    """Fill the element matrices of the chosen cells; returns the smallest Jacobian determinant met."""
    worst = np.inf
    g = np.empty((10, 3))
    jacobian = np.empty((3, 3))
    inverse = np.empty((3, 3))
    for e in chosen:
        stiffness[e] = 0.0
        load[e] = 0.0
        volume[e] = 0.0
        for q in range(weights.size):
            jacobian[:] = 0.0
            for a in range(10):
                node = cells[e, a]
                for i in range(3):
                    for j in range(3):
                        jacobian[i, j] += points[node, i] * shapes[q, a, j]
            for i in range(3):
                i1, i2 = (i + 1) % 3, (i + 2) % 3
                for j in range(3):
                    j1, j2 = (j + 1) % 3, (j + 2) % 3
                    inverse[j, i] = jacobian[i1, j1] * jacobian[i2, j2] - jacobian[i1, j2] * jacobian[i2, j1]
            det = jacobian[0, 0] * inverse[0, 0] + jacobian[0, 1] * inverse[1, 0] + jacobian[0, 2] * inverse[2, 0]
            worst = min(worst, det)
            w = weights[q] * det
            volume[e] += w
            for a in range(10):
                for i in range(3):
                    g[a, i] = (
                        shapes[q, a, 0] * inverse[0, i]
                        + shapes[q, a, 1] * inverse[1, i]
                        + shapes[q, a, 2] * inverse[2, i]
                    ) / det
                load[e, a] += w * (
                    magnetisation[e, 0] * g[a, 0] + magnetisation[e, 1] * g[a, 1] + magnetisation[e, 2] * g[a, 2]
                )
            w *= permeability[e]
            for a in range(10):
                for b in range(a + 1):
                    stiffness[e, a, b] += w * (g[a, 0] * g[b, 0] + g[a, 1] * g[b, 1] + g[a, 2] * g[b, 2])
        for a in range(10):
            for b in range(a):
                stiffness[e, b, a] = stiffness[e, a, b]
    return worst
