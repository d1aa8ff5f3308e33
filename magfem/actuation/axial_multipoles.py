"""Solid harmonics as axial multipoles: of any order, exactly.

By the addition theorem, in Schmidt's normalisation,

    P_l(n·r̂) = Σ_m S_lm(n) S_lm(r̂),

axial multipoles of degree l along 2l + 1 directions n in general position span all harmonics of that degree about one
centre, inside and outside alike. Where fewer do, fewer are used: one for harmonics of order 0, and one for a dipole or
a uniform field of any direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import assoc_legendre_p_all

from magfem.fields.term_kinds import INTERIOR
from magfem.fields.terms import Terms
from magfem.typing import Floats, Points


@dataclass(frozen=True)
class AxialMultipole:
    """Φ = Σ_n B_n P_n(cos θ) / r^{n+1}, or Σ_n A_n rⁿ P_n(cos θ) if `interior`; B = −∇Φ.

    position: (3,) m.  direction: (3,), of length one.  coefficients: B_n, T·m^{n+2}, or A_n, T·m^{1−n}, from n = 1.
    """

    position: Points
    direction: Floats
    interior: bool
    coefficients: Floats


def axial_multipoles(terms: Terms) -> list[AxialMultipole]:
    """The axial multipoles whose sum is the field of `terms`, which are solid harmonics, exterior and interior."""
    return [one for k in range(terms.kind.size) for one in _of_one_centre(terms.source(k))]


def _of_one_centre(harmonic: Terms) -> list[AxialMultipole]:
    frame, position, radius = harmonic.frame[0], harmonic.centre[0], float(harmonic.radius[0])
    interior = bool(harmonic.kind[0] == INTERIOR)
    top = int(harmonic.degree.max())
    table = np.zeros((top + 1, 2 * top + 1))  # [l, m] the cosines, [l, −m] the sines
    column = np.where(harmonic.sine == 1, -harmonic.order, harmonic.order)
    nothing = (harmonic.sine == 1) & (harmonic.order == 0)  # sin 0φ
    np.add.at(table, (harmonic.degree, column), np.where(nothing, 0.0, harmonic.coefficient))
    degree = np.arange(1, top + 1)
    scale = radius ** (1.0 - degree) if interior else radius ** (degree + 2.0)
    if not table[:, 1:].any():  # of revolution about the frame's z
        return [AxialMultipole(position, frame[:, 2], interior, table[1:, 0] * scale)]
    if not table[2:].any():  # a dipole, or a uniform field, whatever its direction
        moment = np.array([table[1, 1], table[1, -1], table[1, 0]])
        size = float(np.linalg.norm(moment))
        return [AxialMultipole(position, frame @ (moment / size), interior, np.array([size * scale[0]]))]
    directions = _spread_directions(2 * top + 1)
    surface = _schmidt(directions, top)
    weights = np.zeros((len(directions), top))
    for l in degree:  # noqa: E741
        columns = np.arange(-l, l + 1)
        weights[:, l - 1] = np.linalg.lstsq(surface[:, l, columns].T, table[l, columns], rcond=None)[0]
    return [
        AxialMultipole(position, frame @ direction, interior, row * scale)
        for direction, row in zip(directions, weights, strict=True)
    ]


def _spread_directions(count: int) -> Points:
    """Unit vectors (count, 3), spread over a half sphere by the golden angle: a direction and its opposite are one."""
    k = np.arange(count)
    z = 1 - (k + 0.5) / count
    azimuth = np.pi * (3 - np.sqrt(5)) * k
    rho = np.sqrt(1 - z**2)
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=-1)


def _schmidt(directions: Points, top: int) -> Floats:
    """Schmidt's semi-normalised surface harmonics (n, top + 1, 2·top + 1): [:, l, m] cosines, [:, l, −m] sines."""
    x, y, z = directions.T
    legendre = assoc_legendre_p_all(top, top, z, norm=True)[0]  # (l, m, n), with (−1)^m, ∫ P² dz = 1
    surface = np.zeros((len(directions), top + 1, 2 * top + 1))
    for l in range(top + 1):  # noqa: E741
        for m in range(l + 1):
            factor = (-1) ** m * np.sqrt((2 if m else 1) * 2 / (2 * l + 1))
            turning = (x + 1j * y) ** m / np.hypot(x, y) ** m
            surface[:, l, -m] = factor * legendre[l, m] * turning.imag
            surface[:, l, m] = factor * legendre[l, m] * turning.real
    return surface
