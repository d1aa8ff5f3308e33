"""The closed surfaces of bodies as triangles, flat or curved: what an external mesh says about its bodies' shape."""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from magfem.errors import InputError
from magfem.typing import Booleans, Floats, Integers, Points

_SIDES = ((0, 1), (1, 2), (2, 0))
_SKIN = 1e-4  # of a facet's size, how far within it a body is probed
_STRAIGHT = 1e-9  # of a facet's size: mid-edge nodes nearer to the middle are in it
# Dunavant's rule of degree 4 on the unit triangle: exact for x·n dS of a curved facet.
_A, _B = 0.445948490915965, 0.091576213509771
_RULE = np.array([[_A, _A], [1 - 2 * _A, _A], [_A, 1 - 2 * _A], [_B, _B], [1 - 2 * _B, _B], [_B, 1 - 2 * _B]])
_WEIGHTS = np.array([0.223381589678011] * 3 + [0.109951743655322] * 3) / 2


@dataclass(frozen=True, eq=False)
class BodySurfaces:
    """Facets between bodies, or between a body and air; where bodies touch, they share facets.

    points: (n, 3) m.  facets: (f, 6) corners, then the mid-edge nodes 01, 12, 20; seen from `outer` the corners
    run counter-clockwise.  inner, outer: (f,) index into `names` of the body on either side, −1 for air.
    Equality compares every bit.
    """

    names: tuple[str, ...]
    points: Points
    facets: Integers
    inner: Integers
    outer: Integers

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BodySurfaces) and self.names == other.names and self._bytes == other._bytes

    def __hash__(self) -> int:
        return hash(self._bytes)

    @classmethod
    def flat(
        cls, names: tuple[str, ...], points: Points, corners: Integers, inner: Integers, outer: Integers
    ) -> BodySurfaces:
        """With straight edges, from the corners (f, 3) alone: mid-edge nodes are made."""
        edges = np.sort(corners[:, _SIDES].reshape(-1, 2), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middles = points[unique].mean(axis=1)
        facets = np.hstack([corners, len(points) + index.reshape(-1, 3)])
        return cls(names, np.vstack([points, middles]), facets, inner, outer)

    @cached_property
    def curved(self) -> Booleans:
        """(f,) Whether a facet has an edge that is not straight, its node in the middle."""
        corners = self.points[self.facets[:, :3]]
        off = self.points[self.facets[:, 3:]] - corners[:, _SIDES].mean(axis=2)
        size = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1)
        bent: Booleans = np.linalg.norm(off, axis=2).max(axis=1) > _STRAIGHT * size
        return bent

    def of_body(self, index: int) -> Integers:
        """The closed surface of one body: facets (k, 6), oriented outwards."""
        out, back = self.facets[self.inner == index], self.facets[self.outer == index]
        return np.concatenate([out, back[:, [0, 2, 1, 5, 4, 3]]])

    def volume(self, index: int) -> float:
        """m³, by the divergence theorem; exact."""
        nodes = self.points[self.of_body(index)]
        position, normal = _on_facets(nodes - nodes[:1, :1].copy())
        return float(np.einsum("q,fqi,fqi->", _WEIGHTS, position, normal) / 3)

    def area(self, index: int) -> float:
        """m², of the whole surface; exact for flat facets."""
        _, normal = _on_facets(self.points[self.of_body(index)])
        return float(np.einsum("q,fq->", _WEIGHTS, np.linalg.norm(normal, axis=2)))

    def check(self) -> None:
        """Raise InputError unless every body is closed, oriented, and encloses a volume."""
        for index, name in enumerate(self.names):
            corners = self.of_body(index)[:, :3]
            directed = corners[:, _SIDES].reshape(-1, 2)
            edges, first, count = np.unique(np.sort(directed, axis=1), axis=0, return_index=True, return_counts=True)
            for wrong, words in (
                (count == 1, "its surface is not closed: {n} edges have one facet only"),
                (count > 2, "its surface is not a single sheet: {n} edges have more than two facets"),
            ):
                if wrong.any():
                    place = self._place(edges[wrong][0])
                    raise InputError(f"body {name!r}: {words.format(n=int(wrong.sum()))}, one at {place}")
            if len(np.unique(directed, axis=0)) != len(directed):
                place = self._place(directed[first[0]])
                raise InputError(f"body {name!r}: its facets do not all face the same way, near {place}")
            volume, area = self.volume(index), self.area(index)
            if not volume > 1e-6 * area**1.5:
                raise InputError(f"body {name!r}: its surface encloses no volume (area {area:.3g} m²)")

    def check_apart(self) -> None:
        """Raise InputError where facets (their corners' triangles) cross, or touch without sharing corners."""
        corners = self.facets[:, :3]
        edges = np.unique(np.sort(corners[:, _SIDES].reshape(-1, 2), axis=1), axis=0)
        for edge, facet in _near(self.points, edges, corners):
            ends, triangle = edges[edge], corners[facet]
            strange = ~(ends[:, :, None] == triangle[:, None, :]).any(axis=(1, 2))
            edge, facet = edge[strange], facet[strange]
            hit = _pierced(self.points[edges[edge]], self.points[corners[facet]])
            if hit.any():
                there = edges[edge[hit][0]]
                of = np.isin(corners, there).sum(axis=1) == 2
                owners = {*self.inner[of], *self.outer[of], self.inner[facet[hit][0]], self.outer[facet[hit][0]]}
                bodies = " and ".join(repr(self.names[index]) for index in sorted(owners - {-1}))
                raise InputError(
                    f"facets of {bodies} cross, or touch without sharing their corners, near {self._place(there)}"
                )

    def check_cover(self) -> None:
        """Raise InputError unless just within every sheet of every body there is this body, once.

        Bodies within others do not cross them, nor do sheets that are inside out; only the count of bodies tells.
        """
        shells = [self.points[self.of_body(index)[:, :3]] for index in range(len(self.names))]
        for index, name in enumerate(self.names):
            triangles, sheet = shells[index], _sheets(self.of_body(index)[:, :3])
            normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
            size = np.linalg.norm(normal, axis=1)
            for one in range(int(sheet.max()) + 1):
                largest = int(np.argmax(np.where(sheet == one, size, -1.0)))
                middle = triangles[largest].mean(axis=0)
                probe = middle - normal[largest] * (_SKIN / np.sqrt(size[largest]))
                cover = [round(winding(probe, shell)) for shell in shells]
                if cover[index] == 1 and sum(map(abs, cover)) == 1:
                    continue
                place = "({:.4g}, {:.4g}, {:.4g}) m".format(*middle)
                others = [other for k, other in enumerate(self.names) if k != index and cover[k]]
                if others:
                    raise InputError(f"bodies {name!r} and {others[0]!r} overlap, near {place}")
                raise InputError(f"body {name!r}: it overlaps itself, or a sheet of it is inside out, near {place}")

    def _place(self, nodes: Integers) -> str:
        x, y, z = self.points[nodes].mean(axis=0)
        return f"({x:.4g}, {y:.4g}, {z:.4g}) m"

    @cached_property
    def _bytes(self) -> bytes:
        digest = sha256()
        for array in (self.points, self.facets, self.inner, self.outer):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.digest()

    def to_text(self) -> str:
        """Every bit as a text of printable characters; `from_text` is the inverse."""
        flat = not self.curved.any()
        nodes = self.facets[:, :3] if flat else self.facets
        used = int(nodes.max()) + 1 if flat else len(self.points)
        again = BodySurfaces.flat(self.names, self.points[:used], nodes, self.inner, self.outer) if flat else self
        if again != self:  # made otherwise than by `flat`: every node is kept
            nodes, used = self.facets, len(self.points)
        head = np.array([used, len(nodes), nodes.shape[1]], dtype="<i8")
        arrays = (nodes.astype("<i4"), self.inner.astype("<i4"), self.outer.astype("<i4"))
        data = head.tobytes() + self.points[:used].astype("<f8").tobytes() + b"".join(a.tobytes() for a in arrays)
        return base64.b64encode(zlib.compress(data, 9)).decode()

    @classmethod
    def from_text(cls, names: tuple[str, ...], text: str) -> BodySurfaces:
        """Raises InputError when the text is not what `to_text` wrote."""
        try:
            data = zlib.decompress(base64.b64decode(text, validate=True))
            used, count, width = (int(number) for number in np.frombuffer(data, "<i8", 3))
            points = np.frombuffer(data, "<f8", 3 * used, 24).reshape(-1, 3).astype(float)
            rest = np.frombuffer(data, "<i4", -1, 24 + 24 * used).astype(np.int64)
            nodes, inner, outer = np.split(rest, [count * width, count * (width + 1)])
            facets = nodes.reshape(count, width)
            whole = width in (3, 6) and inner.size == outer.size == count > 0
            whole = whole and facets.min() >= 0 and facets.max() < used and bool(np.isfinite(points).all())
            whole = whole and min(inner.min(), outer.min()) >= -1 and max(inner.max(), outer.max()) < len(names)
        except (ValueError, binascii.Error, zlib.error):
            whole = False
        if not whole:
            raise InputError("the stored surfaces are damaged")
        made = cls.flat if width == 3 else cls
        return made(names, points, facets, inner, outer)


def merged(points: Points, cells: Integers) -> tuple[Points, Integers]:
    """Points that coincide up to 1e-9 of the whole as one, and `cells` numbered accordingly; unused ones dropped."""
    used, numbered = np.unique(cells, return_inverse=True)
    points = points[used]
    size = float(np.ptp(points, axis=0).max()) or 1.0
    _, first, same = np.unique(np.round((points - points.min(axis=0)) / (1e-9 * size)), axis=0, return_index=True,
                               return_inverse=True)  # fmt: skip
    return points[first], same.ravel()[numbered.reshape(cells.shape)]


def winding(point: Floats, triangles: Floats) -> float:
    """How often a closed surface (f, 3, 3) winds around the point (3,): 1 within an outward one, 0 outside.

    The sum of solid angles (van Oosterom & Strackee 1983) over 4π.
    """
    a, b, c = (triangles[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    ab, bc, ca = (np.einsum("ei,ei->e", u, v) for u, v in ((a, b), (b, c), (c, a)))
    angle = 2 * np.arctan2(np.einsum("ei,ei->e", np.cross(a, b), c), la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angle.sum() / (4 * np.pi))


def _sheets(corners: Integers) -> Integers:
    """Number (f,) of the sheet that each facet of a closed surface belongs to, as edges join them."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.sort(corners[:, _SIDES].reshape(-1, 2), axis=1)
    _, same = np.unique(edges, axis=0, return_inverse=True)
    first, second = np.argsort(same.ravel(), kind="stable").reshape(-1, 2).T // 3  # every edge has two facets
    count = len(corners)
    graph = coo_array((np.ones(first.size), (first, second)), shape=(count, count))
    sheets: Integers = connected_components(graph, directed=False)[1]
    return sheets


def _near(points: Points, edges: Integers, corners: Integers) -> Iterator[tuple[Integers, Integers]]:
    """Pairs of edges and facets, as index arrays, whose balls meet; in batches, by size."""
    from scipy.spatial import cKDTree

    balls = []
    for nodes in (points[edges], points[corners]):
        centre = nodes.mean(axis=1)
        radius = np.linalg.norm(nodes - centre[:, None], axis=2).max(axis=1)
        size = np.ceil(np.log2(np.maximum(radius, 1e-300)))
        balls.append([(group, cKDTree(centre[group]), 2.0**s) for s in np.unique(size)
                      for group in [np.flatnonzero(size == s)]])  # fmt: skip
    for some, tree, reach in balls[0]:
        for others, other_tree, other_reach in balls[1]:
            pairs = tree.sparse_distance_matrix(other_tree, reach + other_reach, output_type="ndarray")
            yield some[pairs["i"]], others[pairs["j"]]


def _pierced(edges: Floats, triangles: Floats) -> Booleans:
    """Whether edges (n, 2, 3) meet triangles (n, 3, 3), their rims included (Möller and Trumbore 1997)."""
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    origin, first, second = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(first, second)
    slope = -np.einsum("ni,ni->n", along, normal)
    steep = np.abs(slope) > 1e-9 * np.linalg.norm(along, axis=1) * np.linalg.norm(normal, axis=1)
    slope = np.where(steep, slope, 1.0)
    off = start - origin
    turned = np.cross(off, along)
    t = np.einsum("ni,ni->n", off, normal) / slope
    u = np.einsum("ni,ni->n", second, turned) / slope
    v = -np.einsum("ni,ni->n", first, turned) / slope
    low = -1e-7
    meets: Booleans = steep & (t > low) & (t < 1 - low) & (u > low) & (v > low) & (u + v < 1 - low)
    return meets


def _on_facets(nodes: Floats) -> tuple[Floats, Floats]:
    """Positions and normals x_u × x_v (f, q, 3) of facets (f, 6, 3) at the points of the rule."""
    u, v = _RULE.T
    w, zero = 1 - u - v, np.zeros_like(u)
    shape = np.stack([w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w])
    du = np.stack([1 - 4 * w, 4 * u - 1, zero, 4 * (w - u), 4 * v, -4 * v])
    dv = np.stack([1 - 4 * w, zero, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)])
    position, x_u, x_v = (np.einsum("aq,fai->fqi", s, nodes, optimize=True) for s in (shape, du, dv))
    return position, np.cross(x_u, x_v)
