"""Networks of tubes in the horizontal plane: nodes, straight edges, and the ways through them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.typing import Floats, Points, Vectors

_STEP = 0.25e-3  # m between the points of a way
_ARC = 16  # points of a rounded corner


@dataclass(frozen=True, eq=False)
class Network:
    """A tree of tubes, entered at `entry`.

    nodes: (2,) m in the plane, by name.  edges: pairs of names.  inner_diameter: m.  corner: m, the radius that centre
    lines are rounded with.  Raises InputError for edges between unknown nodes, and what is no tree.
    """

    nodes: Mapping[str, Floats]
    edges: tuple[tuple[str, str], ...]
    entry: str
    inner_diameter: float
    corner: float

    def __post_init__(self) -> None:
        for one in (self.entry, *(name for edge in self.edges for name in edge)):
            if one not in self.nodes:
                raise InputError(f"network: there is no node {one!r}; known are {', '.join(self.nodes)}")
        reached = {self.entry}
        for _ in self.edges:
            for a, b in self.edges:
                if (a in reached) != (b in reached):
                    reached |= {a, b}
        if len(self.edges) != len(self.nodes) - 1 or reached != set(self.nodes):
            raise InputError("network: the edges must join all nodes, without loops")

    def children(self, node: str) -> list[str]:
        """The nodes next to `node` that lead away from the entry."""
        parent = self.names_to(node)[-2:-1]
        near = [b if a == node else a for a, b in self.edges if node in (a, b)]
        return [one for one in near if one not in parent]

    def names_to(self, node: str) -> list[str]:
        """The nodes from the entry to `node`, both included."""
        if node not in self.nodes:
            raise InputError(f"network: there is no node {node!r}; known are {', '.join(self.nodes)}")
        before: dict[str, str] = {}
        reached = [self.entry]
        for one in reached:
            for a, b in self.edges:
                for here, there in ((a, b), (b, a)):
                    if here == one and there != self.entry and there not in before:
                        before[there] = here
                        reached.append(there)
        found = [node]
        while found[0] != self.entry:
            found.insert(0, before[found[0]])
        return found

    def way(self, node: str) -> Way:
        """The way from the entry to `node`."""
        names = self.names_to(node)
        corners = np.array([self.nodes[name] for name in names])
        line = _rounded(corners, self.corner)
        lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
        s = np.concatenate([[0.0], np.cumsum(lengths)])
        even = np.linspace(0.0, s[-1], max(2, round(s[-1] / _STEP) + 1))
        points = np.stack([np.interp(even, s, line[:, k]) for k in range(2)] + [np.zeros(even.size)], axis=1)
        near = [int(np.argmin(np.linalg.norm(points[:, :2] - corner, axis=1))) for corner in corners]
        return Way(tuple(names), points, even, even[near])


@dataclass(frozen=True, eq=False)
class Way:
    """A centre line from the entry: names of its nodes, points (n, 3) m at arc lengths (n,) m, the nodes' (k,) m."""

    names: tuple[str, ...]
    points: Points
    arc_lengths: Floats
    at_nodes: Floats

    @property
    def length(self) -> float:
        """m."""
        return float(self.arc_lengths[-1])

    def place(self, s: float) -> Points:
        """(3,) m at arc length `s`."""
        return np.array([np.interp(s, self.arc_lengths, self.points[:, k]) for k in range(3)])

    def tangent(self, s: float) -> Vectors:
        """(3,) unit vector, away from the entry."""
        here = float(np.clip(s, 0.0, self.length))
        ahead, behind = self.place(min(here + 1e-3, self.length)), self.place(max(here - 1e-3, 0.0))
        return np.asarray((ahead - behind) / np.linalg.norm(ahead - behind))

    def nearest(self, place: Points) -> tuple[float, float]:
        """Arc length and distance (m) of the point of the line nearest to `place` (3,), in the plane."""
        apart = np.linalg.norm(self.points[:, :2] - place[:2], axis=1)
        k = int(np.argmin(apart))
        return float(self.arc_lengths[k]), float(apart[k])


def _rounded(corners: Floats, radius: float) -> Floats:
    """A polyline (k, 2) with arcs of `radius` for its inner corners, smaller where edges are short."""
    if len(corners) < 3 or radius <= 0:
        return corners
    found: list[Floats] = [corners[:1]]
    for before, here, after in zip(corners, corners[1:], corners[2:], strict=False):
        u, v = before - here, after - here
        a, b = float(np.linalg.norm(u)), float(np.linalg.norm(v))
        u, v = u / a, v / b
        half = 0.5 * np.arccos(np.clip(u @ v, -1.0, 1.0))
        cut = min(radius / np.tan(half), 0.45 * a, 0.45 * b) if half < np.pi / 2 - 1e-6 else 0.0
        if cut <= 0:
            found.append(here[None])
            continue
        middle = here + (u + v) / np.linalg.norm(u + v) * cut / np.cos(half)
        start, end = here + cut * u - middle, here + cut * v - middle
        turn = np.arctan2(start[0] * end[1] - start[1] * end[0], start @ end) * np.linspace(0, 1, _ARC)[:, None]
        found.append(middle + np.cos(turn) * start + np.sin(turn) * np.array([-start[1], start[0]]))
    return np.concatenate([*found, corners[-1:]])


def angle_to(here: Vectors, towards: Vectors) -> float:
    """rad to the left of `here`, both (3,)."""
    return float(np.arctan2(here[0] * towards[1] - here[1] * towards[0], here[:2] @ towards[:2]))


def side_of(here: Vectors, wanted: Vectors, others: Sequence[Vectors]) -> float:
    """+1 where the branch towards `wanted` (3,) leaves to the left of all `others`, seen along `here`, −1 to the right.

    Raises InputError for a branch between others: a tip bends to one side.
    """
    apart = [angle_to(here, wanted) - angle_to(here, one) for one in others]
    if all(one > 0 for one in apart):
        return 1.0
    if all(one < 0 for one in apart):
        return -1.0
    raise InputError("network: a wanted branch must be the leftmost or the rightmost of its junction")
