"""Rods by integrating the Cosserat equations and shooting: the reference that the chain of screws is held against.

    R' = R [u]×,  p' = R v,  n' = −f,  m' = −p' × n − τ,  u = û + K_b⁻¹ Rᵀ m,  v = v̂ + K_s⁻¹ Rᵀ n

(dissertation, eq. 2.2), from the base to the tip by Dormand and Prince's method of order eight at 1e-12; internal force
and moment at the base are found by Newton's method. It shares no code with `magfem.rod`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from magfem.rod import FlexibleSection, MagnetSection, Rod


def skew(a):
    """[a]×."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


@dataclass(frozen=True)
class Problem:
    """A rod, its loads, and B (3,), gradient (3, 3) at a point as `field` gives them."""

    rod: Rod
    field: Callable | None = None
    gravity: tuple = (0.0, 0.0, -9.81)
    tip_force: tuple = (0.0, 0.0, 0.0)
    tip_moment: tuple = (0.0, 0.0, 0.0)
    follower: bool = False


def stiffness(one: FlexibleSection):
    """K_b, K_s of a full circle."""
    E, r = one.youngs_modulus, one.radius
    G = one.shear_modulus if one.shear_modulus is not None else E / (2 * (1 + one.poisson_ratio))
    second, A = np.pi * r**4 / 4, np.pi * r**2
    return np.array([E * second, E * second, G * 2 * second]), np.array([G * A, G * A, E * A])


def integrate(problem: Problem, n, m):
    """R, p, n, m just beyond the tip, and the centres of the magnets, from n, m at the base."""
    R, p = problem.rod.base.rotation.as_matrix(), problem.rod.base.translation
    g, centres = np.array(problem.gravity), []
    for one in problem.rod.sections:
        if isinstance(one, FlexibleSection):
            R, p, n, m = _along(one, R, p, n, m, g)
        else:
            half = one.length / 2 * R[:, 2]
            p, m = p + half, m - np.cross(half, n)
            centres.append((R, p))
            force, torque = _on_magnet(one, problem.field, R, p)
            n, m = n - force - one.mass * g, m - torque
            p, m = p + half, m - np.cross(half, n)
    return R, p, n, m, centres


def _along(one, R, p, n, m, g):
    bending, shear = stiffness(one)
    weight = one.density * np.pi * one.radius**2 * g + np.asarray(one.force_per_length)
    turning = np.asarray(one.moment_per_length)
    curvature = one.intrinsic_curvature
    rest = curvature if callable(curvature) else lambda s: np.tile(curvature, (s.size, 1))

    def slope(s, y):
        R, n, m = y[:9].reshape(3, 3), y[12:15] * scale_n, y[15:] * scale_m
        u = rest(np.array([s]))[0] + R.T @ m / bending
        dp = R @ (np.asarray(one.intrinsic_strain) + R.T @ n / shear)
        return np.concatenate(
            [(R @ skew(u)).ravel(), dp / one.length, -weight / scale_n, (-np.cross(dp, n) - turning) / scale_m]
        )

    scale_n, scale_m = bending[0] / one.length**2, bending[0] / one.length
    start = np.concatenate([R.ravel(), p / one.length, n / scale_n, m / scale_m])
    y = solve_ivp(slope, (0, one.length), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y[:9].reshape(3, 3), y[9:12] * one.length, y[12:15] * scale_n, y[15:] * scale_m


def _on_magnet(one: MagnetSection, field, R, p, points=12):
    """Force and torque about the centre, of a moment spread evenly over the length."""
    force, torque = np.zeros(3), np.zeros(3)
    if field is None:
        return force, torque
    mu = R @ (np.array([0, 0, one.moment]) if np.isscalar(one.moment) else np.asarray(one.moment))
    where, share = np.polynomial.legendre.leggauss(points if one.field_points > 1 else 1)
    for x, w in zip(where, share / 2, strict=True):
        arm = R[:, 2] * one.length / 2 * x
        B, gradient = field(p + arm)
        f = gradient.T @ mu * w
        force, torque = force + f, torque + np.cross(mu * w, B) + np.cross(arm, f)
    return force, torque


def shoot(problem: Problem, n, m):
    """The tip's R, p and the magnets' (R, p), from a start n, m near the wanted solution.

    Newton's method whose Jacobian is taken by differences at the start; it ends when nothing gets better.
    """
    first = next(one for one in problem.rod.sections if isinstance(one, FlexibleSection))
    length = sum(one.length for one in problem.rod.sections)
    scale = np.repeat([stiffness(first)[0][0] / length**2, stiffness(first)[0][0] / length], 3)

    def unbalanced(x):
        R, _, n, m, _ = integrate(problem, x[:3] * scale[0], x[3:] * scale[3])
        turn = R if problem.follower else np.eye(3)
        return np.concatenate([n - turn @ problem.tip_force, m - turn @ problem.tip_moment]) / scale

    x = np.concatenate([n, m]) / scale
    left, best = unbalanced(x), np.inf
    step = 1e-6
    jacobian = np.array([(unbalanced(x + step * e) - unbalanced(x - step * e)) / (2 * step) for e in np.eye(6)]).T
    while np.abs(left).max() < 0.5 * best:
        best = np.abs(left).max()
        x = x - np.linalg.solve(jacobian, left)
        left = unbalanced(x)
    assert np.abs(left).max() < 1e-9, "shooting found no solution"
    R, p, _, _, centres = integrate(problem, x[:3] * scale[0], x[3:] * scale[3])
    return R, p, centres
