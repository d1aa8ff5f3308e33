"""Exterior and interior solid harmonics about a centre, of any degrees and orders: B, gradient and hessian, compiled.

The convention is geomagnetism's: with reference radius a and Schmidt's semi-normalised functions P_l^m,

    exterior   V = a Σ (a/r)^{l+1} (g_lm cos mφ + h_lm sin mφ) P_l^m(cos θ),    B = −∇V,
    interior   V = a Σ (r/a)^l     (g_lm cos mφ + h_lm sin mφ) P_l^m(cos θ),

so coefficients are in T (or T/A). On points in units of a, V = Re Σ C_lm J_l^m with

    exterior   J_l^m = (l−m)! P_l^m e^{imφ} / r^{l+1},    interior   J_l^m = r^l P_l^m e^{imφ} / (l+m)!.

Both are closed under differentiation: with d = +1 outside and −1 inside, J_l^{−m} = (−1)^m conj J_l^m,

    ∂_z J_l^m = −d J_{l+d}^m,   (∂_x + i∂_y) J_l^m = −J_{l+d}^{m+1},   (∂_x − i∂_y) J_l^m = J_{l+d}^{m−1},

and zero where the order would exceed the degree: field, gradient and hessian are sums over one table. A set of order 0
or 1 alone is faster in real numbers, `zonal_harmonics` and `transverse_harmonics`.

Measured against 100-digit arithmetic, single harmonics: relative error of B, gradient and hessian 6e-15 to degree 10,
2e-13 to degree 80; interior 1e-15 and 1e-14.
"""

from __future__ import annotations

from math import factorial, sqrt

import numpy as np

from magfem.compiled import kernel
from magfem.typing import Complexes, Floats, Integers


def schmidt_scale(degree: int, order: int) -> float:
    """The factor N with (l−m)! P_l^m N = Schmidt's P_l^m: C_lm = a N (g_lm − i h_lm) for exterior harmonics."""
    ratio = factorial(degree - order) / factorial(degree + order)
    return sqrt((1 if order == 0 else 2) * ratio) / factorial(degree - order)


def interior_scale(degree: int, order: int) -> float:
    """The factor N with P_l^m N / (l+m)! = Schmidt's P_l^m: as `schmidt_scale`, for interior harmonics."""
    return schmidt_scale(degree, order) * factorial(degree - order) * factorial(degree + order)


@kernel
def fill_table(x: float, y: float, z: float, top: int, widest: int, table: Complexes) -> None:
    """table[l, m] = J_l^m at one point, for degrees l ≤ top and orders m ≤ widest."""
    inverse = 1.0 / (x * x + y * y + z * z)
    side = complex(x, y) * inverse
    rise = z * inverse
    diagonal = complex(inverse**0.5, 0.0)
    for m in range(min(top, widest) + 1):
        if m > 0:
            diagonal = (2 * m - 1) * side * diagonal
        before = complex(0.0, 0.0)
        here = diagonal
        table[m, m] = here
        for degree in range(m, top):
            after = (2 * degree + 1) * rise * here - (degree * degree - m * m) * inverse * before
            before, here = here, after
            table[degree + 1, m] = here


@kernel
def fill_interior_table(x: float, y: float, z: float, top: int, table: Complexes) -> None:
    """table[l, m] = the interior J_l^m at one point, for degrees and orders up to `top`."""
    r2 = x * x + y * y + z * z
    diagonal = complex(1.0, 0.0)
    for m in range(top + 1):
        if m > 0:
            diagonal = diagonal * complex(x, y) / (2.0 * m)
        before = complex(0.0, 0.0)
        here = diagonal
        table[m, m] = here
        for degree in range(m, top):
            after = ((2 * degree + 1) * z * here - r2 * before) / ((degree + 1) * (degree + 1) - m * m)
            before, here = here, after
            table[degree + 1, m] = here


@kernel
def _entry(table: Complexes, degree: int, order: int) -> complex:
    """J_l^m for either sign of m; zero where there is none."""
    if degree < abs(order):
        return complex(0.0, 0.0)
    value: complex = table[degree, abs(order)]
    if order >= 0:
        return value
    return -value.conjugate() if order % 2 else value.conjugate()


@kernel
def add_harmonics(
    x: Floats,
    y: Floats,
    z: Floats,
    count: int,
    radius: float,
    degrees: Integers,
    orders: Integers,
    coefficients: Complexes,
    interior: bool,
    order: int,
    out: Floats,
) -> None:
    """Add the jets of Re Σ C J at `count` points of the source's own frame to `out` (15, BLOCK), packed.

    x, y, z: (BLOCK,) m.  radius: a, m.  coefficients: T, the C_lm over a. Exterior ones are infinite or NaN at the
    centre.
    """
    top, widest = 0, 0
    for i in range(degrees.size):
        top = max(top, degrees[i])
        widest = max(widest, orders[i])
    table = np.zeros((top + 4, top + 4), dtype=np.complex128)
    d = -1 if interior else 1
    for j in range(count):
        if interior:
            fill_interior_table(x[j] / radius, y[j] / radius, z[j] / radius, top, table)
        else:
            fill_table(x[j] / radius, y[j] / radius, z[j] / radius, top + order + 1, widest + order + 1, table)
        z1 = p1 = q1 = complex(0.0, 0.0)
        zz = zp = zq = pp = qq = complex(0.0, 0.0)
        ppp = ppq = pqq = qqq = zpp = zpq = zqq = complex(0.0, 0.0)
        # p stands for ∂_x + i∂_y and q for ∂_x − i∂_y; pq = −zz by Laplace's equation.
        for i in range(degrees.size):
            n, m, C = degrees[i], orders[i], coefficients[i]
            n += d
            z1 -= d * C * _entry(table, n, m)
            p1 -= C * _entry(table, n, m + 1)
            q1 += C * _entry(table, n, m - 1)
            if order > 0:
                n += d
                zz += C * _entry(table, n, m)
                zp += d * C * _entry(table, n, m + 1)
                zq -= d * C * _entry(table, n, m - 1)
                pp += C * _entry(table, n, m + 2)
                qq += C * _entry(table, n, m - 2)
            if order > 1:
                n += d
                ppp -= C * _entry(table, n, m + 3)
                ppq += C * _entry(table, n, m + 1)
                pqq -= C * _entry(table, n, m - 1)
                qqq += C * _entry(table, n, m - 3)
                zpp -= d * C * _entry(table, n, m + 2)
                zpq += d * C * _entry(table, n, m)
                zqq -= d * C * _entry(table, n, m - 2)
        out[0, j] -= 0.5 * (p1 + q1).real
        out[1, j] -= 0.5 * (p1 - q1).imag
        out[2, j] -= z1.real
        if order < 1:
            continue
        scale = -1.0 / radius  # B = −∇V, one 1/a for each further derivative
        out[3, j] += scale * 0.25 * (pp - 2.0 * zz + qq).real
        out[4, j] += scale * 0.25 * (pp - qq).imag
        out[5, j] += scale * 0.5 * (zp + zq).real
        out[6, j] += scale * -0.25 * (pp + 2.0 * zz + qq).real
        out[7, j] += scale * 0.5 * (zp - zq).imag
        if order < 2:
            continue
        scale /= radius
        out[8, j] += scale * 0.125 * (ppp + 3.0 * ppq + 3.0 * pqq + qqq).real
        out[9, j] += scale * 0.125 * (ppp + ppq - pqq - qqq).imag
        out[10, j] += scale * 0.25 * (zpp + 2.0 * zpq + zqq).real
        out[11, j] += scale * -0.125 * (ppp - ppq - pqq + qqq).real
        out[12, j] += scale * 0.25 * (zpp - zqq).imag
        out[13, j] += scale * -0.125 * (ppp - 3.0 * ppq + 3.0 * pqq - qqq).imag
        out[14, j] += scale * -0.25 * (zpp - 2.0 * zpq + zqq).real
