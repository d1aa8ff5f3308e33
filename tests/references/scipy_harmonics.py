"""Schmidt's solid harmonics by SciPy's spherical ones."""

from __future__ import annotations

import numpy as np
from scipy.special import sph_harm_y

from magfem.typing import Floats, Points


def field(points: Points, degree: int, order: int, sine: bool, radius: float, interior: bool = False) -> Floats:
    """−∇ of f(r) P_l^m(cos θ) cos or sin mφ at points (n, 3), f = a (a/r)^{l+1} or, interior, a (r/a)^l, a the radius.

    In spherical coordinates, P_l^m and its slope from SciPy: Schmidt's P_l^m cos mφ is √(4π/(2l+1)) √2 (−1)^m
    Re Y_l^m. SciPy's Y is orthonormal and has the Condon–Shortley sign.
    """
    x, y, z = points.T
    r, theta, phi = np.linalg.norm(points, axis=1), np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
    Y, slopes = sph_harm_y(degree, order, theta, phi, diff_n=1)
    factor = np.sqrt(4 * np.pi / (2 * degree + 1)) * (np.sqrt(2) * (-1) ** order if order else 1.0)
    value, d_theta, d_phi = (factor * (c.imag if sine else c.real) for c in (Y, slopes[..., 0], slopes[..., 1]))
    over_r = (r / radius) ** (degree - 1) if interior else (radius / r) ** (degree + 2)
    slope = (degree if interior else -(degree + 1)) * over_r
    outward = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    south = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)])
    east = np.stack([-np.sin(phi), np.cos(phi), 0 * phi])
    return -(slope * value * outward + over_r * (d_theta * south + d_phi / np.sin(theta) * east)).T
