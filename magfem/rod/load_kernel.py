"""What acts on the chain's nodes: dead forces, couples and magnets in a field; compiled.

A dipole µ = R m at a = R r from its node, in a field of potential −µ·B: force f_j = Σ_i µ_i ∂B_i/∂x_j, torque about the
node µ × B + a × f. Its derivatives need the field's hessian.
"""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel
from magfem.typing import Floats, Integers


@kernel
def field_points(node: Integers, offset: Floats, R: Floats, p: Floats, out: Floats) -> None:
    """Where the dipoles are: out (m, 3); node (m,), offset (m, 3) in the axes of the node."""
    for k in range(node.size):
        n = node[k]
        for i in range(3):
            shift = R[n, i, 0] * offset[k, 0] + R[n, i, 1] * offset[k, 1] + R[n, i, 2] * offset[k, 2]
            out[k, i] = p[n, i] + shift


@kernel
def _cross(a: Floats, b: Floats, out: Floats) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def node_loads(
    force: Floats,
    couple: Floats,
    node: Integers,
    offset: Floats,
    moment: Floats,
    R: Floats,
    p: Floats,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
    wrench: Floats,
    tangent: Floats,
) -> float:
    """Write the nodes' wrenches and tangents, as `chain_kernel.factor` wants them; returns the potential energy, J.

    force: (n, 3) N dead.  couple: (n, 3) N·m, c of a potential −c·(R ẑ): a torque (R ẑ) × c.  node, offset, moment:
    (m,), (m, 3) m, (m, 3) A·m² of the dipoles, in their node's axes.  B, gradient, hessian: the field at the dipoles.
    wrench: (n, 6) torque, force.  tangent: (n, 6, 6).
    """
    energy = 0.0
    for n in range(force.shape[0]):
        for i in range(6):
            wrench[n, i] = 0.0
            for j in range(6):
                tangent[n, i, j] = 0.0
        for i in range(3):
            wrench[n, 3 + i] = force[n, i]
            energy -= force[n, i] * p[n, i]
        for axis in range(3):
            c0, c1, c2 = couple[n, 0, axis], couple[n, 1, axis], couple[n, 2, axis]
            if c0 == 0.0 and c1 == 0.0 and c2 == 0.0:
                continue
            z0, z1, z2 = R[n, 0, axis], R[n, 1, axis], R[n, 2, axis]
            wrench[n, 0] += z1 * c2 - z2 * c1
            wrench[n, 1] += z2 * c0 - z0 * c2
            wrench[n, 2] += z0 * c1 - z1 * c0
            along = z0 * c0 + z1 * c1 + z2 * c2
            energy -= along
            for i in range(3):
                for j in range(3):
                    tangent[n, i, j] -= 0.5 * (R[n, i, axis] * couple[n, j, axis] + couple[n, i, axis] * R[n, j, axis])
                tangent[n, i, i] += along
    mu, a, f, t, u = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    F, GM, K = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 6))
    for k in range(node.size):
        n = node[k]
        for i in range(3):
            mu[i] = R[n, i, 0] * moment[k, 0] + R[n, i, 1] * moment[k, 1] + R[n, i, 2] * moment[k, 2]
            a[i] = R[n, i, 0] * offset[k, 0] + R[n, i, 1] * offset[k, 1] + R[n, i, 2] * offset[k, 2]
        for j in range(3):
            f[j] = mu[0] * gradient[k, 0, j] + mu[1] * gradient[k, 1, j] + mu[2] * gradient[k, 2, j]
            for l in range(3):  # noqa: E741
                F[j, l] = mu[0] * hessian[k, 0, j, l] + mu[1] * hessian[k, 1, j, l] + mu[2] * hessian[k, 2, j, l]
        _cross(mu, B[k], t)
        _cross(a, f, u)
        muB = mu[0] * B[k, 0] + mu[1] * B[k, 1] + mu[2] * B[k, 2]
        af = a[0] * f[0] + a[1] * f[1] + a[2] * f[2]
        energy -= muB
        for i in range(3):
            wrench[n, i] += t[i] + u[i]
            wrench[n, 3 + i] += f[i]
        # K = ∂(torque, force)/∂(ω, v); a column of ω moves the dipole by ω × a and turns its moment by ω × µ.
        for j in range(3):
            _cross(mu, gradient[k, :, j], GM[:, j])
        for j in range(3):
            # e_j × µ and e_j × a
            m0 = 0.0 if j == 0 else (mu[2] if j == 1 else -mu[1])
            m1 = -mu[2] if j == 0 else (0.0 if j == 1 else mu[0])
            m2 = mu[1] if j == 0 else (-mu[0] if j == 1 else 0.0)
            a0 = 0.0 if j == 0 else (a[2] if j == 1 else -a[1])
            a1 = -a[2] if j == 0 else (0.0 if j == 1 else a[0])
            a2 = a[1] if j == 0 else (-a[0] if j == 1 else 0.0)
            for i in range(3):
                K[3 + i, 3 + j] = F[i, j]
                K[3 + i, j] = gradient[k, 0, i] * m0 + gradient[k, 1, i] * m1 + gradient[k, 2, i] * m2
                K[3 + i, j] += F[i, 0] * a0 + F[i, 1] * a1 + F[i, 2] * a2
                K[i, 3 + j] = GM[i, j]
                K[i, j] = mu[i] * B[k, j] + a[i] * f[j] + GM[i, 0] * a0 + GM[i, 1] * a1 + GM[i, 2] * a2
            K[j, j] -= muB + af
        for j in range(6):  # [a]× times the force's derivative
            f0, f1, f2 = K[3, j], K[4, j], K[5, j]
            K[0, j] += a[1] * f2 - a[2] * f1
            K[1, j] += a[2] * f0 - a[0] * f2
            K[2, j] += a[0] * f1 - a[1] * f0
        for i in range(6):
            for j in range(6):
                tangent[n, i, j] -= 0.5 * (K[i, j] + K[j, i])
    return energy


@kernel
def field_loads(
    node: Integers, offset: Floats, moment: Floats, R: Floats, dB: Floats, dG: Floats, load: Floats
) -> None:
    """Add to load (n, 6, k) the torque, force that changes of the field, dB (k, m, 3), dG (k, m, 3, 3), make."""
    mu, a, f, t, u = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for m in range(node.size):
        n = node[m]
        for i in range(3):
            mu[i] = R[n, i, 0] * moment[m, 0] + R[n, i, 1] * moment[m, 1] + R[n, i, 2] * moment[m, 2]
            a[i] = R[n, i, 0] * offset[m, 0] + R[n, i, 1] * offset[m, 1] + R[n, i, 2] * offset[m, 2]
        for k in range(dB.shape[0]):
            for j in range(3):
                f[j] = mu[0] * dG[k, m, 0, j] + mu[1] * dG[k, m, 1, j] + mu[2] * dG[k, m, 2, j]
            _cross(mu, dB[k, m], t)
            _cross(a, f, u)
            for i in range(3):
                load[n, i, k] += t[i] + u[i]
                load[n, 3 + i, k] += f[i]
