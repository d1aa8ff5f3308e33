"""`magfem fit`: a field model of a device."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, moment_text, show_result, table
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine, add_dimension, add_resolution

if TYPE_CHECKING:
    from magfem.fitting import FieldModel, Recipe


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "fit",
        run,
        "a field model, with errors on held-out points",
        "Solves a device, fits a field model to the solution and writes the model file. The table holds the\n"
        "model's relative errors at points that the fit has not seen, next to those of the dissertation's\n"
        "families on the same data. A name is a fit recipe if there is one, else a device card.",
        [
            "magfem fit ring_magnet_4x1.5x1",
            "magfem fit ring_magnet_4x1.5x1 -o ring.json --resolution 2",
            "magfem fit ./my_recipe.toml -o mine.json",
        ],
    )
    parser.add_argument("target", metavar="CARD|RECIPE", help="device card or fit recipe: a name or a path")
    parser.add_argument("-o", "--output", metavar="MODEL.json", help="the model (default: its name, here)")
    add_dimension(parser, None, "the recipe's, or 2 if possible")
    add_resolution(parser, None, "the recipe's, or 1")


def run(options: Namespace) -> int:
    """Solve, fit, write, print the errors."""
    name = Path(options.target).name.removesuffix(".toml")
    path = output_file(options.output or f"{name}.json", [".json"])
    model = _model(options)
    model.save(path)
    content = model.to_dict()
    data = {key: content[key] for key in ("name", "unit", "region", "report", "provenance")}
    show_result(options, _text(model, path), {"output": str(path), "moment": model.moment, **data})
    return 0


def _model(options: Namespace) -> FieldModel:
    """Solved and fitted, or of coefficients that somebody else published."""
    from magfem.fem import solve
    from magfem.fitting import fit
    from magfem.fitting.published import is_published, load_published
    from magfem.geometry.catalogue import is_path, names

    if (is_path(options.target, ".toml") or options.target in names("fits", ".toml")) and is_published(options.target):
        return load_published(options.target)
    recipe = _recipe(options.target)
    assert recipe.geometry is not None
    dimension = recipe.dimension if options.dimension is None else options.dimension
    resolution = recipe.resolution if options.resolution is None else options.resolution
    return fit(solve(recipe.geometry, dimension, resolution), recipe)


def _recipe(target: str) -> Recipe:
    """A recipe as it is; a card as a recipe that names the device and nothing else."""
    from magfem.fitting import Recipe, load_recipe
    from magfem.geometry import load_geometry
    from magfem.geometry.card import read_table
    from magfem.geometry.catalogue import is_path, names

    if is_path(target, ".toml"):
        is_recipe = "device" in read_table(Path(target), target)
    else:
        is_recipe = target in names("fits", ".toml")
    return load_recipe(target) if is_recipe else Recipe(geometry=load_geometry(target))


def _text(model: FieldModel, path: Path) -> str:
    report = model.report
    if report["family"] == "published":
        rows = [
            ("parameters", str(report["parameters"])),
            ("region", model.region.describe()),
            ("stated bound", _errors(report["bound"])),
            ("its ground", report["ground"]),
            ("moment", moment_text(model.moment)),
            ("model", str(path)),
        ]
        return f"{model.name}: {report['label']}\n{listing(rows)}"
    rows = [
        ("parameters", f"{report['parameters']}, condition {report['condition']:.1e}"),
        ("region", model.region.describe()),
        ("held out", f"{_errors(report['heldout'])} (max), {report['heldout']['points']} points"),
        ("FEM's share", _errors(report["fem"])),
        ("stated bound", _errors(report["bound"])),
        ("moment", moment_text(model.moment)),
        ("model", str(path)),
    ]
    errors = [
        ("held-out errors", "parameters", "condition", "B max", "RMS", "gradient max", "RMS"),
        _row("this model", report, report["heldout"]),
    ]
    for other in report["comparison"]:
        errors.append(_row(f"{other['label']}, {other['window']}", other, other["heldout"]))
        if other["ours"] != report["heldout"]:
            errors.append(_row("this model there", report, other["ours"]))
    sources = sorted({other["source"] for other in report["comparison"]})
    heading = f"Next to {'; '.join(sources)}:" if sources else "Errors:"
    return f"{model.name}: {report['label']}\n{listing(rows)}\n\n{heading}\n{table(errors)}"


def _errors(errors: dict[str, Any]) -> str:
    """Two relative errors in words; each a number, or an object with its `max`."""
    B, gradient = (error["max"] if isinstance(error, dict) else error for error in (errors["B"], errors["gradient"]))
    return f"{B:.1e} in B, {gradient:.1e} in the gradient"


def _row(label: str, family: dict[str, Any], heldout: dict[str, Any]) -> tuple[str, ...]:
    errors = [f"{heldout[key][norm]:.1e}" for key in ("B", "gradient") for norm in ("max", "rms")]
    return (label, str(family["parameters"]), f"{family['condition']:.1e}", *errors)
