"""Scalar potential of axisymmetric magnets in the half plane: fourth-order triangles, stock scikit-fem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from magfem.fem.linear_solver import LinearResult, solve_open
from magfem.fem.meridian_currents import MeridianCurrents
from magfem.fem.open_boundary import OpenBoundary, half_circle
from magfem.mesh.mesh import Mesh
from magfem.typing import Floats, Integers


@dataclass(frozen=True)
class AxisymmetricSystem:
    """The assembled problem (everything per radian): basis, load (n,) A·m… and its open boundary."""

    basis: Any
    load: Floats
    boundary: OpenBoundary
    result: LinearResult


def solve_potential(mesh: Mesh, permeability: Floats, magnetisation: Floats) -> AxisymmetricSystem:
    """Scalar potential of a meridian mesh.

    permeability: (e,) relative.  magnetisation: (e,) A/m, remanence/µ₀ along z.
    """
    import skfem
    from skfem import BilinearForm, LinearForm
    from skfem.helpers import dot, grad

    sk_mesh = scikit_mesh(mesh)
    basis = skfem.Basis(sk_mesh, skfem.ElementTriP4(), intorder=9)
    constant = basis.with_element(skfem.ElementTriP0())

    @BilinearForm
    def permeability_energy(phi, psi, w):  # type: ignore[no-untyped-def]
        """∫ µ ∇φ·∇ψ ρ, per radian."""
        return w.mu * dot(grad(phi), grad(psi)) * w.x[0]

    @LinearForm
    def remanence_load(psi, w):  # type: ignore[no-untyped-def]
        """∫ M₀ ∂_zψ ρ, per radian."""
        return w.m * grad(psi)[1] * w.x[0]

    stiffness = permeability_energy.assemble(basis, mu=constant.interpolate(permeability)).tocsr()
    load = remanence_load.assemble(basis, m=constant.interpolate(magnetisation))
    boundary = _boundary(mesh, sk_mesh, basis)
    factors = splu((stiffness + boundary.preconditioner).tocsc())
    result = solve_open(stiffness, boundary, load, factors.solve, tolerance=1e-12)
    return AxisymmetricSystem(basis, load, boundary, result)


def scikit_mesh(mesh: Mesh) -> Any:
    """The same second-order triangles as a `skfem.MeshTri2`, with every triangle's corners in ascending order."""
    import skfem

    corners, numbered = np.unique(mesh.cells[:, :3], return_inverse=True)
    # Elements of third order and more number their edge unknowns from the lower to the higher corner.
    triangles = np.sort(numbered.reshape(-1, 3), axis=1).T
    linear = skfem.MeshTri1(mesh.points[corners].T, triangles, sort_t=False)
    ends = np.sort(numbered.reshape(-1, 3)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    middle = np.empty(linear.nfacets, dtype=np.int64)
    middle[_find_facets(linear, ends)] = mesh.cells[:, 3:].ravel()
    return skfem.MeshTri2(np.hstack([linear.p, mesh.points[middle].T]), triangles)


def _find_facets(sk_mesh: Any, ends: Integers) -> Integers:
    """Facet numbers (k,) of the edges between corners `ends` (k, 2), each in ascending order."""
    width = sk_mesh.p.shape[1]
    known = sk_mesh.facets[0].astype(np.int64) * width + sk_mesh.facets[1]
    order = np.argsort(known)
    found: Integers = order[np.searchsorted(known[order], ends[:, 0].astype(np.int64) * width + ends[:, 1])]
    return found


def _facet_numbers(mesh: Mesh, sk_mesh: Any, facets: Integers) -> tuple[Integers, Integers]:
    """scikit-fem's numbers (f,) of oriented edges (f, 3), and whether each runs from low to high corner."""
    corners = np.unique(mesh.cells[:, :3])
    ends = np.searchsorted(corners, facets[:, :2])
    return _find_facets(sk_mesh, np.sort(ends, axis=1)), ends[:, 0] < ends[:, 1]


def _boundary(mesh: Mesh, sk_mesh: Any, basis: Any) -> OpenBoundary:
    import skfem

    facets, _ = _facet_numbers(mesh, sk_mesh, mesh.outer_facets)
    edge = skfem.FacetBasis(sk_mesh, basis.elem, facets=np.sort(facets), intorder=12)
    shapes = np.array([edge.basis[a][0].value for a in range(edge.Nbfun)])
    dofs = edge.element_dofs
    return half_circle(
        np.asarray(edge.global_coordinates()), np.asarray(edge.normals), shapes, edge.dx, dofs, basis.N
    )


def currents(
    mesh: Mesh, system: AxisymmetricSystem, susceptibility: Floats, magnetisation: Floats
) -> MeridianCurrents:
    """Bound currents of every body: susceptibility (b,) and axial magnetisation (b,) A/m, remanence/µ₀."""
    sk_mesh = system.basis.mesh
    nodes, current = [], []
    t = np.linspace(-1, 1, 5)
    to_powers = np.linalg.inv(np.vander(t, increasing=True))
    for index in range(len(mesh.names)):
        facets, _ = mesh.body_facets(index)
        number, ascending = _facet_numbers(mesh, sk_mesh, facets)
        place = mesh.points[facets]
        # Unknowns along an edge: its corners, then three in between, which are values at quarter points.
        ends = sk_mesh.facets[:, number]
        inner = system.basis.facet_dofs[:, number]
        dofs = np.concatenate([system.basis.nodal_dofs[0, ends[:1]], inner, system.basis.nodal_dofs[0, ends[1:]]])
        values = system.result.values[np.where(ascending, dofs, dofs[::-1])]
        powers = to_powers @ values  # (5, f), ascending powers of t
        slope = (powers[1:] * np.arange(1, 5)[:, None]).T
        start, end, middle = (place[:, k, 1] for k in range(3))
        density = -susceptibility[index] * slope
        density[:, 0] += magnetisation[index] * (end - start) / 2
        density[:, 1] += magnetisation[index] * (start + end - 2 * middle)
        nodes.append(place)
        current.append(density)
    return MeridianCurrents(np.ascontiguousarray(np.concatenate(nodes)), np.ascontiguousarray(np.concatenate(current)))
