"""How well shaped a mesh's elements are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.mesh.mesh import Mesh
from magfem.typing import Floats


@dataclass(frozen=True)
class Quality:
    """Smallest and mean shape measure: 1 for equilateral elements, 0 for flat ones."""

    least: float
    mean: float


def quality(mesh: Mesh) -> Quality:
    """Shape of the mesh's elements, judged by their corners."""
    shapes = shape_measures(mesh)
    return Quality(float(shapes.min()), float(shapes.mean()))


def shape_measures(mesh: Mesh) -> Floats:
    """Mean ratio (e,) of every element: d·(det J)^(2/d) / ‖J‖², J its map from the equilateral one, d the dimension.

    The inverse of the condition of J in the Frobenius norm up to its determinant; 0 when turned inside out.
    Source: Liu and Joe, BIT 34, 268 (1994).
    """
    d = mesh.dimension
    corners = mesh.points[mesh.cells[:, : d + 1]]
    edges = corners[:, 1:] - corners[:, :1]  # rows
    regular = np.linalg.inv(_equilateral(d))
    J = regular @ edges
    volume = np.maximum(np.linalg.det(J), 0.0)
    measures: Floats = d * volume ** (2 / d) / np.sum(J**2, axis=(1, 2))
    return measures


def _equilateral(d: int) -> Floats:
    """Edges from one corner of the equilateral triangle or tetrahedron, as rows (d, d), positively oriented."""
    if d == 2:
        return np.array([[1.0, 0.0], [0.5, np.sqrt(3) / 2]])
    return np.array([[1.0, 0.0, 0.0], [0.5, np.sqrt(3) / 2, 0.0], [0.5, np.sqrt(3) / 6, np.sqrt(2 / 3)]])
