"""How small elements must be, and where: along rims, on walls, at the artificial boundary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

from magfem.errors import InputError
from magfem.geometry import Magnets

_RIM_REACH, _SURFACE_REACH = 2.75, 3.0
"""How far the elements take to grow to their outer size, over the growth: slow growth matters more than small rims."""

_SEVERAL_RIM, _SEVERAL_RIM_REACH = 0.07, 2.0
"""In 3D, for several bodies: the largest rim size over the clearance of the device's region, and the reach from such
rims. Between bodies fields nearly cancel, and an error at the rims is large against what is left of them."""

MOST_UNKNOWNS = 1e6
"""What a 3D mesh may ask for: about 5 GB of memory and some minutes."""


@dataclass(frozen=True)
class Sizes:
    """Element sizes of one body, m: along its rims and edges, and on its walls."""

    rim: float
    surface: float


@dataclass(frozen=True)
class Wanted:
    """What a mesh should be like.

    bodies: sizes by body name.  outer: on the artificial boundary, m.  around: elements round a full turn of a curved
    wall or rim at least, which is what shapes tightly curved ones.  rim_reach: how far elements take to grow from the
    rims to the outer size, over the growth.
    """

    bodies: Mapping[str, Sizes]
    outer: float
    around: float = 1.0
    rim_reach: float = _RIM_REACH


def element_sizes(geometry: Magnets, dimension: int, resolution: float) -> Wanted:
    """Sizes that give the accuracy stated in the docs at `resolution` 1; doubling it halves them all.

    They follow each body's smallest thickness, but not below a share of its radius: thin discs and long rods
    would need millions of elements, and the field some way off does not ask for them.
    """
    outer = geometry.hull.radius
    features = {}
    for body in geometry.bodies:
        thickness, radius = body.thickness or geometry.feature_size, body.radius or outer
        features[body.name] = max(thickness, radius / (8 if dimension == 3 else 40))
    if dimension == 3:
        surface = min(0.13 / resolution, 0.2)  # coarser ones no longer converge
        rims = {name: 0.05 * feature for name, feature in features.items()}
        reach = _RIM_REACH
        if len(rims) > 1 and max(rims.values()) > (largest := _SEVERAL_RIM * geometry.region.clearance):
            rims, reach = {name: min(rim, largest) for name, rim in rims.items()}, _SEVERAL_RIM_REACH
        return Wanted(
            {name: Sizes(rims[name] / resolution, surface * feature) for name, feature in features.items()},
            outer=0.3 * outer / resolution,
            around=max(18.0, 28.0 * resolution),
            rim_reach=reach,
        )
    return Wanted(
        {name: Sizes(0.02 * feature / resolution, 0.12 * feature / resolution) for name, feature in features.items()},
        outer=0.16 * outer / resolution,
        around=max(30.0, 60.0 * resolution),
    )


def local_sizes(
    gmsh: Any, dimension: int, bodies: Mapping[int, str], wanted: Wanted
) -> tuple[dict[int, float], dict[int, float]]:
    """Element size (m) on every wall of the `bodies` (name by tag), and on every rim, where a wall ends; by tag.

    Seams, where a closed wall meets itself, are no rims. Walls and rims that wind tightly get smaller elements;
    where bodies touch, the smaller size counts.
    """
    walls: dict[int, float] = {}
    rims: dict[int, float] = {}
    for tag, name in bodies.items():
        sizes = wanted.bodies[name]
        boundary = gmsh.model.getBoundary([(dimension, tag)], combined=False, oriented=False)
        for wall in sorted({wall for _, wall in boundary}):
            ends = [end for _, end in gmsh.model.getBoundary([(dimension - 1, wall)], combined=False, oriented=False)]
            for rim in sorted(end for end in ends if ends.count(end) == 1):
                turn = _turn(gmsh, dimension - 2, rim)
                rims[rim] = min(rims.get(rim, sizes.rim), sizes.rim, turn / wanted.around)
            turn = _turn(gmsh, dimension - 1, wall)
            walls[wall] = min(walls.get(wall, sizes.surface), sizes.surface, turn / wanted.around)
    return walls, rims


def _turn(gmsh: Any, dimension: int, tag: int) -> float:
    """Length (m) of the full turn that a curve or surface bends in; infinite for straight and flat ones."""
    if dimension == 0 or gmsh.model.getType(dimension, tag) in ("Line", "Plane"):
        return float("inf")
    low, high = gmsh.model.getParametrizationBounds(dimension, tag)
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    (curvature,) = gmsh.model.getCurvature(dimension, tag, middle)
    return 2 * pi / float(curvature) if curvature > 0 else float("inf")


def check_count(gmsh: Any, walls: Mapping[int, float], rims: Mapping[int, float], resolution: float) -> None:
    """Raise InputError before a 3D mesh is made that would not fit; the estimate holds within a factor of two."""
    mass = gmsh.model.occ.getMass
    triangles = sum(2.3 * mass(2, wall) / size**2 for wall, size in walls.items())
    triangles += sum(8 * mass(1, rim) / size for rim, size in rims.items())
    unknowns = 9 * triangles
    if unknowns > MOST_UNKNOWNS:
        raise InputError(
            f"about {unknowns:.1e} unknowns would be needed at resolution {resolution:g}, and at most "
            f"{MOST_UNKNOWNS:.0e} fit: lower the resolution to {resolution * (MOST_UNKNOWNS / unknowns) ** 0.5:.2g}"
        )


def set_size_field(
    gmsh: Any, dimension: int, walls: Mapping[int, float], rims: Mapping[int, float], wanted: Wanted
) -> None:
    """Small along rims (where the magnetisation ends in an edge), growing along the surface and into the air."""
    field = gmsh.model.mesh.field

    def thresholds(kind: str, sizes: Mapping[int, float], growth: float) -> list[int]:
        grown = []
        for low in sorted(set(sizes.values())):
            distance = field.add("Distance")
            field.setNumbers(distance, kind, [tag for tag, size in sizes.items() if size == low])
            field.setNumber(distance, "Sampling", 60)
            grown.append(field.add("Threshold"))
            reach = growth * (wanted.outer - low)
            for key, value in (("SizeMin", low), ("SizeMax", wanted.outer), ("DistMin", 0.0), ("DistMax", reach)):
                field.setNumber(grown[-1], key, value)
            field.setNumber(grown[-1], "InField", distance)
        return grown

    kinds = ("CurvesList", "SurfacesList") if dimension == 3 else ("PointsList", "CurvesList")
    fields = thresholds(kinds[0], rims, wanted.rim_reach) + thresholds(kinds[1], walls, _SURFACE_REACH)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", fields)
    field.setAsBackgroundMesh(smallest)
    for option in ("Mesh.MeshSizeExtendFromBoundary", "Mesh.MeshSizeFromPoints", "Mesh.MeshSizeFromCurvature"):
        gmsh.option.setNumber(option, 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", wanted.outer)
