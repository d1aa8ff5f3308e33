"""Exterior solid harmonics about a centre: B, gradient and hessian in one pass, compiled.

The convention is geomagnetism's: with reference radius a and Schmidt's semi-normalised functions P_l^m,

    V = a Σ (a/r)^{l+1} (g_lm cos mφ + h_lm sin mφ) P_l^m(cos θ),    B = −∇V,

so coefficients are in T (or T/A). Inside, V = Re Σ C_lm J_l^m with J_l^m = (l−m)! P_l^m e^{imφ} / r^{l+1} on
points in units of a. These functions are closed under differentiation,

    ∂_z J_l^m = −J_{l+1}^m,   (∂_x + i∂_y) J_l^m = −J_{l+1}^{m+1},   (∂_x − i∂_y) J_l^m = J_{l+1}^{m−1},

with J_l^{−m} = (−1)^m conj J_l^m: field, gradient and hessian are sums over one table.
"""

from __future__ import annotations

from math import factorial, sqrt

import numpy as np
from numpy.typing import NDArray

from magfem.compiled import kernel
from magfem.typing import Floats, Integers

Complexes = NDArray[np.complex128]


def schmidt_scale(degree: int, order: int) -> float:
    """The factor N with (l−m)! P_l^m N = Schmidt's P_l^m: C_lm = a N (g_lm − i h_lm)."""
    ratio = factorial(degree - order) / factorial(degree + order)
    return sqrt((1 if order == 0 else 2) * ratio) / factorial(degree - order)


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
def _entry(table: Complexes, degree: int, order: int) -> complex:
    """J_l^m for either sign of m."""
    value: complex = table[degree, abs(order)]
    if order >= 0:
        return value
    return -value.conjugate() if order % 2 else value.conjugate()


@kernel
def add_harmonics(
    x: float,
    y: float,
    z: float,
    radius: float,
    degrees: Integers,
    orders: Integers,
    coefficients: Complexes,
    order: int,
    table: Complexes,
    out: Floats,
) -> None:
    """Add the jet of Re Σ C J at one point of the source's own frame to `out` (15,), packed as by `add_loop`.

    `coefficients` are the C_lm of this source; `table` is work space of at least (max degree + order + 2)
    rows and (max order + order + 2) columns. Infinite or NaN at the centre.
    """
    top, widest = 0, 0
    for i in range(degrees.size):
        top = max(top, degrees[i])
        widest = max(widest, orders[i])
    fill_table(x / radius, y / radius, z / radius, top + order + 1, widest + order + 1, table)
    z1 = p1 = q1 = complex(0.0, 0.0)
    zz = zp = zq = pp = qq = complex(0.0, 0.0)
    ppp = ppq = pqq = qqq = zpp = zpq = zqq = complex(0.0, 0.0)
    # p stands for ∂_x + i∂_y and q for ∂_x − i∂_y; pq = −zz by Laplace's equation.
    for i in range(degrees.size):
        n, m, C = degrees[i], orders[i], coefficients[i]
        z1 -= C * table[n + 1, m]
        p1 -= C * table[n + 1, m + 1]
        q1 += C * _entry(table, n + 1, m - 1)
        if order > 0:
            zz += C * table[n + 2, m]
            zp += C * table[n + 2, m + 1]
            zq -= C * _entry(table, n + 2, m - 1)
            pp += C * table[n + 2, m + 2]
            qq += C * _entry(table, n + 2, m - 2)
        if order > 1:
            ppp -= C * table[n + 3, m + 3]
            ppq += C * table[n + 3, m + 1]
            pqq -= C * _entry(table, n + 3, m - 1)
            qqq += C * _entry(table, n + 3, m - 3)
            zpp -= C * table[n + 3, m + 2]
            zpq += C * table[n + 3, m]
            zqq -= C * _entry(table, n + 3, m - 2)
    scale = -1.0 / radius  # B = −∇V, one 1/a for each derivative
    out[0] += scale * 0.5 * (p1 + q1).real
    out[1] += scale * 0.5 * (p1 - q1).imag
    out[2] += scale * z1.real
    if order < 1:
        return
    scale /= radius
    out[3] += scale * 0.25 * (pp - 2.0 * zz + qq).real
    out[4] += scale * 0.25 * (pp - qq).imag
    out[5] += scale * 0.5 * (zp + zq).real
    out[6] += scale * -0.25 * (pp + 2.0 * zz + qq).real
    out[7] += scale * 0.5 * (zp - zq).imag
    if order < 2:
        return
    scale /= radius
    out[8] += scale * 0.125 * (ppp + 3.0 * ppq + 3.0 * pqq + qqq).real
    out[9] += scale * 0.125 * (ppp + ppq - pqq - qqq).imag
    out[10] += scale * 0.25 * (zpp + 2.0 * zpq + zqq).real
    out[11] += scale * -0.125 * (ppp - ppq - pqq + qqq).real
    out[12] += scale * 0.25 * (zpp - zqq).imag
    out[13] += scale * -0.125 * (ppp - 3.0 * ppq + 3.0 * pqq - qqq).imag
    out[14] += scale * -0.25 * (zpp - 2.0 * zpq + zqq).real
