"""Exact field of a uniformly magnetised solid cylinder, and of a ring, with gradient and hessian.

Frame: centre at the origin, z the axis of revolution; any direction of magnetisation. All follows from the
Newtonian potential of the body, U(x) = 1/(4π) ∫ dV / |x − y|: H_i = M_j ∂_i ∂_j U and B = µ0 (H + M).

Let a be the radius, s = x² + y² = ρ², ζ the height over an end face, h = |ζ|, σ = sign ζ, and w(ψ) the
distance to the point ψ of that end's rim, w² = a² + s − 2aρ cos ψ + ζ². With [ ] the difference lower less
upper end,

    ∂_s U     = −min(1, a²/s)/4 where |z| ≤ L/2  +  a²/(8π) [σ ∫ sin²ψ f dψ],   f = 1 / (w (w + h)),
    ∂_z² U    = −a/(4π) [σ ∫ (a − ρ cos ψ) f dψ],
    ∂_s ∂_z U = −½ [N],   N = a²/(4π) ∫ sin²ψ w⁻³ dψ   (A_φ/(µ0 I ρ) of a current loop).

These are the solenoid and charged-face integrals of Derby and Olbert, Am. J. Phys. 78, 229 (2010), and of
Caciagli et al., J. Magn. Magn. Mater. 456, 423 (2018), with ζ/w split into σ − σ (w − h)/w: the first part
is elementary and carries every jump, the second does not cancel. Higher derivatives are those of N, or follow
from Poisson's equation, 4 ∂_s(s ∂_s U) + ∂_z² U = −1 inside, 0 outside.

The ring integrals are complete elliptic ones. Their closed forms cancel near the axis and far away, so they
are summed instead: in the elliptic argument t, sin(ψ/2) = cn t and w = w_max dn t, so the integrands are
periodic and meromorphic with poles K' off the real axis, and the midpoint rule converges as exp(−2π n K'/K).

Measured against 75-digit quadrature, 0.05 ≤ L/a ≤ 50: relative error of B 1e-12, gradient 1e-12, hessian
5e-12 everywhere farther than 1e-3 a from a rim; 1e-6 a from a rim 2e-10, 2e-9 and 5e-7.
"""

from __future__ import annotations

from itertools import product
from math import comb, factorial, perm, pi
from typing import NamedTuple

import numpy as np
from scipy.special import ellipj, ellipkm1, eval_gegenbauer, factorial2, poch

from magfem.constants import MU_0
from magfem.typing import ArrayLike, Booleans, Floats, Jet

NODES = 48  # on half a rim, even
RIM = 1e-7  # points nearer to a rim are moved inwards by this, where the field is large but not infinite
NEAR_AXIS = 0.01  # ρ²/(a² + ζ²) below which derivatives by s are taken without dividing by s
AXIS_ORDER = 8  # the derivative by s from which the recursion there starts; higher ones are below rounding
FAR = 2.0  # distance, in circumscribed radii, beyond which the multipole series is used
DEGREES = np.arange(0, 50, 2)  # of the multipoles
BLOCK = 4096  # points worked on at a time, to stay in the cache

Derivatives = dict[tuple[int, int], Floats]  # {(k, m): ∂_s^k ∂_z^m U}
KEYS = [(k, m) for k in range(5) for m in range(5 - k) if k + m > 1 or k == 1]


def newton_derivatives(points: ArrayLike, radius: float, length: float, order: int) -> tuple[Floats, ...]:
    """Cartesian derivatives of the Newtonian potential U(x) = 1/(4π) ∫ dV / |x − y| of a solid cylinder.

    Parameters
    ----------
    points : (..., 3) m, cylinder frame.
    radius, length : m, > 0.
    order : 2, 3 or 4, the highest derivative.

    Returns
    -------
    Symmetric tensors ∂_i∂_j U (..., 3, 3), ∂_i∂_j∂_k U (..., 3, 3, 3) 1/m and ∂_i∂_j∂_k∂_l U
    (..., 3, 3, 3, 3) 1/m², up to `order`. On the surface: the limit from inside. On a rim, where they are
    infinite, and nearer than 1e-7 radius: the large values 1e-7 radius inwards.
    """
    x, y, z = np.moveaxis(np.asarray(points, dtype=float) / radius, -1, 0)
    s, half = x**2 + y**2, length / (2 * radius)
    u = _derivatives(s.ravel(), z.ravel(), half)
    u = {key: values.reshape(s.shape) for key, values in u.items()}
    return tuple(_cartesian(u, x, y, n) * radius ** (2 - n) for n in range(2, order + 1))


def cylinder_jet(points: ArrayLike, radius: float, length: float, magnetisation: ArrayLike, order: int = 1) -> Jet:
    """Field of a uniformly magnetised solid cylinder, with its derivatives, inside and outside.

    Parameters
    ----------
    points : (..., 3) m, cylinder frame.
    radius, length : m, > 0.
    magnetisation : (3,) A/m, any direction.
    order : 0 for B, 1 for B and gradient, 2 for B, gradient and hessian.

    Returns
    -------
    B (..., 3) T, gradient (..., 3, 3) T/m, hessian (..., 3, 3, 3) T/m², up to `order`.
    The surface belongs to the magnet; the rims as in `newton_derivatives`.
    """
    m = np.asarray(magnetisation, dtype=float)
    b, *derivatives = (MU_0 * (tensor @ m) for tensor in newton_derivatives(points, radius, length, order + 2))
    x, y, z = np.moveaxis(np.asarray(points, dtype=float) / radius, -1, 0)
    inside = _beside(z, length / (2 * radius)) & (x**2 + y**2 <= 1)
    return b + MU_0 * m * inside[..., None], *derivatives


def ring_jet(
    points: ArrayLike,
    inner_radius: float,
    outer_radius: float,
    length: float,
    magnetisation: ArrayLike,
    order: int = 1,
) -> Jet:
    """Field of a uniformly magnetised ring, a cylinder less its bore.

    Arguments and result as in `cylinder_jet`. The wall of the bore belongs to the bore, the rest of the
    surface to the magnet.
    """
    outer = cylinder_jet(points, outer_radius, length, magnetisation, order)
    bore = cylinder_jet(points, inner_radius, length, magnetisation, order)
    return tuple(a - b for a, b in zip(outer, bore, strict=True))


def _cartesian(u: Derivatives, x: Floats, y: Floats, order: int) -> Floats:
    """Derivative tensor (..., 3, …, 3) of U(s, z), s = x² + y²: the chain rule for F(x²) along x and y."""
    component = {}
    for p, q in product(range(order + 1), repeat=2):
        if p + q <= order:
            component[p, q] = sum(
                _chain(p, i, x) * _chain(q, j, y) * u[p + q - i - j, order - p - q]
                for i, j in product(range(p // 2 + 1), range(q // 2 + 1))
            )
    tensor = np.empty((*x.shape, *(3,) * order))
    for axes in np.ndindex((3,) * order):
        tensor[(..., *axes)] = component[axes.count(0), axes.count(1)]
    return tensor


def _chain(p: int, i: int, x: Floats) -> Floats:
    """The factor of F^(p − i) in d^p F(x²)/dx^p = Σ_i p!/(i! (p − 2i)!) (2x)^(p − 2i) F^(p − i)."""
    return comb(p, 2 * i) * perm(2 * i, i) * (2 * x) ** (p - 2 * i)


# From here on lengths are in units of the radius, and arrays are (points,) or (points, nodes).


def _derivatives(s: Floats, z: Floats, half: float) -> Derivatives:
    """Derivatives of U by s and z, each (points,), of the cylinder of radius 1 and half length `half`."""
    s = np.where(np.hypot(np.sqrt(s) - 1, np.abs(z) - half) < RIM, (1 - RIM) ** 2, s)
    far = s + z**2 > FAR**2 * (1 + half**2)
    u = {key: np.empty(s.shape) for key in KEYS}
    for chosen, evaluate in ((far, _multipoles), (~far, _faces)):
        index = np.flatnonzero(chosen)
        for block in np.split(index, range(BLOCK, index.size, BLOCK)):
            for key, values in evaluate(s[block], z[block], half).items():
                u[key][block] = values
    return u


def _multipoles(s: Floats, z: Floats, half: float) -> Derivatives:
    """Far away: U = Σ_l u_l P_l(cos θ)/r^(l+1), whose derivatives are Gegenbauer polynomials,

        ∂_s^k ∂_z^m P_l(z/r)/r^(l+1) = (−1)^(k+m) (l+m)!/l! (½)_k C_{l+m}^{(k+½)}(z/r) / r^(l+m+2k+1),

    since P_l/r^(l+1) = (−∂_z)^l (1/r)/l! and shifting r^(−2λ) along z generates C^{(λ)}.
    """
    ball = np.sqrt(1 + half**2)
    moments = np.array([_moment(n, half / ball, 1 / ball) for n in DEGREES.tolist()]) * half / 2
    r = np.sqrt(s + z**2)
    powers = (ball / r[:, None]) ** DEGREES
    u = {}
    for k in range(5):
        c = eval_gegenbauer(np.arange(DEGREES[-1] + 5), k + 0.5, (z / r)[:, None])
        for m in range(5 - k):
            weights = (-1) ** (k + m) * poch(0.5, k) * poch(DEGREES + 1, m) * moments
            u[k, m] = (c[:, DEGREES + m] * powers) @ weights / r ** (2 * k + m + 1)
    return {key: u[key] for key in KEYS}


def _moment(degree: int, half: float, radius: float) -> float:
    """Mean of the solid harmonic r^l P_l(cos θ), even l, over a cylinder."""
    mean = 0.0
    for j in range(degree // 2 + 1):
        n = degree - 2 * j
        mean += (-0.25) ** j * comb(degree, n) * comb(2 * j, j) * radius ** (2 * j) / (j + 1) * half**n / (n + 1)
    return mean


def _beside(z: Floats, half: float) -> Booleans:
    """Between the planes of the end faces, these included."""
    return np.abs(z) <= half


def _faces(s: Floats, z: Floats, half: float) -> Derivatives:
    """Everywhere else: the two end faces, and between their planes the infinitely long cylinder."""
    beside = _beside(z, half)
    lower = _face(s, z + half, np.where(beside, 1.0, np.sign(z)))
    upper = _face(s, z - half, np.where(beside, -1.0, np.sign(z)))
    u = {key: lower[key] - upper[key] for key in KEYS}
    for k in range(1, 5):
        outside = (-1) ** (k - 1) * factorial(k - 1) / np.maximum(s, 1) ** k
        u[k, 0] -= beside * np.where(s > 1, outside, float(k == 1)) / 4
    return u


def _face(s: Floats, zeta: Floats, side: Floats) -> Derivatives:
    """What one end adds to U; `zeta` is the height over its face, `side` its sign, ±1 also on the face."""
    rim = _Rim.seen_from(s, zeta)
    f = 1 / (rim.w * (rim.w + np.abs(zeta)[:, None]))
    inward = (1 - rim.rho) + rim.rho * rim.versine  # 1 − ρ cos ψ
    t5 = rim.integral(rim.sin2 * rim.w**-5)
    e = {key: np.empty(s.shape) for key in KEYS}
    e[1, 0] = side * rim.integral(rim.sin2 * f) / (8 * pi)
    e[0, 2] = -side * rim.integral(inward * f) / (4 * pi)
    e[1, 1] = -rim.integral(rim.sin2 * rim.w**-3) / (8 * pi)
    e[1, 2] = 3 * zeta * t5 / (8 * pi)
    e[1, 3] = 3 * (t5 - 5 * zeta**2 * rim.integral(rim.sin2 * rim.w**-7)) / (8 * pi)
    axial = s < NEAR_AXIS * (1 + zeta**2)
    for chosen, higher in ((axial, _higher_near_axis), (~axial, _higher_off_axis)):
        known = {key: values[chosen] for key, values in e.items()}
        part = higher(known, s[chosen], zeta[chosen], _Rim(*(values[chosen] for values in rim)))
        for key, values in part.items():
            e[key][chosen] = values
    e[0, 3] = -4 * (e[1, 1] + s * e[2, 1])
    e[0, 4] = -4 * (e[1, 2] + s * e[2, 2])
    return e


def _higher_off_axis(e: Derivatives, s: Floats, zeta: Floats, rim: _Rim) -> Derivatives:
    """∂_s N under the integral, in a form no more singular at the rim; the rest by Poisson upwards."""
    slope = (rim.versine - (1 - rim.rho)) / rim.rho  # ∂w²/∂s
    e[2, 1] = 3 / (16 * pi) * rim.integral(rim.sin2 * slope * rim.w**-5)
    e[2, 2] = -15 / (16 * pi) * zeta * rim.integral(rim.sin2 * slope * rim.w**-7)
    for k, m in ((1, 0), (2, 0), (3, 0), (2, 1)):
        e[k + 1, m] = -(4 * k * e[k, m] + e[k - 1, m + 2]) / (4 * s)
    return e


def _higher_near_axis(e: Derivatives, s: Floats, zeta: Floats, rim: _Rim) -> Derivatives:
    """∂_s N without dividing by ρ; the rest by Poisson downwards, the stable direction here."""
    e[2, 1] = -rim.derivative(1, 3) / (8 * pi)
    e[3, 1] = -rim.derivative(2, 3) / (8 * pi)
    e[2, 2] = 3 * zeta * rim.derivative(1, 5) / (8 * pi)
    u = np.zeros(s.shape)
    for k in range(AXIS_ORDER, 1, -1):
        u = -(3 * zeta * rim.derivative(k - 2, 5) / (32 * pi) + s * u) / k
        if k <= 4:
            e[k, 0] = u
    return e


class _Rim(NamedTuple):
    """Nodes (points, NODES) on half a circle of radius 1, ψ from 0 at the point nearest the observer to π."""

    rho: Floats  # (points, 1)
    w: Floats  # distance to the observer
    sin2: Floats  # sin²ψ
    versine: Floats  # 1 − cos ψ
    weights: Floats

    @classmethod
    def seen_from(cls, s: Floats, zeta: Floats) -> _Rim:
        rho = np.sqrt(s)[:, None]
        height2 = zeta[:, None] ** 2
        farthest = (1 + rho) ** 2 + height2
        nearest = (1 - rho) ** 2 + height2
        modulus = 1 - nearest / farthest
        quarter = ellipkm1(1 - modulus)
        sn, cn, dn, _ = ellipj(quarter * (np.arange(NODES // 2) + 0.5) / NODES, modulus)
        # The other half by t → K − t: there ellipj would lose relative accuracy.
        root = np.sqrt(1 - modulus)
        sn, cn, dn = (np.concatenate(pair, axis=-1) for pair in ((sn, cn / dn), (cn, root * sn / dn), (dn, root / dn)))
        w = np.sqrt(nearest * sn**2 + farthest * cn**2)
        return cls(rho, w, (2 * sn * cn) ** 2, 2 * cn**2, 4 * quarter / NODES * dn)

    def integral(self, values: Floats) -> Floats:
        """∫_0^{2π} dψ of `values` at the nodes, even in ψ."""
        total: Floats = (values * self.weights).sum(axis=-1)
        return total

    def derivative(self, k: int, p: int) -> Floats:
        """∂_s^k ∫ sin²ψ w^(−p) dψ by parts: ∂_s ∫ sin^2j F(w²) = ∫ sin^2j F' + 2/(2j+1) ∫ sin^(2j+2) F''."""
        total = np.zeros(self.rho.shape[0])
        for i in range(k + 1):
            factor = (-1) ** (k + i) * comb(k, i) * 2**i / factorial2(2 * i + 1) * poch(p / 2, k + i)
            total += factor * self.integral(self.sin2 ** (i + 1) * self.w ** (-p - 2 * (k + i)))
        return total
