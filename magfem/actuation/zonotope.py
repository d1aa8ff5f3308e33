"""What bounded currents can make of a vector: the zonotope {Σ I_k v_k, |I_k| ≤ 1}, in closed form.

Its facets have the normals v_i × v_j, and its support in the direction n, the largest n·v, is Σ |n·v_k|. From these
follow exactly the largest ball inside, the reach in a direction, and the farthest vertex; no search takes part.
Source: McMullen, Trans. Am. Math. Soc. 159, 91 (1971).
"""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats, Vectors

_FLAT = 1e-12  # of the sizes: normals shorter than this are those of parallel vectors
_LEVEL = 1e-9  # of a length: components below this are none


def facet_normals(generators: Floats) -> tuple[Floats, Floats]:
    """Unit normals (..., p, 3) of all pairs of generators (..., 3, c), and the support (..., p) of each.

    Where a pair is parallel its normal is zero and its support infinite.
    """
    c = generators.shape[-1]
    first, second = np.triu_indices(c, 1)
    columns = np.swapaxes(generators, -1, -2)
    normals = np.cross(columns[..., first, :], columns[..., second, :])
    length = np.linalg.norm(normals, axis=-1)
    size = np.linalg.norm(columns, axis=-1).max(axis=-1, initial=0.0)[..., None]
    flat = length <= _FLAT * size**2
    unit = np.where(flat[..., None], 0.0, normals / np.where(flat, 1.0, length)[..., None])
    support = np.abs(unit @ generators).sum(axis=-1)
    return unit, np.where(flat, np.inf, support)


def reach_in_every_direction(generators: Floats) -> Floats:
    """The largest radius (...) such that every vector up to it can be made; zero when all lie in a plane."""
    _, support = facet_normals(generators)
    least = support.min(axis=-1, initial=np.inf)
    return np.where(np.isfinite(least), least, 0.0)


def reach_along(generators: Floats, direction: Vectors) -> Floats:
    """The longest multiple (...) of the unit vectors `direction` (..., 3) that can be made."""
    normals, support = facet_normals(generators)
    along = np.abs(np.einsum("...pi,...i->...p", normals, direction))
    limits = np.where(along > 0, support / np.where(along > 0, along, 1.0), np.inf)
    least = limits.min(axis=-1, initial=np.inf)
    return np.where(np.isfinite(least), least, 0.0)


def farthest(generators: Floats) -> Floats:
    """The length (...) of the longest vector that can be made, by way of all vertices.

    A vertex of the facet v_i × v_j is an end of an edge along some v_i: every v_k takes the sign of its component
    along the normal; where that is none, along the edge's own normal in the facet; where that is none too, along v_i.
    """
    columns = np.swapaxes(generators, -1, -2)
    length = np.linalg.norm(columns, axis=-1)
    if generators.shape[-1] == 1:
        alone: Floats = length[..., 0]
        return alone
    first = np.triu_indices(generators.shape[-1], 1)[0]
    normals, support = facet_normals(generators)
    edge = columns[..., first, :]
    edge = edge / np.where(length > 0, length, 1.0)[..., first, None]
    along = [direction @ generators for direction in (normals, np.cross(normals, edge), edge)]  # each (..., p, c)
    level = _LEVEL * length[..., None, :]
    longest = np.zeros(support.shape)
    for side in (1.0, -1.0):
        for end in (1.0, -1.0):
            sign = np.where(np.abs(along[1]) > level, side * np.sign(along[1]), end * np.sign(along[2]))
            sign = np.where(np.abs(along[0]) > level, np.sign(along[0]), sign)
            longest = np.maximum(longest, np.linalg.norm(sign @ columns, axis=-1))
    plane = np.isfinite(support)
    best = np.where(plane, longest, 0.0).max(axis=-1)
    reach: Floats = np.where(plane.any(axis=-1), best, length.sum(axis=-1))  # all parallel: no pair spans a plane
    return reach
