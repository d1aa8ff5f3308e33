"""`magfem show`: a device before any computation."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, moment_text, show_result
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.geometry import Geometry


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "show",
        run,
        "a picture and the derived numbers of a device, no solve",
        "Reads a device card, prints the numbers that follow from it (volume, moment, region of the model, ...)\n"
        "and draws the device.",
        [
            "magfem show ring_magnet_4x1.5x1",
            "magfem show ring_magnet_4x1.5x1 -o ring.png",
            "magfem show ./mine.toml --json",
        ],
    )
    parser.add_argument("card", metavar="CARD", help="device card: a name or a path")
    parser.add_argument("-o", "--output", metavar="PNG", help="the picture (default: CARD.png, here)")


def run(options: Namespace) -> int:
    """Print the device's numbers and draw it."""
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
    from magfem.fields.region import region_to_dict
    from magfem.geometry import describe

    return {
        **describe(geometry),
        "volume": geometry.volume,
        "area": geometry.area,
        "moment": geometry.moment,
        "feature_size": geometry.feature_size,
        "hull": hull_to_dict(geometry.hull),
        "region": region_to_dict(geometry.region),
        "dimension": _dimension(geometry),
        "picture": str(picture),
    }


def _text(geometry: Geometry, picture: Path) -> str:
    from magfem.fields.hull import hull_to_dict

    hull = hull_to_dict(geometry.hull)
    shape = hull.pop("kind")
    sizes = ", ".join(f"{key} {format_quantity(value, 'length')}" for key, value in hull.items())
    rows = [
        ("kind", geometry.kind),
        ("source", geometry.source or "not stated"),
        ("volume", f"{geometry.volume * 1e9:.6g} mm³"),
        ("area", f"{geometry.area * 1e6:.6g} mm²"),
        ("moment", f"{moment_text(geometry.moment)} if rigidly magnetised"),
        ("hull", f"{shape}, {sizes}"),
        ("region", geometry.region.describe()),
        ("feature size", format_quantity(geometry.feature_size, "length")),
        ("solved in", f"dimension {_dimension(geometry)}"),
        ("picture", str(picture)),
    ]
    return f"{geometry.name}\n{listing(rows)}"


def _dimension(geometry: Geometry) -> int:
    """What `magfem solve` takes by default."""
    return 2 if geometry.axisymmetric else 3
