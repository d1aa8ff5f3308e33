"""The field and the vector potential of current sheets, everywhere in space: integrals over curved patches, compiled.

A sheet's current follows from a stream function ψ, K = ∇ψ × n, so that no charge piles up anywhere: what flows
between two lines of constant ψ stays between them. On a patch x(u, v) whose normal is x_u × x_v,

    K dS = (x_u ψ_v − x_v ψ_u) du dv,

which asks for no normal and no metric. Two integrals over it are wanted, with r from the patch to the point:

    ∫ K × r/r³ dS  (B of the sheet),      ∫ K/r dS  (its vector potential, and B of solid conductors: `conduction`).

Patches are biquadratic and may be long and narrow, as pieces of a track are: Gauss's rule is taken where the point is
far enough for it in both directions; else the patch is halved across the direction that needs it more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.fem.biot_savart import add_current, add_currents, add_layer, add_layers
from magfem.threads import in_chunks
from magfem.typing import Floats, Jet, Points

_FAR_RULE, _FAR = (3, 2), (7.3, 28.0)
"""Gauss points along u and v, and the least distance, in half-lengths, at which they integrate to about 1e-7."""
_NEAR_RULE, _NEAR = (5, 4), (2.4, 3.7)
_DEEPEST = 56  # halvings, of both directions together: a point on the sheet gets the mean of both sides


@dataclass(frozen=True)
class SheetCurrents:
    """Currents on p patches.

    nodes: (p, 9, 3) m; node 3i + j stands at u = i/2, v = j/2.  stream: (p, 9) A, the stream function, or A per
    ampere.
    """

    nodes: Floats
    stream: Floats

    def jet(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m: ∫ K × r/r³ times µ0/4π."""
        return self._integrals(points, order, layer=False)

    def layer_jet(self, points: Points, order: int) -> Jet:
        """(A, gradient[, hessian]) at `points` (n, 3) m: ∫ K/r times µ0/4π, the vector potential in T·m."""
        return self._integrals(points, order, layer=True)

    def vector_potential(self, points: Points) -> Floats:
        """A (n, 3) T·m in the Coulomb gauge."""
        return self.layer_jet(points, 0)[0]

    def elements(self, rule: tuple[int, int] = (4, 4)) -> tuple[Floats, Floats]:
        """Current elements of a Gauss rule: places (p, q, 3) m and strengths K dS (p, q, 3) A·m."""
        u, v, weights = _tensor_rule(rule)
        shapes, du, dv = _shapes(u, v)
        places = np.einsum("qa,pai->pqi", shapes, self.nodes)
        xu, xv = (np.einsum("qa,pai->pqi", d, self.nodes) for d in (du, dv))
        pu, pv = (np.einsum("qa,pa->pq", d, self.stream)[..., None] for d in (du, dv))
        return places, (xu * pv - xv * pu) * weights[:, None]

    @property
    def moment(self) -> Floats:
        """Dipole moment (3,) A·m²: ½ ∫ x × K dS."""
        places, strengths = self.elements()
        total: Floats = 0.5 * np.cross(places, strengths).sum(axis=(0, 1))
        return total

    def scaled(self, factor: float) -> SheetCurrents:
        """The same patches with `factor` times the current."""
        return SheetCurrents(self.nodes, factor * self.stream)

    def moved(self, shift: Floats) -> SheetCurrents:
        """The same currents, shifted by `shift` (3,) m."""
        return SheetCurrents(self.nodes + shift, self.stream)

    def _integrals(self, points: Points, order: int, layer: bool) -> Jet:
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        value = np.zeros((count, 3))
        gradient = np.zeros((count if order > 0 else 0, 3, 3))
        hessian = np.zeros((count if order > 1 else 0, 3, 3, 3))
        centre, half_u, half_v = self._extents()
        # One row for each coordinate, points of the rule before patches: the layout that vector units like.
        distant = np.concatenate([array.transpose(2, 1, 0) for array in self.elements(_FAR_RULE)]).copy()
        places, strengths = self.elements(_NEAR_RULE)
        rule = np.stack(_tensor_rule(_NEAR_RULE))

        def run(chunk: slice) -> None:
            _evaluate(
                points[chunk],
                self.nodes,
                self.stream,
                centre,
                half_u,
                half_v,
                distant,
                places,
                strengths,
                rule,
                order,
                layer,
                value[chunk],
                gradient[chunk],
                hessian[chunk],
            )

        in_chunks(run, count, at_least=16)
        return (value, gradient, hessian)[: order + 1]

    def _extents(self) -> tuple[Floats, Floats, Floats]:
        """Middle (p, 3) of every patch and half its extents (p, 3) along u and v."""
        nodes = self.nodes
        middle = nodes[:, 4].copy()
        return middle, 0.5 * (nodes[:, 7] - nodes[:, 1]), 0.5 * (nodes[:, 5] - nodes[:, 3])


def patches(lattice: Floats) -> Floats:
    """The biquadratic patches (n·m, 9, …) of a lattice (2n+1, 2m+1, …)."""
    n, m = lattice.shape[0] // 2, lattice.shape[1] // 2
    i = 2 * np.arange(n)[:, None, None] + np.arange(3)[None, :, None]
    columns = [lattice[i, 2 * j + np.arange(3)[None, None, :]].reshape(n, 9, *lattice.shape[2:]) for j in range(m)]
    return np.ascontiguousarray(np.stack(columns, axis=1).reshape(n * m, 9, *lattice.shape[2:]))


def _tensor_rule(rule: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
    """Places u, v (q,) in [0, 1] and weights (q,) of a product of Gauss rules."""
    (u, wu), (v, wv) = (np.polynomial.legendre.leggauss(n) for n in rule)
    grid_u, grid_v = np.meshgrid(0.5 + 0.5 * u, 0.5 + 0.5 * v, indexing="ij")
    return grid_u.ravel(), grid_v.ravel(), 0.25 * np.outer(wu, wv).ravel()


def _shapes(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Nine biquadratic shape functions (q, 9) at (q,) places of the unit square, and their derivatives."""
    along, along_slope = _quadratic(u)
    across, across_slope = _quadratic(v)

    def product(a: Floats, b: Floats) -> Floats:
        return (a[:, :, None] * b[:, None, :]).reshape(u.size, 9)

    return product(along, across), product(along_slope, across), product(along, across_slope)


def _quadratic(t: Floats) -> tuple[Floats, Floats]:
    """The three quadratic shape functions (q, 3) on [0, 1] with nodes 0, ½, 1, and their slopes."""
    values = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=1)
    slopes = np.stack([4 * t - 3, 4 - 8 * t, 4 * t - 1], axis=1)
    return values, slopes


@kernel
def _evaluate(
    points: Points,
    nodes: Floats,
    stream: Floats,
    centre: Floats,
    half_u: Floats,
    half_v: Floats,
    distant: Floats,
    places: Floats,
    strengths: Floats,
    rule: Floats,
    order: int,
    layer: bool,
    value: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Sum all patches at all points, each by the rule that its distance asks for."""
    count = nodes.shape[0]
    share = np.empty(count)  # 1 for patches that the far rule serves, else 0
    far2 = np.empty(count)
    reach_u = np.empty(count)
    reach_v = np.empty(count)
    radius = np.empty(count)
    for p in range(count):
        reach_u[p] = np.sqrt((half_u[p] ** 2).sum())
        reach_v[p] = np.sqrt((half_v[p] ** 2).sum())
        radius[p] = reach_u[p] + reach_v[p]
        # Measured from the middle, whose distance exceeds that of the patch by less than its radius.
        far2[p] = (max(_FAR[0] * reach_u[p], _FAR[1] * reach_v[p]) + radius[p]) ** 2
    stack = np.empty((_DEEPEST + 2, 5))
    work = np.empty((6, 3))
    b = np.empty(3)
    g = np.zeros((3, 3))
    h = np.zeros((3, 3, 3))
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        b[:] = 0.0
        g[:] = 0.0
        h[:] = 0.0
        for p in range(count):
            dx, dy, dz = x - centre[p, 0], y - centre[p, 1], z - centre[p, 2]
            share[p] = 1.0 if dx * dx + dy * dy + dz * dz > far2[p] else 0.0
        if layer:
            add_layers(x, y, z, distant, share, order, b, g, h)
        else:
            add_currents(x, y, z, distant, share, order, b, g, h)
        for p in range(count):
            if share[p] == 1.0:
                continue
            dx, dy, dz = x - centre[p, 0], y - centre[p, 1], z - centre[p, 2]
            away = np.sqrt(dx * dx + dy * dy + dz * dz) - radius[p]
            if away > _NEAR[0] * reach_u[p] and away > _NEAR[1] * reach_v[p]:
                for q in range(places.shape[1]):
                    at, K = places[p, q], strengths[p, q]
                    if layer:
                        add_layer(x - at[0], y - at[1], z - at[2], K[0], K[1], K[2], order, b, g, h)
                    else:
                        add_current(x - at[0], y - at[1], z - at[2], K[0], K[1], K[2], order, b, g, h)
            else:
                _add_close(x, y, z, nodes[p], stream[p], rule, order, layer, stack, work, b, g, h)
        for j in range(3):
            value[i, j] = MU_0 / (4.0 * np.pi) * b[j]
            if order > 0:
                for k in range(3):
                    gradient[i, j, k] = MU_0 / (4.0 * np.pi) * g[j, k]
            if order > 1:
                for k in range(3):
                    for m in range(3):
                        hessian[i, j, k, m] = MU_0 / (4.0 * np.pi) * h[j, k, m]


@kernel
def _add_close(
    x: float,
    y: float,
    z: float,
    nodes: Floats,
    stream: Floats,
    rule: Floats,
    order: int,
    layer: bool,
    stack: Floats,
    work: Floats,
    b: Floats,
    g: Floats,
    h: Floats,
) -> None:
    """One patch close to the point: halve it until every part is far enough for the near rule."""
    middle, west, east, south, north, place = work[0], work[1], work[2], work[3], work[4], work[5]
    stack[0, :] = (0.0, 1.0, 0.0, 1.0, 0.0)
    height = 1
    while height > 0:
        height -= 1
        u0, u1, v0, v1 = stack[height, 0], stack[height, 1], stack[height, 2], stack[height, 3]
        depth = stack[height, 4]
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        _place(um, vm, nodes, middle)
        _place(u0, vm, nodes, west)
        _place(u1, vm, nodes, east)
        _place(um, v0, nodes, south)
        _place(um, v1, nodes, north)
        aa = bb = ra = rb = 0.0
        for i in range(3):
            a, c = 0.5 * (east[i] - west[i]), 0.5 * (north[i] - south[i])
            r = (x if i == 0 else y if i == 1 else z) - middle[i]
            aa += a * a
            bb += c * c
            ra += r * a
            rb += r * c
        # The distance to the parallelogram that these half-extents span, which the part nearly is.
        s, t = min(max(ra / aa, -1.0), 1.0), min(max(rb / bb, -1.0), 1.0)
        d2 = 0.0
        for i in range(3):
            a, c = 0.5 * (east[i] - west[i]), 0.5 * (north[i] - south[i])
            r = (x if i == 0 else y if i == 1 else z) - middle[i]
            d2 += (r - s * a - t * c) ** 2
        need_u, need_v = _NEAR[0] ** 2 * aa, _NEAR[1] ** 2 * bb
        if d2 < max(need_u, need_v) and depth < _DEEPEST:
            if need_u >= need_v:
                stack[height, :] = (u0, um, v0, v1, depth + 1)
                stack[height + 1, :] = (um, u1, v0, v1, depth + 1)
            else:
                stack[height, :] = (u0, u1, v0, vm, depth + 1)
                stack[height + 1, :] = (u0, u1, vm, v1, depth + 1)
            height += 2
            continue
        area = (u1 - u0) * (v1 - v0)
        for q in range(rule.shape[1]):
            u, v = u0 + (u1 - u0) * rule[0, q], v0 + (v1 - v0) * rule[1, q]
            w = rule[2, q] * area
            kx, ky, kz = _current(u, v, nodes, stream, place)
            rx, ry, rz = x - place[0], y - place[1], z - place[2]
            if rx * rx + ry * ry + rz * rz == 0.0:
                continue  # the point itself: its two sides cancel
            if layer:
                add_layer(rx, ry, rz, w * kx, w * ky, w * kz, order, b, g, h)
            else:
                add_current(rx, ry, rz, w * kx, w * ky, w * kz, order, b, g, h)


@kernel
def _place(u: float, v: float, nodes: Floats, out: Floats) -> None:
    """The point that (u, v) maps to."""
    a = ((1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1))
    b = ((1 - v) * (1 - 2 * v), 4 * v * (1 - v), v * (2 * v - 1))
    out[:] = 0.0
    for i in range(3):
        for j in range(3):
            weight = a[i] * b[j]
            for k in range(3):
                out[k] += weight * nodes[3 * i + j, k]


@kernel
def _current(u: float, v: float, nodes: Floats, stream: Floats, place: Floats) -> tuple[float, float, float]:
    """The current x_u ψ_v − x_v ψ_u at (u, v); `place` gets the point."""
    a = ((1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1))
    b = ((1 - v) * (1 - 2 * v), 4 * v * (1 - v), v * (2 * v - 1))
    da = (4 * u - 3, 4 - 8 * u, 4 * u - 1)
    db = (4 * v - 3, 4 - 8 * v, 4 * v - 1)
    px = py = pz = xu = yu = zu = xv = yv = zv = su = sv = 0.0
    for i in range(3):
        for j in range(3):
            n = 3 * i + j
            w, wu, wv = a[i] * b[j], da[i] * b[j], a[i] * db[j]
            px += w * nodes[n, 0]
            py += w * nodes[n, 1]
            pz += w * nodes[n, 2]
            xu += wu * nodes[n, 0]
            yu += wu * nodes[n, 1]
            zu += wu * nodes[n, 2]
            xv += wv * nodes[n, 0]
            yv += wv * nodes[n, 1]
            zv += wv * nodes[n, 2]
            su += wu * stream[n]
            sv += wv * stream[n]
    place[0], place[1], place[2] = px, py, pz
    return xu * sv - xv * su, yu * sv - yv * su, zu * sv - zv * su
