"""Straight tetrahedra of coils in a ball of air, for edge elements.

Solid coaxial windings are bodies of revolution whose end faces and walls are faces of the mesh. Ribbons are closed
strips of foil without thickness: their triangles are embedded in the air, so that every one of them is a face
shared by two tetrahedra. Away from the coils the elements grow to the size that suits the outer sphere.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from magfem.errors import InputError, MeshError
from magfem.mesh.session import gmsh_session
from magfem.typing import Floats, Integers

log = logging.getLogger("magfem")

BALL = 1.7
"""Radius of the outer sphere over the coils'."""

MOST_EDGES = 2.5e6
"""What a mesh may ask for: about 6 GB of memory."""

_GROWTH = 2.4
"""Element size on the outer sphere over that in windings, if the sphere does not ask for less."""

_EDGES_PER_CUBE = 18.0
"""Edges over the cubes of the element size that fill the windings and their bores; the air around is included."""

_EDGES_PER_POINT = 35.0
"""Edges over the ribbons' points."""

STRETCH = 2.0
"""Length of a ribbon's elements along the strip over that across."""

_CORNER = 0.3
"""Turns (rad) between two stations that are kept as corners."""

_FIRST_TAG = 1000  # of the ribbons' points: clear of those of the sphere

_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_FACES = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])


@dataclass(frozen=True)
class Winding:
    """A solid coil about z with a uniform azimuthal current density.

    Lengths in m. centre: height of its middle above the origin. Negative turns are wound left-handed.
    """

    inner_radius: float
    outer_radius: float
    length: float
    turns: float
    centre: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.inner_radius < self.outer_radius:
            raise InputError(
                f"winding: inner_radius must be at least 0 and smaller than outer_radius ({self.outer_radius:g} m), "
                f"got {self.inner_radius:g} m"
            )
        if not self.length > 0:
            raise InputError(f"winding: length must be positive, got {self.length:g} m")


Ribbon: TypeAlias = tuple[Floats, Floats]
"""Left and right edge points (k, 3) m of a closed strip, the last station equal to the first; corners mitred.

The current runs along the stations and is spread evenly from edge to edge.
"""


@dataclass(frozen=True)
class AirMesh:
    """Straight tetrahedra out to a sphere around the coils.

    points: (n, 3) m.  tetrahedra: (e, 4), corners in ascending order.  centre: (3,) m and radius: m, of the sphere.
    ribbons: of every circuit the triangles (t, 3), counter-clockwise for whom the left edge lies to the left, and
    the share (t, 3) of the current that runs between the left edge and each of their corners.
    """

    points: Floats
    tetrahedra: Integers
    centre: Floats
    radius: float
    ribbons: tuple[tuple[Integers, Floats], ...] = ()

    @cached_property
    def edges(self) -> Integers:
        """Ends (m, 2) of every edge, the smaller number first, in lexical order."""
        return self._edges[0]

    @cached_property
    def cell_edges(self) -> Integers:
        """Edges (e, 6) of every tetrahedron: 01, 02, 03, 12, 13, 23."""
        return self._edges[1]

    @cached_property
    def outer_triangles(self) -> Integers:
        """Corners (f, 3) of the faces on the outer sphere, oriented outwards."""
        faces = self.tetrahedra[:, _FACES].reshape(-1, 3)
        total = self.points.shape[0]
        key = (faces[:, 0] * total + faces[:, 1]) * total + faces[:, 2]
        _, first, count = np.unique(key, return_index=True, return_counts=True)
        faces = faces[first[count == 1]]
        a, b, c = (self.points[faces[:, k]] for k in range(3))
        inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - self.centre) < 0
        return np.asarray(np.where(inwards[:, None], faces[:, [0, 2, 1]], faces))

    def edge_numbers(self, pairs: Integers) -> Integers:
        """Numbers (...) of the edges between the points `pairs` (..., 2). Raises MeshError where there is none."""
        low, high = pairs.min(axis=-1), pairs.max(axis=-1)
        wanted = low * self.points.shape[0] + high
        keys = self.edges[:, 0] * self.points.shape[0] + self.edges[:, 1]
        found = np.minimum(np.searchsorted(keys, wanted), keys.size - 1)
        if not np.array_equal(keys[found], wanted):
            raise MeshError("the mesh of the air lost a part of the coil's surface: try another resolution")
        return np.asarray(found)

    @cached_property
    def _edges(self) -> tuple[Integers, Integers]:
        pairs = self.tetrahedra[:, _EDGES].reshape(-1, 2)
        total = self.points.shape[0]
        keys, number = np.unique(pairs[:, 0] * total + pairs[:, 1], return_inverse=True)
        return np.column_stack([keys // total, keys % total]), number.reshape(-1, 6)


def windings_in_air(circuits: Sequence[Sequence[Winding]], size: float, ball: float = BALL) -> AirMesh:
    """Mesh coaxial windings with elements of `size` m in them and in their bores.

    ball: radius of the outer sphere over that of the windings. Raises InputError for a mesh that would not fit
    into memory, MeshError when Gmsh fails.
    """
    windings = [winding for circuit in circuits for winding in circuit]
    low, high = (f(w.centre + side * w.length / 2 for w in windings) for f, side in ((min, -1), (max, 1)))
    centre = np.array([0.0, 0.0, (low + high) / 2])
    radius = ball * max(float(np.hypot(w.outer_radius, abs(w.centre - centre[2]) + w.length / 2)) for w in windings)
    filled = sum(np.pi * w.outer_radius**2 * w.length for w in windings)
    _check_size(_EDGES_PER_CUBE * filled / size**3, size)
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        space = occ.addSphere(*centre, radius)
        solids = []
        for w in windings:
            radii = [r for r in (w.inner_radius, w.outer_radius) if r > 0]
            solids += [(3, occ.addCylinder(0, 0, w.centre - w.length / 2, 0, 0, w.length, r)) for r in radii]
        _, pieces = occ.fragment([(3, space)], solids)
        occ.synchronize()
        outer = min(0.3 * radius, _GROWTH * size)
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), outer)
        inside = [part for piece in pieces[1:] for part in piece]
        gmsh.model.mesh.setSize(gmsh.model.getBoundary(inside, combined=False, oriented=False, recursive=True), size)
        points, tetrahedra = _fill(gmsh, outer)
    return _report(AirMesh(points, tetrahedra, centre, radius))


def ribbons_in_air(circuits: Sequence[Sequence[Ribbon]], across: int, ball: float = BALL) -> AirMesh:
    """Mesh closed ribbons with `across` elements from edge to edge, stretched along the strip by `STRETCH`.

    ball: radius of the outer sphere over that of the ribbons. Raises InputError for ribbons that are not closed and
    meshes that would not fit into memory, MeshError when Gmsh fails, as it does where strips touch or cross.
    """
    strips = [[_strip(ribbon, across) for ribbon in circuit] for circuit in circuits]
    everything = np.concatenate([strip.reshape(-1, 3) for circuit in strips for strip in circuit])
    size = max(float(ribbon_widths(ribbon).max()) for circuit in circuits for ribbon in circuit) / across
    _check_size(_EDGES_PER_POINT * everything.shape[0], size)
    low, high = everything.min(axis=0), everything.max(axis=0)
    centre = (low + high) / 2
    radius = ball * float(np.linalg.norm(everything - centre, axis=1).max())
    parts = []
    start = 0
    for circuit in strips:
        numbered = []
        for strip in circuit:
            triangles, share = _strip_triangles(strip)
            numbered.append((triangles + start, share))
            start += strip.shape[0] * strip.shape[1]
        parts.append(tuple(np.concatenate(columns) for columns in zip(*numbered, strict=True)))
    with gmsh_session() as gmsh:
        air = gmsh.model.occ.addSphere(0, 0, 0, 1)  # in units of the radius: Gmsh has absolute tolerances
        gmsh.model.occ.synchronize()
        outer = max(0.3 / across, 0.06)
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), outer)
        foil = gmsh.model.addDiscreteEntity(2)
        tags = _FIRST_TAG + np.arange(everything.shape[0])
        gmsh.model.mesh.addNodes(2, foil, tags, ((everything - centre) / radius).ravel())
        corners = np.concatenate([triangles for triangles, _ in parts])
        gmsh.model.mesh.addElementsByType(foil, 2, [], tags[corners].ravel())
        gmsh.model.mesh.embed(2, [foil], 3, air)
        points, tetrahedra = _fill(gmsh, outer)
    # Gmsh numbers the points anew, but does not move them.
    distance, number = cKDTree(points).query((everything - centre) / radius)
    if distance.max() > 1e-9:
        raise MeshError("the mesh of the air lost a part of the ribbons: strips must not touch or cross")
    ribbons = tuple((number[triangles], share) for triangles, share in parts)
    return _report(AirMesh(centre + radius * points, tetrahedra, centre, radius, ribbons))


def ribbon_widths(ribbon: Ribbon) -> Floats:
    """Distance (k,) m between the edges of a ribbon, square to its middle line where that is straight."""
    left, right = ribbon
    along = np.diff(left + right, axis=0)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    across = (left - right)[1:]
    return np.asarray(np.linalg.norm(across - np.einsum("ki,ki->k", across, along)[:, None] * along, axis=1))


def _strip(ribbon: Ribbon, across: int) -> Floats:
    """Points (k, across + 1, 3) of a closed ribbon from left to right, evenly spaced between its corners."""
    left, right = (np.asarray(side, dtype=float) for side in ribbon)
    if left.ndim != 2 or left.shape != right.shape or left.shape[0] < 4 or left.shape[1] != 3:
        raise InputError(
            f"ribbon: left and right must both be (k, 3) with k at least 4, got {left.shape}, {right.shape}"
        )
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        raise InputError("ribbon: its edge points must be finite")
    width = float(np.median(ribbon_widths((left, right))))
    if max(np.abs(left[-1] - left[0]).max(), np.abs(right[-1] - right[0]).max()) > 1e-6 * width:
        raise InputError("ribbon: the current path is open, its last station must equal its first")
    middle = (left + right) / 2
    step = np.linalg.norm(np.diff(middle, axis=0), axis=1)
    if (step <= 1e-9 * width).any():
        raise InputError("ribbon: two stations in a row are the same")
    along = np.diff(middle, axis=0) / step[:, None]
    straight = np.einsum("ki,ki->k", along[:-1], along[1:])
    corners = [0, *(1 + np.flatnonzero(straight < np.cos(_CORNER))), middle.shape[0] - 1]
    length = np.concatenate([[0.0], np.cumsum(step)])
    share = np.linspace(0.0, 1.0, across + 1)
    stations = []
    for first, last in pairwise(corners):
        count = max(1, round((length[last] - length[first]) / (STRETCH * width / across)))
        at = np.linspace(length[first], length[last], count + 1)[:-1]
        # Rectangles would have both diagonals in one sphere, which invites flat tetrahedra: lean them, but at corners.
        lean = np.where(np.arange(count) > 0, 0.4 * (length[last] - length[first]) / count, 0.0)
        stations.append(at[:, None] + lean[:, None] * share)
    along_lines = np.concatenate(stations)
    left, right = (
        np.stack([np.interp(along_lines, length, side[:, i]) for i in range(3)], axis=-1) for side in (left, right)
    )
    points: Floats = left * (1 - share[:, None]) + right * share[:, None]
    return points


def _strip_triangles(strip: Floats) -> tuple[Integers, Floats]:
    """Triangles (t, 3) of a closed strip of points (k, a, 3), and the share of its width (t, 3) at their corners."""
    stations, lines = strip.shape[:2]
    number = np.arange(stations * lines).reshape(stations, lines)
    after = np.roll(number, -1, axis=0)
    quads = np.stack([number[:, 1:], after[:, 1:], after[:, :-1], number[:, :-1]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return triangles, (triangles % lines) / (lines - 1.0)


def windings_size(circuits: Sequence[Sequence[Winding]], edges: float = 3.5e5) -> float:
    """Element size (m) that leads to about so many edges; thin windings ask for more of them."""
    windings = [winding for circuit in circuits for winding in circuit]
    filled = sum(np.pi * w.outer_radius**2 * w.length for w in windings)
    thinnest = min(min(w.outer_radius - w.inner_radius, w.length) for w in windings)
    return float(min((_EDGES_PER_CUBE * filled / edges) ** (1 / 3), 0.7 * thinnest))


def _check_size(edges: float, size: float) -> None:
    """Raise InputError before a mesh is made that would not fit; the estimate holds within a factor of two."""
    if edges > MOST_EDGES:
        raise InputError(
            f"about {edges:.1e} edges would be needed for elements of {size:.2g} m at the coils, and at most "
            f"{MOST_EDGES:.1e} fit: lower the resolution"
        )


def _fill(gmsh: Any, outer: float) -> tuple[Floats, Integers]:
    """Mesh all volumes, sizes growing from the surfaces: points (n, 3) and tetrahedra (e, 4)."""
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 1)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", outer)
    gmsh.option.setNumber("Mesh.Algorithm3D", 10)  # HXT: Delaunay's method takes minutes to embed a ribbon
    gmsh.model.mesh.generate(3)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    found = []
    for _, entity in gmsh.model.getEntities(3):
        kinds, _, nodes = gmsh.model.mesh.getElements(3, entity)
        if list(kinds) != [4]:
            raise MeshError(f"Gmsh left a part of the air without elements (entity {entity})")
        found.append(np.asarray(nodes[0], dtype=np.int64).reshape(-1, 4))
    cells = np.concatenate(found)
    if cells.max() > tags.max():  # what HXT leaves behind when its surfaces intersect
        raise MeshError(
            "the air could not be meshed: strips must not touch or cross, at this resolution's chords either"
        )
    used, numbered = np.unique(cells, return_inverse=True)
    row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    row[np.asarray(tags, dtype=np.int64)] = np.arange(tags.size)
    points = np.asarray(coordinates).reshape(-1, 3)[row[used]]
    return points, np.sort(numbered.reshape(cells.shape), axis=1)


def _report(mesh: AirMesh) -> AirMesh:
    log.info("mesh: %d tetrahedra, %d edges", mesh.tetrahedra.shape[0], mesh.edges.shape[0])
    return mesh
