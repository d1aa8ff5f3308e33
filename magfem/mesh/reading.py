"""Out of Gmsh: its second-order elements as the mesh that the solvers see."""

from __future__ import annotations

from typing import Any

import numpy as np

from magfem.errors import MeshError
from magfem.mesh.mesh import Mesh
from magfem.mesh.shape_functions import shape_gradients, tetrahedron_rule
from magfem.typing import Floats, Integers

_GMSH_TET10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # Gmsh numbers the last two mid-edge nodes the other way round


def read_mesh(gmsh: Any, dimension: int, body_of: dict[int, int], names: tuple[str, ...], radius: float) -> Mesh:
    """Nodes and elements from Gmsh's own tags: going through a file format could lose them.

    body_of: index into `names` by the tag of a volume (or surface, in dimension 2).  radius: of the artificial
    boundary, m. Raises MeshError when a part has no second-order elements.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    points = np.asarray(coordinates).reshape(-1, 3)
    kind, width = (11, 10) if dimension == 3 else (9, 6)
    cells: list[Integers] = []
    body: list[Integers] = []
    for _, entity in gmsh.model.getEntities(dimension):
        types, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        if list(types) != [kind]:
            raise MeshError(f"Gmsh left a part of the geometry without second-order elements (entity {entity})")
        found = np.asarray(nodes[0], dtype=np.int64).reshape(-1, width)
        cells.append(found)
        body.append(np.full(found.shape[0], body_of.get(entity, -1), dtype=np.int64))
    all_cells = np.concatenate(cells)
    # Nodes of construction points belong to no element and would make the matrix singular: drop them.
    used, numbered = np.unique(all_cells, return_inverse=True)
    index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    index[np.asarray(tags, dtype=np.int64)] = np.arange(tags.size)
    numbered = numbered.reshape(all_cells.shape)
    points = points[index[used]][:, :dimension].copy()
    if dimension == 3:
        numbered = numbered[:, _GMSH_TET10]
        points = _straightened(points, numbered)
    else:
        numbered = _counter_clockwise(points, numbered)
    return Mesh(
        points=points,
        cells=np.ascontiguousarray(numbered),
        body=np.concatenate(body),
        names=names,
        radius=radius,
    )


def _straightened(points: Floats, cells: Integers) -> Floats:
    """The nodes (n, 3) of second-order tetrahedra, with those whose curved edges turned them inside out made straight.

    Where a small curved wall meets larger elements a few may fold over; straight edges there cost a little of
    the wall's shape, which the check of volumes watches.
    """
    points = points.copy()
    shapes = shape_gradients(np.vstack([np.eye(4)[:, 1:], tetrahedron_rule(5)[0]]))
    for _ in range(5):
        jacobian = np.einsum("eai,qaj->eqij", points[cells], shapes, optimize=True)
        folded = np.linalg.det(jacobian).min(axis=1) <= 0
        if not folded.any():
            break
        corners = points[cells[folded, :4]]
        middles = 0.5 * (corners[:, [0, 1, 0, 0, 1, 2]] + corners[:, [1, 2, 2, 3, 3, 3]])
        points[cells[folded, 4:]] = middles
    return points


def _counter_clockwise(points: Floats, triangles: Integers) -> Integers:
    """Second-order triangles (e, 6), those that Gmsh numbered clockwise turned round."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.where(area[:, None] > 0, triangles, triangles[:, [0, 2, 1, 5, 4, 3]])
