"""The surface of a device as triangles, straight from its geometry: for pictures, nothing is solved on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.geometry import Magnets, MeshedMagnets
from magfem.mesh.session import gmsh_session
from magfem.typing import Floats, Integers, Points

AROUND = 96
"""Triangles' edges along a full circle."""


@dataclass(frozen=True)
class Surface:
    """The closed surface of one body. points: (n, 3) m.  triangles: (t, 3)."""

    name: str
    points: Points
    triangles: Integers

    def section(self, origin: Floats, normal: Floats) -> Points:
        """Where a plane cuts the surface: segments (s, 2, 3) m."""
        # A hair beside the plane no corner lies on it, and every cut triangle gives exactly one segment.
        size = float(np.abs(self.points).max())
        height = (self.points - origin) @ normal - 1e-7 * size
        above = height[self.triangles] > 0
        cut = above.any(axis=1) & ~above.all(axis=1)
        triangles, above = self.triangles[cut], above[cut]
        lonely = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
        rows = np.arange(triangles.shape[0])
        tip = triangles[rows, lonely]
        ends = []
        for step in (1, 2):
            other = triangles[rows, (lonely + step) % 3]
            share = height[tip] / (height[tip] - height[other])
            ends.append(self.points[tip] + share[:, None] * (self.points[other] - self.points[tip]))
        return np.stack(ends, axis=1)


def surfaces(geometry: Magnets) -> tuple[Surface, ...]:
    """One surface for every body of the device."""
    if isinstance(geometry, MeshedMagnets):
        return _facets(geometry)
    found = []
    with gmsh_session() as gmsh:
        bodies = geometry.build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", AROUND)
        gmsh.option.setNumber("Mesh.MeshSizeMax", geometry.hull.radius)
        gmsh.model.mesh.generate(2)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        index[np.asarray(tags, dtype=np.int64)] = np.arange(tags.size)
        points = np.asarray(coordinates, dtype=float).reshape(-1, 3)
        for name, volumes in bodies.items():
            faces = gmsh.model.getBoundary([(3, tag) for tag in volumes], oriented=False)
            nodes = [gmsh.model.mesh.getElementsByType(2, tag)[1] for _, tag in faces]
            triangles = index[np.concatenate(nodes).astype(np.int64)].reshape(-1, 3)
            found.append(_surface(name, points, triangles))
    return tuple(found)


def _facets(geometry: MeshedMagnets) -> tuple[Surface, ...]:
    """An external mesh: its facets by their corners."""
    shared = geometry.surfaces
    return tuple(_surface(name, shared.points, shared.of_body(index)[:, :3]) for index, name in enumerate(shared.names))


def _surface(name: str, points: Points, triangles: Integers) -> Surface:
    """A surface with only the points that its triangles use."""
    used, numbered = np.unique(triangles, return_inverse=True)
    return Surface(name, points[used], numbered.reshape(triangles.shape))
