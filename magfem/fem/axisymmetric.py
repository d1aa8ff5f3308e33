"""Scalar potential of axisymmetric magnets in the half plane: fourth-order triangles, stock scikit-fem."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from magfem.constants import MU_0
from magfem.fem.discrete import Discrete
from magfem.fem.linear_solver import solve_open
from magfem.fem.meridian_currents import MeridianCurrents
from magfem.fem.open_boundary import OpenBoundary, half_circle
from magfem.mesh.mesh import Mesh
from magfem.typing import Booleans, Floats, Integers


def solve(mesh: Mesh, permeability: Floats, magnetisation: Floats) -> Discrete:
    """Solve a meridian mesh whose bodies have relative `permeability` (b,) and `magnetisation` (b, 3) A/m.

    `magnetisation` is remanence/µ₀ and points along z. Raises ConvergenceError.
    """
    import skfem
    from skfem import BilinearForm, Functional, LinearForm
    from skfem.helpers import dot, grad

    sk_mesh = scikit_mesh(mesh)
    basis = skfem.Basis(sk_mesh, skfem.ElementTriP4(), intorder=9)
    constant = basis.with_element(skfem.ElementTriP0())
    inside = mesh.body >= 0
    axial = magnetisation[:, 2]
    mu = np.where(inside, permeability[mesh.body], 1.0)
    m = np.where(inside, axial[mesh.body], 0.0)

    @BilinearForm
    def permeability_energy(phi, psi, w):  # type: ignore[no-untyped-def]
        """∫ µ ∇φ·∇ψ ρ dρdz, the volume integral per radian."""
        return w.mu * dot(grad(phi), grad(psi)) * w.x[0]

    @LinearForm
    def remanence_load(psi, w):  # type: ignore[no-untyped-def]
        """∫ M₀ ∂ψ/∂z ρ dρdz, M₀ = remanence/µ₀."""
        return w.m * grad(psi)[1] * w.x[0]

    @Functional
    def revolved_volume(w):  # type: ignore[no-untyped-def]
        """∫ 2πρ dρdz."""
        return 2 * np.pi * w.x[0]

    stiffness = permeability_energy.assemble(basis, mu=constant.interpolate(mu)).tocsr()
    load = remanence_load.assemble(basis, m=constant.interpolate(m))
    boundary = _boundary(mesh, sk_mesh, basis)
    factors = splu((stiffness + boundary.preconditioner).tocsc())
    result = solve_open(stiffness, boundary, load, factors.solve, tolerance=1e-12)
    values = result.values
    currents = _currents(mesh, basis, values, permeability - 1.0, axial)
    exterior = boundary.coefficients(values)
    gradient = np.asarray(basis.interpolate(values).grad).mean(axis=-1)
    volume = revolved_volume.elemental(basis)
    return Discrete(
        mesh=mesh,
        currents=currents,
        potential=_at_nodes(mesh, basis, values),
        flux_density=(MU_0 * (np.stack([np.zeros_like(m), m]) - mu * gradient)).T,
        volume=np.bincount(mesh.body[inside], volume[inside], minlength=len(mesh.names)).astype(float),
        quantities={
            "moment": currents.moment.tolist(),
            # φ = m cos θ/(4πr²) outside, against the orthonormal √(3/2) cos θ.
            "boundary_moment": [
                0.0,
                0.0,
                float(4 * np.pi * boundary.radius**2 * np.sqrt(3 / 2) * exterior[1]),
            ],
            "field_energy": float(0.5 * MU_0 * 2 * np.pi * load @ values),
            "boundary_flux": float(MU_0 * boundary.radius * 2 * np.pi * np.sqrt(2) * exterior[0]),
        },
        unknowns=load.size,
        iterations=result.iterations,
        residual=result.residual,
    )


def scikit_mesh(mesh: Mesh) -> Any:
    """The same second-order triangles as a `skfem.MeshTri2`, with every triangle's corners in ascending order."""
    import skfem

    corners, numbered = np.unique(mesh.cells[:, :3], return_inverse=True)
    # Elements of third order and more number their edge unknowns from the lower to the higher corner.
    triangles = np.ascontiguousarray(np.sort(numbered.reshape(-1, 3), axis=1).T)
    linear = skfem.MeshTri1(np.ascontiguousarray(mesh.points[corners].T), triangles, sort_t=False)
    ends = np.sort(numbered.reshape(-1, 3)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    middle = np.empty(linear.nfacets, dtype=np.int64)
    middle[_find_facets(linear, ends)] = mesh.cells[:, 3:].ravel()
    return skfem.MeshTri2(np.ascontiguousarray(np.hstack([linear.p, mesh.points[middle].T])), triangles)


def _find_facets(sk_mesh: Any, ends: Integers) -> Integers:
    """Facet numbers (k,) of the edges between corners `ends` (k, 2), each in ascending order."""
    width = sk_mesh.p.shape[1]
    known = sk_mesh.facets[0].astype(np.int64) * width + sk_mesh.facets[1]
    order = np.argsort(known)
    found: Integers = order[np.searchsorted(known[order], ends[:, 0].astype(np.int64) * width + ends[:, 1])]
    return found


def _facet_numbers(mesh: Mesh, sk_mesh: Any, facets: Integers) -> tuple[Integers, Booleans]:
    """scikit-fem's numbers (f,) of oriented edges (f, 3), and whether each runs from low to high corner."""
    corners = np.unique(mesh.cells[:, :3])
    ends = np.searchsorted(corners, facets[:, :2])
    return _find_facets(sk_mesh, np.sort(ends, axis=1)), ends[:, 0] < ends[:, 1]


def _boundary(mesh: Mesh, sk_mesh: Any, basis: Any) -> OpenBoundary:
    import skfem

    facets, _ = _facet_numbers(mesh, sk_mesh, mesh.outer_facets)
    edge = skfem.FacetBasis(sk_mesh, basis.elem, facets=np.sort(facets), intorder=12)
    shapes = np.array([np.asarray(edge.basis[a][0]) for a in range(edge.Nbfun)])
    dofs = edge.element_dofs
    return half_circle(np.asarray(edge.global_coordinates()), np.asarray(edge.normals), shapes, edge.dx, dofs, basis.N)


def _currents(mesh: Mesh, basis: Any, values: Floats, susceptibility: Floats, axial: Floats) -> MeridianCurrents:
    """Bound currents of every body with `susceptibility` (b,) and `axial` magnetisation (b,) A/m, remanence/µ₀."""
    nodes, current = [], []
    to_powers = np.linalg.inv(np.vander(np.linspace(-1, 1, 5), increasing=True))
    for index in range(len(mesh.names)):
        facets, _ = mesh.body_facets(index)
        place = mesh.points[facets]
        powers = to_powers @ values[_along_edges(mesh, basis, facets)]  # (5, f), ascending powers of t
        slope = (powers[1:] * np.arange(1, 5)[:, None]).T
        start, end, middle = (place[:, k, 1] for k in range(3))
        density = -susceptibility[index] * slope
        density[:, 0] += axial[index] * (end - start) / 2
        density[:, 1] += axial[index] * (start + end - 2 * middle)
        nodes.append(place)
        current.append(density)
    return MeridianCurrents(np.concatenate(nodes), np.ascontiguousarray(np.concatenate(current)))


def _along_edges(mesh: Mesh, basis: Any, edges: Integers) -> Integers:
    """Unknowns (5, f) met along oriented edges (f, 3): start, three quarter points, end."""
    number, ascending = _facet_numbers(mesh, basis.mesh, edges)
    ends = basis.nodal_dofs[0, basis.mesh.facets[:, number]]
    dofs = np.concatenate([ends[:1], basis.facet_dofs[:, number], ends[1:]])
    return np.where(ascending, dofs, dofs[::-1])


def _at_nodes(mesh: Mesh, basis: Any, values: Floats) -> Floats:
    """The potential (n,) at the mesh's corners and mid-edge nodes."""
    potential = np.empty(mesh.points.shape[0])
    for edge in ([0, 1, 3], [1, 2, 4], [2, 0, 5]):
        nodes = mesh.cells[:, edge]
        potential[nodes] = values[_along_edges(mesh, basis, nodes)[[0, 4, 2]].T]
    return potential
