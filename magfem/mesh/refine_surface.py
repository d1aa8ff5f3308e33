"""Finer facets on the same surface: halved where they are longer than wanted, flipped where flat ones are slender."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from magfem.errors import InputError
from magfem.geometry.body_surfaces import BodySurfaces
from magfem.typing import Booleans, Floats, Integers, Points

_FLAT = 1e-9  # height over a facet's plane, relative to the size of the pair, below which two facets are in one plane
_SIDES = ((0, 1), (1, 2), (2, 0))

Facets = tuple[Integers, Integers, Integers, Integers, Floats]
"""Corners (f, 3), inner and outer (f,), the facet of the original (f,) that a curved one is a part of (−1 for
straight ones), and its corners there (f, 3, 2)."""


def refine(surfaces: BodySurfaces, wanted: Callable[[Points], Floats], most: int) -> BodySurfaces:
    """The same surfaces with no edge longer than `wanted` (m, at (n, 3) m) gives.

    Halves the longest edges (Rivara), so that angles never fall below half the smallest, and flips the diagonals of
    pairs in one plane to Delaunay's condition. No point leaves the surface: volumes stay to rounding.
    Raises InputError when more than `most` facets would be needed.
    """
    curved = surfaces.curved
    count = len(surfaces.facets)
    corners = surfaces.facets[:, :3]
    used, numbered = np.unique(corners, return_inverse=True)
    points = surfaces.points[used]
    parent = np.where(curved, np.arange(count), -1)
    place = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (count, 1, 1))
    facets: Facets = (numbered.reshape(-1, 3), surfaces.inner, surfaces.outer, parent, place)
    while True:
        facets = (_flipped(points, *facets[:4]), *facets[1:])
        edges, index, length = _edges(points, facets[0])
        marked = length > wanted(points[edges].mean(axis=1)) * (1 + 1e-9)
        if not marked.any():
            break
        points, facets = _halved(surfaces, points, facets, edges, index, length, marked)
        if len(facets[0]) > most:
            raise InputError(f"more than {most} facets would be needed: lower the resolution")
    corners, inner, outer, parent, place = facets
    edges, index, _ = _edges(points, corners)
    middles = _middles(surfaces, points, edges, index, parent, place)
    return BodySurfaces(
        surfaces.names, np.vstack([points, middles]), np.hstack([corners, len(points) + index]), inner, outer
    )


def _edges(points: Points, corners: Integers) -> tuple[Integers, Integers, Floats]:
    """All edges (e, 2), those of every facet (f, 3) in the order 01, 12, 20, and their lengths (e,) m."""
    ends = np.sort(corners[:, _SIDES].reshape(-1, 2), axis=1)
    key, index = np.unique(ends[:, 0] * len(points) + ends[:, 1], return_inverse=True)
    edges = np.stack([key // len(points), key % len(points)], axis=1)
    return edges, index.reshape(-1, 3), np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)


def _middles(
    surfaces: BodySurfaces, points: Points, edges: Integers, index: Integers, parent: Integers, place: Floats
) -> Points:
    """The middle (e, 3) of every edge, on the curved facet where it belongs to one."""
    middles: Points = points[edges].mean(axis=1)
    bent = parent >= 0
    if bent.any():
        for k, (i, j) in enumerate(_SIDES):
            u, v = ((place[bent, i] + place[bent, j]) / 2).T
            w = 1 - u - v
            shapes = [w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w]
            nodes = surfaces.points[surfaces.facets[parent[bent]]]
            middles[index[bent, k]] = np.einsum("af,fai->fi", np.array(shapes), nodes)
    return middles


def _halved(
    surfaces: BodySurfaces,
    points: Points,
    facets: Facets,
    edges: Integers,
    index: Integers,
    length: Floats,
    marked: Booleans,
) -> tuple[Points, Facets]:
    """Every marked edge halved, and before it the longest of its facets, so that neighbours keep matching."""
    corners, inner, outer, parent, place = facets
    rank = np.empty(len(edges), dtype=np.int64)
    rank[np.argsort(length, kind="stable")] = np.arange(len(edges))
    rows = np.arange(len(corners))
    longest = rank[index].argmax(axis=1)
    while True:
        late = marked[index].any(axis=1) & ~marked[index[rows, longest]]
        if not late.any():
            break
        marked[index[late, longest[late]]] = True
    middles = _middles(surfaces, points, edges, index, parent, place)
    number = np.full(len(edges), -1, dtype=np.int64)
    number[marked] = len(points) + np.arange(int(marked.sum()))
    points = np.vstack([points, middles[marked]])
    turn = (longest[:, None] + np.arange(3)) % 3  # the longest edge becomes 01
    corners, place = corners[rows[:, None], turn], place[rows[:, None], turn]
    new = number[index[rows[:, None], turn]]  # (f, 3) new nodes on the edges 01, 12, 20, or −1
    between = (place + place[:, [1, 2, 0]]) / 2
    nodes, spots = np.hstack([corners, new]), np.concatenate([place, between], axis=1)
    split, second, third = new[:, 0] >= 0, new[:, 1] >= 0, new[:, 2] >= 0
    pieces = [
        (~split, [0, 1, 2]),
        (split & ~third, [2, 0, 3]),
        (split & third, [3, 2, 5]),
        (split & third, [3, 5, 0]),
        (split & ~second, [1, 2, 3]),
        (split & second, [3, 1, 4]),
        (split & second, [3, 4, 2]),
    ]
    keep = [np.flatnonzero(chosen) for chosen, _ in pieces]
    rows = np.concatenate(keep)
    local = np.concatenate([np.tile(c, (len(k), 1)) for k, (_, c) in zip(keep, pieces, strict=True)])
    return points, (nodes[rows[:, None], local], inner[rows], outer[rows], parent[rows], spots[rows[:, None], local])


def _flipped(points: Points, corners: Integers, inner: Integers, outer: Integers, parent: Integers) -> Integers:
    """Facets (f, 3) with the shared edge of flat pairs turned wherever that makes them less slender."""
    corners = corners.copy()
    for _ in range(50):
        _, index, _ = _edges(points, corners)
        flat = np.argsort(index.ravel(), kind="stable")
        owner, side = flat // 3, flat % 3
        sorted_edges = index.ravel()[flat]
        count = np.bincount(sorted_edges)
        start = np.concatenate([[0], np.cumsum(count)[:-1]])[count == 2]
        f, g, i, j = owner[start], owner[start + 1], side[start], side[start + 1]
        alike = (inner[f] == inner[g]) & (outer[f] == outer[g]) & (parent[f] < 0) & (parent[g] < 0)
        f, g, i, j = f[alike], g[alike], i[alike], j[alike]
        a, b, c = (corners[f, (i + k) % 3] for k in range(3))
        d = corners[g, (j + 2) % 3]
        pa, pb, pc, pd = points[a], points[b], points[c], points[d]
        normal = np.cross(pb - pa, pc - pa)
        size = np.linalg.norm(pb - pa, axis=1)
        size = np.maximum(size, np.linalg.norm(pd - pc, axis=1))
        height = np.abs(np.einsum("ei,ei->e", normal, pd - pa)) / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
        bad = _angle(pa - pc, pb - pc) + _angle(pa - pd, pb - pd) - np.pi
        # After the flip both must face as before: the four corners are convex.
        first, second = np.cross(pd - pa, pc - pa), np.cross(pc - pb, pd - pb)
        convex = (np.einsum("ei,ei->e", first, normal) > 0) & (np.einsum("ei,ei->e", second, normal) > 0)
        wrong = (height < _FLAT * size) & (bad > 1e-6) & convex
        if not wrong.any():
            break
        f, g, a, b, c, d, bad = (array[wrong] for array in (f, g, a, b, c, d, bad))
        worst = np.zeros(len(corners))
        np.maximum.at(worst, f, bad)
        np.maximum.at(worst, g, bad)
        chosen = (worst[f] == bad) & (worst[g] == bad)
        f, g, a, b, c, d = (array[chosen] for array in (f, g, a, b, c, d))
        both = np.concatenate([f, g])
        alone = np.bincount(both, minlength=len(corners))  # equal ones may meet in a facet: leave them for later
        single = (alone[f] == 1) & (alone[g] == 1)
        if not single.any():
            single[:1] = True
        f, g, a, b, c, d = (array[single] for array in (f, g, a, b, c, d))
        corners[f] = np.stack([a, d, c], axis=1)
        corners[g] = np.stack([d, b, c], axis=1)
    return corners


def _angle(u: Floats, v: Floats) -> Floats:
    angle: Floats = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ei,ei->e", u, v))
    return angle
