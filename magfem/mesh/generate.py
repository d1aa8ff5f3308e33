"""From a geometry to its mesh: the device in a tight ball (3D), or its half section in a half disc (2D)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.errors import InputError, MeshError
from magfem.geometry import Magnets
from magfem.mesh.mesh import Mesh
from magfem.mesh.session import gmsh_session
from magfem.mesh.shape_functions import shape_gradients, tetrahedron_rule
from magfem.typing import Floats, Integers

log = logging.getLogger("magfem")

BALL = 1.35
"""Radius of the artificial boundary over the device's: tight, yet a few elements away from the rims."""

_RIM_REACH, _SURFACE_REACH = 2.75, 3.0
"""How far the elements take to grow to their outer size, over the growth: slow growth matters more than small rims."""

MOST_UNKNOWNS = 1e6
"""What a 3D mesh may ask for: about 5 GB of memory and some minutes."""

_GMSH_TET10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # Gmsh numbers the last two mid-edge nodes the other way round


@dataclass(frozen=True)
class Sizes:
    """Element sizes, m: along rims, on bodies' surfaces, on the artificial boundary.

    around: how many elements at least go round a rim, which is what shapes a tightly curved wall.
    """

    rim: float
    surface: float
    outer: float
    around: float = 0.0


def element_sizes(geometry: Magnets, dimension: int, resolution: float) -> Sizes:
    """Sizes that give the accuracy stated in the docs at `resolution` 1; doubling it halves them all.

    They follow the smallest thickness, but not below a share of the device's radius: thin discs and long rods
    would need millions of elements, and the field some way off does not ask for them.
    """
    radius = geometry.hull.radius
    if dimension == 3:
        feature = max(geometry.feature_size, radius / 8)
        return Sizes(
            rim=0.05 * feature / resolution,
            surface=min(0.13 / resolution, 0.2) * feature,  # coarser ones no longer converge
            around=max(18.0, 28.0 * resolution),
            outer=0.3 * radius / resolution,
        )
    feature = max(geometry.feature_size, radius / 40)
    return Sizes(
        rim=0.02 * feature / resolution,
        surface=0.12 * feature / resolution,
        outer=0.16 * radius / resolution,
    )


def generate(geometry: Magnets, dimension: int, resolution: float = 1.0) -> Mesh:
    """Mesh `geometry` in `dimension` 2 or 3 (2: the half plane of a body of revolution).

    Raises MeshError when Gmsh fails or loses a body, InputError for a mesh that would not fit into memory.
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
        walls, rims = _wanted_sizes(gmsh, dimension, list(body_of), sizes)
        if dimension == 3:
            _check_size(gmsh, walls, rims, resolution)
        _size_fields(gmsh, dimension, walls, rims, sizes)
        gmsh.model.mesh.generate(2)
        if dimension == 3:
            _fill(gmsh)
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


def _fill(gmsh: Any) -> None:
    """Tetrahedra inside the surface mesh: by HXT, which is three times faster, else by Delaunay's method."""
    gmsh.option.setNumber("Mesh.Algorithm3D", 10)
    try:
        gmsh.model.mesh.generate(3)
    except Exception:  # Gmsh raises nothing more specific; the second method raises if it fails as well
        gmsh.option.setNumber("Mesh.Algorithm3D", 1)
        gmsh.model.mesh.generate(3)


def _wanted_sizes(
    gmsh: Any, dimension: int, bodies: list[int], sizes: Sizes
) -> tuple[dict[int, float], dict[int, float]]:
    """Element size (m) on every wall of the bodies, and on every rim, where a wall ends; by tag.

    Seams, where a closed wall meets itself, are no rims. Walls and rims that wind tightly get smaller elements.
    """
    boundary = gmsh.model.getBoundary([(dimension, tag) for tag in bodies], combined=False, oriented=False)
    walls: dict[int, float] = {}
    rims: dict[int, float] = {}
    for wall in sorted({tag for _, tag in boundary}):
        walls[wall] = sizes.surface
        ends = [tag for _, tag in gmsh.model.getBoundary([(dimension - 1, wall)], combined=False, oriented=False)]
        for rim in sorted(tag for tag in ends if ends.count(tag) == 1):
            rims[rim] = sizes.rim
            if sizes.around:
                turn = gmsh.model.occ.getMass(1, rim) / sizes.around
                rims[rim] = min(sizes.rim, turn)
                if gmsh.model.getType(dimension - 1, wall) != "Plane":
                    walls[wall] = min(walls[wall], turn)
    return walls, rims


def _check_size(gmsh: Any, walls: dict[int, float], rims: dict[int, float], resolution: float) -> None:
    """Raise InputError before a mesh is made that would not fit; the estimate holds within a factor of two."""
    mass = gmsh.model.occ.getMass
    triangles = sum(2.3 * mass(2, wall) / size**2 for wall, size in walls.items())
    triangles += sum(8 * mass(1, rim) / size for rim, size in rims.items())
    unknowns = 9 * triangles
    if unknowns > MOST_UNKNOWNS:
        raise InputError(
            f"about {unknowns:.1e} unknowns would be needed at resolution {resolution:g}, and at most "
            f"{MOST_UNKNOWNS:.0e} fit: lower the resolution to {resolution * (MOST_UNKNOWNS / unknowns) ** 0.5:.2g}"
        )


def _size_fields(gmsh: Any, dimension: int, walls: dict[int, float], rims: dict[int, float], sizes: Sizes) -> None:
    """Small along rims (where the magnetisation ends in an edge), growing along the surface and into the air."""
    field = gmsh.model.mesh.field

    def thresholds(kind: str, wanted: dict[int, float], growth: float) -> list[int]:
        grown = []
        for low in sorted(set(wanted.values())):
            distance = field.add("Distance")
            field.setNumbers(distance, kind, [tag for tag, size in wanted.items() if size == low])
            field.setNumber(distance, "Sampling", 60)
            grown.append(field.add("Threshold"))
            reach = growth * (sizes.outer - low)
            for key, value in (("SizeMin", low), ("SizeMax", sizes.outer), ("DistMin", 0.0), ("DistMax", reach)):
                field.setNumber(grown[-1], key, value)
            field.setNumber(grown[-1], "InField", distance)
        return grown

    kinds = ("CurvesList", "SurfacesList") if dimension == 3 else ("PointsList", "CurvesList")
    fields = thresholds(kinds[0], rims, _RIM_REACH) + thresholds(kinds[1], walls, _SURFACE_REACH)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", fields)
    field.setAsBackgroundMesh(smallest)
    for option in ("Mesh.MeshSizeExtendFromBoundary", "Mesh.MeshSizeFromPoints", "Mesh.MeshSizeFromCurvature"):
        gmsh.option.setNumber(option, 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", sizes.outer)


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


def _counter_clockwise(points: Floats, triangles: Integers) -> Integers:
    """Second-order triangles (e, 6), those that Gmsh numbered clockwise turned round."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.where(area[:, None] > 0, triangles, triangles[:, [0, 2, 1, 5, 4, 3]])
