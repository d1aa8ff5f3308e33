"""Fifteen numbers are a whole jet in air: B, and the independent entries of its symmetric, trace-free derivatives.

Packed order: B_x, B_y, B_z; the gradient's xx, xy, xz, yy, yz; the hessian's xxx, xxy, xxz, xyy, xyz, yyy, yyz.

Kernels work on blocks of points, packed jets as rows (15, BLOCK): their inner loops run over the points of a block and
so use the processor's vector units.
"""

from __future__ import annotations

from magfem.compiled import kernel
from magfem.typing import Floats

BLOCK = 32
"""Points that kernels work on at a time."""

WORK_ROWS = 24
"""Rows of the work space (WORK_ROWS, BLOCK) that every kernel of a source may overwrite."""


@kernel
def add_axisymmetric(x: Floats, y: Floats, profile: Floats, count: int, order: int, out: Floats) -> None:
    """Add the jets of a field of revolution about z to `out` (15, BLOCK) at `count` points.

    profile: rows F, G, F_s, G_s, G_sz, G_ss (6, BLOCK) of B_z = F(s, z), B_ρ/ρ = G(s, z), s = x² + y². B is free of
    curl, G_z = 2 F_s, and of divergence, F_z = −2 (G + s G_s): these are the whole jet.
    """
    for j in range(count):
        out[0, j] += x[j] * profile[1, j]
        out[1, j] += y[j] * profile[1, j]
        out[2, j] += profile[0, j]
    if order < 1:
        return
    for j in range(count):
        G, F_s, G_s = profile[1, j], profile[2, j], profile[3, j]
        out[3, j] += G + 2.0 * x[j] * x[j] * G_s
        out[4, j] += 2.0 * x[j] * y[j] * G_s
        out[5, j] += 2.0 * x[j] * F_s
        out[6, j] += G + 2.0 * y[j] * y[j] * G_s
        out[7, j] += 2.0 * y[j] * F_s
    if order < 2:
        return
    for j in range(count):
        F_s, G_s, G_sz, G_ss = profile[2, j], profile[3, j], profile[4, j], profile[5, j]
        xx, yy = x[j] * x[j], y[j] * y[j]
        out[8, j] += x[j] * (6.0 * G_s + 4.0 * xx * G_ss)
        out[9, j] += y[j] * (2.0 * G_s + 4.0 * xx * G_ss)
        out[10, j] += 2.0 * (F_s + xx * G_sz)
        out[11, j] += x[j] * (2.0 * G_s + 4.0 * yy * G_ss)
        out[12, j] += 2.0 * x[j] * y[j] * G_sz
        out[13, j] += y[j] * (6.0 * G_s + 4.0 * yy * G_ss)
        out[14, j] += 2.0 * (F_s + yy * G_sz)


@kernel
def add_rotated(f: Floats, local: Floats, count: int, order: int, total: Floats) -> None:
    """Add packed jets (15, BLOCK) of the frame `f` (9,; row by row, columns are its axes), turned, to `total`."""
    for j in range(count):
        for i in range(3):
            total[i, j] += f[3 * i] * local[0, j] + f[3 * i + 1] * local[1, j] + f[3 * i + 2] * local[2, j]
    if order < 1:
        return
    for j in range(count):
        xx, xy, xz, yy, yz = local[3, j], local[4, j], local[5, j], local[6, j], local[7, j]
        zz = -xx - yy
        # Rows x and y of f · gradient, then their products with the rows of f.
        ax = f[0] * xx + f[1] * xy + f[2] * xz
        ay = f[0] * xy + f[1] * yy + f[2] * yz
        az = f[0] * xz + f[1] * yz + f[2] * zz
        bx = f[3] * xx + f[4] * xy + f[5] * xz
        by = f[3] * xy + f[4] * yy + f[5] * yz
        bz = f[3] * xz + f[4] * yz + f[5] * zz
        total[3, j] += ax * f[0] + ay * f[1] + az * f[2]
        total[4, j] += ax * f[3] + ay * f[4] + az * f[5]
        total[5, j] += ax * f[6] + ay * f[7] + az * f[8]
        total[6, j] += bx * f[3] + by * f[4] + bz * f[5]
        total[7, j] += bx * f[6] + by * f[7] + bz * f[8]
    if order < 2:
        return
    for n, (p, q, r) in enumerate(((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 1), (0, 1, 2), (1, 1, 1), (1, 1, 2))):
        for j in range(count):
            xxx, xxy, xxz, xyy = local[8, j], local[9, j], local[10, j], local[11, j]
            xyz, yyy, yyz = local[12, j], local[13, j], local[14, j]
            xzz, yzz, zzz = -xxx - xyy, -xxy - yyy, -xxz - yyz
            u, v, w = f[3 * p], f[3 * p + 1], f[3 * p + 2]
            xx = u * xxx + v * xxy + w * xxz
            xy = u * xxy + v * xyy + w * xyz
            xz = u * xxz + v * xyz + w * xzz
            yy = u * xyy + v * yyy + w * yyz
            yz = u * xyz + v * yyz + w * yzz
            zz = u * xzz + v * yzz + w * zzz
            u, v, w = f[3 * q], f[3 * q + 1], f[3 * q + 2]
            ax, ay, az = u * xx + v * xy + w * xz, u * xy + v * yy + w * yz, u * xz + v * yz + w * zz
            total[8 + n, j] += ax * f[3 * r] + ay * f[3 * r + 1] + az * f[3 * r + 2]


@kernel
def unpack_gradient(packed: Floats, gradient: Floats) -> None:
    """The symmetric, trace-free (3, 3) of one packed jet (15,)."""
    xx, xy, xz, yy, yz = packed[3], packed[4], packed[5], packed[6], packed[7]
    gradient[0, 0], gradient[0, 1], gradient[0, 2] = xx, xy, xz
    gradient[1, 0], gradient[1, 1], gradient[1, 2] = xy, yy, yz
    gradient[2, 0], gradient[2, 1], gradient[2, 2] = xz, yz, -xx - yy


@kernel
def unpack_hessian(packed: Floats, h: Floats) -> None:
    """The symmetric, trace-free (3, 3, 3) of one packed jet (15,)."""
    xxx, xxy, xxz, xyy = packed[8], packed[9], packed[10], packed[11]
    xyz, yyy, yyz = packed[12], packed[13], packed[14]
    xzz, yzz, zzz = -xxx - xyy, -xxy - yyy, -xxz - yyz
    h[0, 0, 0], h[0, 0, 1], h[0, 0, 2] = xxx, xxy, xxz
    h[0, 1, 0], h[0, 1, 1], h[0, 1, 2] = xxy, xyy, xyz
    h[0, 2, 0], h[0, 2, 1], h[0, 2, 2] = xxz, xyz, xzz
    h[1, 0, 0], h[1, 0, 1], h[1, 0, 2] = xxy, xyy, xyz
    h[1, 1, 0], h[1, 1, 1], h[1, 1, 2] = xyy, yyy, yyz
    h[1, 2, 0], h[1, 2, 1], h[1, 2, 2] = xyz, yyz, yzz
    h[2, 0, 0], h[2, 0, 1], h[2, 0, 2] = xxz, xyz, xzz
    h[2, 1, 0], h[2, 1, 1], h[2, 1, 2] = xyz, yyz, yzz
    h[2, 2, 0], h[2, 2, 1], h[2, 2, 2] = xzz, yzz, zzz


@kernel
def unpack(packed: Floats, count: int, order: int, B: Floats, gradient: Floats, hessian: Floats) -> None:
    """Packed jets (15, BLOCK) into B (count, 3), gradient (count, 3, 3) and hessian (count, 3, 3, 3)."""
    for j in range(count):
        B[j, 0], B[j, 1], B[j, 2] = packed[0, j], packed[1, j], packed[2, j]
    if order < 1:
        return
    for j in range(count):
        unpack_gradient(packed[:, j], gradient[j])
    if order < 2:
        return
    for j in range(count):
        unpack_hessian(packed[:, j], hessian[j])
