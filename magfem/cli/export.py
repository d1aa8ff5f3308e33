"""`magfem export`: a field model, or a coil system, for another program."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.cli.systems import add_joints, means_a_system, stated_joints
from magfem.errors import InputError
from magfem.units import quantity, quoted

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem
    from magfem.fields import Field
    from magfem.typing import Points

Corner = tuple[float, float, float]
Write = Callable[[Any, Path, Namespace], dict[str, Any]]
"""Writes a field (or, where that is a target's choice, a coil system) to a file; what --json prints besides.

`beside` are more files, `remark` is a word about the result for people.
"""


@dataclass(frozen=True)
class Target:
    """What a model can be exported to.

    ending: of its file.  options: those that it takes, by their names.  of_coils: whether the format is one of coil
    systems, which may come whole, and whose fields are always per ampere.
    """

    write: Write
    ending: str
    options: frozenset[str] = frozenset()
    of_coils: bool = False


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "export",
        run,
        "a field model for another program",
        "Writes a field model for another program:\n"
        "  magpylib   .py   a module whose `source` is a CustomSource\n"
        "  mat        .mat  for MATLAB and Octave, with magfem_field.m beside it, which evaluates it\n"
        "  c          .h    one header, C99 or C++, with the numbers and what evaluates them\n"
        "  mpem       .yaml axial multipoles, as mag_manip reads them, of a model or a coil system; terms that are\n"
        "                   none are fitted, with their residual\n"
        "  vti        .vti  a regular grid for ParaView\n"
        "  vtu        .vtu  points for ParaView\n"
        "  samples    .csv  x,y,z,Bx,By,Bz\n"
        "All are in SI units and in the model's frame; a model per ampere stays in T/A unless --current says what\n"
        "flows. docs/exchange.md shows the other side of each.",
        [
            "magfem export ring_magnet_4x1.5x1 --to c -o ring.h",
            'magfem export ring.json --to vti -o ring.vti --grid 81 --bounds "-4 mm, 4 mm, -4 mm, 4 mm, 1 mm, 6 mm"',
            "magfem export ring.json --to samples -o ring.csv --points points.csv --gradient",
            "magfem export bigmag --to mpem -o bigmag.yaml",
        ],
    )
    parser.add_argument("model", metavar="MODEL", help="field model (mpem: also a coil system): a name or a path")
    parser.add_argument("--to", choices=tuple(TARGETS), required=True, help="the other program")
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help="the file to write")
    parser.add_argument("--current", metavar="A", type=float, help="a coil's current in A: the export is then in T")
    parser.add_argument("--name", metavar="NAME", help="c: what functions' names begin with (default: the file's name)")
    parser.add_argument("--grid", metavar="N", type=int, help="vti: points along the longest edge (default: 61)")
    parser.add_argument(
        "--bounds",
        metavar="X,X,Y,Y,Z,Z",
        help="vti, mpem: where, six lengths with their units, lowest and highest x, y and z (default: around the "
        "region; mpem: all of it)",
    )
    parser.add_argument("--tolerance", metavar="REL", type=float, help="mpem: largest relative error (default: 0.01)")
    parser.add_argument("--points", metavar="P.csv", help="vtu, samples: where (default: 2560 points of the region)")
    add_joints(parser)
    parser.add_argument("--gradient", action="store_true", help="samples: with the nine components of the gradient")


def run(options: Namespace) -> int:
    """Load, write."""
    target = TARGETS[options.to]
    path = output_file(options.output, [target.ending])
    _check_options(options, target)
    if target.of_coils and means_a_system(options.model):
        source, name, unit = _system(options)
    else:
        from magfem.fitting import load_model

        model = load_model(options.model)
        source = _driven(model, options.current)
        name, unit = model.name, source.unit
    more = target.write(source, path, options)
    if unit == "T/A" and not target.of_coils and not options.quiet:
        print("the field is that of 1 A, in T/A; --current gives it in T", file=sys.stderr)
    remark = f" ({more.pop('remark')})" if "remark" in more else ""
    data = {"output": str(path), "to": options.to, "name": name, "unit": unit, **more}
    files = [str(path), *more.get("beside", [])]
    show_result(options, f"{name}, in {unit}, for {options.to}: {', '.join(files)}{remark}", data)
    return 0


def _check_options(options: Namespace, target: Target) -> None:
    """Raise InputError for an option that the target does not know."""
    for name in sorted(frozenset().union(*(one.options for one in TARGETS.values())) - target.options):
        if getattr(options, name) not in (None, False):
            users = " and ".join(other for other, one in TARGETS.items() if name in one.options)
            raise InputError(f"--{name} is for {users}, not for {options.to}")


def _system(options: Namespace) -> tuple[Any, str, str]:
    """The system, its name and unit."""
    from magfem.actuation import load_system

    if options.current is not None:
        raise InputError("--current is for one coil's model, and this is a coil system")
    system = load_system(options.model)
    stated_joints(system, options)
    return system, system.name, "T/A"


def _driven(field: Field, current: float | None) -> Field:
    """The field at a current (A); without one as it is."""
    from magfem.fields.field import Scaled

    if current is None:
        return field
    if not math.isfinite(current):
        raise InputError(f"--current must be a number of A, got {current}")
    if field.unit == "T":
        raise InputError("--current is for models per ampere, and this one is in T")
    return Scaled(field, current, "T")


def _magpylib(field: Field, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.exchange import magpylib_module
    from magfem.files import write_text

    write_text(path, magpylib_module(field, options.model, path, options.current))
    return {}


def _mat(field: Field, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.exchange import write_mat

    _, evaluator = write_mat(field, path)
    return {"beside": [str(evaluator)]}


def _c(field: Field, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.exchange import c_header
    from magfem.exchange.c_source import as_c_name
    from magfem.files import write_text

    name = as_c_name(path.stem) if options.name is None else options.name
    write_text(path, c_header(field, name))
    return {"function": f"{name}_field"}


def _vti(field: Field, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.exchange import write_grid
    from magfem.exchange.vtk_grid import LONGEST

    bounds = None if options.bounds is None else _bounds(options.bounds)
    points = write_grid(field, path, bounds, LONGEST if options.grid is None else options.grid)
    return {"points": len(points), "bounds": [points[0], points[-1]]}


def _vtu(field: Field, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.exchange import write_points

    return {"points": len(write_points(field, path, _points(options)))}


def _samples(field: Field, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.cli.points import field_text
    from magfem.fields.region_parts import region_points
    from magfem.files import write_text

    given = _points(options)
    points = region_points(field.region) if given is None else given
    write_text(path, field_text(points, *field.jet(points, 1 if options.gradient else 0)))
    return {"points": len(points), "gradient": options.gradient}


def _mpem(source: Field | CoilSystem, path: Path, options: Namespace) -> dict[str, Any]:
    from magfem.actuation import CoilSystem
    from magfem.actuation.mpem_export import TOLERANCE, write_mpem
    from magfem.fields.workspace_region import Box

    tolerance = TOLERANCE if options.tolerance is None else options.tolerance
    if not 0 < tolerance < math.inf:
        raise InputError(f"--tolerance must be a positive number, got {tolerance}")
    workspace = None if options.bounds is None else Box(*_bounds(options.bounds))
    joints = stated_joints(source, options) if isinstance(source, CoilSystem) else None
    if joints is None and options.joint:
        raise InputError("--joint is for coil systems, and this is one coil's model")
    done = write_mpem(source, path, workspace, tolerance, joints=joints)
    count = f"{done.sources} source{'s' * (done.sources != 1)}"
    residual = f"fitted, relative error of B at most {done.maximum:.1e}, {done.rms:.1e} RMS"
    return {
        "remark": f"{count}, {'exact' if done.exact else residual}",
        "sources": done.sources,
        "exact": done.exact,
        "residual": {"max": done.maximum, "rms": done.rms},
        "coils": {label: {"max": worst, "rms": rms} for label, (worst, rms) in done.residuals.items()},
        "region": done.region,
    }


def _points(options: Namespace) -> Points | None:
    from magfem.cli.points import read_points

    return None if options.points is None else read_points(Path(options.points))


def _bounds(text: str) -> tuple[Corner, Corner]:
    """Lowest and highest corner, m."""
    parts = text.split(",")
    if len(parts) != 6:
        raise InputError(f"--bounds is six lengths with commas between them, x, x, y, y, z, z, got {quoted(text)}")
    x, X, y, Y, z, Z = (quantity(part, "length") for part in parts)
    return (x, y, z), (X, Y, Z)


TARGETS: dict[str, Target] = {
    "magpylib": Target(_magpylib, ".py"),
    "mat": Target(_mat, ".mat"),
    "c": Target(_c, ".h", frozenset({"name"})),
    "mpem": Target(_mpem, ".yaml", frozenset({"bounds", "tolerance", "joint"}), of_coils=True),
    "vti": Target(_vti, ".vti", frozenset({"grid", "bounds"})),
    "vtu": Target(_vtu, ".vtu", frozenset({"points"})),
    "samples": Target(_samples, ".csv", frozenset({"points", "gradient"})),
}
"""What there is to export to; another program is a function above and a line here."""
