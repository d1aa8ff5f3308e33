"""Solid harmonics of order 1 about a centre: the multipoles of magnets that are magnetised across their axis; compiled.

In units of the reference radius, V = x q(s, z) with q = Σ C_l Q_l^1, in the notation of `zonal_harmonics`: all
derivatives are sums over the columns 1 to 4 of one table of real numbers, where harmonics of mixed orders take complex
ones. The sine part, V = y q, is the same with x and y exchanged.

Measured against 100-digit arithmetic, single degrees: relative error of B, gradient and hessian 6e-15 to degree 10,
7e-14 to degree 80.
"""

from __future__ import annotations

from math import sqrt

from magfem.compiled import kernel
from magfem.typing import Floats


@kernel
def add_transverse(
    x: Floats,
    y: Floats,
    z: Floats,
    count: int,
    radius: float,
    coefficients: Floats,
    sine: bool,
    order: int,
    work: Floats,
    out: Floats,
) -> None:
    """Add the jets at `count` points of the source's own frame to `out` (15, BLOCK), packed.

    x, y, z: (BLOCK,) m.  radius: a, m.  coefficients: (top + 6,) T, C_l at 3 + l, zeros around them.  sine: whether
    they are the h_l1 rather than the g_l1. Infinite at the centre.
    """
    if sine:
        x, y = y, x
    a = 1.0 / radius
    # Rows: z/r², 1/r², 1/r³; of each column m here and before; from 11 on Σ C Q_l^1 and, with one letter for each
    # derivative, u by s (times −2) and v by z (times −1): p, p_u, p_v, p_uu, p_uv, p_uuu, p_uuv.
    for row in range(3, 18):
        for j in range(count):
            work[row, j] = 0.0
    for j in range(count):
        height = z[j] * a
        inverse = 1.0 / ((x[j] * x[j] + y[j] * y[j]) * a * a + height * height)
        work[0, j] = height * inverse
        work[1, j] = inverse
        work[2, j] = sqrt(inverse) * inverse
    size = coefficients.size
    for degree in range(1, size - 4 + order):
        last = degree - 1
        step, square = 2.0 * last + 1.0, 1.0 * last * last
        begin1, begin2 = 1.0 if degree == 1 else 0.0, 3.0 if degree == 2 else 0.0
        C, D = coefficients[3 + degree] if degree < size - 3 else 0.0, coefficients[2 + degree]
        for j in range(count):
            climb, inverse = step * work[0, j], work[1, j]
            q1 = climb * work[3, j] - (square - 1.0) * inverse * work[4, j] + begin1 * work[2, j]
            work[4, j] = work[3, j]
            work[3, j] = q1
            q2 = climb * work[5, j] - (square - 4.0) * inverse * work[6, j] + begin2 * work[2, j] * inverse
            work[6, j] = work[5, j]
            work[5, j] = q2
            work[11, j] += C * q1
            work[12, j] += D * q2
            work[13, j] += D * q1
        if order > 0:
            begin3 = 15.0 if degree == 3 else 0.0
            C = coefficients[1 + degree]
            for j in range(count):
                inverse = work[1, j]
                q3 = (
                    step * work[0, j] * work[7, j]
                    - (square - 9.0) * inverse * work[8, j]
                    + begin3 * work[2, j] * inverse * inverse
                )
                work[8, j] = work[7, j]
                work[7, j] = q3
                work[14, j] += C * q3
                work[15, j] += C * work[5, j]
        if order > 1:
            begin4 = 105.0 if degree == 4 else 0.0
            C = coefficients[degree]
            for j in range(count):
                inverse = work[1, j]
                q4 = (
                    step * work[0, j] * work[9, j]
                    - (square - 16.0) * inverse * work[10, j]
                    + begin4 * work[2, j] * inverse * inverse * inverse
                )
                work[10, j] = work[9, j]
                work[9, j] = q4
                work[16, j] += C * q4
                work[17, j] += C * work[7, j]
    first, second = (1, 0) if sine else (0, 1)
    for j in range(count):
        u, v = x[j] * a, y[j] * a
        out[first, j] += u * u * work[12, j] - work[11, j]
        out[second, j] += u * v * work[12, j]
        out[2, j] += u * work[13, j]
    if order < 1:
        return
    xx, xz, yy, yz = (6, 7, 3, 5) if sine else (3, 5, 6, 7)
    for j in range(count):
        u, v = x[j] * a, y[j] * a
        p_u, p_v, p_uu, p_uv = work[12, j], work[13, j], work[14, j], work[15, j]
        out[xx, j] += a * (u * (3.0 * p_u - u * u * p_uu))
        out[4, j] += a * (v * (p_u - u * u * p_uu))
        out[xz, j] += a * (p_v - u * u * p_uv)
        out[yy, j] += a * (u * (p_u - v * v * p_uu))
        out[yz, j] -= a * (u * v * p_uv)
    if order < 2:
        return
    xxx, xxy, xxz, xyy, yyy, yyz = (13, 11, 14, 9, 8, 10) if sine else (8, 9, 10, 11, 13, 14)
    for j in range(count):
        u, v, a2 = x[j] * a, y[j] * a, a * a
        p_u, p_uu, p_uv, p_uuu, p_uuv = work[12, j], work[14, j], work[15, j], work[16, j], work[17, j]
        out[xxx, j] += a2 * (3.0 * p_u + u * u * (u * u * p_uuu - 6.0 * p_uu))
        out[xxy, j] += a2 * (u * v * (u * u * p_uuu - 3.0 * p_uu))
        out[xxz, j] += a2 * (u * (u * u * p_uuv - 3.0 * p_uv))
        out[xyy, j] += a2 * (p_u - (u * u + v * v) * p_uu + u * u * v * v * p_uuu)
        out[12, j] += a2 * (v * (u * u * p_uuv - p_uv))
        out[yyy, j] += a2 * (u * v * (v * v * p_uuu - 3.0 * p_uu))
        out[yyz, j] += a2 * (u * (v * v * p_uuv - p_uv))
