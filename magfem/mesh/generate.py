"""From a geometry to its mesh: the device in a tight ball (3D), or its half section in a half disc (2D)."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.geometry import Magnets, MeshedMagnets
from magfem.mesh.external import mesh_in_air
from magfem.mesh.mesh import Mesh, body_volumes, check_volumes
from magfem.mesh.reading import read_mesh
from magfem.mesh.session import gmsh_session
from magfem.mesh.sizes import check_count, element_sizes, local_sizes, set_size_field
from magfem.units import quoted

log = logging.getLogger("magfem")

BALL = 1.35
"""Radius of the artificial boundary over the device's: tight, yet a few elements away from the rims."""


def generate(geometry: Magnets, dimension: int, resolution: float = 1.0) -> Mesh:
    """Mesh `geometry` in `dimension` 2 or 3 (2: the half plane of a body of revolution).

    Bodies may touch. Raises MeshError when Gmsh fails, loses a body or misses a volume by 1e-3, InputError for
    bodies that overlap and for a mesh that would not fit into memory.
    """
    mesh = _generate(geometry, dimension, resolution)
    volume = {body.name: body.volume for body in geometry.bodies}
    check_volumes(body_volumes(mesh), np.array([volume[name] for name in mesh.names]), mesh.names, tolerance=1e-3)
    log.info("mesh: %d %s", mesh.cells.shape[0], "tetrahedra" if dimension == 3 else "triangles")
    return mesh


def _generate(geometry: Magnets, dimension: int, resolution: float) -> Mesh:
    if isinstance(geometry, MeshedMagnets):
        return mesh_in_air(geometry.surfaces, geometry.feature_size, geometry.hull.radius, resolution)
    wanted = element_sizes(geometry, dimension, resolution)
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
        body_of = _bodies_of_pieces(owner, pieces[1:])
        walls, rims = local_sizes(gmsh, dimension, body_of, wanted)
        if dimension == 3:
            check_count(gmsh, walls, rims, resolution)
        set_size_field(gmsh, dimension, walls, rims, wanted)
        gmsh.model.mesh.generate(2)
        if dimension == 3:
            _fill(gmsh)
        gmsh.model.mesh.setOrder(2)
        indices = {tag: names.index(name) for tag, name in body_of.items()}
        return read_mesh(gmsh, dimension, indices, names, BALL * geometry.hull.radius)


def _bodies_of_pieces(owner: list[str], pieces: list[list[tuple[int, int]]]) -> dict[int, str]:
    """Body name by the tag of every piece that the bodies were cut into; `owner` names the body of each input.

    A piece of two bodies is where they overlap: InputError names both.
    """
    body_of: dict[int, str] = {}
    for name, piece in zip(owner, pieces, strict=True):
        for _, tag in piece:
            other = body_of.setdefault(tag, name)
            if other != name:
                raise InputError(f"{quoted(other)} and {quoted(name)} overlap; magnets may touch only")
    return body_of


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
