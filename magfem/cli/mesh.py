"""`magfem mesh`: a device's mesh as a file for other programs."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from magfem.cli.console import show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine, add_dimension, add_resolution


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "mesh",
        run,
        "the mesh of a device as a file",
        "Meshes a device and the ball of air around it with second-order elements and writes the mesh in the\n"
        "format that the file's ending names: .msh (Gmsh), .vtu, .vtk or .xdmf (ParaView), .med, .inp (Abaqus) and\n"
        "whatever else meshio writes; formats without curved elements get straight ones. Lengths are in m. Bodies\n"
        "keep their names where the format has names; the cell data `body` is the body's number, or -1 in air.",
        [
            "magfem mesh ring_magnet_4x1.5x1 -o ring.msh",
            "magfem mesh ring_magnet_4x1.5x1 -o ring.vtu --resolution 0.5",
            "magfem mesh ring_magnet_4x1.5x1 -o ring.med",
            "magfem mesh ring_magnet_4x1.5x1 -o half_section.vtu --dimension 2",
        ],
    )
    parser.add_argument("card", metavar="CARD", help="device card: a name or a path")
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help="the mesh; its ending says how")
    add_dimension(parser, 3, "3")
    add_resolution(parser, 1.0, "1")


def run(options: Namespace) -> int:
    """Mesh and write."""
    from magfem.fem.solve import check_resolution, choose_dimension
    from magfem.geometry import load_geometry
    from magfem.mesh.export import ending_of, format_of, write_mesh
    from magfem.mesh.generate import generate

    path = Path(options.output)
    if not path.is_dir():
        format_of(path, frozenset({"tetra10" if options.dimension != 2 else "triangle6"}))
    path = output_file(options.output, [ending_of(path), path.suffix.lower()])

    geometry = load_geometry(options.card)
    dimension = choose_dimension(geometry, options.dimension)
    check_resolution(options.resolution, geometry, dimension)
    mesh = generate(geometry, dimension, options.resolution)
    write_mesh(mesh, path)
    cells, nodes = len(mesh.cells), len(mesh.points)
    kind = "tetrahedra" if dimension == 3 else "triangles"
    show_result(
        options,
        f"{geometry.name}: {cells} {kind}, {nodes} nodes in {path}",
        {
            "output": str(path),
            "dimension": dimension,
            "cells": cells,
            "nodes": nodes,
            "bodies": {name: int((mesh.body == index).sum()) for index, name in enumerate(mesh.names)},
        },
    )
    return 0
