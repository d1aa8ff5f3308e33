"""Self- and mutual inductance of coaxial loops, current sheets and windings of rectangular section.

Loops: Maxwell's formula, M = 2πρ A_φ with the elliptic integrals of `magfem.fields.loop`. Current sheets: Lorenz's
formula, tabulated by Nagaoka. Windings: the flux linkage N/S ∫∫ 2πρ A_φ dρ dz of one window in the vector potential of
the other, by Gauss rules on panels that shrink towards the edges of both windows, where A_φ is r² log r.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf, log, pi
from typing import Literal

import numpy as np
from scipy.special import ellipkm1, elliprd

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.loop import potential_over_rho
from magfem.fields.thick_solenoid import thick_solenoid_vector_potential
from magfem.typing import ArrayLike, Floats

THICKEST = 0.2  # wire over loop radius up to which the formulas of a round wire are used
POINTS = 8  # Gauss points on a panel
GRADING = 0.25  # ratio of neighbouring panels
MOST_LEVELS = 8  # of panels towards an edge


@dataclass(frozen=True)
class CoaxialWinding:
    """A winding of rectangular section about the z axis with uniform current density.

    Sheets (equal radii), discs (length 0) and single loops (both) are windings too.
    """

    inner_radius: float  # m
    outer_radius: float  # m
    length: float  # m, along z
    turns: float = 1.0
    height: float = 0.0  # m, z of the centre

    def __post_init__(self) -> None:
        if not (0 <= self.inner_radius <= self.outer_radius and self.outer_radius > 0 and self.length >= 0):
            raise InputError(
                "coaxial winding: expected 0 ≤ inner_radius ≤ outer_radius, 0 < outer_radius and 0 ≤ length, "
                f"got {self.inner_radius:g}, {self.outer_radius:g} and {self.length:g} m"
            )


def loops_mutual_inductance(radius: ArrayLike, other_radius: ArrayLike, distance: ArrayLike) -> Floats:
    """Mutual inductance (...) H of two coaxial circular filaments, Maxwell's formula.

    Parameters
    ----------
    radius, other_radius, distance : (...) m, broadcast; `distance` between the planes.

    Relative error 1e-13, as far apart or as nearly coincident as the arguments can tell; infinite when they coincide.

    Source: Maxwell, Treatise on Electricity and Magnetism, art. 701.
    """
    a, b, z = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (radius, other_radius, distance)))
    if np.any((a <= 0) | (b <= 0)):
        raise InputError("coaxial loops: both radii must be positive")
    result = _mutual(a.ravel(), b.ravel(), z.ravel()).reshape(a.shape)
    return np.where((a == b) & (z == 0), inf, result)


@kernel
def _mutual(a: Floats, b: Floats, z: Floats) -> Floats:
    result = np.empty(a.size)
    for i in range(a.size):
        result[i] = 2.0 * pi * b[i] * b[i] * potential_over_rho(b[i], z[i], a[i])
    return result


def wire_loop_inductance(radius: float, wire_radius: float, current: Literal["uniform", "skin"] = "uniform") -> float:
    """Self-inductance, H, of a circular loop of round wire.

    Parameters
    ----------
    radius : m, of the wire's centre line.
    wire_radius : m, at most 0.2 of `radius`.
    current : "uniform" density over the section, or on the "skin" alone (high frequency).

    Uniform: µ0 R [(1 + a²/8R²) ln(8R/a) − 7/4 + a²/24R²], good to (a/R)⁴. Skin: µ0 R [ln(8R/a) − 2], good to
    (a/R)² ln(8R/a), since the current crowds towards the hole. Thicker wires are refused.

    Source: Rayleigh and Niven (1881); Rosa and Grover, Bull. Bureau of Standards 8 (1912), formulas 58 and 60.
    """
    if not (0 < wire_radius <= THICKEST * radius):
        raise InputError(
            f"loop of round wire: wire_radius must be positive and at most {THICKEST:g} of the loop's radius "
            f"({radius:g} m), got {wire_radius:g} m"
        )
    logarithm, ratio2 = log(8 * radius / wire_radius), (wire_radius / radius) ** 2
    if current == "uniform":
        return MU_0 * radius * ((1 + ratio2 / 8) * logarithm - 1.75 + ratio2 / 24)
    if current == "skin":
        return MU_0 * radius * (logarithm - 2)
    raise InputError(f'loop of round wire: current must be "uniform" or "skin", got "{current}"')


def nagaoka_coefficient(radius: float, length: float) -> float:
    """Inductance of a cylindrical current sheet over that of an equal piece of an infinitely long one.

    With k = D/√(D² + l²) it is 4/(3πk') [k'²(K − E)/k² + E − k] (Lorenz 1879). Relative error 1e-11 for every
    l/D > 0.

    Source: Nagaoka, J. Coll. Sci. Tokyo 27, art. 6 (1909).
    """
    if not (radius > 0 and length > 0):
        raise InputError(f"current sheet: radius and length must be positive, got {radius:g} and {length:g} m")
    diagonal = hypot(2 * radius, length)
    k, complement = 2 * radius / diagonal, length / diagonal
    c2 = complement**2
    third = float(elliprd(0.0, c2, 1.0)) / 3  # (K − E)/k²
    if complement < 0.01:
        # E − 1 by its series: E − k is the difference of two numbers near one.
        L = log(4 / complement)
        excess = c2 / 2 * (L - 0.5) + 3 / 16 * c2**2 * (L - 13 / 12) + 15 / 128 * c2**3 * (L - 1.2)
    else:
        excess = float(ellipkm1(c2)) - k**2 * third - 1
    return 4 / (3 * pi * complement) * (c2 * third + excess + c2 / (1 + k))


def sheet_inductance(radius: float, length: float, turns: float = 1.0) -> float:
    """Self-inductance, H, of a cylindrical current sheet, radius and length in m, > 0."""
    return MU_0 * pi * radius**2 * turns**2 / length * nagaoka_coefficient(radius, length)


def self_inductance(winding: CoaxialWinding) -> float:
    """Self-inductance, H, of a winding with uniform current density; relative error 1e-8."""
    if winding.length == 0 and winding.outer_radius == winding.inner_radius:
        raise InputError("coaxial winding: a filament without a section has no finite self-inductance")
    return mutual_inductance(winding, winding)


def mutual_inductance(winding: CoaxialWinding, other: CoaxialWinding) -> float:
    """Mutual inductance, H, of two coaxial windings with uniform current density, apart, touching or overlapping.

    Relative error 1e-7: as far as the two orders of the windings agree, and far better when they are apart.
    """
    centre = other.height - winding.height
    low, high = centre - other.length / 2, centre + other.length / 2
    half = winding.length / 2
    radii = (winding.inner_radius, winding.outer_radius)
    gap = hypot(
        max(other.inner_radius - radii[1], radii[0] - other.outer_radius, 0.0),
        max(low - half, -half - high, 0.0),
    )
    sides = (radii[1] - radii[0], winding.length, other.outer_radius - other.inner_radius, other.length)
    scale = max(min((side for side in sides if side > 0), default=0.0), gap)
    # At the edge of a sheet or disc A_φ is r log r, at the corner of a thick winding r² log r.
    fewest = 6 if min(sides[:2]) == 0 else 2
    rho, rho_weights = _panels(other.inner_radius, other.outer_radius, radii, gap, scale, fewest)
    symmetric = centre == 0 and other.length > 0
    z, z_weights = _panels(0.0 if symmetric else low, high, (-half, half), gap, scale, fewest, symmetric)
    points = np.zeros((rho.size, z.size, 3))
    points[..., 0] = rho[:, None]
    points[..., 2] = z
    potential = thick_solenoid_vector_potential(points, *radii, winding.length, winding.turns)[..., 1]
    return float(other.turns * 2 * pi * np.einsum("i,i,ij,j", rho_weights, rho, potential, z_weights))


def _panels(
    start: float, end: float, cuts: tuple[float, float], gap: float, scale: float, fewest: int, mirrored: bool = False
) -> tuple[Floats, Floats]:
    """Gauss nodes and weights of sum 1 on [start, end], graded towards its ends and the `cuts` within.

    mirrored : the interval is the upper half of one that is symmetric about `start`: nothing to grade there.
    """
    if end == start:
        return np.array([start]), np.ones(1)
    edges = np.unique([start, end, *(cut for cut in cuts if start < cut < end)])
    breaks = [edges]
    for a, b in pairwise(edges):
        width = b - a
        if gap > 2 * width:
            continue
        levels = min(MOST_LEVELS, max(fewest, round(log(width / scale) / -log(GRADING)) + 2))
        steps = width * GRADING ** np.arange(1, levels + 1)
        breaks += [b - steps] if mirrored and a == start else [a + steps, b - steps]
    corners = np.unique(np.concatenate(breaks))
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    half = np.diff(corners)[:, None] / 2
    x = (corners[:-1, None] + half) + half * nodes
    return x.ravel(), (half * weights).ravel() / (end - start)
