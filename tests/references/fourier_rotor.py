"""A transversely magnetised cylinder by its first azimuthal mode: a second, independent route to its field.

φ = f(ρ, z) cos θ on the half plane, fourth-order triangles, Dirichlet-to-Neumann map in associated Legendre
functions of order one; the field by Biot–Savart over the wall's and faces' bound currents, on Gauss points
along the meridian and equidistant azimuths (which converges exponentially). Shares the mesh with the 3D
solver's sibling, and nothing of the 3D formulation, its elements, its boundary or its evaluation.
"""

from __future__ import annotations

import numpy as np
import skfem
from scipy.sparse.linalg import splu
from scipy.special import lpmv
from skfem import BilinearForm, LinearForm
from skfem.helpers import dot, grad

from magfem.constants import MU_0
from magfem.fem.axisymmetric import _along_edges, _facet_numbers, scikit_mesh
from magfem.geometry import CylinderMagnet
from magfem.mesh.generate import generate
from magfem.typing import Floats

DEGREES = np.arange(1, 25)
AZIMUTHS = 48


def sources(cylinder: CylinderMagnet, resolution: float) -> tuple[Floats, Floats]:
    """Places (n, 3) m and strengths (n, 3) A·m of the bound current elements of a magnet magnetised along x."""
    mesh = generate(cylinder, 2, resolution)
    basis = skfem.Basis(scikit_mesh(mesh), skfem.ElementTriP4(), intorder=9)
    constant = basis.with_element(skfem.ElementTriP0())
    magnetisation = cylinder.material.remanence / MU_0
    permeability = cylinder.material.recoil_permeability
    inside = mesh.body >= 0

    @BilinearForm
    def energy(f, g, w):
        rho = w.x[0]
        return w.mu * (dot(grad(f), grad(g)) + f * g / rho**2) * rho

    @LinearForm
    def load(g, w):
        return w.m * (grad(g)[0] * w.x[0] + g)

    A = energy.assemble(basis, mu=constant.interpolate(np.where(inside, permeability, 1.0)))
    b = load.assemble(basis, m=constant.interpolate(np.where(inside, magnetisation, 0.0)))
    free = np.setdiff1d(np.arange(basis.N), basis.get_dofs(lambda x: np.abs(x[0]) < 1e-12).flatten())
    U, weights = _boundary(mesh, basis)
    factors = splu(A.tocsc()[free][:, free])
    Z, y = factors.solve(U[free]), factors.solve(b[free])
    potential = np.zeros(basis.N)  # Sherman–Morrison–Woodbury
    potential[free] = y - Z @ np.linalg.solve(np.diag(1 / weights) + U[free].T @ Z, U[free].T @ y)
    return _bound_currents(mesh, basis, potential, magnetisation, permeability - 1.0)


def _boundary(mesh, basis):
    facets, _ = _facet_numbers(mesh, basis.mesh, mesh.outer_facets)
    edge = skfem.FacetBasis(basis.mesh, basis.elem, facets=np.sort(facets), intorder=12)
    x = np.asarray(edge.global_coordinates())
    r = np.hypot(*x)
    angle = x[0] * (np.asarray(edge.normals) * x).sum(axis=0) / r**3 * edge.dx
    U = np.zeros((basis.N, DEGREES.size))
    for column, degree in enumerate(DEGREES):
        harmonic = np.sqrt((2 * degree + 1) / (2 * degree * (degree + 1))) * lpmv(1, degree, x[1] / r)
        for k in range(edge.Nbfun):
            np.add.at(U[:, column], edge.element_dofs[k], (harmonic * angle * np.asarray(edge.basis[k][0])).sum(axis=1))
    return U, (angle * r).sum() / angle.sum() * (DEGREES + 1)


def _bound_currents(mesh, basis, potential, magnetisation, susceptibility):
    edges, _ = mesh.body_facets(0)
    powers = (
        np.linalg.inv(np.vander(np.linspace(-1, 1, 5), increasing=True)) @ potential[_along_edges(mesh, basis, edges)]
    )
    t, w = np.polynomial.legendre.leggauss(8)
    f = np.polynomial.polynomial.polyval(t, powers)
    slope = np.polynomial.polynomial.polyval(t, powers[1:] * np.arange(1, 5)[:, None])
    start, end = mesh.points[edges[:, 0]], mesh.points[edges[:, 1]]
    tangent = (end - start) / 2
    rho, z = ((start[:, k, None] * (1 - t) + end[:, k, None] * (1 + t)) / 2 for k in range(2))
    theta = 2 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    cosine, sine = np.cos(theta), np.sin(theta)
    shape = (*rho.shape, AZIMUTHS)

    def vectors(x, y, z_):
        return np.stack([np.broadcast_to(component, shape) for component in (x, y, z_)], axis=-1)

    along = vectors(tangent[:, 0, None, None] * cosine, tangent[:, 0, None, None] * sine, tangent[:, 1, None, None])
    around = vectors(-rho[..., None] * sine, rho[..., None] * cosine, 0.0)
    outward = np.cross(around, along)  # n dS per dt dθ
    d_along, d_around = slope[..., None, None] * cosine[:, None], -f[..., None, None] * sine[:, None]
    K = np.cross([magnetisation, 0.0, 0.0], outward) - susceptibility * (around * d_along - along * d_around)
    K *= w[:, None, None] * 2 * np.pi / AZIMUTHS
    places = vectors(rho[..., None] * cosine, rho[..., None] * sine, z[..., None])
    return places.reshape(-1, 3), K.reshape(-1, 3)


def field(cylinder: CylinderMagnet, resolution: float, points: Floats) -> tuple[Floats, Floats]:
    """B and gradient at `points` (..., 3) by Biot–Savart over `sources`."""
    places, strengths = sources(cylinder, resolution)
    flat = points.reshape(-1, 3)
    B, gradient = np.empty((len(flat), 3)), np.empty((len(flat), 3, 3))
    for i, point in enumerate(flat):
        r = point - places
        distance = np.linalg.norm(r, axis=1)
        turned = np.cross(strengths, r)
        B[i] = (turned / distance[:, None] ** 3).sum(axis=0)
        levi = np.cross(strengths[:, None, :], np.eye(3)[None])  # [n, j, :] = K × e_j
        gradient[i] = (levi / distance[:, None, None] ** 3).sum(axis=0).T - 3 * np.einsum(
            "ni,nj,n->ij", turned, r, distance**-5.0
        )
    scale = MU_0 / (4 * np.pi)
    return scale * B.reshape(points.shape), scale * gradient.reshape(*points.shape, 3)


def moment(cylinder: CylinderMagnet, resolution: float) -> Floats:
    """Dipole moment (3,) A·m²."""
    places, strengths = sources(cylinder, resolution)
    return 0.5 * np.cross(places, strengths).sum(axis=0)
