"""Laplace's form on a rectangle or a box that is bent into space: biquadratic elements of scikit-fem on its lattice.

With the metric g of the map from lattice numbers to space,

    a(u, w) = ∫ √g g^{ij} ∂_i u ∂_j w  over the rectangle or box,

so that a ribbon that spirals, folds and rolls is, to the solver, one straight row of elements.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from magfem.typing import Floats, Integers


@dataclass(frozen=True)
class LatticeForm:
    """The form of a lattice that closes on itself along its first direction.

    basis, metric: scikit-fem's.  matrix: (d, d) of all nodes, the two ends apart.  dof: number of every lattice
    point in it.  unknown: the same with the ends joined.
    """

    basis: Any
    metric: Any
    matrix: csr_matrix
    dof: Integers
    unknown: Integers

    @classmethod
    def of(cls, points: Floats) -> LatticeForm:
        """The form on lattice points (2n+1, 2m+1, 3) m of a surface, or (2n+1, 2m+1, 2p+1, 3) of a solid."""
        import skfem

        shape = points.shape[:-1]
        mesh_class, element = (
            (skfem.MeshQuad, skfem.ElementQuad2()) if len(shape) == 2 else (skfem.MeshHex, skfem.ElementHex2())
        )
        mesh = mesh_class.init_tensor(*(np.arange(size // 2 + 1.0) for size in shape))
        basis = skfem.Basis(mesh, element, intorder=5)
        places = np.rint(2 * basis.doflocs).astype(int)
        dof = np.empty(shape, dtype=np.int64)
        dof[tuple(places)] = np.arange(places.shape[1])
        slopes = np.stack([basis.interpolate(_nodal(points[..., axis], dof)).grad for axis in range(3)])
        inner = np.einsum("aieq,ajeq->eqij", slopes, slopes)
        root = np.sqrt(np.linalg.det(inner))[..., None, None]
        metric = np.moveaxis(np.linalg.inv(inner) * root, (2, 3), (0, 1))
        unknown = np.arange(dof.size, dtype=np.int64).reshape(shape)
        unknown[-1] = unknown[0]
        return cls(basis, metric, _forms()[0].assemble(basis, metric=metric).tocsr(), dof, unknown)

    @property
    def size(self) -> int:
        """Unknowns, those joined counted once."""
        return int(self.unknown.max()) + 1

    def minimum(self, fixed: dict[float, Integers], jump: float) -> Floats:
        """The lattice function of least energy with `fixed` values at unknowns and a `jump` between its ends."""
        join = np.empty(self.dof.size, dtype=np.int64)
        join[self.dof] = self.unknown
        spread = csr_matrix((np.ones(join.size), (np.arange(join.size), join)), shape=(join.size, self.size))
        matrix = (spread.T @ self.matrix @ spread).tocsr()
        step = np.zeros(self.dof.size)
        step[self.dof[-1]] = jump
        values = np.zeros(self.size)
        known = np.zeros(self.size, dtype=bool)
        for value, unknowns in fixed.items():
            values[unknowns], known[unknowns] = value, True
        if not fixed:  # a constant is free: settle it
            known[0] = True
        free = np.flatnonzero(~known)
        load = -(spread.T @ (self.matrix @ step)) - matrix @ values
        values[free] = splu(matrix[free][:, free].tocsc()).solve(load[free])
        found: Floats = values[self.unknown]
        found[-1] += jump
        return found

    def energy(self, values: Floats) -> Floats:
        """a(u, u) of lattice values, element by element: (n, m) or (n, m, p)."""
        u = self.basis.interpolate(_nodal(values, self.dof))
        shares = _forms()[1].elemental(self.basis, u=u, metric=self.metric)
        middle = self.basis.mesh.p[:, self.basis.mesh.t].mean(axis=1)
        found = np.empty([size // 2 for size in values.shape])
        found[tuple(middle.astype(int))] = shares
        return found


def _nodal(values: Floats, dof: Integers) -> Floats:
    nodal = np.empty(dof.size)
    nodal[dof] = values
    return nodal


@cache
def _forms() -> tuple[Any, Any]:
    """The form, and its value for one function."""
    from skfem import BilinearForm, Functional
    from skfem.helpers import dot, grad, mul

    def form(u, w, p):  # type: ignore[no-untyped-def]
        return dot(mul(p.metric, grad(u)), grad(w))

    def energy(p):  # type: ignore[no-untyped-def]
        return dot(mul(p.metric, p["u"].grad), p["u"].grad)

    return BilinearForm(form), Functional(energy)
