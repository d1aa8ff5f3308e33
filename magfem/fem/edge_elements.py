"""Magnetic vector potential of coils in air: lowest-order edge elements on tetrahedra, open boundary on a sphere.

B = curl A and curl B = µ₀ J, in weak form

    ∫ curl A · curl v dV + Σ_k (∮ Y_k curl A · n dS) (∮ Y_k curl v · n dS) / (R (l_k + 1)) = µ₀ ∫ J · v dV.

The second term is the energy of the field outside the sphere of radius R that has the same flux through it, in
spherical harmonics Y_k of degree l_k. Both terms see nothing but curl A: A is free up to a gradient, and no gauge is
imposed. The system is consistent because every load is free of divergence to the last bit: a solid winding's is
∫ T · curl v with curl T = J, and a ribbon's current is the rotated gradient of a piecewise linear stream function on
faces of the mesh. Conjugate gradients then converge as if the matrix were regular.

The inductance of circuits i and j is L_ij = µ₀ load_i · A_j per ampere squared: from below on any mesh, with an error
of second order in the element size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from magfem.constants import MU_0
from magfem.errors import ConvergenceError
from magfem.fem.linear_solver import Apply
from magfem.mesh.coil_in_air import AirMesh, Winding
from magfem.mesh.shape_functions import tetrahedron_rule, triangle_rule
from magfem.typing import Floats, Integers, Points

DEGREE = 6
"""Harmonics kept on the sphere. On a ball twice the coils' radius less than 1e-4 of the others comes back."""

_PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_CHUNK = 200_000  # tetrahedra assembled at a time: bounds the memory that triplets take


@dataclass(frozen=True)
class EdgeSolution:
    """Vector potentials of circuits, one ampere in each in turn.

    potential: (c, m) T·m² per ampere, ∫ A·dx along every edge of the mesh.  inductance: (c, c) H; row i holds the
    flux with circuit i.  iterations, residual: the most that any circuit took, and the largest that was left.
    """

    mesh: AirMesh
    potential: Floats
    inductance: Floats
    iterations: int
    residual: float

    def energy(self, currents: Floats) -> float:
        """Energy of the magnetic field, J, at `currents` (c,) A."""
        return float(0.5 * currents @ self.inductance @ currents)

    def flux_density(self) -> Floats:
        """B (c, e, 3) in every tetrahedron, T per ampere; constant in each."""
        curls = shape_curls(self.mesh)[0]
        found: Floats = np.einsum("cea,eai->cei", self.potential[:, self.mesh.cell_edges], curls, optimize=True)
        return found

    def flux(self, loop: Integers) -> Floats:
        """Flux (c,) T·m² per ampere through a closed path of mesh points (k,), the last joined to the first."""
        pairs = np.column_stack([loop, np.roll(loop, -1)])
        along = np.where(pairs[:, 0] < pairs[:, 1], 1.0, -1.0)
        found: Floats = self.potential[:, self.mesh.edge_numbers(pairs)] @ along
        return found


def solve(mesh: AirMesh, loads: Floats, tolerance: float = 1e-8, degree: int = DEGREE) -> EdgeSolution:
    """Solve for the vector potentials of `loads` (c, m), ∫ J·v of every edge's shape function per ampere.

    Raises ConvergenceError.
    """
    gradients, volume = shape_gradients(mesh)
    curls = _curls(gradients)
    matrix = stiffness(mesh, curls, volume)
    flux, weight = open_boundary(mesh, degree)
    cycle = auxiliary_space(mesh, matrix, _laplacian(mesh, gradients, volume))
    del gradients, curls
    potentials, iterations, residuals = [], [], []
    for load in loads:
        x, steps, residual = _conjugate_gradients(matrix, flux, weight, load, cycle, tolerance)
        potentials.append(x)
        iterations.append(steps)
        residuals.append(residual)
    potential = MU_0 * np.array(potentials).reshape(loads.shape)
    inductance = loads @ potential.T
    return EdgeSolution(
        mesh, potential, 0.5 * (inductance + inductance.T), max(iterations, default=0), max(residuals, default=0.0)
    )


def shape_gradients(mesh: AirMesh) -> tuple[Floats, Floats]:
    """Gradients (e, 4, 3) of the corners' linear functions, 1/m, and volumes (e,) m³."""
    corners = mesh.points[mesh.tetrahedra]
    jacobian = corners[:, 1:] - corners[:, :1]
    volume = np.abs(np.linalg.det(jacobian)) / 6
    # Between coplanar triangles of a ribbon Gmsh may leave a flat tetrahedron: it holds no energy and is left out.
    flat = volume < 1e-9 * np.abs(jacobian).max(axis=(1, 2)) ** 3
    jacobian[flat], volume[flat] = np.eye(3), 0.0
    last = np.swapaxes(np.linalg.inv(jacobian), 1, 2)
    last[flat] = 0.0
    return np.concatenate([-last.sum(axis=1, keepdims=True), last], axis=1), volume


def shape_curls(mesh: AirMesh) -> tuple[Floats, Floats]:
    """Curls (e, 6, 3) of the edges' shape functions λ_a ∇λ_b − λ_b ∇λ_a, 1/m², and volumes (e,) m³."""
    gradients, volume = shape_gradients(mesh)
    return _curls(gradients), volume


def _curls(gradients: Floats) -> Floats:
    curls: Floats = 2 * np.cross(gradients[:, _PAIRS[:, 0]], gradients[:, _PAIRS[:, 1]])
    return curls


def stiffness(mesh: AirMesh, curls: Floats, volume: Floats) -> csr_matrix:
    """∫ curl u · curl v (m, m), from the curls (e, 6, 3) and volumes (e,)."""
    return _assemble(mesh.cell_edges, curls, volume, mesh.edges.shape[0])


def _laplacian(mesh: AirMesh, gradients: Floats, volume: Floats) -> csr_matrix:
    """∫ ∇u · ∇v + ∮ uv/R (n, n) of linear elements, the boundary's part lumped."""
    matrix = _assemble(mesh.tetrahedra, gradients, volume, mesh.points.shape[0])
    faces = mesh.outer_triangles
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    lumped = np.bincount(faces.ravel(), np.repeat(area / 3, 3), minlength=mesh.points.shape[0]) / mesh.radius
    matrix.setdiag(matrix.diagonal() + lumped)
    return matrix


def _assemble(numbers: Integers, slopes: Floats, volume: Floats, size: int) -> csr_matrix:
    """Sum over cells of volume · slope_a · slope_b at the unknowns `numbers` (e, a); slopes (e, a, 3)."""
    width = numbers.shape[1]
    total = csr_matrix((size, size))
    for start in range(0, numbers.shape[0], _CHUNK):
        part = slice(start, start + _CHUNK)
        local = np.matmul(slopes[part] * volume[part, None, None], np.swapaxes(slopes[part], 1, 2))
        index = numbers[part].astype(np.int32)
        rows, columns = np.repeat(index, width, axis=1).ravel(), np.tile(index, (1, width)).ravel()
        total = total + coo_matrix((local.ravel(), (rows, columns)), shape=(size, size)).tocsr()
    return total


def open_boundary(mesh: AirMesh, degree: int = DEGREE) -> tuple[csr_matrix, Floats]:
    """The exterior's energy as a term of low rank: flux moments ∮ Y_k curl v · n dS (k, m) and their weights (k,).

    Y_k: real orthonormal spherical harmonics of degrees 1 to `degree`, averaged over the solid angle of each face.
    """
    from scipy.special import sph_harm_y

    faces = mesh.outer_triangles
    corners = mesh.points[faces] - mesh.centre
    local, w = triangle_rule(4)
    points = corners[:, :1] + np.einsum("qi,fij->fqj", local, corners[:, 1:] - corners[:, :1])
    distance = np.linalg.norm(points, axis=-1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    angle = np.einsum("fi,fqi->fq", normal, points) / distance**3 * w
    radius = float((angle * distance).sum() / angle.sum())
    theta, phi = np.arccos(points[..., 2] / distance), np.arctan2(points[..., 1], points[..., 0])
    means, degrees = [], []
    for n in range(1, degree + 1):
        for m in range(n + 1):
            value = sph_harm_y(n, m, theta, phi) * (np.sqrt(2) if m else 1.0)
            for part in (value.real, value.imag)[: 2 if m else 1]:
                means.append((angle * part).sum(axis=1) / angle.sum(axis=1))
                degrees.append(n)
    # The flux of a face is the sum of the potential along its edges, taken in the sense of the face.
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)
    sign = np.where(ends[..., 0] < ends[..., 1], 1.0, -1.0)
    number = mesh.edge_numbers(ends)
    size = mesh.edges.shape[0]
    face = np.repeat(np.arange(faces.shape[0]), 3)
    circulation = coo_matrix((sign.ravel(), (face, number.ravel())), shape=(faces.shape[0], size)).tocsr()
    flux = csr_matrix(csr_matrix(np.array(means)) @ circulation)
    return flux, 1.0 / (radius * (np.array(degrees) + 1.0))


def auxiliary_space(mesh: AirMesh, matrix: csr_matrix, laplacian: csr_matrix) -> Apply:
    """A preconditioner for the curl-curl `matrix` (m, m): Gauss–Seidel on edges, multigrid on nodal vector fields.

    What varies slowly in A is, up to a gradient, a continuous vector field; on those the curl's energy is close to
    the `laplacian`'s (n, n), which algebraic multigrid inverts. Gradients need no treatment: the residual has none.

    Source: Hiptmair and Xu 2007, SIAM J. Numer. Anal. 45, 2483 (nodal auxiliary space preconditioning).
    """
    from pyamg import smoothed_aggregation_solver
    from pyamg.relaxation.relaxation import gauss_seidel

    along = mesh.points[mesh.edges[:, 1]] - mesh.points[mesh.edges[:, 0]]
    count = mesh.edges.shape[0]
    mean = csr_matrix(
        (np.full(2 * count, 0.5), mesh.edges.ravel().astype(np.int32), 2 * np.arange(count + 1)),
        shape=(count, mesh.points.shape[0]),
    )
    gather = mean.T.tocsr()
    nodal = smoothed_aggregation_solver(laplacian, max_coarse=300).aspreconditioner(cycle="V")

    def cycle(r: Floats) -> Floats:
        x = np.zeros_like(r)
        gauss_seidel(matrix, x, r, sweep="forward")
        rest = r - matrix @ x
        for axis in range(3):
            x += along[:, axis] * (mean @ nodal.matvec(gather @ (along[:, axis] * rest)))
        gauss_seidel(matrix, x, r, sweep="backward")
        return x

    return cycle


def _conjugate_gradients(
    matrix: csr_matrix,
    flux: csr_matrix,
    weight: Floats,
    load: Floats,
    precondition: Apply,
    tolerance: float,
    limit: int = 400,
) -> tuple[Floats, int, float]:
    """Solve (matrix + fluxᵀ weight flux) x = load: x, steps, relative residual. Raises ConvergenceError."""
    back = flux.T.tocsr()
    x = np.zeros_like(load)
    scale = float(np.linalg.norm(load))
    if scale == 0.0:
        return x, 0, 0.0
    r = load.copy()
    p = z = precondition(r)
    rz = r @ z
    residual = 1.0
    for step in range(1, limit + 1):
        Ap = matrix @ p + back @ (weight * (flux @ p))
        a = rz / (p @ Ap)
        x += a * p
        r -= a * Ap
        residual = float(np.linalg.norm(r)) / scale
        if residual <= tolerance:
            return x, step, residual
        z = precondition(r)
        rz, before = r @ z, rz
        p = z + rz / before * p
    raise ConvergenceError(
        f"the vector potential's solver stopped after {limit} steps at a relative residual of {residual:.1e} "
        f"(wanted {tolerance:.0e}): the mesh is probably distorted"
    )


def winding_loads(mesh: AirMesh, circuits: Sequence[Sequence[Winding]]) -> Floats:
    """∫ J·v (c, m) of circuits of coaxial windings per ampere, as ∫ T · curl v with J = curl T.

    T points along z: in a winding it falls linearly from its inner wall to zero at its outer one, in the bore it is
    constant. It is sampled on the true circles, whatever the mesh makes of them.
    """
    curls, volume = shape_curls(mesh)
    local, w = tetrahedron_rule(4)
    loads = np.zeros((len(circuits), mesh.edges.shape[0]))
    corners = mesh.points[mesh.tetrahedra]
    for load, circuit in zip(loads, circuits, strict=True):
        for winding in circuit:
            near = np.linalg.norm(corners[..., :2], axis=-1).min(axis=1) < winding.outer_radius
            near &= (np.abs(corners[..., 2] - winding.centre) < (0.5 + 1e-9) * winding.length).any(axis=1)
            cells = np.flatnonzero(near)
            points = corners[cells, :1] + np.einsum("qi,eij->eqj", local, corners[cells, 1:] - corners[cells, :1])
            T = _current_potential(points, winding) @ w * 6 * volume[cells]
            np.add.at(load, mesh.cell_edges[cells], curls[cells, :, 2] * T[:, None])
    return loads


def ribbon_loads(mesh: AirMesh) -> Floats:
    """∫ K·v (c, m) of the circuits of ribbons in the mesh, per ampere.

    The share ψ of the current between the left edge and a point is the stream function, K = n × ∇ψ. On a triangle
    that is constant, and its integral with the shape function of the edge ab is (ψ_a + ψ_b − 2 ψ_c)/6.
    """
    loads = np.zeros((len(mesh.ribbons), mesh.edges.shape[0]))
    for load, (triangles, share) in zip(loads, mesh.ribbons, strict=True):
        ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1)
        sign = np.where(ends[..., 0] < ends[..., 1], 1.0, -1.0)
        value = share + np.roll(share, -1, axis=1) - 2 * np.roll(share, -2, axis=1)
        np.add.at(load, mesh.edge_numbers(ends), sign * value / 6)
    return loads


def _current_potential(points: Points, winding: Winding) -> Floats:
    """T_z (...) A/m per ampere at points (..., 3) m."""
    thickness = winding.outer_radius - winding.inner_radius
    density = winding.turns / (thickness * winding.length)
    depth = np.clip(winding.outer_radius - np.hypot(points[..., 0], points[..., 1]), 0.0, thickness)
    value: Floats = density * depth * (np.abs(points[..., 2] - winding.centre) < winding.length / 2)
    return value
