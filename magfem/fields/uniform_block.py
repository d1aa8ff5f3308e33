"""Exact field of a uniformly magnetised rectangular block, with gradient and hessian.

Frame: centre at the origin, edges along the axes; any direction of magnetisation. All follows from the
Newtonian potential of the body, U(x) = 1/(4π) ∫ dV / |x − y|: H_i = M_j ∂_i ∂_j U and B = µ0 (H + M). A
straight bar of uniform current density J has B = µ0 ∇U × J.

U = 1/(4π) Σ ± G(X, Y, Z) over the corners, X = x ± a/2 and so on, where ∂_X ∂_Y ∂_Z G = 1/r, so that

    ∂_X G     = Y ln(r + Z) + Z ln(r + Y) − X atan(YZ / (X r)),
    ∂_X ∂_Y G = ln(r + Z),     ∂_X² G = −atan(YZ / (X r)),

and cyclically (MacMillan, The Theory of the Potential, 1930, §44; Yang and Schweins, J. Magn. 1990, give the
field). Derivatives above the second without mixed axes follow from Laplace's equation, which avoids terms that
are infinite on the extensions of the edges. U is even in each coordinate, so x, y, z ≥ 0 is enough; there
r + Z nearly vanishes only where the edge itself is near, and is taken as (X² + Y²)/(r − Z).

The corners cancel by the cube of distance over volume. Far away Gauss–Legendre rules over the block are
summed instead, with as many nodes along each edge as the distance asks for.

Measured against 60-digit corner sums, orders 1 to 4, relative to the norm of the tensor, from 1e-5 of the
shortest edge off the surface to 100 times the longest: a cube and a block 4 × 1 × 0.05 2e-12, a plate
12 × 12 × 0.01 3e-11, a bar 12 × 0.1 × 0.01 2e-10. A point takes 2 to 12 µs with all four orders.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from math import atan2, log, pi, sqrt

import numpy as np

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.threads import in_chunks
from magfem.typing import ArrayLike, Floats, Integers, Jet

EDGE = 1e-7  # points nearer to an edge, in units of the shortest half length, are moved inwards by this
CANCELLATION = 2e3  # farthest corner's distance cubed over the volume beyond which Gauss rules are used
NODES = 20  # at most, of a Gauss rule
THREAD = 2000  # points that are worth a thread

# The components of derivatives of orders 1 to 4: how often along x, y and z.
_COUNTS = [
    (axes.count(0), axes.count(1), axes.count(2))
    for order in range(1, 5)
    for axes in combinations_with_replacement(range(3), order)
]
_PLACE = np.full((5, 5, 5), -1)
for _place, _counts in enumerate(_COUNTS):
    _PLACE[_counts] = _place
_POWERS = np.array(_COUNTS)
_SIZES = (0, 3, 9, 19, 34)  # components up to each order
_RULES = np.zeros((2, NODES + 1, NODES))
for _count in range(1, NODES + 1):
    _RULES[:, _count, :_count] = np.polynomial.legendre.leggauss(_count)


def newton_derivatives(points: ArrayLike, size: ArrayLike, lowest: int, highest: int) -> tuple[Floats, ...]:
    """Cartesian derivatives of the Newtonian potential U(x) = 1/(4π) ∫ dV / |x − y| of a block.

    Parameters
    ----------
    points : (..., 3) m, block frame.
    size : (3,) m, the edge lengths along x, y, z, > 0.
    lowest, highest : orders of the derivatives, 1 ≤ lowest ≤ highest ≤ 4.

    Returns
    -------
    Symmetric tensors of the orders from `lowest` to `highest`: ∂_i U (..., 3) m, ∂_i∂_j U (..., 3, 3),
    ∂_i∂_j∂_k U (..., 3, 3, 3) 1/m and ∂_i∂_j∂_k∂_l U (..., 3, 3, 3, 3) 1/m². On the surface: the limit from
    inside. On edges and corners, where they are infinite from order 2, and nearer than 1e-7 of the shortest
    half length: the large values that far inwards.
    """
    array = np.asarray(points, dtype=float)
    flat = _moved(array.reshape(-1, 3), np.asarray(size, dtype=float) / 2)
    components = np.empty((flat.shape[0], _SIZES[highest]))
    half = np.asarray(size, dtype=float) / 2

    def run(chunk: slice) -> None:
        _block(flat[chunk], half, highest, components[chunk])

    in_chunks(run, flat.shape[0], THREAD)
    return symmetric_tensors(components.reshape(*array.shape[:-1], components.shape[1]), lowest, highest)


def block_jet(points: ArrayLike, size: ArrayLike, magnetisation: ArrayLike, order: int = 1) -> Jet:
    """Field of a uniformly magnetised block, with its derivatives, inside and outside.

    Parameters
    ----------
    points : (..., 3) m, block frame.
    size : (3,) m, the edge lengths along x, y, z, > 0.
    magnetisation : (3,) A/m, any direction.
    order : 0 for B, 1 for B and gradient, 2 for B, gradient and hessian.

    Returns
    -------
    B (..., 3) T, gradient (..., 3, 3) T/m, hessian (..., 3, 3, 3) T/m², up to `order`.
    The surface belongs to the magnet; edges as in `newton_derivatives`.
    """
    m = np.asarray(magnetisation, dtype=float)
    half = np.asarray(size, dtype=float) / 2
    b, *derivatives = (MU_0 * (tensor @ m) for tensor in newton_derivatives(points, size, 2, order + 2))
    inside = np.all(np.abs(_moved(np.asarray(points, dtype=float), half)) <= half, axis=-1)
    return b + MU_0 * m * inside[..., None], *derivatives


def rectangle_derivatives(points: ArrayLike, width: float, height: float, highest: int) -> tuple[Floats, ...]:
    """Cartesian derivatives of the potential S(x) = 1/(4π) ∫ dA / |x − y| of a flat rectangle in the xz plane.

    Parameters
    ----------
    points : (..., 3) m, frame of the rectangle: centre at the origin, normal y.
    width, height : m, along x and z, > 0.
    highest : 1, 2 or 3, the highest order.

    Returns
    -------
    ∂_i S (..., 3), ∂_i∂_j S (..., 3, 3) 1/m, ∂_i∂_j∂_k S (..., 3, 3, 3) 1/m², up to `highest`. On the
    rectangle itself: the limit from the side of negative y. Infinite or NaN on its edges.
    """
    array = np.asarray(points, dtype=float)
    flat = array.reshape(-1, 3)
    components = np.empty((flat.shape[0], _SIZES[highest]))

    def run(chunk: slice) -> None:
        _rectangle(flat[chunk], width / 2, height / 2, highest, components[chunk])

    in_chunks(run, flat.shape[0], THREAD)
    return symmetric_tensors(components.reshape(*array.shape[:-1], components.shape[1]), 1, highest)


def _moved(points: Floats, half: Floats) -> Floats:
    """The points, those on edges moved inwards."""
    step = EDGE * half.min()
    excess = np.abs(points) - half
    beside = excess <= step
    near = beside & (excess >= -step)
    on_edge = beside.all(axis=-1, keepdims=True) & (near.sum(axis=-1, keepdims=True) > 1)
    return np.where(on_edge & near, np.copysign(half - step, points), points)


def symmetric_tensors(components: Floats, lowest: int, highest: int) -> tuple[Floats, ...]:
    """Symmetric tensors (..., 3), (..., 3, 3), … of the orders from `lowest` to `highest` from their components.

    `components` (..., n) holds x, y, z, xx, xy, xz, yy, yz, zz, xxx, … from order 1 on.
    """
    return tuple(components[..., _spread(order)] for order in range(lowest, highest + 1))


def _spread(order: int) -> Integers:
    """The component of each entry of a symmetric tensor of this order."""
    entries = np.indices((3,) * order)
    x, y, z = ((entries == axis).sum(axis=0) for axis in range(3))
    return np.asarray(_PLACE[x, y, z])


@kernel
def _block(points: Floats, half: Floats, highest: int, out: Floats) -> None:
    """Components (n, c) of the derivatives of U, by corners or, far away, by Gauss rules."""
    volume = 8.0 * half[0] * half[1] * half[2]
    longest = max(half[0], half[1], half[2])
    folded = np.empty(3)
    count = np.empty(3, np.int64)
    size = out.shape[1]
    for n in range(points.shape[0]):
        gap2 = farthest2 = 0.0
        for axis in range(3):
            folded[axis] = abs(points[n, axis])
            gap2 += max(folded[axis] - half[axis], 0.0) ** 2
            farthest2 += (folded[axis] + half[axis]) ** 2
        for i in range(size):
            out[n, i] = 0.0
        gap = sqrt(gap2)
        if farthest2 * sqrt(farthest2) > CANCELLATION * volume and gap > longest:
            for axis in range(3):
                # 1/r is singular `gap` off the real axis at the nearest: the rule converges as ratio^(−2 nodes).
                ratio = gap / half[axis] + sqrt(1.0 + (gap / half[axis]) ** 2)
                count[axis] = min(NODES, int(15.0 / log(ratio)) + 2)
            _by_gauss(folded, half, count, highest, out[n])
        else:
            for corner in range(8):
                sx, sy, sz = 1.0 - 2.0 * (corner & 1), 1.0 - (corner & 2), 1.0 - 0.5 * (corner & 4)
                x, y, z = folded[0] + sx * half[0], folded[1] + sy * half[1], folded[2] + sz * half[2]
                _add_corner(x, y, z, sx * sy * sz / (4.0 * pi), highest, out[n])
        _unfold(points[n], out[n])


@kernel
def _unfold(point: Floats, out: Floats) -> None:
    """Components at |x|, |y|, |z| to those at x, y, z of a potential even in each."""
    for axis in range(3):
        if point[axis] < 0.0:
            for i in range(out.size):
                if _POWERS[i, axis] % 2 == 1:
                    out[i] = -out[i]


@kernel
def _rectangle(points: Floats, half_width: float, half_height: float, highest: int, out: Floats) -> None:
    """Components (n, c) of the derivatives of S = 1/(4π) Σ ± ∂_Y G over the four corners."""
    work = np.empty(34)
    for n in range(points.shape[0]):
        for i in range(34):
            work[i] = 0.0
        x, y, z = abs(points[n, 0]), abs(points[n, 1]), abs(points[n, 2])
        for corner in range(4):
            sx, sz = 1.0 - 2.0 * (corner & 1), 1.0 - (corner & 2)
            weight = sx * sz / (4.0 * pi)
            _add_corner(x + sx * half_width, y, z + sz * half_height, weight, highest + 1, work)
        for i in range(out.shape[1]):
            out[n, i] = work[_PLACE[_POWERS[i, 0], _POWERS[i, 1] + 1, _POWERS[i, 2]]]
        _unfold(points[n], out[n])


@kernel
def _add_corner(x: float, y: float, z: float, weight: float, highest: int, out: Floats) -> None:
    """Add the derivatives of G, orders 1 to `highest`, to `out`; x = 0 is the limit from below, so are y and z."""
    u = (x, y, z)
    r = sqrt(x * x + y * y + z * z)
    inverse = 1.0 / r
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        a, b, c = u[i], u[j], u[k]
        p = r + c if c > 0.0 else (a * a + b * b) / (r - c)
        logarithm = weight * log(p)
        angle = weight * atan2(a * b if c > 0.0 else -a * b, abs(c) * r)
        ei, ej, ek = _unit(i), _unit(j), _unit(k)
        out[i] += b * logarithm
        out[j] += a * logarithm
        out[k] -= c * angle
        if highest < 2:
            continue
        out[_at(ei, ej, 0, 0)] += logarithm
        out[_at(ek, ek, 0, 0)] -= angle
        if highest < 3:
            continue
        f = weight * inverse / p  # ∂_a ln(r + c) = a f
        if k == 0:
            out[_at(ei, ej, ek, 0)] += weight * inverse
        out[_at(ei, ei, ej, 0)] += a * f
        out[_at(ei, ej, ej, 0)] += b * f
        out[_at(ei, ei, ei, 0)] -= b * f
        out[_at(ej, ej, ej, 0)] -= a * f
        if highest < 4:
            continue
        g = -f * inverse * (inverse + 1.0 / p)  # ∂_a f = a g
        out[_at(ei, ei, ej, ek)] -= weight * a * inverse**3
        out[_at(ei, ei, ei, ej)] += f + a * a * g
        out[_at(ei, ej, ej, ej)] += f + b * b * g
        out[_at(ei, ei, ej, ej)] += a * b * g
        out[_at(ei, ei, ei, ei)] -= a * b * g
        out[_at(ej, ej, ej, ej)] -= a * b * g


@kernel
def _unit(axis: int) -> int:
    """One derivative along an axis, as digits to base 5; sums of these count derivatives."""
    return 25 if axis == 0 else (5 if axis == 1 else 1)


@kernel
def _at(first: int, second: int, third: int, fourth: int) -> int:
    """The component that these derivatives make together."""
    digits = first + second + third + fourth
    return int(_PLACE[digits // 25, digits // 5 % 5, digits % 5])


@kernel
def _by_gauss(point: Floats, half: Floats, count: Integers, highest: int, out: Floats) -> None:
    """Add the derivatives of U as a Gauss–Legendre rule over the block of those of 1/(4π |x − y|)."""
    u = np.empty(3)
    volume = half[0] * half[1] * half[2] / (4.0 * pi)
    for nx in range(count[0]):
        u[0] = point[0] - half[0] * _RULES[0, count[0], nx]
        for ny in range(count[1]):
            u[1] = point[1] - half[1] * _RULES[0, count[1], ny]
            weight = volume * _RULES[1, count[0], nx] * _RULES[1, count[1], ny]
            for nz in range(count[2]):
                u[2] = point[2] - half[2] * _RULES[0, count[2], nz]
                add_pole(u, weight * _RULES[1, count[2], nz], highest, out)


@kernel
def add_pole(u: Floats, weight: float, highest: int, out: Floats) -> None:
    """Add the derivatives of weight/|u|, orders 1 to `highest`, to `out` (n,), components as in `symmetric_tensors`."""
    square = 1.0 / (u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    r3 = weight * square * sqrt(square)
    r5 = 3.0 * r3 * square
    r7 = 5.0 * r5 * square
    r9 = 7.0 * r7 * square
    for i in range(3):
        out[i] -= u[i] * r3
    if highest < 2:
        return
    place = 3
    for i in range(3):
        for j in range(i, 3):
            out[place] += u[i] * u[j] * r5 - (r3 if i == j else 0.0)
            place += 1
    if highest < 3:
        return
    for i in range(3):
        for j in range(i, 3):
            for k in range(j, 3):
                pairs = (u[k] if i == j else 0.0) + (u[j] if i == k else 0.0) + (u[i] if j == k else 0.0)
                out[place] += pairs * r5 - u[i] * u[j] * u[k] * r7
                place += 1
    if highest < 4:
        return
    for i in range(3):
        for j in range(i, 3):
            for k in range(j, 3):
                for m in range(k, 3):
                    pairs = (u[k] * u[m] if i == j else 0.0) + (u[j] * u[m] if i == k else 0.0)
                    pairs += (u[j] * u[k] if i == m else 0.0) + (u[i] * u[m] if j == k else 0.0)
                    pairs += (u[i] * u[k] if j == m else 0.0) + (u[i] * u[j] if k == m else 0.0)
                    both = (i == j and k == m) + (i == k and j == m) + (i == m and j == k)
                    out[place] += u[i] * u[j] * u[k] * u[m] * r9 - pairs * r7 + both * r5
                    place += 1
