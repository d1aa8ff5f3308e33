"""Axial multipoles: exterior solid harmonics of order 0, about a real or a complex centre; compiled.

In units of the reference radius a, V = Σ C_l Q_l^0 with J_l^m = (x + iy)^m Q_l^m(s, z), s = x² + y², and J_l^m as in
`solid_harmonics`. From the derivatives of J_l^m follow ∂_s Q_l^m = −½ Q_{l+1}^{m+1} and ∂_z Q_l^m = −Q_{l+1}^m, hence

    B_z = Σ C_l Q_{l+1}^0,    B_ρ/ρ = Σ C_l Q_{l+1}^1,

and their derivatives are sums of Q_{l+2}^1, Q_{l+2}^2, Q_{l+3}^2, Q_{l+3}^3. Each column m climbs by

    Q_{l+1}^m = [(2l+1) z Q_l^m − (l² − m²) Q_{l−1}^m] / r².

Nothing in this asks z to be real. At z − i the centre lies at an imaginary height and the point's singularity becomes
that of a disc of radius a (oblate harmonics; the idea of complex source points is Deschamps', Electron. Lett. 7, 684
(1971)). The real part of Σ C_l Q_l, C_l complex, is harmonic everywhere off the disc; one kernel serves both.

Measured against 100-digit arithmetic, single degrees, on the axis, near the disc and out to 100 radii: relative error
of B, gradient and hessian 1e-14 to degree 10, 2e-13 to degree 80 (oblate 4e-13); d radii from a disc's rim
1e-16 (l + 1)/d. Degree 80 overflows where d < 0.01.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from magfem.compiled import kernel
from magfem.fields.packing import BLOCK, add_axisymmetric
from magfem.typing import Complexes, Floats

# Rows of the work space: z/r², 1/r², 1/r³; of each column m here Q_l^m and before it Q_{l−1}^m; from _SUMS on
# F, G, F_s, G_s, G_sz, G_ss.
_RISE, _INVERSE, _DIAGONAL, _SUMS = 0, 1, 2, 11


@kernel
def add_zonal(
    x: Floats,
    y: Floats,
    z: Floats,
    count: int,
    radius: float,
    coefficients: Floats,
    order: int,
    work: Floats,
    out: Floats,
) -> None:
    """Add the jets of an axial multipole at `count` points of its own frame to `out` (15, BLOCK), packed.

    x, y, z: (BLOCK,) m.  radius: a, m.  coefficients: (top + 6,) T, C_l at 3 + l, zeros around them. Infinite at the
    centre.
    """
    a = 1.0 / radius
    for j in range(count):
        height = z[j] * a
        inverse = 1.0 / ((x[j] * x[j] + y[j] * y[j]) * a * a + height * height)
        root = sqrt(inverse)
        work[_RISE, j] = height * inverse
        work[_INVERSE, j] = inverse
        work[_DIAGONAL, j] = root * inverse
        work[3, j] = root
    _climb(work, count, coefficients, order)
    profile = work[_SUMS:]
    _to_metres(profile, profile, count, a)
    add_axisymmetric(x, y, profile, count, order, out)


@kernel
def add_oblate(
    x: Floats, y: Floats, z: Floats, count: int, radius: float, coefficients: Complexes, order: int, out: Floats
) -> None:
    """Add the jets of an axial multipole at the imaginary height i·radius, a disc's; as `add_zonal`, but complex.

    The disc's two sides differ: z = 0 inside it counts as its upper side. Infinite or NaN on its rim.
    """
    work = np.empty((17, BLOCK), dtype=np.complex128)
    profile = np.empty((6, BLOCK))
    a = 1.0 / radius
    for j in range(count):
        height = z[j] * a
        # r² = s + (z − i)²; of its roots the one with a positive real part, which jumps across the disc alone.
        real, imaginary = (x[j] * x[j] + y[j] * y[j]) * a * a + height * height - 1.0, -2.0 * height
        size = sqrt(real * real + imaginary * imaginary)
        if real >= 0.0:
            r_real = sqrt(0.5 * (size + real))
            r_imaginary = 0.5 * imaginary / r_real
        else:
            r_imaginary = sqrt(0.5 * (size - real))
            if imaginary <= 0.0:
                r_imaginary = -r_imaginary
            r_real = 0.5 * imaginary / r_imaginary
        # Real divisions alone: complex ones raise on the rim, where the field is infinite or NaN.
        per_size = 1.0 / size
        root = complex(r_real * per_size, -r_imaginary * per_size)
        inverse = complex(real * per_size * per_size, -imaginary * per_size * per_size)
        work[_RISE, j] = complex(height, -1.0) * inverse
        work[_INVERSE, j] = inverse
        work[_DIAGONAL, j] = root * inverse
        work[3, j] = root
    _climb(work, count, coefficients, order)
    _to_metres(work[_SUMS:].real, profile, count, a)
    add_axisymmetric(x, y, profile, count, order, out)


@kernel
def _to_metres(sums: Floats, profile: Floats, count: int, a: float) -> None:
    """The sums (6, BLOCK), whose lengths are in units of 1/a, in SI."""
    a2 = a * a
    for j in range(count):
        profile[0, j] = sums[0, j]
        profile[1, j] = sums[1, j] * a
        profile[2, j] = sums[2, j] * a2
        profile[3, j] = sums[3, j] * (a2 * a)
        profile[4, j] = sums[4, j] * (a2 * a2)
        profile[5, j] = sums[5, j] * (a2 * a2 * a)


@kernel
def _climb(work: Any, count: int, coefficients: Any, order: int) -> None:
    """Fill the sums of `work`, whose first four rows are given, degree by degree; in real or complex numbers."""
    for row in range(4, 17):
        for j in range(count):
            work[row, j] = 0.0
    for degree in range(1, coefficients.size - 4 + order):
        last = degree - 1
        step, square = 2.0 * last + 1.0, 1.0 * last * last
        begin = 1.0 if degree == 1 else 0.0  # a column begins at its diagonal (2m − 1)!! / r^(2m+1)
        C = coefficients[2 + degree]
        for j in range(count):
            climb, inverse = step * work[0, j], work[1, j]
            q0 = climb * work[3, j] - square * inverse * work[4, j]
            work[4, j] = work[3, j]
            work[3, j] = q0
            q1 = climb * work[5, j] - (square - 1.0) * inverse * work[6, j] + begin * work[2, j]
            work[6, j] = work[5, j]
            work[5, j] = q1
            work[11, j] += C * q0
            work[12, j] += C * q1
        if order > 0:
            begin = 3.0 if degree == 2 else 0.0
            C = coefficients[1 + degree]
            for j in range(count):
                inverse = work[1, j]
                q2 = (
                    step * work[0, j] * work[7, j]
                    - (square - 4.0) * inverse * work[8, j]
                    + begin * work[2, j] * inverse
                )
                work[8, j] = work[7, j]
                work[7, j] = q2
                work[13, j] -= 0.5 * C * work[5, j]
                work[14, j] -= 0.5 * C * q2
        if order > 1:
            begin = 15.0 if degree == 3 else 0.0
            C = coefficients[degree]
            for j in range(count):
                inverse = work[1, j]
                q3 = (
                    step * work[0, j] * work[9, j]
                    - (square - 9.0) * inverse * work[10, j]
                    + begin * work[2, j] * inverse * inverse
                )
                work[10, j] = work[9, j]
                work[9, j] = q3
                work[15, j] += 0.5 * C * work[7, j]
                work[16, j] += 0.25 * C * q3
