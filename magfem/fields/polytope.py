"""Distances to convex polytopes, compiled."""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel
from magfem.typing import Floats, Integers


@kernel
def foremost(directions: Floats, corners: Floats, out: Integers) -> None:
    """The corner that lies farthest along each direction (n, 3)."""
    for n in range(directions.shape[0]):
        best = -np.inf
        for c in range(corners.shape[0]):
            along = 0.0
            for i in range(3):
                along += directions[n, i] * corners[c, i]
            if along > best:
                best = along
                out[n] = c


@kernel
def distances(points: Floats, corners: Floats, triangles: Integers, normals: Floats, out: Floats) -> None:
    """Distance (n,) of each point to the polytope.

    The nearest point lies on a facet that the point is in front of, and no facet is nearer than its plane.
    Coplanar triangles may differ on which side a point of their plane is: what is hardly behind counts too.
    """
    size = 0.0
    for c in range(corners.shape[0]):
        for i in range(3):
            size = max(size, abs(corners[c, i] - corners[0, i]))
    for n in range(points.shape[0]):
        nearest = np.inf
        outside = False
        hardly = size
        for i in range(3):
            hardly = max(hardly, abs(points[n, i] - corners[0, i]))
        hardly *= -1e-12
        for t in range(triangles.shape[0]):
            height = 0.0
            for i in range(3):
                height += normals[t, i] * (points[n, i] - corners[triangles[t, 0], i])
            if not height <= hardly:
                if not height <= 0.0:
                    outside = True
                if not height >= nearest:
                    gap = _to_triangle(points[n], height, corners, triangles[t], normals[t])
                    if not gap >= nearest:
                        nearest = gap
        out[n] = nearest if outside else 0.0


@kernel
def _to_triangle(point: Floats, height: float, corners: Floats, triangle: Integers, normal: Floats) -> float:
    """Distance of a point to a triangle: to its plane where the foot lies within, else to the nearest edge."""
    nearest = np.inf
    within = True
    nx, ny, nz = normal
    for i in range(3):
        start, end = corners[triangle[i]], corners[triangle[(i + 1) % 3]]
        ex, ey, ez = end[0] - start[0], end[1] - start[1], end[2] - start[2]
        px, py, pz = point[0] - start[0], point[1] - start[1], point[2] - start[2]
        # The edge's inward normal in the plane is n × e.
        if px * (ny * ez - nz * ey) + py * (nz * ex - nx * ez) + pz * (nx * ey - ny * ex) < 0.0:
            within = False
        along = (px * ex + py * ey + pz * ez) / (ex * ex + ey * ey + ez * ez)
        along = min(max(along, 0.0), 1.0)
        px, py, pz = px - along * ex, py - along * ey, pz - along * ez
        gap = np.sqrt(px * px + py * py + pz * pz)
        if not gap >= nearest:
            nearest = gap
    return abs(height) if within else nearest
