"""The field of a solved axisymmetric magnetisation: its bound currents as coaxial loops, compiled.

The half-plane counterpart of `surface_currents`: along a body's boundary curve, with parameter t, direction of
travel counter-clockwise (body on the left) and M = M₀ − χ∇φ, the azimuthal current is

    K ds = (M × n)_φ ds = M · dx = [M₀z dz/dt − χ dφ/dt] dt,

again from the trace of φ alone (M₀ is axial). Each piece of the curve is a sheet of loops, integrated by Gauss's
rule on pieces that are short against their distance from the point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.compiled import kernel
from magfem.fields.loop import add_loop
from magfem.fields.packing import unpack_gradient, unpack_hessian
from magfem.threads import in_chunks
from magfem.typing import Floats, Jet, Points

_GAUSS = np.polynomial.legendre.leggauss(8)
_NEAR = 1.5
"""Shortest distance, in lengths of the piece, at which one Gauss rule integrates it; below, it is halved."""
_DEEPEST = 48


@dataclass(frozen=True)
class MeridianCurrents:
    """Bound currents on c curved pieces of the meridian.

    nodes: (c, 3, 2) m, start, end and middle (ρ, z).  current: (c, d), coefficients of K ds/dt in A, ascending
    powers of t ∈ [−1, 1].
    """

    nodes: Floats
    current: Floats

    def jet(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m, as `Evaluated.evaluate` wants them."""
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        B = np.zeros((count, 3))
        gradient = np.zeros((count if order > 0 else 0, 3, 3))
        hessian = np.zeros((count if order > 1 else 0, 3, 3, 3))

        def run(chunk: slice) -> None:
            _evaluate(
                points[chunk],
                self.nodes,
                self.current,
                *_GAUSS,
                order,
                B[chunk],
                gradient[chunk],
                hessian[chunk],
            )

        in_chunks(run, count, at_least=64)
        return (B, gradient, hessian)[: order + 1]

    @property
    def moment(self) -> Floats:
        """Dipole moment (3,) A·m²: ∫ π ρ² K ds along z."""
        t, w = _GAUSS
        start, end, middle = (self.nodes[:, k, 0, None] for k in range(3))
        rho = start * t * (t - 1) / 2 + end * t * (t + 1) / 2 + middle * (1 - t * t)
        density = np.polynomial.polynomial.polyval(t, self.current.T)
        return np.array([0.0, 0.0, float(np.sum(np.pi * rho**2 * density * w))])


@kernel
def _evaluate(
    points: Points,
    nodes: Floats,
    current: Floats,
    gauss: Floats,
    weights: Floats,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Sum all pieces at all points."""
    out = np.zeros(15)
    stack = np.empty((_DEEPEST + 2, 2))
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        rho = np.sqrt(x * x + y * y)
        out[:] = 0.0
        for c in range(nodes.shape[0]):
            n = nodes[c]
            length = np.sqrt((n[1, 0] - n[0, 0]) ** 2 + (n[1, 1] - n[0, 1]) ** 2)
            stack[0, 0], stack[0, 1] = -1.0, 1.0
            height = 1
            while height > 0:
                height -= 1
                low, high = stack[height, 0], stack[height, 1]
                middle, half = 0.5 * (low + high), 0.5 * (high - low)
                dr = _along(n, middle, 0) - rho
                dz = _along(n, middle, 1) - z
                reach = (_NEAR + 0.5) * half * length
                if dr * dr + dz * dz < reach * reach and height + 2 < stack.shape[0]:
                    stack[height, 0], stack[height, 1] = low, middle
                    stack[height + 1, 0], stack[height + 1, 1] = middle, high
                    height += 2
                    continue
                for q in range(gauss.size):
                    t = middle + half * gauss[q]
                    density = 0.0
                    for k in range(current.shape[1] - 1, -1, -1):
                        density = density * t + current[c, k]
                    radius = _along(n, t, 0)
                    add_loop(x, y, z - _along(n, t, 1), radius, density * half * weights[q], order, out)
        B[i, 0], B[i, 1], B[i, 2] = out[0], out[1], out[2]
        if order > 0:
            unpack_gradient(out, gradient[i])
        if order > 1:
            unpack_hessian(out, hessian[i])


@kernel
def _along(nodes: Floats, t: float, axis: int) -> float:
    """Coordinate of the quadratic piece at t ∈ [−1, 1]."""
    value: float = nodes[0, axis] * t * (t - 1.0) / 2.0 + nodes[1, axis] * t * (t + 1.0) / 2.0
    value += nodes[2, axis] * (1.0 - t * t)
    return value
