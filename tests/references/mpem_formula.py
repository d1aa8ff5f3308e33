"""The formula of MPEM files, written down once more: Legendre polynomials and their derivatives from SciPy.

Φ = Σ_n (A_n rⁿ + B_n / r^{n+1}) P_n(c),  c = d·(x − p)/r,  B = −∇Φ,  ∇c = (d − c r̂)/r.
"""

from __future__ import annotations

import numpy as np
from scipy.special import legendre_p


def source_field(points, position, direction, A=(), B=()):
    """B (n, 3) of one source at points (n, 3)."""
    way = np.asarray(points, dtype=float) - np.asarray(position)
    d = np.asarray(direction) / np.linalg.norm(direction)
    r = np.linalg.norm(way, axis=1)
    unit = way / r[:, None]
    c = unit @ d
    field = np.zeros_like(way)
    for coefficients, power in ((A, lambda n: n), (B, lambda n: -n - 1)):
        for n, coefficient in enumerate(coefficients, start=1):
            P, slope = legendre_p(n, c, diff_n=1)
            s = power(n)
            along = coefficient * r ** (s - 1) * s * P
            across = coefficient * r ** (s - 1) * slope
            field -= along[:, None] * unit + across[:, None] * (d - c[:, None] * unit)
    return field


def coil_field(points, content, coil):
    """B (n, 3) per ampere of one coil of a parsed MPEM file, whose numbers are in plain lists."""
    total = np.zeros((len(points), 3))
    for name in content[coil]["Source_List"]:
        source = content[coil][name]
        coefficients = [source[key] or () for key in ("A_Coeff", "B_Coeff")]
        total += source_field(points, source["Source_Position"], source["Source_Direction"], *coefficients)
    return total


def file_field(points, content, currents):
    """B (n, 3) of all coils at their currents, and of the Offset."""
    coils = [name for name in content["Coil_List"] if "Offset" not in name]
    offsets = [name for name in content["Coil_List"] if "Offset" in name]
    total = sum(current * coil_field(points, content, coil) for coil, current in zip(coils, currents, strict=True))
    return total + sum(coil_field(points, content, name) for name in offsets)
