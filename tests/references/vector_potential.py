"""An axisymmetric magnet by its vector potential A_φ: the formulation dual to the scalar potential.

Weak form, per radian, ν = 1/(µ₀µ): ∫ ν curl(A φ̂)·curl(v φ̂) ρ = ∫ ν B_r·curl(v φ̂) ρ, with
curl(A φ̂) = (−∂_z A, ∂_ρ A + A/ρ). On the artificial half circle A = Σ a_l (R/r)^{l+1} P_l¹(cos θ), so the
tangential H there is a Dirichlet-to-Neumann map as well. Where the scalar potential's energy is too small on
any mesh, this one's coenergy is too small: together they bracket the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from scipy.sparse.linalg import splu
from scipy.special import lpmv
from skfem import BilinearForm, LinearForm
from skfem.helpers import grad

from magfem.constants import MU_0
from magfem.fem.axisymmetric import _facet_numbers, scikit_mesh
from magfem.geometry import RingMagnet
from magfem.mesh.generate import generate

DEGREES = np.arange(1, 25)


@dataclass(frozen=True)
class VectorSolution:
    """Dipole moment along z (A·m²) and field energy ½∫µ₀µH² (J), with H = (B − B_r)/(µ₀µ)."""

    moment: float
    field_energy: float


def solve(ring: RingMagnet, resolution: float) -> VectorSolution:
    mesh = generate(ring, 2, resolution)
    basis = skfem.Basis(scikit_mesh(mesh), skfem.ElementTriP4(), intorder=10)
    constant = basis.with_element(skfem.ElementTriP0())
    inside = mesh.body >= 0
    mu = np.where(inside, ring.material.recoil_permeability, 1.0)
    remanence = np.where(inside, ring.material.remanence, 0.0)

    def axial_curl(u, w):
        return grad(u)[0] + u / w.x[0]

    @BilinearForm
    def energy(a, v, w):
        return (grad(a)[1] * grad(v)[1] + axial_curl(a, w) * axial_curl(v, w)) * w.x[0] / (MU_0 * w.mu)

    @LinearForm
    def load(v, w):
        return w.br * axial_curl(v, w) * w.x[0] / (MU_0 * w.mu)

    fields = {"mu": constant.interpolate(mu)}
    K = energy.assemble(basis, **fields)
    b = load.assemble(basis, br=constant.interpolate(remanence), **fields)
    free = np.setdiff1d(np.arange(basis.N), basis.get_dofs(lambda x: np.abs(x[0]) < 1e-12).flatten())
    facets, _ = _facet_numbers(mesh, basis.mesh, mesh.outer_facets)
    edge = skfem.FacetBasis(basis.mesh, basis.elem, facets=np.sort(facets), intorder=12)
    x = np.asarray(edge.global_coordinates())
    r = np.hypot(*x)
    angle = x[0] * (np.asarray(edge.normals) * x).sum(axis=0) / r**3 * edge.dx
    radius = (angle * r).sum() / angle.sum()
    U = np.zeros((basis.N, DEGREES.size))
    for column, degree in enumerate(DEGREES):
        harmonic = np.sqrt((2 * degree + 1) / (2 * degree * (degree + 1))) * lpmv(1, degree, x[1] / r)
        for k in range(edge.Nbfun):
            np.add.at(U[:, column], edge.element_dofs[k], (harmonic * angle * np.asarray(edge.basis[k][0])).sum(axis=1))
    # H_θ = −(1/µ₀ r) ∂(rA)/∂r = (l/R) A/µ₀ on each harmonic, and the surface element is R² sin θ dθ.
    weights = radius * DEGREES / MU_0
    factors = splu(K.tocsc()[free][:, free])
    Z, y = factors.solve(U[free]), factors.solve(b[free])
    A = np.zeros(basis.N)
    A[free] = y - Z @ np.linalg.solve(np.diag(1 / weights) + U[free].T @ Z, U[free].T @ y)
    # A_φ = µ₀ m sin θ/(4πr²); the orthonormal harmonic of degree one is √(3/4) sin θ, up to sign.
    first = abs(U[:, 0] @ A)
    moment = first * 4 * np.pi * radius**2 / MU_0 * np.sqrt(3 / 4)
    # ½∫µ₀µH² = ½∫B_r²/(µ₀µ) − ½ b·A, since b·A = ∫ν B·B over all space.
    material = ring.material
    stored = 0.5 * material.remanence**2 / (MU_0 * material.recoil_permeability) * ring.volume
    return VectorSolution(float(moment), float(stored - 0.5 * 2 * np.pi * b @ A))
