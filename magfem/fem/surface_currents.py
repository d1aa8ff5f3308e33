"""The field of a solved magnetisation, everywhere in space: Biot–Savart over the bodies' surfaces, compiled.

A body's magnetisation is M = M₀ + χH with H = −∇φ. Its dipole integral over the volume equals the field of
its bound currents ∇×M and M×n. With uniform M₀ and χ, and H the gradient of the *continuous* solved φ, there is
no current inside, not even between elements, so the surface alone carries

    K dS = M × n dS = [M₀ × (x_u × x_v) − χ (x_u φ_v − x_v φ_u)] du dv,

which needs only the trace of φ. It is the same integral over the solved sources, exact in the open space and
inside the magnet as well, with the accuracy of an integrated (not a differentiated) solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.compiled import kernel
from magfem.fem.biot_savart import add_current, add_currents, put_sums
from magfem.mesh.shape_functions import triangle_rule, triangle_shapes
from magfem.threads import in_chunks
from magfem.typing import Floats, Jet, Points

_FAR, _NEAR = 10.0, 3.5
"""Distance over triangle size from which 6 and 16 points integrate it to 1e-7; below, it is quartered."""
_DEEPEST = 24  # quarterings: a point on the surface itself gets the mean of both sides


@dataclass(frozen=True)
class SurfaceCurrents:
    """Bound currents on t curved triangles.

    nodes: (t, 6, 3) m, oriented outwards.  potential: (t, 6) A.  magnetisation: (t, 3) A/m, M₀ of the body
    inside.  susceptibility: (t,), χ = recoil permeability − 1.
    """

    nodes: Floats
    potential: Floats
    magnetisation: Floats
    susceptibility: Floats

    def jet(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m, as `Evaluated.evaluate` wants them."""
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        B = np.zeros((count, 3))
        gradient = np.zeros((count if order > 0 else 0, 3, 3))
        hessian = np.zeros((count if order > 1 else 0, 3, 3, 3))
        centre = self.nodes[:, :3].mean(axis=1)
        size = np.linalg.norm(self.nodes[:, :3] - centre[:, None], axis=-1).max(axis=1)
        far, near = triangle_rule(4), triangle_rule(8)
        places, strengths = self._elements(*near)
        # One row for each coordinate, points of the rule before triangles: the layout that vector units like.
        distant = np.concatenate([array.transpose(2, 1, 0) for array in self._elements(*far)]).copy()
        barycentric = np.column_stack([1 - near[0].sum(axis=1), near[0]])

        def run(chunk: slice) -> None:
            _evaluate(
                points[chunk],
                self.nodes,
                self.potential,
                self.magnetisation,
                self.susceptibility,
                centre,
                size,
                distant,
                places,
                strengths,
                barycentric,
                near[1],
                order,
                B[chunk],
                gradient[chunk],
                hessian[chunk],
            )

        in_chunks(run, count, at_least=16)
        return (B, gradient, hessian)[: order + 1]

    def _elements(self, local: Floats, weights: Floats) -> tuple[Floats, Floats]:
        """Current elements of a rule: places (t, q, 3) m and strengths K·w (t, q, 3) A·m."""
        shapes, du, dv = triangle_shapes(local)
        places = np.einsum("qa,tai->tqi", shapes, self.nodes)
        xu, xv = (np.einsum("qa,tai->tqi", d, self.nodes) for d in (du, dv))
        pu, pv = (np.einsum("qa,ta->tq", d, self.potential)[..., None] for d in (du, dv))
        bound = np.cross(self.magnetisation[:, None], np.cross(xu, xv))
        current = bound - self.susceptibility[:, None, None] * (xu * pv - xv * pu)
        return places, current * weights[:, None]

    @property
    def moment(self) -> Floats:
        """Dipole moment (3,) A·m²: ½ ∮ x × K dS."""
        places, strengths = self._elements(*triangle_rule(8))
        total: Floats = 0.5 * np.cross(places, strengths).sum(axis=(0, 1))
        return total


@kernel
def _evaluate(
    points: Points,
    nodes: Floats,
    potential: Floats,
    magnetisation: Floats,
    susceptibility: Floats,
    centre: Floats,
    size: Floats,
    distant: Floats,
    places: Floats,
    strengths: Floats,
    barycentric: Floats,
    weights: Floats,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Sum all triangles at all points, each by the rule that its distance asks for."""
    stack = np.empty((4 * _DEEPEST, 7))  # corner coordinates of sub-triangles, and their depth
    share = np.empty(nodes.shape[0])  # 1 for triangles that the far rule serves, else 0
    b = np.empty(3)
    g = np.zeros((3, 3))
    h = np.zeros((3, 3, 3))
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        b[:] = 0.0
        g[:] = 0.0
        h[:] = 0.0
        for t in range(nodes.shape[0]):
            dx, dy, dz = x - centre[t, 0], y - centre[t, 1], z - centre[t, 2]
            share[t] = 1.0 if dx * dx + dy * dy + dz * dz > (_FAR * size[t]) ** 2 else 0.0
        add_currents(x, y, z, distant, share, order, b, g, h)
        for t in range(nodes.shape[0]):
            if share[t] == 1.0:
                continue
            dx, dy, dz = x - centre[t, 0], y - centre[t, 1], z - centre[t, 2]
            if dx * dx + dy * dy + dz * dz > (_NEAR * size[t]) ** 2:
                for q in range(places.shape[1]):
                    at, K = places[t, q], strengths[t, q]
                    add_current(x - at[0], y - at[1], z - at[2], K[0], K[1], K[2], order, b, g, h)
            else:
                _add_close(
                    x,
                    y,
                    z,
                    nodes[t],
                    potential[t],
                    magnetisation[t],
                    susceptibility[t],
                    barycentric,
                    weights,
                    order,
                    stack,
                    b,
                    g,
                    h,
                )
        put_sums(i, order, b, g, h, B, gradient, hessian)


@kernel
def _add_close(
    x: float,
    y: float,
    z: float,
    nodes: Floats,
    potential: Floats,
    magnetisation: Floats,
    chi: float,
    barycentric: Floats,
    weights: Floats,
    order: int,
    stack: Floats,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """One triangle close to the point: quarter it until every part is far enough for the 16-point rule."""
    shape = np.empty(6)
    du = np.empty(6)
    dv = np.empty(6)
    corner = np.empty((3, 3))
    stack[0, :] = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0)
    height = 1
    while height > 0:
        height -= 1
        u0, v0, u1, v1, u2, v2 = (
            stack[height, 0],
            stack[height, 1],
            stack[height, 2],
            stack[height, 3],
            stack[height, 4],
            stack[height, 5],
        )
        depth = stack[height, 6]
        for n, (u, v) in enumerate(((u0, v0), (u1, v1), (u2, v2))):
            _place(u, v, nodes, shape, du, dv, corner[n])
        cx = (corner[0, 0] + corner[1, 0] + corner[2, 0]) / 3.0
        cy = (corner[0, 1] + corner[1, 1] + corner[2, 1]) / 3.0
        cz = (corner[0, 2] + corner[1, 2] + corner[2, 2]) / 3.0
        extent2 = 0.0
        for n in range(3):
            extent2 = max(extent2, (corner[n, 0] - cx) ** 2 + (corner[n, 1] - cy) ** 2 + (corner[n, 2] - cz) ** 2)
        distance2 = (x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2
        if distance2 < _NEAR * _NEAR * extent2 and depth < _DEEPEST:
            ua, va, ub, vb, uc, vc = (
                0.5 * (u0 + u1),
                0.5 * (v0 + v1),
                0.5 * (u1 + u2),
                0.5 * (v1 + v2),
                0.5 * (u2 + u0),
                0.5 * (v2 + v0),
            )
            stack[height, :] = (u0, v0, ua, va, uc, vc, depth + 1)
            stack[height + 1, :] = (ua, va, u1, v1, ub, vb, depth + 1)
            stack[height + 2, :] = (uc, vc, ub, vb, u2, v2, depth + 1)
            stack[height + 3, :] = (ua, va, ub, vb, uc, vc, depth + 1)
            height += 4
            continue
        if distance2 == 0.0:
            continue  # the point itself: its two sides cancel
        area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
        for q in range(weights.size):
            u = barycentric[q, 0] * u0 + barycentric[q, 1] * u1 + barycentric[q, 2] * u2
            v = barycentric[q, 0] * v0 + barycentric[q, 1] * v1 + barycentric[q, 2] * v2
            p = corner[0]
            _place(u, v, nodes, shape, du, dv, p)
            xu = yu = zu = xv = yv = zv = pu = pv = 0.0
            for a in range(6):
                xu += du[a] * nodes[a, 0]
                yu += du[a] * nodes[a, 1]
                zu += du[a] * nodes[a, 2]
                xv += dv[a] * nodes[a, 0]
                yv += dv[a] * nodes[a, 1]
                zv += dv[a] * nodes[a, 2]
                pu += du[a] * potential[a]
                pv += dv[a] * potential[a]
            nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
            w = weights[q] * area
            kx = w * (magnetisation[1] * nz - magnetisation[2] * ny - chi * (xu * pv - xv * pu))
            ky = w * (magnetisation[2] * nx - magnetisation[0] * nz - chi * (yu * pv - yv * pu))
            kz = w * (magnetisation[0] * ny - magnetisation[1] * nx - chi * (zu * pv - zv * pu))
            add_current(x - p[0], y - p[1], z - p[2], kx, ky, kz, order, B, gradient, hessian)


@kernel
def _place(u: float, v: float, nodes: Floats, shape: Floats, du: Floats, dv: Floats, out: Floats) -> None:
    """Shape functions and their derivatives at (u, v), and the point they map to."""
    w = 1.0 - u - v
    shape[0], shape[1], shape[2] = w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1)
    shape[3], shape[4], shape[5] = 4 * u * w, 4 * u * v, 4 * v * w
    du[0], du[1], du[2], du[3], du[4], du[5] = 1 - 4 * w, 4 * u - 1, 0.0, 4 * (w - u), 4 * v, -4 * v
    dv[0], dv[1], dv[2], dv[3], dv[4], dv[5] = 1 - 4 * w, 0.0, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)
    for i in range(3):
        out[i] = 0.0
        for a in range(6):
            out[i] += shape[a] * nodes[a, i]
