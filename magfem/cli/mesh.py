"""`magfem mesh`: a device's mesh as a file for other programs."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from magfem.cli.console import show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine, add_dimension, add_resolution

if TYPE_CHECKING:
    from magfem.geometry import Coil, Magnets


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "mesh",
        run,
        "the mesh of a device as a file",
        "Meshes magnets and the ball of air around them with second-order elements, or the surface of a coil's\n"
        "conductors, and writes the mesh in the format that the file's ending names: .msh (Gmsh), .vtu, .vtk or\n"
        ".xdmf (ParaView), .med, .inp (Abaqus) and whatever else meshio writes; formats without curved elements get\n"
        "straight ones. Lengths are in m. Bodies and circuits keep their names where the format has names; the cell\n"
        "data `body` is the number of the body or circuit, or -1 in air.",
        [
            "magfem mesh ring_magnet_4x1.5x1 -o ring.msh",
            "magfem mesh ring_magnet_4x1.5x1 -o ring.vtu --resolution 0.5",
            "magfem mesh planar_coil_12mm -o coil.vtu",
            "magfem mesh ring_magnet_4x1.5x1 -o half_section.vtu --dimension 2",
        ],
    )
    parser.add_argument("card", metavar="CARD", help="device card: a name or a path")
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help="the mesh; its ending says how")
    add_dimension(parser, None, "3; coils have none")
    add_resolution(parser, 1.0, "1")


def run(options: Namespace) -> int:
    """Mesh and write."""
    from magfem.fem.solve import check_resolution, choose_dimension
    from magfem.geometry import Coil, Magnets, load_geometry

    path = Path(options.output)
    path = output_file(options.output, [_ending(path), path.suffix.lower()])
    geometry = load_geometry(options.card)
    wanted = 3 if options.dimension is None and not isinstance(geometry, Coil) else options.dimension
    dimension = choose_dimension(geometry, wanted)
    _check_format(path, dimension)
    check_resolution(options.resolution, geometry, dimension)
    if isinstance(geometry, Coil):
        return _coil(options, geometry, path)
    assert isinstance(geometry, Magnets)
    assert dimension is not None
    return _magnets(options, geometry, dimension, path)


def _ending(path: Path) -> str:
    from magfem.mesh.export import ending_of

    return ending_of(path)


def _check_format(path: Path, dimension: int | None) -> None:
    """Raise InputError unless the file's format holds the cells of a dimension, None for coils."""
    from magfem.mesh.export import format_of

    format_of(path, frozenset({{2: "triangle6", 3: "tetra10", None: "quad9"}[dimension]}))


def _magnets(options: Namespace, geometry: Magnets, dimension: int, path: Path) -> int:
    from magfem.mesh.export import write_mesh
    from magfem.mesh.generate import generate
    from magfem.mesh.quality import quality

    mesh = generate(geometry, dimension, options.resolution)
    write_mesh(mesh, path)
    cells, nodes = len(mesh.cells), len(mesh.points)
    kind = "tetrahedra" if dimension == 3 else "triangles"
    shape = quality(mesh)
    show_result(
        options,
        f"{geometry.name}: {cells} {kind} (quality at least {shape.least:.2f}, {shape.mean:.2f} on average), "
        f"{nodes} nodes in {path}",
        {
            "output": str(path),
            "dimension": dimension,
            "cells": cells,
            "nodes": nodes,
            "quality": asdict(shape),
            "bodies": {name: int((mesh.body == index).sum()) for index, name in enumerate(mesh.names)},
        },
    )
    return 0


def _coil(options: Namespace, geometry: Coil, path: Path) -> int:
    """The surface of the conductors."""
    import numpy as np

    from magfem.geometry import FoilTrack, check_ribbon
    from magfem.mesh.coil_surfaces import coil_surfaces, quadrilaterals
    from magfem.mesh.export import write_cells
    from magfem.mesh.lattice import shape_of

    for circuit in geometry.circuits:
        for part in circuit.parts:
            if isinstance(part, FoilTrack):
                check_ribbon(part, options.resolution)
    surfaces = coil_surfaces(geometry, options.resolution)
    sine, aspect = shape_of(np.concatenate([surface.nodes for surface in surfaces]))
    points, cells, owner = quadrilaterals(surfaces)
    names = tuple(surface.name for surface in surfaces)
    lead = np.concatenate([surface.lead for surface in surfaces]).astype(np.int32)
    write_cells(path, points, {"quad9": cells}, {"quad9": owner}, names, {"lead": {"quad9": lead}})
    show_result(
        options,
        f"{geometry.name}: {len(cells)} quadrilaterals of {len(names)} circuit(s), {len(points)} nodes in {path}",
        {
            "output": str(path),
            "cells": len(cells),
            "nodes": len(points),
            "quality": {"least_sine": sine, "largest_aspect": aspect},
            "circuits": {name: int((owner == index).sum()) for index, name in enumerate(names)},
        },
    )
    return 0
