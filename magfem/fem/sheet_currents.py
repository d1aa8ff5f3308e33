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

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from magfem.compiled import kernel
from magfem.fem.biot_savart import add_currents, add_layers, put_sums
from magfem.threads import in_chunks
from magfem.typing import Floats, Jet, Points


class Rules(NamedTuple):
    """Numbers of Gauss points along u and v, and the least distances, in half-lengths along u and v, that they serve.

    n points on a half-length h integrate 1/distance at distance d up to (q + √(q² + 1))^(−2n), q = d/h.
    """

    far: tuple[int, int]
    far_from: tuple[float, float]
    near: tuple[int, int]
    near_from: tuple[float, float]


FIELD = Rules((3, 2), (5.5, 18.0), (6, 3), (1.75, 6.0))  # about 1e-6 of a patch's field
POTENTIAL = Rules((3, 2), (5.5, 18.0), (6, 3), (1.0, 3.0))  # the same, of the smoother 1/r
FACES = Rules((4, 3), (6.6, 15.8), (8, 5), (1.7, 3.9))  # about 1e-9, for faces of foil that nearly cancel each other

_DEEPEST = 40  # halvings, of both directions together, after which a point counts as lying on the sheet
_STEP = 2e-4  # off the sheet for such a point, over the patch's smaller half-extent: it gets the mean of both sides
_DEEPEST_LAYER = 18  # the same for 1/r, whose integral over what is left then is below 1e-7 of a patch's


@dataclass(frozen=True)
class SheetCurrents:
    """Currents on p patches.

    nodes: (p, 9, 3) m; node 3i + j stands at u = i/2, v = j/2.  stream: (p, 9) A, the stream function, or A per
    ampere.
    """

    nodes: Floats
    stream: Floats

    @classmethod
    def none(cls) -> SheetCurrents:
        """No current at all."""
        return cls(np.empty((0, 9, 3)), np.empty((0, 9)))

    @classmethod
    def joined(cls, parts: Sequence[SheetCurrents]) -> SheetCurrents:
        """All patches of several sheets."""
        if not parts:
            return cls.none()
        return cls(np.concatenate([part.nodes for part in parts]), np.concatenate([part.stream for part in parts]))

    @property
    def count(self) -> int:
        """Patches."""
        return len(self.nodes)

    def jet(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m: ∫ K × r/r³ times µ0/4π."""
        return self._integrals(points, order, layer=False, rules=FIELD)

    def layer_jet(self, points: Points, order: int, rules: Rules | None = None) -> Jet:
        """(A, gradient[, hessian]) at `points` (n, 3) m: ∫ K/r times µ0/4π, the vector potential in T·m."""
        return self._integrals(points, order, layer=True, rules=rules or (POTENTIAL if order == 0 else FIELD))

    def vector_potential(self, points: Points) -> Floats:
        """A (n, 3) T·m in the Coulomb gauge."""
        return self.layer_jet(points, 0)[0]

    def elements(self, rule: tuple[int, int] = (2, 3)) -> tuple[Floats, Floats]:
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

    def _integrals(self, points: Points, order: int, layer: bool, rules: Rules) -> Jet:
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        value = np.zeros((count, 3))
        gradient = np.zeros((count if order > 0 else 0, 3, 3))
        hessian = np.zeros((count if order > 1 else 0, 3, 3, 3))
        centre, half_u, half_v = self._extents()
        # One row for each coordinate, points of the rule before patches: the layout that vector units like.
        distant = np.concatenate([array.transpose(2, 1, 0) for array in self.elements(rules.far)]).copy()
        near = np.concatenate([array.transpose(0, 2, 1) for array in self.elements(rules.near)], axis=1)[
            :, :, None
        ].copy()
        (u, wu), (v, wv) = (_gauss(count) for count in rules.near)
        limits = np.array([*rules.far_from, *rules.near_from])

        def run(chunk: slice) -> None:
            _evaluate(
                points[chunk],
                self.nodes,
                self.stream,
                centre,
                half_u,
                half_v,
                distant,
                near,
                (u, v, wu, wv),
                limits,
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


def _tensor_rule(rule: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
    """Places u, v (q,) in [0, 1] and weights (q,) of a product of Gauss rules."""
    (u, wu), (v, wv) = (_gauss(count) for count in rule)
    grid_u, grid_v = np.meshgrid(u, v, indexing="ij")
    return grid_u.ravel(), grid_v.ravel(), np.outer(wu, wv).ravel()


def _gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss's rule on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 + 0.5 * nodes, 0.5 * weights


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
    near: Floats,
    rule: tuple[Floats, Floats, Floats, Floats],
    limits: Floats,
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
    near2 = np.empty(count)
    for p in range(count):
        reach_u, reach_v = np.sqrt((half_u[p] ** 2).sum()), np.sqrt((half_v[p] ** 2).sum())
        # Measured from the middle, whose distance exceeds that of the patch by less than its half-diagonal.
        radius = np.hypot(reach_u, reach_v)
        far2[p] = (max(limits[0] * reach_u, limits[1] * reach_v) + radius) ** 2
        near2[p] = (max(limits[2] * reach_u, limits[3] * reach_v) + radius) ** 2
    stack = np.empty((_DEEPEST + 2, 5))
    work = np.empty((6, 3))
    leaf = np.empty((6, 1, near.shape[3]))
    each = np.ones(near.shape[3])
    scratch = (stack, work, leaf, each)
    own = (np.empty(3), np.empty((3, 3)), np.empty((3, 3, 3)))
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
        _add_elements(x, y, z, distant, share, order, layer, b, g, h)
        for p in range(count):
            if share[p] == 1.0:
                continue
            dx, dy, dz = x - centre[p, 0], y - centre[p, 1], z - centre[p, 2]
            if dx * dx + dy * dy + dz * dz > near2[p]:
                _add_elements(x, y, z, near[p], each, order, layer, b, g, h)
            else:
                _add_close(x, y, z, nodes[p], stream[p], rule, limits, order, layer, scratch, own, b, g, h)
        put_sums(i, order, b, g, h, value, gradient, hessian)


@kernel
def _add_elements(
    x: float,
    y: float,
    z: float,
    elements: Floats,
    share: Floats,
    order: int,
    layer: bool,
    b: Floats,
    g: Floats,
    h: Floats,
) -> None:
    """Add the current elements (6, q, p), places then strengths, whose `share` (p,) is one."""
    if layer:
        add_layers(x, y, z, elements, share, order, b, g, h)
    else:
        add_currents(x, y, z, elements, share, order, b, g, h)


@kernel
def _add_close(
    x: float,
    y: float,
    z: float,
    nodes: Floats,
    stream: Floats,
    rule: tuple[Floats, Floats, Floats, Floats],
    limits: Floats,
    order: int,
    layer: bool,
    scratch: tuple[Floats, Floats, Floats, Floats],
    own: tuple[Floats, Floats, Floats],
    b: Floats,
    g: Floats,
    h: Floats,
) -> None:
    """One patch close to the point; when the point lies on it, the mean of both sides."""
    touches = _sum_close(x, y, z, nodes, stream, rule, limits, order, layer, scratch, own)
    if not touches:
        _add_own(1.0, own, order, b, g, h)
        return
    # Integrals of 1/r² over the last piece would depend on its shape: step off the sheet along its normal.
    step = scratch[1][5]
    for side in (-1.0, 1.0):
        _sum_close(
            x + side * step[0],
            y + side * step[1],
            z + side * step[2],
            nodes,
            stream,
            rule,
            limits,
            order,
            layer,
            scratch,
            own,
        )
        _add_own(0.5, own, order, b, g, h)


@kernel
def _add_own(factor: float, own: tuple[Floats, Floats, Floats], order: int, b: Floats, g: Floats, h: Floats) -> None:
    """Add `factor` times one patch's sums."""
    b += factor * own[0]
    if order > 0:
        g += factor * own[1]
    if order > 1:
        h += factor * own[2]


@kernel
def _sum_close(
    x: float,
    y: float,
    z: float,
    nodes: Floats,
    stream: Floats,
    rule: tuple[Floats, Floats, Floats, Floats],
    limits: Floats,
    order: int,
    layer: bool,
    scratch: tuple[Floats, Floats, Floats, Floats],
    own: tuple[Floats, Floats, Floats],
) -> bool:
    """Halve one patch until every part is far enough for the near rule; its sums are put into `own`.

    True when the point lies on the patch, so that sums other than those of 1/r are worth nothing; `scratch[1][5]` is
    then a small step along the normal.
    """
    stack, work, leaf, each = scratch
    middle, west, east, south, north, step = work[0], work[1], work[2], work[3], work[4], work[5]
    b, g, h = own
    b[:] = 0.0
    g[:] = 0.0
    h[:] = 0.0
    stack[0, :] = (0.0, 1.0, 0.0, 1.0, 0.0)
    height = 1
    smooth = layer and order == 0
    deepest = _DEEPEST_LAYER if smooth else _DEEPEST
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
        need_u, need_v = limits[2] ** 2 * aa, limits[3] ** 2 * bb
        if d2 < max(need_u, need_v):
            if depth < deepest:
                if need_u >= need_v:
                    stack[height, :] = (u0, um, v0, v1, depth + 1)
                    stack[height + 1, :] = (um, u1, v0, v1, depth + 1)
                else:
                    stack[height, :] = (u0, u1, v0, vm, depth + 1)
                    stack[height + 1, :] = (u0, u1, vm, v1, depth + 1)
                height += 2
                continue
            if not smooth:
                for i in range(3):
                    j, k = (i + 1) % 3, (i + 2) % 3
                    step[i] = (east[j] - west[j]) * (north[k] - south[k]) - (east[k] - west[k]) * (north[j] - south[j])
                size = _STEP * np.sqrt(min(aa / (u1 - u0) ** 2, bb / (v1 - v0) ** 2))
                step *= size / np.sqrt((step**2).sum())
                return True
        _fill_leaf(u0, u1, v0, v1, nodes, stream, rule, leaf)
        _add_elements(x, y, z, leaf, each, order, layer, b, g, h)
    return False


@kernel
def _place(u: float, v: float, nodes: Floats, out: Floats) -> None:
    """The point that (u, v) maps to."""
    a = ((1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1))
    b = ((1 - v) * (1 - 2 * v), 4 * v * (1 - v), v * (2 * v - 1))
    for k in range(3):
        total = 0.0
        for i in range(3):
            total += a[i] * (b[0] * nodes[3 * i, k] + b[1] * nodes[3 * i + 1, k] + b[2] * nodes[3 * i + 2, k])
        out[k] = total


@kernel
def _fill_leaf(
    u0: float,
    u1: float,
    v0: float,
    v1: float,
    nodes: Floats,
    stream: Floats,
    rule: tuple[Floats, Floats, Floats, Floats],
    leaf: Floats,
) -> None:
    """Current elements (6, 1, q) of a part of a patch: places x, and (x_u ψ_v − x_v ψ_u) times the weights."""
    us, vs, wu, wv = rule
    line = np.empty((3, 8))  # along u at one v: place, ∂/∂v of the place, ψ, ∂ψ/∂v at the three nodes
    for j in range(vs.size):
        v = v0 + (v1 - v0) * vs[j]
        b0, b1, b2 = (1 - v) * (1 - 2 * v), 4 * v * (1 - v), v * (2 * v - 1)
        d0, d1, d2 = 4 * v - 3, 4 - 8 * v, 4 * v - 1
        for i in range(3):
            for k in range(3):
                p0, p1, p2 = nodes[3 * i, k], nodes[3 * i + 1, k], nodes[3 * i + 2, k]
                line[i, k] = b0 * p0 + b1 * p1 + b2 * p2
                line[i, 3 + k] = d0 * p0 + d1 * p1 + d2 * p2
            s0, s1, s2 = stream[3 * i], stream[3 * i + 1], stream[3 * i + 2]
            line[i, 6] = b0 * s0 + b1 * s1 + b2 * s2
            line[i, 7] = d0 * s0 + d1 * s1 + d2 * s2
        for i in range(us.size):
            u = u0 + (u1 - u0) * us[i]
            a0, a1, a2 = (1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1)
            c0, c1, c2 = 4 * u - 3, 4 - 8 * u, 4 * u - 1
            su = c0 * line[0, 6] + c1 * line[1, 6] + c2 * line[2, 6]
            sv = a0 * line[0, 7] + a1 * line[1, 7] + a2 * line[2, 7]
            w = wu[i] * wv[j] * (u1 - u0) * (v1 - v0)
            q = i * vs.size + j
            for k in range(3):
                leaf[k, 0, q] = a0 * line[0, k] + a1 * line[1, k] + a2 * line[2, k]
                xu = c0 * line[0, k] + c1 * line[1, k] + c2 * line[2, k]
                xv = a0 * line[0, 3 + k] + a1 * line[1, 3 + k] + a2 * line[2, 3 + k]
                leaf[3 + k, 0, q] = w * (xu * sv - xv * su)
