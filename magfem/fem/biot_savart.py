"""What one element of current adds to a field, compiled: its Biot–Savart term, or its term 1/r.

Sums leave the factor µ0/4π to the caller. `order` 0, 1, 2 adds to B, to B and gradient, or to the hessian too.
"""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel, summing_kernel
from magfem.constants import MU_0
from magfem.typing import Floats


@kernel
def _add_sums(sums: tuple[float, ...], order: int, value: Floats, gradient: Floats) -> None:
    """Add three sums to a vector and, from order 1, nine to a matrix, row by row."""
    for i in range(3):
        value[i] += sums[i]
        if order > 0:
            for j in range(3):
                gradient[i, j] += sums[3 + 3 * i + j]


@kernel
def put_sums(
    i: int, order: int, b: Floats, g: Floats, h: Floats, value: Floats, gradient: Floats, hessian: Floats
) -> None:
    """Write the sums at point `i`, times µ0/4π, into the arrays of a jet."""
    factor = MU_0 / (4.0 * np.pi)
    for j in range(3):
        value[i, j] = factor * b[j]
        if order > 0:
            for k in range(3):
                gradient[i, j, k] = factor * g[j, k]
                if order > 1:
                    for m in range(3):
                        hessian[i, j, k, m] = factor * h[j, k, m]


@kernel
def add_current(
    rx: float,
    ry: float,
    rz: float,
    kx: float,
    ky: float,
    kz: float,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Add K × r/r³ and its derivatives with respect to the point; r leads from the element to the point."""
    r2 = rx * rx + ry * ry + rz * rz
    i3 = 1.0 / (r2 * np.sqrt(r2))
    cx, cy, cz = ky * rz - kz * ry, kz * rx - kx * rz, kx * ry - ky * rx
    B[0] += cx * i3
    B[1] += cy * i3
    B[2] += cz * i3
    if order < 1:
        return
    # ∂_j (K × r)_i i3 = ε_iaj K_a i3 − 3 c_i r_j / r⁵
    i5 = -3.0 * i3 / r2
    gradient[0, 0] += cx * rx * i5
    gradient[0, 1] += cx * ry * i5 - kz * i3
    gradient[0, 2] += cx * rz * i5 + ky * i3
    gradient[1, 0] += cy * rx * i5 + kz * i3
    gradient[1, 1] += cy * ry * i5
    gradient[1, 2] += cy * rz * i5 - kx * i3
    gradient[2, 0] += cz * rx * i5 - ky * i3
    gradient[2, 1] += cz * ry * i5 + kx * i3
    gradient[2, 2] += cz * rz * i5
    if order < 2:
        return
    i7 = -5.0 * i5 / r2
    r = (rx, ry, rz)
    c = (cx, cy, cz)
    e = ((0.0, -kz, ky), (kz, 0.0, -kx), (-ky, kx, 0.0))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                value = c[i] * r[j] * r[k] * i7 + (e[i][j] * r[k] + e[i][k] * r[j]) * i5
                if j == k:
                    value += c[i] * i5
                hessian[i, j, k] += value


@summing_kernel
def add_currents(
    x: float,
    y: float,
    z: float,
    distant: Floats,
    share: Floats,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Add all elements `distant` (6, q, t), places then strengths, whose `share` (t,) is one.

    The same sums as `add_current`, written for vector units; the hessian, rarely wanted, is not.
    """
    if order > 1:
        for q in range(distant.shape[1]):
            for t in range(distant.shape[2]):
                if share[t] == 1.0:
                    e = distant[:, q, t]
                    add_current(x - e[0], y - e[1], z - e[2], e[3], e[4], e[5], order, B, gradient, hessian)
        return
    bx = by = bz = 0.0
    gxx = gxy = gxz = gyx = gyy = gyz = gzx = gzy = gzz = 0.0
    for q in range(distant.shape[1]):
        px, py, pz = distant[0, q], distant[1, q], distant[2, q]
        sx, sy, sz = distant[3, q], distant[4, q], distant[5, q]
        if order == 0:
            for t in range(distant.shape[2]):
                rx, ry, rz = x - px[t], y - py[t], z - pz[t]
                r2 = max(rx * rx + ry * ry + rz * rz, 1e-60)
                i3 = share[t] / (r2 * np.sqrt(r2))
                bx += (sy[t] * rz - sz[t] * ry) * i3
                by += (sz[t] * rx - sx[t] * rz) * i3
                bz += (sx[t] * ry - sy[t] * rx) * i3
        else:
            for t in range(distant.shape[2]):
                rx, ry, rz = x - px[t], y - py[t], z - pz[t]
                r2 = max(rx * rx + ry * ry + rz * rz, 1e-60)
                inverse = 1.0 / r2
                i3 = share[t] * inverse * np.sqrt(inverse)
                kx, ky, kz = sx[t] * i3, sy[t] * i3, sz[t] * i3
                cx, cy, cz = ky * rz - kz * ry, kz * rx - kx * rz, kx * ry - ky * rx
                bx += cx
                by += cy
                bz += cz
                ux, uy, uz = -3.0 * inverse * rx, -3.0 * inverse * ry, -3.0 * inverse * rz
                gxx += cx * ux
                gxy += cx * uy - kz
                gxz += cx * uz + ky
                gyx += cy * ux + kz
                gyy += cy * uy
                gyz += cy * uz - kx
                gzx += cz * ux - ky
                gzy += cz * uy + kx
                gzz += cz * uz
    _add_sums((bx, by, bz, gxx, gxy, gxz, gyx, gyy, gyz, gzx, gzy, gzz), order, B, gradient)


@kernel
def add_layer(
    rx: float,
    ry: float,
    rz: float,
    kx: float,
    ky: float,
    kz: float,
    order: int,
    A: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Add K/r and its derivatives with respect to the point; r leads from the element to the point."""
    r2 = rx * rx + ry * ry + rz * rz
    i1 = 1.0 / np.sqrt(r2)
    r = (rx, ry, rz)
    k = (kx, ky, kz)
    i3 = i1 / r2
    i5 = 3.0 * i3 / r2
    for i in range(3):
        A[i] += k[i] * i1
        if order > 0:
            for j in range(3):
                gradient[i, j] -= k[i] * r[j] * i3
                if order > 1:
                    for m in range(3):
                        hessian[i, j, m] += k[i] * r[j] * r[m] * i5
                    hessian[i, j, j] -= k[i] * i3


@summing_kernel
def add_layers(
    x: float,
    y: float,
    z: float,
    distant: Floats,
    share: Floats,
    order: int,
    A: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Add all elements `distant` (6, q, t), places then strengths, whose `share` (t,) is one, as `add_layer` does."""
    if order > 1:
        for q in range(distant.shape[1]):
            for t in range(distant.shape[2]):
                if share[t] == 1.0:
                    e = distant[:, q, t]
                    add_layer(x - e[0], y - e[1], z - e[2], e[3], e[4], e[5], order, A, gradient, hessian)
        return
    ax = ay = az = 0.0
    gxx = gxy = gxz = gyx = gyy = gyz = gzx = gzy = gzz = 0.0
    for q in range(distant.shape[1]):
        px, py, pz = distant[0, q], distant[1, q], distant[2, q]
        sx, sy, sz = distant[3, q], distant[4, q], distant[5, q]
        for t in range(distant.shape[2]):
            rx, ry, rz = x - px[t], y - py[t], z - pz[t]
            inverse = 1.0 / max(rx * rx + ry * ry + rz * rz, 1e-60)
            i1 = share[t] * np.sqrt(inverse)
            kx, ky, kz = sx[t] * i1, sy[t] * i1, sz[t] * i1
            ax += kx
            ay += ky
            az += kz
            if order > 0:
                ux, uy, uz = -inverse * rx, -inverse * ry, -inverse * rz
                gxx += kx * ux
                gxy += kx * uy
                gxz += kx * uz
                gyx += ky * ux
                gyy += ky * uy
                gyz += ky * uz
                gzx += kz * ux
                gzy += kz * uy
                gzz += kz * uz
    _add_sums((ax, ay, az, gxx, gxy, gxz, gyx, gyy, gyz, gzx, gzy, gzz), order, A, gradient)
