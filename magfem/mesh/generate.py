"""From a geometry to its mesh: the device in a tight ball (3D), or its half section in a half disc (2D)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.errors import MeshError
from magfem.geometry import Geometry
from magfem.mesh.mesh import Mesh
from magfem.mesh.session import gmsh_session
from magfem.typing import Floats, Integers

log = logging.getLogger("magfem")

BALL = 1.35
"""Radius of the artificial boundary over the device's: tight, yet a few elements away from the rims."""

_RIM_REACH, _SURFACE_REACH = 2.75, 3.0
"""How far the elements take to grow to their outer size, over the growth: slow growth matters more than small rims."""
_GMSH_TET10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # Gmsh numbers the last two mid-edge nodes the other way round


@dataclass(frozen=True)
class Sizes:
    """Element sizes, m: along rims, on bodies' surfaces, on the artificial boundary."""

    rim: float
    surface: float
    outer: float


def element_sizes(geometry: Geometry, dimension: int, resolution: float) -> Sizes:
    """Sizes that give the accuracy stated in the docs at `resolution` 1; doubling it halves them all."""
    feature, radius = geometry.feature_size, geometry.hull.radius
    if dimension == 3:
        return Sizes(
            rim=0.05 * feature / resolution,
            surface=min(0.13 / resolution, 0.18) * feature,  # larger ones would misshape curved walls
            outer=0.3 * radius / resolution,
        )
    return Sizes(
        rim=0.02 * feature / resolution,
        surface=0.12 * feature / resolution,
        outer=0.16 * radius / resolution,
    )


def generate(geometry: Geometry, dimension: int, resolution: float = 1.0) -> Mesh:
    """Mesh `geometry` in `dimension` 2 or 3 (2: the half plane of a body of revolution).

    Raises MeshError when Gmsh fails, a body is lost or an element is inverted.
    """
    sizes = element_sizes(geometry, dimension, resolution)
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        if dimension == 3:
            bodies = geometry.build(occ)
            space = occ.addSphere(0, 0, 0, BALL * geometry.hull.radius)
        else:
            bodies = geometry.build_meridian(occ)
            space = _half_disc(occ, BALL * geometry.hull.radius)
        names = tuple(bodies)
        parts = [(dimension, tag) for name in names for tag in bodies[name]]
        owner = [name for name in names for _ in bodies[name]]
        _, pieces = occ.fragment([(dimension, space)], parts)
        occ.synchronize()
        body_of = {tag: names.index(name) for name, piece in zip(owner, pieces[1:], strict=True) for _, tag in piece}
        _size_fields(gmsh, dimension, list(body_of), sizes, BALL * geometry.hull.radius)
        gmsh.option.setNumber("Mesh.Algorithm3D", 10)  # HXT: three times faster than Delaunay
        gmsh.option.setNumber("Mesh.HighOrderOptimize", 0)
        gmsh.model.mesh.generate(dimension)
        gmsh.model.mesh.setOrder(2)
        mesh = _read(gmsh, dimension, body_of, names, BALL * geometry.hull.radius)
    log.info("mesh: %d %s", mesh.cells.shape[0], "tetrahedra" if dimension == 3 else "triangles")
    return mesh


def _half_disc(occ: Any, radius: float) -> int:
    """The half disc x = ρ ≥ 0, y = z of the artificial boundary; returns its surface tag."""
    centre = occ.addPoint(0, 0, 0)
    south, east, north = (occ.addPoint(radius * x, radius * y, 0) for x, y in ((0, -1), (1, 0), (0, 1)))
    boundary = [
        occ.addCircleArc(south, centre, east),
        occ.addCircleArc(east, centre, north),
        occ.addLine(north, centre),
        occ.addLine(centre, south),
    ]
    return int(occ.addPlaneSurface([occ.addCurveLoop(boundary)]))


def _size_fields(gmsh: Any, dimension: int, bodies: list[int], sizes: Sizes, radius: float) -> None:
    """Small along rims (where the magnetisation ends in an edge), growing along the surface and into the air."""
    field = gmsh.model.mesh.field
    surfaces = gmsh.model.getBoundary([(dimension, tag) for tag in bodies], combined=False, oriented=False)
    walls = sorted({tag for _, tag in surfaces})
    edges = sorted(set().union(*(_rims(gmsh, dimension - 1, wall) for wall in walls)))

    def threshold(kind: str, tags: list[int], low: float, high: float, reach: float) -> int:
        distance = field.add("Distance")
        field.setNumbers(distance, kind, tags)
        field.setNumber(distance, "Sampling", 60)
        grown = field.add("Threshold")
        for key, value in (("SizeMin", low), ("SizeMax", high), ("DistMin", 0.0), ("DistMax", reach)):
            field.setNumber(grown, key, value)
        field.setNumber(grown, "InField", distance)
        return int(grown)

    kinds = ("CurvesList", "SurfacesList") if dimension == 3 else ("PointsList", "CurvesList")
    fields = [
        threshold(kinds[0], edges, sizes.rim, sizes.outer, _RIM_REACH * (sizes.outer - sizes.rim)),
        threshold(kinds[1], walls, sizes.surface, sizes.outer, _SURFACE_REACH * (sizes.outer - sizes.surface)),
    ]
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", fields)
    field.setAsBackgroundMesh(smallest)
    for option in (
        "Mesh.MeshSizeExtendFromBoundary",
        "Mesh.MeshSizeFromPoints",
        "Mesh.MeshSizeFromCurvature",
    ):
        gmsh.option.setNumber(option, 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", sizes.outer)


def _rims(gmsh: Any, dimension: int, wall: int) -> set[int]:
    """Curves (points) where a wall ends; seams, where a closed wall meets itself, are no rims."""
    ends = [tag for _, tag in gmsh.model.getBoundary([(dimension, wall)], combined=False, oriented=False)]
    return {tag for tag in ends if ends.count(tag) == 1}


def _read(gmsh: Any, dimension: int, body_of: dict[int, int], names: tuple[str, ...], radius: float) -> Mesh:
    """Nodes and elements from Gmsh's own tags: going through a file format could lose them."""
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
    numbered = numbered[:, _GMSH_TET10] if dimension == 3 else _counter_clockwise(points, numbered)
    return Mesh(
        points=points,
        cells=np.ascontiguousarray(numbered),
        body=np.concatenate(body),
        names=names,
        radius=radius,
    )


def _counter_clockwise(points: Floats, triangles: Integers) -> Integers:
    """Second-order triangles (e, 6), those that Gmsh numbered clockwise turned round."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.where(area[:, None] > 0, triangles, triangles[:, [0, 2, 1, 5, 4, 3]])
