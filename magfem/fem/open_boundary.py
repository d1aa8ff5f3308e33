"""The open boundary: what the unbounded air outside a sphere (or half circle) answers to a potential on it.

Outside a sphere of radius R about the device the potential is Σ c_k (R/r)^{l+1} Y_k, so that −∂φ/∂r = (l+1)/R
on each spherical harmonic: the Dirichlet-to-Neumann map. In weak form it adds

    R Σ_k (l_k + 1) (∮ φ Y_k dΩ)(∮ ψ Y_k dΩ)

to the stiffness, a term of low rank. Degrees beyond the last one kept, L, take the Robin value (L + 2)/R,
which is exact for the first of them. On an axisymmetric mesh only the zonal harmonics are there, and the
integrals run over the polar angle (the factor 2π is left out on both sides of the equation).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.special import eval_legendre

from magfem.compiled import kernel
from magfem.fields.solid_harmonics import fill_table, schmidt_scale
from magfem.mesh.mesh import Mesh
from magfem.mesh.shape_functions import triangle_rule, triangle_shapes
from magfem.typing import Complexes, Floats, Integers, Points

DEGREE = 18
"""Harmonics kept on the sphere. Beyond, on a ball 1.35 times the device, less than 1e-5 of them comes back."""


@dataclass(frozen=True)
class OpenBoundary:
    """The exterior's part of the system matrix.

    robin: (n, n) sparse, ∮ φψ dΩ.  nodes: (b,) the unknowns on the boundary.  harmonics: (b, k), ∮ φ Y_k dΩ of
    each.  degree: (k,).  radius: m, the mean over the meshed boundary.
    """

    robin: csr_matrix
    nodes: Integers
    harmonics: Floats
    degree: Integers
    radius: float

    @property
    def sparse(self) -> csr_matrix:
        """The Robin part (n, n): add it to the stiffness."""
        return self.radius * (self._last + 2) * self.robin

    @property
    def preconditioner(self) -> csr_matrix:
        """A cheap stand-in for the whole boundary (n, n): the dipole's Robin value 2/R."""
        return 2.0 * self.radius * self.robin

    def add_low_rank(self, potential: Floats, out: Floats) -> None:
        """Add to `out` (n,) what the boundary does to `potential` (n,) beyond `sparse`."""
        excess = self.radius * (self.degree - self._last - 1.0)
        out[self.nodes] += self.harmonics @ (excess * self.coefficients(potential))

    def coefficients(self, potential: Floats) -> Floats:
        """The exterior field's coefficients c_k (k,) A of a potential (n,) A."""
        found: Floats = self.harmonics.T @ potential[self.nodes]
        return found

    @property
    def _last(self) -> int:
        return int(self.degree.max())


def sphere(mesh: Mesh, degree: int = DEGREE) -> OpenBoundary:
    """Open boundary of a tetrahedral mesh; harmonics by degree l, then order m with cosine before sine."""
    points, angle, shapes = _sphere_rule(mesh)
    distance = np.linalg.norm(points, axis=-1)
    values = np.empty((points.shape[0] * points.shape[1], (degree + 1) ** 2))
    table = np.empty((degree + 1, degree + 1), dtype=np.complex128)
    kinds = [(n, m, part) for n in range(degree + 1) for m in range(n + 1) for part in range(2 if m else 1)]
    n, m, part = (np.array(column) for column in zip(*kinds, strict=True))
    scale = np.array([np.sqrt((2 * k + 1) / (4 * np.pi)) * schmidt_scale(k, q) for k, q in zip(n, m, strict=True)])
    _real_harmonics((points / distance[..., None]).reshape(-1, 3), n, m, part, scale, table, values)
    # The curved facets lie a little inside the sphere; their mean radius takes the first order of that out.
    radius = float((angle * distance).sum() / angle.sum())
    robin = np.einsum("fq,qa,qb->fab", angle, shapes, shapes)
    return _collect(mesh.outer_facets, mesh.points.shape[0], values, angle[..., None] * shapes, robin, n, radius)


@kernel
def _real_harmonics(
    directions: Points,
    degree: Integers,
    order: Integers,
    sine: Integers,
    scale: Floats,
    table: Complexes,
    out: Floats,
) -> None:
    """Real orthonormal spherical harmonics (p, k) at unit directions (p, 3)."""
    top = table.shape[0] - 1
    for p in range(directions.shape[0]):
        fill_table(directions[p, 0], directions[p, 1], directions[p, 2], top, top, table)
        for k in range(degree.size):
            value = table[degree[k], order[k]]
            out[p, k] = scale[k] * (value.imag if sine[k] else value.real)


def half_circle(
    points: Floats,
    normal: Floats,
    shapes: Floats,
    weights: Floats,
    dofs: Integers,
    size: int,
    degree: int = DEGREE,
) -> OpenBoundary:
    """Open boundary of an axisymmetric mesh, from a facet basis on its artificial half circle.

    points, normal: (2, f, q), rows (ρ, z).  shapes: (a, f, q).  weights: (f, q), line elements m.
    dofs: (a, f).  size: number of unknowns.
    """
    distance = np.hypot(points[0], points[1])
    cosine = (points[1] / distance).ravel()
    # sin θ dθ of the true polar angle, whatever the facet's shape.
    angle = points[0] * (normal * points).sum(axis=0) / distance**3 * weights
    degrees = np.arange(degree + 1)
    values = np.sqrt(degrees + 0.5) * eval_legendre(degrees, cosine[:, None])
    radius = float((angle * distance).sum() / angle.sum())
    robin = np.einsum("fq,afq,bfq->fab", angle, shapes, shapes, optimize=True)
    weighted = angle[..., None] * np.moveaxis(shapes, 0, -1)
    return _collect(dofs.T, size, values, weighted, robin, degrees, radius)


def _sphere_rule(mesh: Mesh) -> tuple[Floats, Floats, Floats]:
    """Points (f, q, 3), solid-angle weights (f, q) and shape functions (q, 6) on the outer facets."""
    local, w = triangle_rule(8)
    shapes, du, dv = triangle_shapes(local)
    nodes = mesh.points[mesh.outer_facets]
    points = np.einsum("qa,fai->fqi", shapes, nodes)
    normal = np.cross(np.einsum("qa,fai->fqi", du, nodes), np.einsum("qa,fai->fqi", dv, nodes))
    # dΩ = n·x/|x|³ dS is the true solid angle whatever the facet's shape.
    angle = np.einsum("fqi,fqi->fq", normal, points) / np.linalg.norm(points, axis=-1) ** 3
    return points, angle * w, shapes


def _collect(
    facets: Integers,
    size: int,
    values: Floats,
    shapes: Floats,
    robin: Floats,
    degree: Integers,
    radius: float,
) -> OpenBoundary:
    """Sum facets (f, a): harmonics (f·q, k), weighted shape functions (f, q, a), and their products (f, a, a)."""
    count, rule, width = shapes.shape
    nodes, number = np.unique(facets, return_inverse=True)
    number = number.reshape(facets.shape)
    rows = np.broadcast_to(number[:, None, :], shapes.shape)
    columns = np.broadcast_to(np.arange(count * rule).reshape(count, rule, 1), shapes.shape)
    project = coo_matrix((shapes.ravel(), (rows.ravel(), columns.ravel())), shape=(nodes.size, count * rule))
    left = np.repeat(facets, width, axis=1).ravel()
    right = np.tile(facets, (1, width)).ravel()
    mass = coo_matrix((robin.ravel(), (left, right)), shape=(size, size)).tocsr()
    return OpenBoundary(mass, nodes, project.tocsr() @ values, degree, radius)
