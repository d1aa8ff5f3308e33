"""Cosserat's equations of a rod along its sections, by explicit Runge–Kutta steps of order four; compiled.

A state is y = (p, q, n, m), 13 numbers: position, quaternion (real part first), internal force and moment in world
axes. Source: dissertation, eqs. 2.1–2.3. The R(q) of 2.3 is a rotation times |q|², and Runge–Kutta steps do not keep
|q| = 1: it is divided by |q|² here, so that a drift of |q| turns nothing.
"""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel
from magfem.typing import Floats, Integers


@kernel
def _rate(y: Floats, compliance: Floats, rest: Floats, force: Floats, torque: Floats, out: Floats) -> None:
    """y′ (13,), eq. 2.2; compliance, rest: (6,) of curvature u, then strain v; force, torque: (3,) per length."""
    r, a, b, c = y[3], y[4], y[5], y[6]
    s = 1.0 / (r * r + a * a + b * b + c * c)
    R00, R01, R02 = s * (r * r + a * a - b * b - c * c), s * 2.0 * (a * b - r * c), s * 2.0 * (a * c + r * b)
    R10, R11, R12 = s * 2.0 * (a * b + r * c), s * (r * r - a * a + b * b - c * c), s * 2.0 * (b * c - r * a)
    R20, R21, R22 = s * 2.0 * (a * c - r * b), s * 2.0 * (b * c + r * a), s * (r * r - a * a - b * b + c * c)
    n0, n1, n2, m0, m1, m2 = y[7], y[8], y[9], y[10], y[11], y[12]
    u0 = compliance[0] * (R00 * m0 + R10 * m1 + R20 * m2) + rest[0]
    u1 = compliance[1] * (R01 * m0 + R11 * m1 + R21 * m2) + rest[1]
    u2 = compliance[2] * (R02 * m0 + R12 * m1 + R22 * m2) + rest[2]
    v0 = compliance[3] * (R00 * n0 + R10 * n1 + R20 * n2) + rest[3]
    v1 = compliance[4] * (R01 * n0 + R11 * n1 + R21 * n2) + rest[4]
    v2 = compliance[5] * (R02 * n0 + R12 * n1 + R22 * n2) + rest[5]
    p0, p1, p2 = R00 * v0 + R01 * v1 + R02 * v2, R10 * v0 + R11 * v1 + R12 * v2, R20 * v0 + R21 * v1 + R22 * v2
    w0, w1, w2 = R00 * u0 + R01 * u1 + R02 * u2, R10 * u0 + R11 * u1 + R12 * u2, R20 * u0 + R21 * u1 + R22 * u2
    out[0], out[1], out[2] = p0, p1, p2
    out[3] = -0.5 * (a * w0 + b * w1 + c * w2)
    out[4] = 0.5 * (r * w0 - (b * w2 - c * w1))
    out[5] = 0.5 * (r * w1 - (c * w0 - a * w2))
    out[6] = 0.5 * (r * w2 - (a * w1 - b * w0))
    out[7], out[8], out[9] = -force[0], -force[1], -force[2]
    out[10] = -(p1 * n2 - p2 * n1) - torque[0]
    out[11] = -(p2 * n0 - p0 * n2) - torque[1]
    out[12] = -(p0 * n1 - p1 * n0) - torque[2]


@kernel
def integrate(
    length: Floats,
    steps: Integers,
    compliance: Floats,
    rest: Floats,
    force: Floats,
    torque: Floats,
    Y: Floats,
) -> None:
    """From Y[0] (13,) on along the rod to Y (N + 1, 13), N the sum of `steps`.

    Of every section length, steps: (k,); compliance, rest: (k, 6); force, torque: (k, 3) per length, world axes.
    """
    k1, k2, k3, k4, at = np.empty(13), np.empty(13), np.empty(13), np.empty(13), np.empty(13)
    row = 0
    for part in range(steps.size):
        h = length[part] / steps[part]
        c, r, f, t = compliance[part], rest[part], force[part], torque[part]
        for _ in range(steps[part]):
            y = Y[row]
            _rate(y, c, r, f, t, k1)
            for i in range(13):
                at[i] = y[i] + 0.5 * h * k1[i]
            _rate(at, c, r, f, t, k2)
            for i in range(13):
                at[i] = y[i] + 0.5 * h * k2[i]
            _rate(at, c, r, f, t, k3)
            for i in range(13):
                at[i] = y[i] + h * k3[i]
            _rate(at, c, r, f, t, k4)
            for i in range(13):
                Y[row + 1, i] = y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            row += 1


@kernel
def slope(
    length: Floats,
    steps: Integers,
    compliance: Floats,
    rest: Floats,
    force: Floats,
    torque: Floats,
    Y: Floats,
    increment: Floats,
    other: Floats,
    out: Floats,
) -> None:
    """How n, m at the tip change with n₀, m₀: out (6, 6), by forward differences of `increment` (6,) from shape Y.

    other: like Y, overwritten.
    """
    last = Y.shape[0] - 1
    for j in range(6):
        for i in range(13):
            other[0, i] = Y[0, i]
        other[0, 7 + j] += increment[j]
        integrate(length, steps, compliance, rest, force, torque, other)
        for i in range(6):
            out[i, j] = (other[last, 7 + i] - Y[last, 7 + i]) / increment[j]
