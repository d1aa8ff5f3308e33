"""Scalar potential of permanent magnets in 3D: curved second-order tetrahedra, open boundary on a sphere.

H = −∇φ and B = µ₀ µ H + B_r with the recoil permeability µ (relative) and remanence B_r; div B = 0 in weak form:

    ∫ µ ∇φ·∇ψ dV + boundary(φ, ψ) = ∫ (B_r/µ₀)·∇ψ dV.

The bodies' bound currents, from which the field is integrated, need φ on the surfaces only. There it is computed
once more, from its own sources: along rims the elements' φ is least accurate, and what is left of it decides where
the fields of several bodies nearly cancel.
"""

from __future__ import annotations

import numpy as np

from magfem.constants import MU_0
from magfem.fem.discrete import Discrete
from magfem.fem.linear_solver import solve_open, two_level
from magfem.fem.open_boundary import sphere
from magfem.fem.stiffness import assemble
from magfem.fem.surface_currents import SurfaceCurrents
from magfem.fem.surface_potential import surface_potential
from magfem.mesh.mesh import Mesh
from magfem.mesh.shape_functions import shape_gradients
from magfem.typing import Floats


def solve(mesh: Mesh, permeability: Floats, magnetisation: Floats) -> Discrete:
    """Solve a tetrahedral mesh whose bodies have relative `permeability` (b,) and `magnetisation` (b, 3) A/m.

    `magnetisation` is remanence/µ₀. Raises MeshError, ConvergenceError.
    """
    inside = mesh.body >= 0
    mu = np.where(inside, permeability[mesh.body], 1.0)
    m = np.where(inside[:, None], magnetisation[mesh.body], 0.0)
    stiffness, load, volume = assemble(mesh, mu, m)
    boundary = sphere(mesh)
    cycle = two_level((stiffness + boundary.preconditioner).tocsr(), mesh)
    result = solve_open(stiffness, boundary, load, cycle)
    potential = result.values
    currents = _currents(mesh, potential, permeability, magnetisation)
    exterior = boundary.coefficients(potential)
    # φ = m·x/(4πr³) outside: the harmonics of degree one are Y = √(3/4π) (z, x, y)/r, in this order.
    dipole = 4 * np.pi * boundary.radius**2 * np.sqrt(3 / (4 * np.pi)) * exterior[[2, 3, 1]]
    return Discrete(
        mesh=mesh,
        currents=currents,
        potential=potential,
        flux_density=_flux_density(mesh, potential, mu, m),
        volume=np.bincount(mesh.body[inside], volume[inside], minlength=len(mesh.names)).astype(float),
        quantities={
            "moment": currents.moment.tolist(),
            "boundary_moment": dipole.tolist(),
            "field_energy": float(0.5 * MU_0 * load @ potential),
            "boundary_flux": float(MU_0 * boundary.radius * np.sqrt(4 * np.pi) * exterior[0]),
        },
        unknowns=load.size,
        iterations=result.iterations,
        residual=result.residual,
    )


def _currents(mesh: Mesh, potential: Floats, permeability: Floats, magnetisation: Floats) -> SurfaceCurrents:
    facets = [mesh.body_facets(index)[0] for index in range(len(mesh.names))]
    owner = np.repeat(np.arange(len(facets)), [len(f) for f in facets])
    nodes = np.concatenate(facets)
    M, chi = magnetisation[owner], permeability[owner] - 1.0
    found = surface_potential(mesh.points, nodes, potential, M, chi)
    return SurfaceCurrents(mesh.points[nodes], found[nodes], M, chi)


def _flux_density(mesh: Mesh, potential: Floats, mu: Floats, m: Floats) -> Floats:
    """B (e, 3) T in the middle of every cell."""
    shapes = shape_gradients(np.full((1, 3), 0.25))[0]
    jacobian = np.einsum("eai,aj->eij", mesh.points[mesh.cells], shapes)
    slope = np.einsum("ea,aj->ej", potential[mesh.cells], shapes)
    H = -np.linalg.solve(np.swapaxes(jacobian, 1, 2), slope[..., None])[..., 0]
    B: Floats = MU_0 * (mu[:, None] * H + m)
    return B
