"""Second-order shape functions on reference triangles and tetrahedra, and quadrature rules there.

Node order: corners, then the mid-edge nodes 01, 12, 02 of a triangle, 01, 12, 02, 03, 13, 23 of a tetrahedron.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from magfem.typing import Floats


def triangle_shapes(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Six quadratic shape functions (q, 6) on the unit triangle at (q, 2), and their two derivatives."""
    u, v = points[:, 0], points[:, 1]
    w = 1 - u - v
    zero = np.zeros_like(u)
    values = np.stack([w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w], axis=1)
    du = np.stack([1 - 4 * w, 4 * u - 1, zero, 4 * (w - u), 4 * v, -4 * v], axis=1)
    dv = np.stack([1 - 4 * w, zero, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)], axis=1)
    return values, du, dv


@cache
def triangle_rule(order: int) -> tuple[Floats, Floats]:
    """Quadrature points (q, 2) and weights (q,) on the unit triangle, exact to degree `order`."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefTri

    points, weights = get_quadrature(RefTri, order)
    return np.ascontiguousarray(points.T), np.ascontiguousarray(weights)


@cache
def tetrahedron_rule(order: int) -> tuple[Floats, Floats]:
    """Quadrature points (q, 3) and weights (q,) on the unit tetrahedron, exact to degree `order`."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefTet

    points, weights = get_quadrature(RefTet, order)
    return np.ascontiguousarray(points.T), np.ascontiguousarray(weights)


def shape_gradients(points: Floats) -> Floats:
    """Gradients (q, 10, 3) of the ten quadratic shape functions at reference points (q, 3)."""
    first = 1.0 - points.sum(axis=1)
    barycentric = np.column_stack([first, points])
    slope = np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    gradients = np.empty((points.shape[0], 10, 3))
    gradients[:, :4] = (4.0 * barycentric[:, :, None] - 1.0) * slope
    for n, (i, j) in enumerate(((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))):
        gradients[:, 4 + n] = 4.0 * (barycentric[:, i, None] * slope[j] + barycentric[:, j, None] * slope[i])
    return gradients
