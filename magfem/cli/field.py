"""`magfem field`: B and its gradient at the points of a file."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from magfem.cli.console import show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine

if TYPE_CHECKING:
    from magfem.fields import Field


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "field",
        run,
        "B, and its gradient, at the points of a CSV file",
        "Evaluates a field model, or the solution of a device card, at the points of a CSV file with the columns\n"
        "x,y,z in m (or x_mm,y_mm,z_mm, in any unit of length), in the device's frame: origin in its middle, z\n"
        "along its axis. Writes x,y,z,Bx,By,Bz and, with --gradient, dBx_dx,dBx_dy,...,dBz_dz, in m, T and T/m.\n"
        "A name is a field model if there is one, else a device card.",
        [
            "magfem field ring.json --points points.csv -o field.csv",
            "magfem field ring.json --points points.csv -o field.csv --gradient --outside nan",
            "magfem field ./my_card.toml --points points.csv -o field.csv",
        ],
    )
    parser.add_argument("target", metavar="MODEL|CARD", help="field model or device card: a name or a path")
    parser.add_argument("--points", metavar="P.csv", required=True, help="where")
    parser.add_argument("-o", "--output", metavar="F.csv", required=True, help="the field there")
    parser.add_argument("--gradient", action="store_true", help="with the nine components of the gradient")
    parser.add_argument(
        "--outside",
        choices=("raise", "nan", "extrapolate"),
        default="raise",
        help="at points where the model makes no promise: end with an error, write nan, or evaluate it all the "
        "same (default: raise)",
    )


def run(options: Namespace) -> int:
    """Read the points, evaluate, write."""
    path = output_file(options.output, [".csv"])
    from magfem.cli.points import field_text, read_points
    from magfem.files import write_text

    points = read_points(Path(options.points))
    field = _field(options.target)
    order = 1 if options.gradient else 0
    B, *gradient = field.jet(points, order, options.outside)
    write_text(path, field_text(points, B, *gradient))
    what = f"B in {field.unit}" + (f" and gradient in {field.unit}/m" if gradient else "")
    data = {"output": str(path), "points": len(points), "unit": field.unit, "gradient": options.gradient}
    show_result(options, f"{what} at {len(points)} points in {path}", data)
    return 0


def _field(target: str) -> Field:
    """A model as it is, the solution of a card."""
    from magfem.geometry.catalogue import names

    if target.endswith(".json") or target in names("fits", ".json"):
        from magfem.fitting import load_model

        return load_model(target)
    from magfem.fem import solve
    from magfem.geometry import load_geometry

    return solve(load_geometry(target))
