"""`magfem show`: a device before any computation, or a coil system."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, moment_text, show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.cli.show_system import show_system
from magfem.cli.systems import add_joints, means_a_system
from magfem.errors import InputError
from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.geometry import Coil, Geometry, Magnets

MANY = 4
"""Circuits that are listed one by one."""


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "show",
        run,
        "a picture and the derived numbers of a device or coil system, no solve",
        "Reads a device card, prints the numbers that follow from it (volume, moment, length of a coil's wire,\n"
        "region of the model, ...) and draws the device: magnets with their poles, coils with their current.\n"
        "Of a coil system it lists coils, joints and what it can do at the middle of its workspace.",
        [
            "magfem show ring_magnet_4x1.5x1",
            "magfem show planar_coil_12mm -o coil.png",
            "magfem show ./mine.toml --json",
            'magfem show bigmag --joint "gamma_top=30 deg"',
        ],
    )
    parser.add_argument("card", metavar="CARD|SYSTEM", help="device card or coil system: a name or a path")
    parser.add_argument("-o", "--output", metavar="PNG", help="the picture (default: CARD.png, here)")
    add_joints(parser)


def run(options: Namespace) -> int:
    """Print the device's numbers and draw it."""
    if means_a_system(options.card):
        return show_system(options)
    if options.joint:
        raise InputError("--joint is for coil systems whose coils move")
    from magfem.geometry import load_geometry

    geometry = load_geometry(options.card)
    stem = options.card.removesuffix(".toml")
    picture = output_file(options.output or f"{Path(stem).name}.png", [".png"])
    from magfem.report import show_picture

    show_picture(geometry, picture)
    show_result(options, _text(geometry, picture), _data(geometry, picture))
    return 0


def _data(geometry: Geometry, picture: Path) -> dict[str, Any]:
    """The device's numbers, SI units."""
    from magfem.fields.hull import hull_to_dict
    from magfem.fields.region_json import region_to_dict
    from magfem.geometry import Coil, describe

    return {
        **describe(geometry),
        "volume": geometry.volume,
        **(_coil_data(geometry) if isinstance(geometry, Coil) else _magnet_data(_magnets(geometry))),
        "hull": hull_to_dict(geometry.hull),
        "region": region_to_dict(geometry.region),
        "picture": str(picture),
    }


def _magnet_data(geometry: Magnets) -> dict[str, Any]:
    return {
        "area": geometry.area,
        "moment": geometry.moment,
        "feature_size": geometry.feature_size,
        "bodies": [
            {
                "name": body.name,
                "volume": body.volume,
                "remanence": body.material.remanence_vector,
                "recoil_permeability": body.material.recoil_permeability,
            }
            for body in geometry.bodies
        ],
        "dimension": _dimension(geometry),
    }


def _coil_data(geometry: Coil) -> dict[str, Any]:
    from magfem.report.coil_numbers import conductor_numbers

    conductor = geometry.conductor
    return {
        "conductor": {
            "material": conductor.material,
            "temperature": conductor.temperature,
            "resistivity": conductor.resistivity,
            "current_density_limit": conductor.current_density_limit,
        },
        "circuits": {
            one.name: {
                "turns": one.turns,
                "length": one.length,
                "lead_length": one.lead_length,
                "volume": one.volume,
                "resistance_estimate": one.estimate,
            }
            for one in conductor_numbers(geometry)
        },
    }


def _text(geometry: Geometry, picture: Path) -> str:
    from magfem.geometry import Coil

    rows = [
        ("kind", geometry.kind),
        ("source", geometry.source or "not stated"),
        *(_coil_rows(geometry) if isinstance(geometry, Coil) else _magnet_rows(_magnets(geometry))),
        ("hull", geometry.hull.describe()),
        ("region", geometry.region.describe()),
        ("picture", str(picture)),
    ]
    return f"{geometry.name}\n{listing(rows)}"


def _magnet_rows(geometry: Magnets) -> list[tuple[str, str]]:
    bodies = len(geometry.bodies)
    return [
        *([("bodies", str(bodies))] if bodies > 1 else []),
        ("volume", f"{geometry.volume * 1e9:.6g} mm³"),
        ("area", f"{geometry.area * 1e6:.6g} mm²"),
        ("moment", f"{moment_text(geometry.moment)} if rigidly magnetised"),
        ("feature size", format_quantity(geometry.feature_size, "length")),
        ("solved in", f"dimension {_dimension(geometry)}"),
    ]


def _coil_rows(geometry: Coil) -> list[tuple[str, str]]:
    """What the card tells of the conductor; of many circuits, which are alike, that of the first."""
    from magfem.report.coil_numbers import conductor_numbers

    circuits = conductor_numbers(geometry)
    shown = circuits if len(circuits) <= MANY else circuits[:1]
    names = ", ".join(one.name for one in circuits[:MANY]) + (", ..." if len(circuits) > MANY else "")
    rows = [
        ("circuits", f"{len(circuits)}: {names}"),
        ("volume", f"{geometry.volume * 1e9:.6g} mm³ of {geometry.conductor.material}, leads apart"),
        ("resistivity", format_quantity(geometry.conductor.resistivity, "resistivity")),
    ]
    for one in shown:
        turns = "" if one.turns is None else f"{one.turns:g} turns, "
        leads = f", leads {format_quantity(one.lead_length, 'length')}" if one.lead_length else ""
        about = f"about {format_quantity(one.estimate, 'resistance')}"
        rows.append((one.name, f"{turns}{format_quantity(one.length, 'length')}{leads}, {about}"))
    return [*rows, ("", "(resistivity · length / section; `magfem solve` finds the true resistance)")]


def _magnets(geometry: Geometry) -> Magnets:
    from magfem.geometry import Magnets

    assert isinstance(geometry, Magnets)
    return geometry


def _dimension(geometry: Geometry) -> int:
    """What `magfem solve` takes by default."""
    return 2 if geometry.axisymmetric else 3
