"""`magfem field`: B and its gradient at the points of a file."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from magfem.cli.console import show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.cli.systems import add_joints, means_a_system, stated_currents, stated_joints
from magfem.errors import InputError
from magfem.units import quoted

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
        "A name is a field model if there is one, else a device card. A coil's field is per ampere in every circuit,\n"
        "in T/A and T/m/A, unless --current says what flows. A coil system (a card, a system or MPEM file, or a name)\n"
        "is evaluated at the currents of its coils, zero where --current says nothing, and at its joints.",
        [
            "magfem field planar_coil_12mm --points points.csv -o field.csv --current 0.5",
            "magfem field ring.json --points points.csv -o field.csv --gradient --outside nan",
            "magfem field stator_1.6x5.5 --points p.csv -o f.csv --current inner=0.1 --current outer=-0.05",
            'magfem field bigmag --points p.csv -o f.csv --current 0=2 --current 3=-5 --joint "gamma_top=30 deg"',
        ],
    )
    parser.add_argument(
        "target", metavar="MODEL|CARD|SYSTEM", help="field model, device card or coil system: a name or a path"
    )
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
    parser.add_argument(
        "--current",
        metavar="[NAME=]A",
        action="append",
        help="a coil's current in A: one value, or once for every circuit or coil that carries one",
    )
    add_joints(parser)


def run(options: Namespace) -> int:
    """Read the points, evaluate, write."""
    path = output_file(options.output, [".csv"])
    from magfem.cli.points import field_text, read_points
    from magfem.files import write_text

    currents = _currents(options.current or [])
    points = read_points(Path(options.points))
    if means_a_system(options.target):
        field = _system_field(options, currents)
    elif options.joint:
        raise InputError("--joint is for coil systems whose coils move")
    else:
        field = _driven(_field(options.target, bool(currents)), currents)
    order = 1 if options.gradient else 0
    B, *gradient = field.jet(points, order, options.outside)
    write_text(path, field_text(points, B, *gradient))
    what = f"B in {field.unit}" + (f" and gradient in {field.unit}/m" if gradient else "")
    data = {"output": str(path), "points": len(points), "unit": field.unit, "gradient": options.gradient}
    if field.unit == "T/A" and not options.quiet:
        print("the field is that of 1 A in every circuit; --current gives it in T", file=sys.stderr)
    show_result(options, f"{what} at {len(points)} points in {path}", data)
    return 0


def _system_field(options: Namespace, currents: dict[str, float]) -> Field:
    """The field of a coil system at its currents and joints."""
    from magfem.actuation import load_system

    system = load_system(options.target)
    return system.at(stated_currents(system, currents), stated_joints(system, options))


def _field(target: str, driven: bool) -> Field:
    """A model as it is, the solution of a card; before it is solved, InputError for a magnet that is to be `driven`."""
    from magfem.geometry.catalogue import names

    if target.endswith(".json") or target in names("fits", ".json"):
        from magfem.fitting import load_model

        return load_model(target)
    from magfem.fem import solve
    from magfem.geometry import Coil, load_geometry

    geometry = load_geometry(target)
    if driven and not isinstance(geometry, Coil):
        raise InputError(f"--current is for coils: {geometry.name} carries none")
    return solve(geometry)


def _currents(texts: list[str]) -> dict[str, float]:
    """Currents (A) by the circuit's name; an empty name stands for the only circuit, or for all of one value."""
    currents: dict[str, float] = {}
    for text in texts:
        name, _, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f"--current must be a number of A, or NAME=A, got {quoted(text)}")
        if name in currents:
            raise InputError(f"--current is given twice {f'for {quoted(name)}' if name else 'without a name'}")
        currents[name] = value
    if "" in currents and len(currents) > 1:
        raise InputError("--current is one value, or NAME=A for every circuit that carries a current, not both")
    return currents


def _driven(field: Field, currents: dict[str, float]) -> Field:
    """The field at stated currents; without any as it is."""
    from magfem.fem.coil_solution import CoilSolution

    if not currents:
        return field
    if not isinstance(field, CoilSolution):
        if field.unit == "T" or "" not in currents:
            raise InputError("--current is for coils, and circuits have names only where a device card is given")
        from magfem.fields.field import Scaled

        return Scaled(field, currents[""], "T")
    if "" in currents:
        if len(field.circuits) > 1:
            names = ", ".join(quoted(circuit.name) for circuit in field.circuits)
            raise InputError(f"{field.geometry.name} has {len(field.circuits)} circuits: --current NAME=A of {names}")
        return field.driven([currents[""]])
    return field.driven(currents)
