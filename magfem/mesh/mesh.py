"""The mesh that the solvers see: curved second-order tetrahedra, or triangles of the half plane, with bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from magfem.errors import MeshError
from magfem.mesh.shape_functions import shape_gradients, tetrahedron_rule, triangle_rule, triangle_shapes
from magfem.typing import Floats, Integers

# Local faces of a tetrahedron seen from outside: three corners, then the mid-edge nodes between them.
_TET_EDGES = {(0, 1): 4, (1, 2): 5, (0, 2): 6, (0, 3): 7, (1, 3): 8, (2, 3): 9}
_TET_FACES = np.array(
    [
        [*corners, *(_TET_EDGES[tuple(sorted((corners[i], corners[(i + 1) % 3])))] for i in range(3))]  # type: ignore[index]
        for corners in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
    ]
)
# Edges of a triangle, counter-clockwise: two corners, then the mid-edge node.
_TRIANGLE_EDGES = np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]])


@dataclass(frozen=True)
class Mesh:
    """Second-order simplices about the origin, out to an artificial sphere (or half circle).

    points: (n, d) m, d = 3, or d = 2 with columns (ρ, z).
    cells: (e, 10) tetrahedra with mid-edge nodes 01, 12, 02, 03, 13, 23, or (e, 6) triangles with 01, 12, 20.
    body: (e,) index into `names`, −1 in air.
    radius: of the artificial boundary, m.
    """

    points: Floats
    cells: Integers
    body: Integers
    names: tuple[str, ...]
    radius: float

    @property
    def dimension(self) -> int:
        return int(self.points.shape[1])

    @cached_property
    def outer_facets(self) -> Integers:
        """Facets of the artificial boundary, oriented outwards: (f, 6) triangles or (f, 3) edges."""
        facets, _, count, _ = self._facets
        lonely = facets[count == 1]
        if self.dimension == 2:  # the axis of revolution is no boundary
            lonely = lonely[np.abs(self.points[lonely[:, 2], 0]) > 1e-9 * self.radius]
        return np.asarray(lonely)

    def body_facets(self, index: int) -> tuple[Integers, Integers]:
        """The surface of a body, oriented outwards: facets (f, 6) or (f, 3), and the cell (f,) each belongs to."""
        facets, owner, _, partner = self._facets
        beyond = np.where(partner >= 0, self.body[partner], -1)
        surface = (self.body[owner] == index) & (beyond != index)
        if self.dimension == 2:
            surface &= np.abs(self.points[facets[:, 2], 0]) > 1e-9 * self.radius
        return facets[surface], owner[surface]

    @cached_property
    def _facets(self) -> tuple[Integers, Integers, Integers, Integers]:
        """Every cell's facets with their cell, how many cells share each, and the cell beyond (−1: none)."""
        local = _TET_FACES if self.dimension == 3 else _TRIANGLE_EDGES
        facets = self.cells[:, local].reshape(-1, local.shape[1])
        owner = np.repeat(np.arange(self.cells.shape[0]), local.shape[0])
        corners = np.sort(facets[:, : self.dimension], axis=1)
        total = self.points.shape[0]
        key = corners[:, 0].astype(np.int64)
        for column in range(1, corners.shape[1]):
            key = key * total + corners[:, column]
        order = np.argsort(key, kind="stable")
        same = key[order][1:] == key[order][:-1]
        first, second = order[:-1][same], order[1:][same]
        partner = np.full(owner.size, -1, dtype=np.int64)
        partner[first], partner[second] = owner[second], owner[first]
        count = np.where(partner >= 0, 2, 1)
        return facets, owner, count, partner


def body_volumes(mesh: Mesh) -> Floats:
    """Volume (b,) m³ of every body as meshed, curved walls and all; of the body of revolution for half sections."""
    if mesh.dimension == 3:
        local, weights = tetrahedron_rule(5)
        jacobian = np.einsum("eai,qaj->eqij", mesh.points[mesh.cells], shape_gradients(local), optimize=True)
        volume = np.linalg.det(jacobian) @ weights
    else:
        local, weights = triangle_rule(6)
        shapes, du, dv = triangle_shapes(local)
        nodes = mesh.points[mesh.cells]
        xu, xv = (np.einsum("qa,eai->eqi", slope, nodes) for slope in (du, dv))
        area = xu[..., 0] * xv[..., 1] - xu[..., 1] * xv[..., 0]
        volume = 2 * np.pi * (np.einsum("qa,ea->eq", shapes, nodes[..., 0]) * area) @ weights
    inside = mesh.body >= 0
    return np.bincount(mesh.body[inside], volume[inside], minlength=len(mesh.names)).astype(float)


def check_volumes(measured: Floats, expected: Floats, names: tuple[str, ...], tolerance: float) -> None:
    """Raise MeshError when a meshed body's volume (b,) m³ differs from its closed form by more than `tolerance`."""
    for name, found, wanted in zip(names, measured, expected, strict=True):
        if not abs(found - wanted) <= tolerance * wanted:
            raise MeshError(
                f"the mesh of body {name!r} has a volume of {found:.6e} m³ where {wanted:.6e} m³ are expected: "
                "a finer resolution resolves its curved walls better"
            )
