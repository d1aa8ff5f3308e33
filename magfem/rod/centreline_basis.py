"""Curves that are polynomials on flexible stretches and straight between: the functions that centrelines are sums of.

The second derivative of a centreline is a polynomial of its own on every flexible stretch and zero where the rod is
rigid; integrated twice, position and direction are continuous. That is what a rod under loads at its magnets does: its
curvature may jump at a magnet, its direction may not. Without rigid stretches the space is that of all polynomials of
the degree, as in the dissertation's eq. 3.6.

The functions are orthonormal over the rod, (1/L) ∫ φ_j φ_k ds = δ_jk. The powers of s that eq. 3.6 uses make least
squares lose digits: for degree 8 and s up to 45 mm their columns have a condition number beyond 1e13 (measured by the
tests), these about 1 to 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import legendre

from magfem.errors import InputError
from magfem.typing import Booleans, Floats, Integers

HIGHEST_DEGREE = 16
Stretches = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class CentrelineBasis:
    """K functions of arc length on [0, length], all zero at the base.

    length: m.  straight: (start, end) of the rigid stretches, m, in order, apart.  degree: of position on every
    flexible stretch, 2 to 16.  free_tangent: whether the direction at the base is free; if not, all functions have
    zero slope there. Raises InputError for lengths and stretches that make no rod.
    """

    length: float
    straight: Stretches = ()
    degree: int = 6
    free_tangent: bool = True

    def __post_init__(self) -> None:
        if not 0 < self.length < np.inf:
            raise InputError(f"centreline: the rod's length must be positive and finite, got {self.length!r} m")
        if isinstance(self.degree, bool) or not isinstance(self.degree, int) or not 2 <= self.degree <= HIGHEST_DEGREE:
            raise InputError(
                f"centreline: degree must be a whole number from 2 to {HIGHEST_DEGREE}, got {self.degree!r}"
            )
        last = 0.0
        for start, end in self.straight:
            if not last <= start < end <= self.length * (1 + 1e-9):
                raise InputError(
                    f"centreline: straight stretches are (start, end) in order between 0 and the length "
                    f"{self.length:g} m, got ({start:g}, {end:g}) m"
                )
            last = end
        if self.count == 0:
            raise InputError("centreline: a rod that is rigid all along with a fixed base leaves nothing to fit")

    @cached_property
    def breaks(self) -> Floats:
        """(P + 1,) m, where the P pieces meet."""
        ends = {0.0, self.length} | {min(s, self.length) for stretch in self.straight for s in stretch}
        return np.array(sorted(ends))

    @cached_property
    def flexible(self) -> Booleans:
        """(P,) which pieces bend."""
        middle = (self.breaks[1:] + self.breaks[:-1]) / 2
        flexible = np.ones(middle.size, dtype=bool)
        for start, end in self.straight:
            flexible &= (middle < start) | (middle > end)
        return flexible

    @cached_property
    def count(self) -> int:
        """K."""
        return int(self.flexible.sum()) * (self.degree - 1) + self.free_tangent

    @cached_property
    def tables(self) -> Floats:
        """(4, P, degree + 1, K): on every piece the Legendre coefficients of the functions and three derivatives."""
        half = np.diff(self.breaks) / 2
        table = np.zeros((half.size, self.degree + 1, self.count))
        column = 0
        if self.free_tangent:
            table[:, 0, 0], table[:, 1, 0] = (self.breaks[1:] + self.breaks[:-1]) / 2, half
            column = 1
        for piece in np.flatnonzero(self.flexible):
            for k in range(self.degree - 1):
                slope = half[piece] * legendre.legint(np.eye(k + 1)[k], lbnd=-1)
                place = half[piece] * legendre.legint(slope, lbnd=-1)
                table[piece, : place.size, column] = place
                end, end_slope = legendre.legval(1.0, place), legendre.legval(1.0, slope)
                for later in range(piece + 1, half.size):
                    table[later, :2, column] = end + end_slope * half[later], end_slope * half[later]
                    end += end_slope * 2 * half[later]
                column += 1
        nodes, weights = legendre.leggauss(self.degree + 1)
        values = np.einsum("qd,pdk->pqk", legendre.legvander(nodes, self.degree), table)
        weighted = np.sqrt(weights[None, :, None] * (half / self.length)[:, None, None]) * values
        table = table @ np.linalg.inv(np.linalg.qr(weighted.reshape(-1, self.count))[1])
        tables = [table]
        for _ in range(3):
            lower = legendre.legder(tables[-1], axis=1)
            padded = np.zeros_like(table)
            padded[:, : lower.shape[1]] = lower / half[:, None, None]
            tables.append(padded)
        return np.array(tables)

    def local(self, s: Floats) -> tuple[Integers, Floats]:
        """Pieces (n,) of arc lengths (n,) m and the Legendre polynomials (n, degree + 1) there.

        Where two pieces meet, the one nearer the tip counts: curvature may jump there.
        """
        piece = np.clip(np.searchsorted(self.breaks, s, side="right") - 1, 0, self.breaks.size - 2)
        start, end = self.breaks[piece], self.breaks[piece + 1]
        x = (2 * s - start - end) / (end - start)
        values = np.empty((s.size, self.degree + 1))
        values[:, 0], values[:, 1] = 1.0, x
        for k in range(2, self.degree + 1):
            values[:, k] = ((2 * k - 1) * x * values[:, k - 1] - (k - 1) * values[:, k - 2]) / k
        return piece, values

    def functions(self, s: Floats, derivative: int = 0) -> Floats:
        """(n, K) values or derivatives with respect to s at arc lengths (n,) m."""
        piece, values = self.local(s)
        found: Floats = np.einsum("nd,ndk->nk", values, self.tables[derivative][piece])
        return found

    @cached_property
    def quadrature(self) -> tuple[Floats, Floats]:
        """Arc lengths (q,) m and weights (q,), sum 1, that integrate squares of the functions exactly."""
        nodes, weights = legendre.leggauss(self.degree + 1)
        half, middle = np.diff(self.breaks)[:, None] / 2, (self.breaks[1:] + self.breaks[:-1])[:, None] / 2
        return (middle + half * nodes).ravel(), (half / self.length * weights).ravel()

    @cached_property
    def slopes(self) -> Floats:
        """(q, K) first derivatives at the nodes of `quadrature`."""
        return self.functions(self.quadrature[0], 1)


@lru_cache(maxsize=64, typed=True)
def centreline_basis(length: float, straight: Stretches, degree: int, free_tangent: bool) -> CentrelineBasis:
    """The same basis for the same rod, so that its tables are made once."""
    return CentrelineBasis(length, straight, degree, free_tangent)
