"""`magfem solve`: the finite-element solution of a device."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from magfem.cli.console import listing, moment_text, show_result, table
from magfem.cli.outputs import output_folder
from magfem.cli.parser import CommandLine, add_dimension, add_resolution
from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.fem import Solution
    from magfem.fem.coil_solution import CoilSolution
    from magfem.typing import Floats

MANY = 4
"""Circuits that are listed one by one."""

_NOTHING = 1e-12  # an estimated error below is not worth its digits


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "solve",
        run,
        "mesh and finite elements, with a stated error",
        "Meshes and solves a device by finite elements and prints the result with its stated error: the largest\n"
        "relative error of B and of its gradient in the device's region. A coil's current is solved in its\n"
        "conductor: resistance, inductance and the field at 1 A follow from it. With -o the solution is kept in a\n"
        "folder: solution.vtu (for ParaView), summary.json and fields.npz.",
        [
            "magfem solve ring_magnet_4x1.5x1",
            "magfem solve ring_magnet_4x1.5x1 -o solution --dimension 3 --tolerance 1e-3",
            "magfem solve planar_coil_12mm --conduction sheet",
            "magfem solve stator_1.6x5.5 -o solution --json",
        ],
    )
    parser.add_argument("card", metavar="CARD", help="device card: a name or a path")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the solution (default: not kept)")
    add_dimension(parser, None, "2 if possible; coils have none")
    add_resolution(parser, 1.0, "1")
    parser.add_argument(
        "--tolerance", type=float, metavar="REL", help="refine until the stated error of B is below, such as 1e-4"
    )
    parser.add_argument(
        "--conduction",
        choices=("filament", "sheet", "solid"),
        help="how foil carries current (default: by thickness and clearance)",
    )


def run(options: Namespace) -> int:
    """Solve, keep the solution when asked to, print what it is worth."""
    from magfem.fem import solve
    from magfem.fem.coil_solution import CoilSolution
    from magfem.fem.solution import FILES
    from magfem.geometry import load_geometry

    folder = options.output and output_folder(options.output, FILES)
    geometry = load_geometry(options.card)
    solution = solve(geometry, options.dimension, options.resolution, options.tolerance, options.conduction)
    if folder:
        solution.save(folder)
    text = _coil_text(solution) if isinstance(solution, CoilSolution) else _text(solution)
    show_result(options, text, solution.summary)
    return 0


def _text(solution: Solution) -> str:
    settings = solution.settings
    rows = [
        ("solved in", f"dimension {settings['dimension']}, resolution {settings['resolution']:g}"),
        *_error_rows(solution),
        ("moment", moment_text(solution.moment)),
        ("field energy", f"{solution.quantities['field_energy'] * 1e3:.6g} mJ"),
        *_cost_rows(solution),
    ]
    return f"{solution.geometry.name}\n{listing(rows)}"


def _error_rows(solution: Solution | CoilSolution) -> list[tuple[str, str]]:
    error = solution.error
    return [
        ("stated error", f"{error['B']:.1e} in B, {error['gradient']:.1e} in the gradient"),
        ("region", error["region"]),
    ]


def _cost_rows(solution: Solution | CoilSolution) -> list[tuple[str, str]]:
    stats = solution.stats
    return [
        ("unknowns", str(stats["unknowns"])),
        ("time", f"{stats['seconds']:.1f} s"),
        ("peak memory", f"{stats['peak_bytes'] / 1e6:.0f} MB"),
    ]


def _coil_text(solution: CoilSolution) -> str:
    circuits = solution.circuits
    model = " and ".join(sorted({circuit.model for circuit in circuits}))
    rows = [
        ("conduction", f"{model}, resolution {solution.settings['resolution']:g}"),
        ("model's error", f"{_estimate(solution.error['model'])} in B, estimated at the clearance"),
        *_error_rows(solution),
    ]
    if len(circuits) <= MANY:
        rows += [row for circuit in circuits for row in _circuit_rows(solution, circuit.name, len(circuits) > 1)]
    else:
        rows += _many_rows(solution)
    inductance = solution.inductance
    if len(circuits) == 1:
        rows.append(("inductance", format_quantity(float(inductance[0, 0]), "inductance")))
    rows += [("moment at 1 A", f"{moment_text(solution.moment)}{' in every circuit' if len(circuits) > 1 else ''}")]
    text = f"{solution.geometry.name}\n{listing([*rows, *_cost_rows(solution)])}"
    return text + _matrix(inductance, [circuit.name for circuit in circuits]) if 1 < len(circuits) <= MANY else text


def _estimate(error: float) -> str:
    return f"{error:.1e}" if error > _NOTHING else f"below {_NOTHING:.0e}"


def _circuit_rows(solution: CoilSolution, name: str, named: bool) -> list[tuple[str, str]]:
    circuit = solution.circuit(name)
    of = f"{name}: " if named else ""
    spread = circuit.resistance_error
    bounds = f" ± {spread:.1e}, relative, between its bounds" if spread else ""
    leads = format_quantity(circuit.lead_resistance, "resistance")
    density = format_quantity(circuit.crowding / circuit.section, "current density")
    rows = [(f"{of}resistance", f"{format_quantity(circuit.resistance, 'resistance')}{bounds}")]
    rows += [(f"{of}leads", f"{leads} of it")] if circuit.lead_resistance else []
    rows += [
        (f"{of}power at 1 A", format_quantity(circuit.resistance, "power")),
        (f"{of}current density", f"at most {density} at 1 A, {circuit.crowding:.3g} times the mean"),
    ]
    return [*rows, (f"{of}moment at 1 A", moment_text(circuit.moment))] if named else rows


def _many_rows(solution: CoilSolution) -> list[tuple[str, str]]:
    """The range of every number over the circuits."""
    circuits, inductance = solution.circuits, solution.inductance
    count = len(circuits)
    self_inductance = inductance.diagonal().tolist()
    mutual = [abs(float(inductance[i, j])) for i in range(count) for j in range(i)]
    resistance = [circuit.resistance for circuit in circuits]
    density = [circuit.crowding / circuit.section for circuit in circuits]
    return [
        ("circuits", str(count)),
        ("resistance", f"{_range(resistance, 'resistance')} each"),
        ("power at 1 A", f"{_range(resistance, 'power')} each, {format_quantity(sum(resistance), 'power')} in all"),
        ("current density", f"at most {format_quantity(max(density), 'current density')} at 1 A"),
        ("inductance", f"{_range(self_inductance, 'inductance')} each"),
        ("mutual", f"at most {format_quantity(max(mutual), 'inductance')}"),
    ]


def _range(values: list[float], dimension: str) -> str:
    low, high = (format_quantity(value, dimension) for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def _matrix(inductance: Floats, names: list[str]) -> str:
    rows = [["inductance", *names]]
    for name, row in zip(names, inductance, strict=True):
        rows.append([name, *(format_quantity(float(value), "inductance") for value in row)])
    return f"\n\n{table(rows)}"
