"""Straight current filaments: B, gradient, hessian and vector potential in closed form, compiled.

A filament of length l along the unit vector e has A = µ0 I/(4π) g e with g = ln((S + l)/(S − l)), where S is the sum of
the point's distances to its two ends (Hanson and Hirshman, Phys. Plasmas 9, 4410 (2002)). Hence B = µ0 I/(4π) ∇g × e,
and every derivative of B follows from those of S. S² − l² = 2 (r_a r_b + r_a·r_b) = r_a r_b |∇S|² is the denominator of
them all; it vanishes on the filament itself, where B is infinite. In its first form it cancels beside the wire like the
square of the distance to it, in its last like the distance.

A filament alone is no circuit: only closed chains of them have a field that obeys Ampère's law.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.threads import in_chunks
from magfem.typing import Floats, Jet, Points


@dataclass(frozen=True)
class Filaments:
    """f straight filaments. start, end: (f, 3) m.  current: (f,) A from start to end, or per ampere."""

    start: Floats
    end: Floats
    current: Floats

    @classmethod
    def none(cls) -> Filaments:
        """No current at all."""
        return cls(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))

    def jet(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m."""
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        B = np.zeros((count, 3))
        gradient = np.zeros((count if order > 0 else 0, 3, 3))
        hessian = np.zeros((count if order > 1 else 0, 3, 3, 3))

        def run(chunk: slice) -> None:
            arrays = (B[chunk], gradient[chunk], hessian[chunk])
            _add_filaments(points[chunk], self.start, self.end, self.current, order, *arrays)

        in_chunks(run, count, at_least=16)
        return (B, gradient, hessian)[: order + 1]

    def vector_potential(self, points: Points) -> Floats:
        """A (n, 3) T·m in the Coulomb gauge."""
        points = np.ascontiguousarray(points, dtype=float)
        A = np.zeros(points.shape)

        def run(chunk: slice) -> None:
            _add_potentials(points[chunk], self.start, self.end, self.current, A[chunk])

        in_chunks(run, points.shape[0], at_least=16)
        return A

    @property
    def moment(self) -> Floats:
        """Dipole moment (3,) A·m² of closed chains: ½ Σ I x × dl."""
        total: Floats = 0.5 * (self.current[:, None] * np.cross(self.start, self.end)).sum(axis=0)
        return total


@kernel
def _add_filaments(
    points: Points,
    start: Floats,
    end: Floats,
    current: Floats,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Add every filament's field to B (n, 3), gradient (n, 3, 3) and hessian (n, 3, 3, 3)."""
    a = np.empty(3)
    b = np.empty(3)
    e = np.empty(3)
    slope = np.empty(3)
    second = np.empty((3, 3))
    third = np.empty(3)
    for i in range(points.shape[0]):
        for f in range(start.shape[0]):
            length2 = aa = bb = 0.0
            for k in range(3):
                e[k] = end[f, k] - start[f, k]
                a[k] = points[i, k] - start[f, k]
                b[k] = points[i, k] - end[f, k]
                length2 += e[k] * e[k]
                aa += a[k] * a[k]
                bb += b[k] * b[k]
            length, ra, rb = sqrt(length2), sqrt(aa), sqrt(bb)
            steepness2 = 0.0
            for k in range(3):
                e[k] /= length
                a[k] /= ra
                b[k] /= rb
                slope[k] = a[k] + b[k]  # ∇S
                steepness2 += slope[k] * slope[k]
            total = ra + rb
            inverse = 1.0 / (ra * rb * steepness2)  # 1/(S² − l²)
            scale = MU_0 / (4.0 * pi) * current[f]
            g1 = -2.0 * length * inverse * scale
            B[i, 0] += g1 * (slope[1] * e[2] - slope[2] * e[1])
            B[i, 1] += g1 * (slope[2] * e[0] - slope[0] * e[2])
            B[i, 2] += g1 * (slope[0] * e[1] - slope[1] * e[0])
            if order < 1:
                continue
            g2 = -2.0 * total * inverse * g1
            for j in range(3):
                for k in range(3):
                    unit = 1.0 if j == k else 0.0
                    curved = (unit - a[j] * a[k]) / ra + (unit - b[j] * b[k]) / rb
                    second[j, k] = curved
            for j in range(3):
                x = g2 * slope[j] * slope[0] + g1 * second[j, 0]
                y = g2 * slope[j] * slope[1] + g1 * second[j, 1]
                z = g2 * slope[j] * slope[2] + g1 * second[j, 2]
                gradient[i, 0, j] += y * e[2] - z * e[1]
                gradient[i, 1, j] += z * e[0] - x * e[2]
                gradient[i, 2, j] += x * e[1] - y * e[0]
            if order < 2:
                continue
            g3 = (8.0 * total * total * inverse - 2.0) * inverse * g1
            for j in range(3):
                for m in range(3):
                    for k in range(3):
                        jk = 1.0 if j == k else 0.0
                        jm = 1.0 if j == m else 0.0
                        km = 1.0 if k == m else 0.0
                        twist = (3.0 * a[j] * a[k] * a[m] - jk * a[m] - jm * a[k] - km * a[j]) / aa
                        twist += (3.0 * b[j] * b[k] * b[m] - jk * b[m] - jm * b[k] - km * b[j]) / bb
                        third[k] = g3 * slope[j] * slope[k] * slope[m] + g1 * twist
                        third[k] += g2 * (second[j, k] * slope[m] + second[j, m] * slope[k] + second[k, m] * slope[j])
                    hessian[i, 0, j, m] += third[1] * e[2] - third[2] * e[1]
                    hessian[i, 1, j, m] += third[2] * e[0] - third[0] * e[2]
                    hessian[i, 2, j, m] += third[0] * e[1] - third[1] * e[0]


@kernel
def _add_potentials(points: Points, start: Floats, end: Floats, current: Floats, A: Floats) -> None:
    """Add every filament's vector potential to A (n, 3)."""
    for i in range(points.shape[0]):
        for f in range(start.shape[0]):
            length2 = aa = bb = 0.0
            for k in range(3):
                length2 += (end[f, k] - start[f, k]) ** 2
                aa += (points[i, k] - start[f, k]) ** 2
                bb += (points[i, k] - end[f, k]) ** 2
            length = sqrt(length2)
            # ln((S + l)/(S − l)) = 2 artanh(l/S): no cancellation far away
            weight = MU_0 / (4.0 * pi) * current[f] * 2.0 * np.arctanh(length / (sqrt(aa) + sqrt(bb))) / length
            for k in range(3):
                A[i, k] += weight * (end[f, k] - start[f, k])
