"""`magfem solve`: the finite-element solution of a device."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from magfem.cli.console import listing, moment_text, show_result
from magfem.cli.outputs import output_folder
from magfem.cli.parser import CommandLine, add_dimension, add_resolution

if TYPE_CHECKING:
    from magfem.fem import Solution


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "solve",
        run,
        "mesh and finite elements, with a stated error",
        "Meshes and solves a device by finite elements and prints the result with its stated error: the largest\n"
        "relative error of B and of its gradient in the device's region. With -o the solution is kept in a\n"
        "folder: solution.vtu (for ParaView), summary.json and fields.npz.",
        [
            "magfem solve ring_magnet_4x1.5x1",
            "magfem solve ring_magnet_4x1.5x1 -o solution --resolution 2",
            "magfem solve ring_magnet_4x1.5x1 -o solution --dimension 3 --tolerance 1e-3",
            "magfem solve ring_magnet_4x1.5x1 --json",
        ],
    )
    parser.add_argument("card", metavar="CARD", help="device card: a name or a path")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the solution (default: not kept)")
    add_dimension(parser, None, "2 if possible")
    add_resolution(parser, 1.0, "1")
    parser.add_argument(
        "--tolerance", type=float, metavar="REL", help="refine until the stated error of B is below, such as 1e-4"
    )


def run(options: Namespace) -> int:
    """Solve, keep the solution when asked to, print what it is worth."""
    from magfem.fem import solve
    from magfem.fem.solution import FILES
    from magfem.geometry import load_geometry

    folder = options.output and output_folder(options.output, FILES)
    solution = solve(load_geometry(options.card), options.dimension, options.resolution, options.tolerance)
    if folder:
        solution.save(folder)
    show_result(options, _text(solution), solution.summary)
    return 0


def _text(solution: Solution) -> str:
    error, stats, settings = solution.error, solution.stats, solution.settings
    rows = [
        ("solved in", f"dimension {settings['dimension']}, resolution {settings['resolution']:g}"),
        ("stated error", f"{error['B']:.1e} in B, {error['gradient']:.1e} in the gradient"),
        ("region", error["region"]),
        ("moment", moment_text(solution.moment)),
        ("field energy", f"{solution.quantities['field_energy'] * 1e3:.6g} mJ"),
        ("unknowns", str(stats["unknowns"])),
        ("time", f"{stats['seconds']:.1f} s"),
        ("peak memory", f"{stats['peak_bytes'] / 1e6:.0f} MB"),
    ]
    return f"{solution.geometry.name}\n{listing(rows)}"
