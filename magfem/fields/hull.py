"""Convex hulls of bodies: the distance that cards and regions speak of, and points at a given distance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from magfem.errors import InputError
from magfem.typing import Booleans, Floats, Integers, Points

SMOOTH = np.radians(20)  # facets that meet at a smaller exterior angle count as one side, such as a sampled arc


class Hull(Protocol):
    """A convex body about the origin of its source frame."""

    @property
    def radius(self) -> float:
        """Radius of the smallest ball about the origin that holds the body, m."""
        ...

    def distance(self, points: Points) -> Floats:
        """Distance (...) m of `points` (..., 3) m to the body; zero inside."""
        ...

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        """Random points at given hull distances, uniform over each offset surface.

        `distance` (n,) m gives n surfaces; the result is (n, count, 3) m.
        """
        ...

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        """Points (n, count, 3) m at given hull distances that reach every part of each offset surface.

        Walls, faces and rims get equal shares whatever their area, axes and edges among them: fields are
        extreme there, and uniform points hardly ever meet them.
        """
        ...

    def describe(self) -> str:
        """The body in words, sizes in mm, for listings."""
        ...


@dataclass(frozen=True)
class CylinderHull:
    """A solid cylinder about the z axis: the hull of rings, cylinders, discs, solenoids."""

    diameter: float  # m
    length: float  # m

    @property
    def radius(self) -> float:
        return float(np.hypot(self.diameter, self.length) / 2)

    def distance(self, points: Points) -> Floats:
        if points.ndim == 1:  # one point, ten times faster without arrays
            x, y, z = points.tolist()
            beside = max(math.hypot(x, y) - self.diameter / 2, 0.0)
            return np.asarray(math.hypot(beside, max(abs(z) - self.length / 2, 0.0)))
        radial = np.hypot(points[..., 0], points[..., 1]) - self.diameter / 2
        axial = np.abs(points[..., 2]) - self.length / 2
        outside: Floats = np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0))
        return outside

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None]
        shape = (d.shape[0], count)
        # The offset surface is the wall, two faces and, along the rims, two quarters of a torus.
        radius = self.diameter / 2
        wall = 2 * np.pi * (radius + d) * self.length
        faces = 2 * np.pi * radius**2 * np.ones_like(d)
        rims = 4 * np.pi * (radius * np.pi / 2 * d + d**2)
        pick = rng.random(shape) * (wall + faces + rims)
        u = rng.random(shape)
        part = np.where(pick < wall, 0, np.where(pick < wall + faces, 1, 2))
        return self._on_part(d, part, np.where(part == 1, np.sqrt(u), u), _torus_angle(u, radius, d), rng)

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None]
        shape = (d.shape[0], count)
        part = np.broadcast_to(np.arange(count) % 3, shape)
        u = rng.random(shape)
        # The first six go to the equator, the axis and four edges, near enough; no two draws meet exactly.
        ends = np.array([0.5, 0.0, 0.0, 1.0, 1.0, 1.0])[:count]
        u[:, :6] = np.abs(ends - 1e-4 * u[:, :6])
        return self._on_part(d, part, u, u * (np.pi / 2), rng)

    def describe(self) -> str:
        return f"cylinder, diameter {_mm(self.diameter)} mm, length {_mm(self.length)} mm"

    def _on_part(self, d: Floats, part: Integers, u: Floats, polar: Floats, rng: np.random.Generator) -> Points:
        """Points (n, c, 3) on wall (0), face (1), rim (2): `u` in [0, 1] along the first two, `polar` along a rim."""
        radius, half = self.diameter / 2, self.length / 2
        side = np.where(rng.random(u.shape) < 0.5, -1.0, 1.0)
        rho = np.choose(part, [radius + d + 0 * u, radius * u, radius + d * np.sin(polar)])
        z = np.choose(part, [self.length * (u - 0.5), side * (half + d), side * (half + d * np.cos(polar))])
        azimuth = rng.uniform(0, 2 * np.pi, u.shape)
        return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=-1)


def _torus_angle(u: Floats, radius: float, tube: Floats) -> Floats:
    """Polar angle in [0, π/2] whose density is proportional to radius + tube·sin: area-uniform on the rim."""
    target = u * (radius * np.pi / 2 + tube)
    angle = u * (np.pi / 2)
    for _ in range(6):  # Newton on a smooth monotone function: six steps reach rounding
        value = radius * angle + tube * (1 - np.cos(angle))
        angle = angle - (value - target) / (radius + tube * np.sin(angle))
    return np.clip(angle, 0.0, np.pi / 2)


@dataclass(frozen=True)
class BoxHull:
    """A rectangular block about the origin, edges along the axes."""

    size: tuple[float, float, float]  # m, along x, y, z

    def __post_init__(self) -> None:
        x, y, z = (float(length) for length in self.size)
        object.__setattr__(self, "size", (x, y, z))

    @property
    def radius(self) -> float:
        return math.hypot(*self.size) / 2

    def distance(self, points: Points) -> Floats:
        excess = np.maximum(np.abs(points) - np.array(self.size) / 2, 0.0)
        outside: Floats = np.hypot(np.hypot(excess[..., 0], excess[..., 1]), excess[..., 2])
        return outside

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        return self._corners.offset_points(distance, count, rng)

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        return self._corners.marked_points(distance, count, rng)

    def describe(self) -> str:
        return f"box, {' × '.join(_mm(length) for length in self.size)} mm"

    @cached_property
    def _corners(self) -> PolytopeHull:
        x, y, z = (length / 2 for length in self.size)
        return PolytopeHull(tuple(product((-x, x), (-y, y), (-z, z))))


@dataclass(frozen=True)
class SphereHull:
    """A ball about the origin."""

    diameter: float  # m

    @property
    def radius(self) -> float:
        return self.diameter / 2

    def distance(self, points: Points) -> Floats:
        length = np.hypot(np.hypot(points[..., 0], points[..., 1]), points[..., 2])
        outside: Floats = np.maximum(length - self.radius, 0.0)
        return outside

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None, None]
        return (self.radius + d) * _directions((d.shape[0], count), rng)

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None, None]
        directions = _directions((d.shape[0], count), rng)
        # The first six go to the axes, near enough; no two draws meet exactly.
        axes = np.concatenate([np.eye(3), -np.eye(3)])[[2, 0, 5, 1, 3, 4]][:count]
        directions[:, :6] = axes + 1e-4 * directions[:, :6]
        points: Points = (self.radius + d) * directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        return points

    def describe(self) -> str:
        return f"sphere, diameter {_mm(self.diameter)} mm"


@dataclass(frozen=True)
class PolytopeHull:
    """The convex hull of given points, which need not lie around the origin.

    Points that are no corners of the hull are dropped. A sampled curve is cut by its chords: what it bounds
    sticks out of the hull by radius · (1 − cos(half the step)) unless its points are taken farther out.
    Raises InputError for fewer than four points, points in one plane, or coordinates that are not finite.
    """

    vertices: tuple[tuple[float, float, float], ...]  # m

    def __post_init__(self) -> None:
        try:
            points = np.array(self.vertices, dtype=float)
        except (TypeError, ValueError):
            points = np.empty(0)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise InputError("a polytope hull needs points of three finite coordinates")
        corners = points[np.sort(_convex(points).vertices)]
        while corners.shape != points.shape:  # until nothing more falls away: a copy must be equal to its original
            points, corners = corners, corners[np.sort(_convex(corners).vertices)]
        object.__setattr__(self, "vertices", tuple((x, y, z) for x, y, z in corners.tolist()))

    @property
    def radius(self) -> float:
        return float(np.linalg.norm(self.vertices, axis=1).max())

    def distance(self, points: Points) -> Floats:
        from magfem.fields.polytope import distances  # compiled code, which cards alone do not need

        array = np.asarray(points, dtype=float)
        found = np.empty(array.size // 3)
        surface = self._surface
        distances(array.reshape(-1, 3), surface.corners, surface.triangles, surface.normals, found)
        return found.reshape(array.shape[:-1])

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        surface, d = self._surface, np.asarray(distance, dtype=float)[:, None]
        shape = (d.shape[0], count)
        # The offset surface is the facets, along each edge a part of a cylinder, and about the corners parts of
        # a sphere that make a whole one (Steiner).
        edges = d * (surface.lengths @ surface.angles)
        pick = rng.random(shape) * (surface.areas.sum() + edges + 4 * np.pi * d**2)
        part = np.where(pick < surface.areas.sum(), 0, np.where(pick < surface.areas.sum() + edges, 1, 2))
        points = np.empty((*shape, 3))
        everywhere = np.broadcast_to(d, shape)
        for index, sample in enumerate((surface.on_facets, surface.on_edges, surface.on_corners)):
            chosen = part == index
            points[chosen] = sample(everywhere[chosen], rng)
        return points

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None]
        surface, points = self._surface, np.empty((d.shape[0], count, 3))
        # Sides, edges and corners in turn; each side gets as many as another, however small.
        points[:, 0::3] = surface.on_sides(d, (count + 2) // 3, rng)
        points[:, 1::3] = surface.on_sharp_edges(d, (count + 1) // 3, rng)
        for column in range(2, count, 3):
            points[:, column] = surface.on_corners(d[:, 0], rng)
        return points

    def describe(self) -> str:
        low, high = np.min(self.vertices, axis=0), np.max(self.vertices, axis=0)
        return f"convex hull of {len(self.vertices)} points, {' × '.join(_mm(q) for q in high - low)} mm"

    @cached_property
    def _surface(self) -> _Surface:
        return _Surface.of(np.array(self.vertices))


class _Surface(NamedTuple):
    """The boundary of a polytope as triangles (t), the edges (e) between them, and smooth sides (s) of them."""

    corners: Floats  # (c, 3) m
    triangles: Integers  # (t, 3) corners of each, right-handed about the outward normal
    normals: Floats  # (t, 3)
    areas: Floats  # (t,) m²
    side: Integers  # (t,) the side that each triangle belongs to
    ends: Integers  # (e, 2) corners
    beside: Integers  # (e, 2) triangles
    lengths: Floats  # (e,) m
    angles: Floats  # (e,) rad, exterior

    @classmethod
    def of(cls, corners: Floats) -> _Surface:
        hull = _convex(corners)
        triangles, normals = hull.simplices.astype(np.int64), hull.equations[:, :3]
        a, b, c = (corners[triangles[:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        turned = np.sum(cross * normals, axis=1) < 0
        triangles[turned] = triangles[turned][:, ::-1]
        neighbours = hull.neighbors.astype(np.int64)
        # Edge i of a triangle lies across from its corner i, and towards its neighbour i.
        first = np.repeat(np.arange(len(triangles)), 3)
        ends = np.stack([hull.simplices[:, [1, 2, 0]].ravel(), hull.simplices[:, [2, 0, 1]].ravel()], axis=1)
        beside = np.stack([first, neighbours.ravel()], axis=1)
        once = beside[:, 0] < beside[:, 1]
        ends, beside = ends[once].astype(np.int64), beside[once]
        one, other = normals[beside[:, 0]], normals[beside[:, 1]]
        angles = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.sum(one * other, axis=1))
        smooth = beside[angles < SMOOTH]
        links = coo_array((np.ones(len(smooth)), (smooth[:, 0], smooth[:, 1])), shape=(len(triangles),) * 2)
        return cls(
            corners,
            triangles,
            normals,
            np.linalg.norm(cross, axis=1) / 2,
            connected_components(links, directed=False)[1].astype(np.int64),
            ends,
            beside,
            np.linalg.norm(corners[ends[:, 0]] - corners[ends[:, 1]], axis=1),
            angles,
        )

    def on_facets(self, distance: Floats, rng: np.random.Generator) -> Points:
        """Points (n, 3) uniform over the facets, moved out by `distance` (n,)."""
        triangle = _draw(self.areas, rng.random(distance.shape))
        return self._over_triangles(distance, triangle, _barycentric(distance.shape, rng))

    def on_edges(self, distance: Floats, rng: np.random.Generator) -> Points:
        """Points (n, 3) uniform over the cylinders about the edges, of radius `distance` (n,)."""
        edge = _draw(self.lengths * self.angles, rng.random(distance.shape))
        return self._about_edges(distance, edge, rng.random(distance.shape), rng.random(distance.shape))

    def on_corners(self, distance: Floats, rng: np.random.Generator) -> Points:
        """Points (n, 3) uniform over the spheres about the corners: each direction belongs to one of them."""
        directions = _directions(distance.shape, rng)
        from magfem.fields.polytope import foremost

        corner = np.empty(distance.size, dtype=np.int64)
        foremost(directions, self.corners, corner)
        return self.corners[corner] + distance[:, None] * directions

    def on_sides(self, d: Floats, count: int, rng: np.random.Generator) -> Points:
        """Points (n, count, 3): the sides in turn, from a random one; the first point by the middle of its facet."""
        shape = (d.shape[0], count)
        sides = self.side.max() + 1
        turn = (rng.integers(sides, size=(shape[0], 1)) + np.arange(count)) % sides
        triangle = np.empty(shape, dtype=np.int64)
        for side in range(sides):
            chosen = turn == side
            triangle[chosen] = _draw(np.where(self.side == side, self.areas, 0.0), rng.random(chosen.sum()))
        weights = _barycentric(shape, rng)
        # One point at a middle and one at an edge, near enough; no two draws meet exactly.
        weights[:, :1] = (1 - 1e-4) / 3 + 1e-4 * weights[:, :1]
        weights[:, 1:2, 0] *= 1e-4
        return self._over_triangles(np.broadcast_to(d, shape), triangle, weights / weights.sum(axis=-1, keepdims=True))

    def on_sharp_edges(self, d: Floats, count: int, rng: np.random.Generator) -> Points:
        """Points (n, count, 3) about the edges between sides, by their length; the first two at ends of the turn."""
        shape = (d.shape[0], count)
        sharp: Booleans = self.angles >= SMOOTH
        weight = self.lengths * (sharp if sharp.any() else self.angles)
        edge = _draw(weight, rng.random(shape))
        turn = rng.random(shape)
        turn[:, :1] *= 1e-4
        turn[:, 1:2] = 0.5 + 1e-4 * turn[:, 1:2]
        return self._about_edges(np.broadcast_to(d, shape), edge, rng.random(shape), turn)

    def _over_triangles(self, distance: Floats, triangle: Integers, weights: Floats) -> Points:
        points = np.einsum("...i,...ij->...j", weights, self.corners[self.triangles[triangle]])
        found: Points = points + distance[..., None] * self.normals[triangle]
        return found

    def _about_edges(self, distance: Floats, edge: Integers, along: Floats, turn: Floats) -> Points:
        """`along` from one end to the other and `turn` from one facet's normal to the other's, both in [0, 1]."""
        start, end = np.moveaxis(self.corners[self.ends[edge]], -2, 0)
        one, other = np.moveaxis(self.normals[self.beside[edge]], -2, 0)
        angle = self.angles[edge] * turn
        across = other - np.sum(one * other, axis=-1, keepdims=True) * one
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-300)
        normal = np.cos(angle)[..., None] * one + np.sin(angle)[..., None] * across
        found: Points = start + along[..., None] * (end - start) + distance[..., None] * normal
        return found


def _convex(points: Points) -> Any:
    """SciPy's hull of the points, found at unit size about the origin: its tolerances grow with both."""
    try:
        middle = points.mean(axis=0) if len(points) else 0.0
        size = np.abs(points - middle).max() if len(points) else 0.0
        return ConvexHull((points - middle) / (size or 1.0))
    except (QhullError, ValueError):
        raise InputError("a polytope hull needs four points or more that do not lie in one plane") from None


def _mm(length: float) -> str:
    return f"{length * 1e3:.4g}"


def _directions(shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Random unit vectors (..., 3), uniform over the sphere."""
    vectors = rng.normal(size=(*shape, 3))
    unit: Floats = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit


def _barycentric(shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Random barycentric weights (..., 3), uniform over a triangle."""
    root, second = np.sqrt(rng.random(shape)), rng.random(shape)
    return np.stack([1 - root, root * (1 - second), root * second], axis=-1)


def _draw(weights: Floats, u: Floats) -> Integers:
    """Indices with chances proportional to `weights`, from uniform numbers `u` in [0, 1)."""
    cumulated = np.cumsum(weights)
    index: Integers = np.searchsorted(cumulated, u * cumulated[-1], side="right")
    return np.minimum(index, int(np.flatnonzero(weights)[-1]))


def hull_to_dict(hull: Hull) -> dict[str, Any]:
    """The hull as JSON-ready data (SI units)."""
    if isinstance(hull, CylinderHull):
        return {"kind": "cylinder", "diameter": hull.diameter, "length": hull.length}
    if isinstance(hull, BoxHull):
        return {"kind": "box", "size": list(hull.size)}
    if isinstance(hull, SphereHull):
        return {"kind": "sphere", "diameter": hull.diameter}
    if isinstance(hull, PolytopeHull):
        return {"kind": "polytope", "vertices": [list(vertex) for vertex in hull.vertices]}
    raise InputError(f"hull of type {type(hull).__name__} cannot be written to a model file")


def hull_from_dict(data: dict[str, Any]) -> Hull:
    """Inverse of `hull_to_dict`."""
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in _KEYS:
        raise InputError(f"unknown hull kind {kind!r}; known: {', '.join(_KEYS)}")
    keys = _KEYS[kind]
    if set(data) != {"kind", *keys}:
        raise InputError(f"a {kind} hull needs {' and '.join(keys)}, and nothing else")
    if kind == "polytope":
        return PolytopeHull(data["vertices"])
    if kind == "box":
        size = data["size"]
        if not isinstance(size, (list, tuple)) or len(size) != 3:
            raise InputError("a box hull needs a size of three lengths")
        return BoxHull((_size(size[0]), _size(size[1]), _size(size[2])))
    if kind == "sphere":
        return SphereHull(_size(data["diameter"]))
    return CylinderHull(_size(data["diameter"]), _size(data["length"]))


_KEYS = {"cylinder": ("diameter", "length"), "box": ("size",), "sphere": ("diameter",), "polytope": ("vertices",)}


def _size(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise InputError("a hull needs finite sizes above 0")
    return float(value)
