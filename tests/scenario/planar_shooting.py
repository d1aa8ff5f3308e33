"""Euler's elastica with two point magnets in the xz plane, by shooting: a second route to the shapes of scenarios.

Inextensible, without shear; scipy integrates and finds the root. θ is the angle from +z towards +x.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

GRAVITY = 9.81
RADIUS, LENGTH, DENSITY = 1.5e-3, 25e-3, 1040.0
HALF, MASS, MOMENTS = 2e-3, 0.147e-3, (-0.021, 0.021)
START = (-0.03, 0.0, np.pi / 2)


def magnet_angles(field, modulus: float, guess, forces: bool = True):
    """θ (2,) rad of both magnets. field: point (3,) to B (3,), gradient (3, 3).  guess: (2,) rad.

    The unknowns are force and moment at the base; they begin where magnets at straight sections' ends would have them.
    """
    stiffness = modulus * np.pi / 4 * RADIUS**4
    weight = DENSITY * np.pi * RADIUS**2 * GRAVITY

    def flexible(y):
        def slope(_, y):
            theta, fx, fz, m = y[2:]
            # m' = −(t × n)_y, n' = weight upwards, as the rest of the rod is lighter further out
            tx, tz = np.sin(theta), np.cos(theta)
            return [tx, tz, m / stiffness, 0.0, weight, -(tz * fx - tx * fz)]

        return solve_ivp(slope, (0, LENGTH), y, rtol=1e-11, atol=1e-14).y[:, -1]

    def rigid(y, moment):
        """Through a magnet: its loads are taken off at its middle."""
        x, z, theta, fx, fz, m = y
        t = np.array([np.sin(theta), 0.0, np.cos(theta)])
        middle = np.array([x, 0.0, z]) + HALF * t
        m = m - HALF * (t[2] * fx - t[0] * fz)
        B, gradient = field(middle)
        mu = moment * t
        force = gradient.T @ mu if forces else np.zeros(3)
        fx, fz = fx - force[0], fz - force[2] + MASS * GRAVITY
        m = m - np.cross(mu, B)[1]
        m = m - HALF * (t[2] * fx - t[0] * fz)
        end = middle + HALF * t
        return np.array([end[0], end[2], theta, fx, fz, m])

    def along(base):
        y, angles = np.array([*START, *base]), []
        for moment in MOMENTS:
            y = flexible(y)
            angles.append(y[2])
            y = rigid(y, moment)
        return y[3:], np.array(angles)

    scale = np.array([1e-2, 1e-2, 1e-4])
    first = root(lambda u: [*(along(scale * u)[1] - guess), along(scale * u)[0][0] / 1e-2], np.zeros(3))
    found = root(lambda u: along(scale * u)[0] / scale, first.x, tol=1e-12)
    assert found.success, found.message
    return along(scale * found.x)[1]
