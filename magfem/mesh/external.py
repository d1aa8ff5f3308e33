"""Meshes about given surfaces: bodies whose shape comes from an external mesh, in a tight ball of air.

The surfaces are refined where the field is sharp but never moved, so that the bodies keep the volume of the external
mesh; inside and air are filled with new tetrahedra.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from magfem.errors import InputError, MeshError
from magfem.geometry.body_surfaces import BodySurfaces, winding
from magfem.mesh.mesh import Mesh
from magfem.mesh.refine_surface import refine
from magfem.mesh.session import gmsh_session
from magfem.mesh.shape_functions import shape_gradients, tetrahedron_rule
from magfem.typing import Booleans, Floats, Integers, Points

log = logging.getLogger("magfem")

BALL = 1.35
"""Radius of the artificial boundary over the bodies'."""
SHARP = np.radians(25.0)
"""Facets that meet at a larger angle make a rim, where the field is singular; at smaller ones they round a wall."""
MOST_FACETS = 110_000
"""What a mesh may have on its bodies: about a million unknowns."""

_LONGEST = 1.5  # edge over the wanted element size at which an edge is halved: halves are then about that size
_GROWTH = 2.75  # distance over which elements grow by their own size, away from rims
_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])


def mesh_in_air(surfaces: BodySurfaces, feature: float, radius: float, resolution: float = 1.0) -> Mesh:
    """Tetrahedra inside the bodies and in the ball of air around them.

    feature: the smallest thickness, m.  radius: of the ball about the origin that holds the bodies, m.
    resolution: factor on the fineness; facets of the surface are halved until they are as small as it asks for,
    those that are smaller already stay.

    Raises InputError when surfaces cross or would need too many facets, MeshError when Gmsh fails.
    """
    feature = max(feature, radius / 8)
    rim, wall, outer = 0.05 * feature / resolution, min(0.13 / resolution, 0.2) * feature, 0.3 * radius / resolution
    fine = refine(surfaces, _sizes(surfaces, _LONGEST * rim, _LONGEST * wall), MOST_FACETS)
    ball, ball_facets = _sphere(BALL * radius, max(2, round(1.15 * BALL * radius / outer)))
    corners, numbered = np.unique(fine.facets[:, :3], return_inverse=True)
    points = np.vstack([fine.points[corners], ball])
    facets = numbered.reshape(-1, 3)
    regions = _regions(points, facets, fine.inner, fine.outer, ball_facets + len(corners))
    nodes, cells, body = _fill(points, regions, outer)
    mesh = _second_order(nodes, cells, body, fine, corners, BALL * radius)
    log.info("mesh: %d tetrahedra", len(cells))
    return mesh


def _sizes(surfaces: BodySurfaces, rim: float, wall: float) -> Callable[[Points], Floats]:
    """Wanted edge length (m) on the surface: `rim` on sharp edges, growing to `wall` away from them."""
    ends = surfaces.points[_rims(surfaces)]
    if len(ends) == 0:
        return lambda places: np.full(len(places), wall)
    steps = np.maximum(np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / rim), 1).astype(int)
    if steps.sum() > 20 * MOST_FACETS:
        raise InputError("the surface's sharp edges are too long for so fine a mesh: lower the resolution")
    row = np.repeat(np.arange(len(ends)), steps)
    share = (np.arange(row.size) - np.repeat(np.cumsum(steps) - steps, steps) + 0.5) / steps[row]
    tree = cKDTree(ends[row, 0] + share[:, None] * (ends[row, 1] - ends[row, 0]))

    def wanted(places: Points) -> Floats:
        distance = np.maximum(tree.query(places)[0] - rim / 2, 0.0)
        size: Floats = np.minimum(rim + distance / _GROWTH, wall)
        return size

    return wanted


def _rims(surfaces: BodySurfaces) -> Integers:
    """Edges (r, 2) where the surface has a sharp bend, or more than two facets meet."""
    nodes = surfaces.points[surfaces.facets]
    ends, normals = [], []
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        # The facet's plane at this edge's middle: for a curved one its tangent plane there.
        along = nodes[:, j] - nodes[:, i]
        sides = nodes[:, 3 + (k + 1) % 3] + nodes[:, 3 + (k + 2) % 3]
        across = 2 * (sides - nodes[:, 3 + k]) - nodes[:, (k + 2) % 3] - (nodes[:, i] + nodes[:, j]) / 2
        normals.append(np.cross(along, across))
        ends.append(np.sort(surfaces.facets[:, [i, j]], axis=1))
    edges, index, count = np.unique(np.concatenate(ends), axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()
    normal = np.concatenate(normals)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    order = np.argsort(index, kind="stable")
    start = np.cumsum(count) - count
    pair = count == 2
    cosine = np.full(len(edges), -1.0)
    cosine[pair] = np.einsum("ei,ei->e", normal[order[start[pair]]], normal[order[start[pair] + 1]])
    sharp: Integers = edges[cosine < np.cos(SHARP)]
    return sharp


def _sphere(radius: float, parts: int) -> tuple[Points, Integers]:
    """Nodes (n, 3) and facets (f, 3), outwards, of a ball: an icosahedron with its edges in `parts`."""
    golden = (1 + 5**0.5) / 2
    tops = np.array([[s, t * golden, 0.0] for s in (-1, 1) for t in (-1, 1)])
    tops = np.vstack([tops, tops[:, [2, 0, 1]], tops[:, [1, 2, 0]]])
    weights = [(i, j, parts - i - j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    number = {weight: n for n, weight in enumerate(weights)}
    small = [
        [number[i + p, j + q, parts - i - j - p - q] for p, q in corners]
        for i in range(parts)
        for j in range(parts - i)
        for corners in (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
        if all(i + p + j + q <= parts for p, q in corners)
    ]
    faces = ConvexHull(tops).simplices
    points = np.einsum("wk,fki->fwi", np.array(weights) / parts, tops[faces]).reshape(-1, 3)
    facets = (np.arange(len(faces))[:, None, None] * len(weights) + np.array(small)).reshape(-1, 3)
    _, first, same = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    points, facets = points[first], same.ravel()[facets]
    points *= radius / np.linalg.norm(points, axis=1)[:, None]
    a, b, c = (points[facets[:, k]] for k in range(3))
    inward = np.einsum("ei,ei->e", np.cross(b - a, c - a), a) < 0
    facets[inward] = facets[inward][:, [0, 2, 1]]
    return points, facets


Regions = tuple[list[Integers], list[tuple[int, list[int]]]]
"""Patches of facets (f, 3); and the regions: body (−1 in air) and the patches around each."""


def _regions(points: Points, facets: Integers, inner: Integers, outer: Integers, ball: Integers) -> Regions:
    """What Gmsh must be told: every connected region by the patches that bound it, holes within it included."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(facets)
    # A side is a facet seen from one of the regions that it separates; sides of one body (or of air) that share
    # an edge bound the same region.
    label = np.concatenate([inner, outer])
    sides = np.concatenate([facets, facets[:, [0, 2, 1]]])
    ends = np.sort(sides[:, ((0, 1), (1, 2), (2, 0))].reshape(-1, 2), axis=1)
    key = np.column_stack([ends, np.repeat(label, 3)])
    edges, index = np.unique(key, axis=0, return_inverse=True)
    rows = np.repeat(np.arange(2 * count), 3)
    total = 2 * count + len(edges)
    graph = coo_array((np.ones(rows.size), (rows, 2 * count + index.ravel())), shape=(total, total))
    _, group = connected_components(graph, directed=False)
    shells, shell = np.unique(group[: 2 * count], return_inverse=True)
    a, b, c = (points[sides[:, k]] for k in range(3))
    volume = np.bincount(shell, np.einsum("ei,ei->e", np.cross(a, b), c) / 6, minlength=len(shells))
    kind = np.array([label[np.argmax(shell == s)] for s in range(len(shells))])
    patch_key, patch = np.unique(np.column_stack([shell[:count], shell[count:]]), axis=0, return_inverse=True)
    patches = [facets[patch.ravel() == p] for p in range(len(patch_key))] + [ball]
    bounds = [[p for p, pair in enumerate(patch_key) if s in pair] for s in range(len(shells))]
    regions = {int(s): (int(kind[s]), list(bounds[s])) for s in np.flatnonzero(volume > 0)}
    air = (-1, [len(patch_key)])
    for s in np.flatnonzero(volume <= 0):
        # A hole: in the smallest region of its kind around it, else in the air that reaches the ball.
        probe = points[sides[np.argmax(shell == s)]].mean(axis=0)
        around = [
            (float(volume[r]), r)
            for r in regions
            if kind[r] == kind[s] and volume[r] > -volume[s] and _inside(probe, points[sides[shell == r]])
        ]
        home = regions[min(around)[1]] if around else air
        if home is air and kind[s] >= 0:
            raise InputError("a body's surface is inside out")
        home[1].extend(bounds[s])
    return patches, [*regions.values(), air]


def _inside(point: Floats, triangles: Floats) -> bool:
    """Whether a closed surface (f, 3, 3) winds around the point (3,)."""
    return abs(winding(point, triangles)) > 0.5


def _fill(points: Points, regions: Regions, outer: float) -> tuple[Points, Integers, Integers]:
    """Nodes, tetrahedra (e, 4) and the body of each; the first nodes are `points`."""
    patches, volumes = regions
    cells: list[Integers]
    body: list[Integers]
    with gmsh_session() as gmsh:
        seen = np.zeros(len(points), dtype=bool)
        for tag, patch in enumerate(patches, start=1):
            gmsh.model.addDiscreteEntity(2, tag)
            nodes = np.unique(patch)
            nodes = nodes[~seen[nodes]]
            seen[nodes] = True
            gmsh.model.mesh.addNodes(2, tag, nodes + 1, points[nodes].ravel())
            gmsh.model.mesh.addElementsByType(tag, 2, [], (patch + 1).ravel())
        geo = gmsh.model.geo
        tags = [geo.addVolume([geo.addSurfaceLoop([patch + 1 for patch in around])]) for _, around in volumes]
        geo.synchronize()
        for option, value in (
            ("Mesh.MeshSizeExtendFromBoundary", 1),
            ("Mesh.MeshSizeFromPoints", 0),
            ("Mesh.MeshSizeFromCurvature", 0),
            ("Mesh.MeshSizeMax", outer),
        ):
            gmsh.option.setNumber(option, value)
        _generate(gmsh)
        found, coordinates, _ = gmsh.model.mesh.getNodes()
        number = np.zeros(int(found.max()) + 1, dtype=np.int64)
        rows = _first(points, np.asarray(coordinates).reshape(-1, 3))
        number[np.asarray(found, dtype=np.int64)[rows]] = np.arange(found.size)
        filled: Points = np.asarray(coordinates).reshape(-1, 3)[rows]
        cells, body = [], []
        for (index, _), tag in zip(volumes, tags, strict=True):
            inside = number[np.asarray(gmsh.model.mesh.getElementsByType(4, tag)[1], dtype=np.int64)].reshape(-1, 4)
            if len(inside) == 0:
                raise MeshError("Gmsh left a part of the space between the surfaces empty")
            cells.append(inside)
            body.append(np.full(len(inside), index))
    return filled, np.concatenate(cells), np.concatenate(body)


def _first(points: Points, nodes: Points) -> Integers:
    """Order (n,) that puts those of `nodes` (n, 3) at `points` first: Gmsh numbers nodes anew."""
    distance, place = cKDTree(nodes).query(points)
    if distance.max() > 1e-12 * np.abs(points).max() or len(np.unique(place)) < len(points):
        raise MeshError("Gmsh did not keep the bodies' surfaces")
    return np.concatenate([place, np.setdiff1d(np.arange(len(nodes)), place)])


def _generate(gmsh: Any) -> None:
    gmsh.option.setNumber("Mesh.Algorithm3D", 10)
    try:
        gmsh.model.mesh.generate(3)
    except Exception:  # Gmsh raises nothing more specific
        gmsh.option.setNumber("Mesh.Algorithm3D", 1)
        try:
            gmsh.model.mesh.generate(3)
        except Exception as error:
            raise InputError(
                f"the space around the surfaces cannot be meshed, most often because they cross or touch without "
                f"sharing facets (Gmsh: {error})"
            ) from None


def _second_order(
    nodes: Points, cells: Integers, body: Integers, fine: BodySurfaces, corners: Integers, radius: float
) -> Mesh:
    """With a node on every edge: on the surfaces where they have it, on the ball, else in the middle."""
    ends = np.sort(cells[:, _EDGES].reshape(-1, 2), axis=1)
    key, index = np.unique(ends[:, 0] * len(nodes) + ends[:, 1], return_inverse=True)
    edges = np.stack([key // len(nodes), key % len(nodes)], axis=1)
    middles = nodes[edges].mean(axis=1)
    number = np.full(len(fine.points), -1, dtype=np.int64)
    number[corners] = np.arange(len(corners))
    sides = np.sort(number[fine.facets[:, ((0, 1), (1, 2), (2, 0))]].reshape(-1, 2), axis=1)
    wanted = sides[:, 0] * len(nodes) + sides[:, 1]
    place = np.searchsorted(key, wanted)
    if not np.array_equal(key[np.minimum(place, key.size - 1)], wanted):
        raise MeshError("Gmsh did not keep the bodies' surfaces")
    middles[place] = fine.points[fine.facets[:, 3:].ravel()]
    far = np.abs(np.linalg.norm(nodes, axis=1) - radius) < 1e-9 * radius
    far = far[edges].all(axis=1)
    middles[far] *= radius / np.linalg.norm(middles[far], axis=1)[:, None]
    curved = np.hstack([cells, len(nodes) + index.reshape(-1, 6)])
    points = np.vstack([nodes, middles])
    used, numbered = np.unique(curved, return_inverse=True)
    points, curved = points[used], numbered.reshape(curved.shape)
    folded = _folded(points, curved)
    for _ in range(5):
        if not folded.any():
            break
        points[curved[folded, 4:]] = points[curved[folded][:, _EDGES]].mean(axis=2)
        folded = _folded(points, curved)
    return Mesh(points, np.ascontiguousarray(curved), body, fine.names, radius)


def _folded(points: Points, cells: Integers) -> Booleans:
    """(e,) Whether a curved tetrahedron is inside out somewhere."""
    shapes = shape_gradients(np.vstack([np.eye(4)[:, 1:], tetrahedron_rule(5)[0]]))
    jacobian = np.einsum("eai,qaj->eqij", points[cells], shapes, optimize=True)
    folded: Booleans = np.linalg.det(jacobian).min(axis=1) <= 0
    return folded
