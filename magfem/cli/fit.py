"""`magfem fit`: a field model of a device, or of measured samples."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, moment_text, show_result, table
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine, add_dimension, add_resolution
from magfem.cli.samples import (
    add_samples_options,
    columns_and_sigma,
    is_samples,
    read_any_samples,
    refuse_samples_options,
)
from magfem.units import format_quantity, quoted

if TYPE_CHECKING:
    from magfem.fitting import FieldModel, Recipe


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "fit",
        run,
        "a field model, with errors on held-out points",
        "Solves a device, fits a field model to the solution and writes the model file; or fits one to measured\n"
        "samples. The table holds the model's relative errors at points that the fit has not seen, next to those of\n"
        "the dissertation's families on the same data. A name is a fit recipe if there is one, else a device card.\n"
        "Samples of a coil system (px,py,pz,i0,...,bx,by,bz) make a system file: every coil per ampere, background,\n"
        "linearity, saturation. What else a fit of samples can do (bounds, robust loss, weights) is for recipes.",
        [
            "magfem fit ring_magnet_4x1.5x1",
            "magfem fit ./my_recipe.toml -o mine.json",
            "magfem fit system.csv -o system.json --sigma '50 uT'",
            "magfem fit scan.csv --device disc_magnet_8x2 --column x=-magnet_x_mm --column 'y==0 mm' -o scan.json",
        ],
    )
    parser.add_argument("target", metavar="CARD|RECIPE|SAMPLES.csv", help="device card, fit recipe or samples")
    parser.add_argument("-o", "--output", metavar="MODEL.json", help="the model (default: its name, here)")
    add_dimension(parser, None, "the recipe's, or 2 if possible")
    add_resolution(parser, None, "the recipe's, or 1")
    parser.add_argument("--circuit", metavar="NAME", help="of a coil with several circuits")
    parser.add_argument("--family", metavar="NAME", help='of models, or "search" (default: what suits the device)')
    samples = parser.add_argument_group("samples")
    samples.add_argument("--device", metavar="CARD", help="whose samples they are; not for coil systems")
    add_samples_options(samples)
    samples.add_argument("--free", metavar="NAME", action="append", help="centre, tilt, turn, offsets, gain, ...")
    samples.add_argument("--background", action="store_true", help="find a static field as well")


def run(options: Namespace) -> int:
    """Solve or read, fit, write, print the errors."""
    if is_samples(options.target):
        from magfem.samples import SystemSamples

        samples = read_any_samples(options.target, options)
        if isinstance(samples, SystemSamples):
            from magfem.cli.fit_system import fit_system

            return fit_system(samples, options)
    name = Path(options.target).name.removesuffix(".toml").removesuffix(".csv")
    path = output_file(options.output or f"{name}.json", [".json"])
    from magfem.fitting import model_from_recipe

    recipe = _recipe(options)
    model = model_from_recipe(recipe, options.dimension, options.resolution)
    model.save(path)
    content = model.to_dict()
    data = {key: content[key] for key in ("name", "unit", "region", "report", "provenance")}
    show_result(options, _text(model, path), {"output": str(path), "moment": model.moment, **data})
    return 0


def _recipe(options: Namespace) -> Recipe | str | Path:
    """A recipe's name or path as it is; a card or samples as a recipe that says just that."""
    from magfem.fitting import Recipe
    from magfem.geometry import load_geometry
    from magfem.geometry.card import read_table
    from magfem.geometry.catalogue import is_path, names

    target, choices = options.target, {"circuit": options.circuit, "family": options.family}
    if is_samples(target):
        return _samples_recipe(options)
    refuse_samples_options(options, f"target, got {quoted(target)}", "device", "free", "background")
    if is_path(target, ".toml"):
        is_recipe = "kind" not in read_table(Path(target), target)
    else:
        is_recipe = target in names("fits", ".toml")
    if not is_recipe:
        return Recipe(geometry=load_geometry(target), **choices)
    recipe = Path(target) if is_path(target, ".toml") else target
    given: dict[str, Any] = {key: value for key, value in choices.items() if value}
    if not given:
        return recipe
    from magfem.fitting import load_recipe

    loaded = load_recipe(recipe)
    if options.family and options.family != loaded.suiting_family:  # options are those of the recipe's own family
        given["options"] = {}
    return replace(loaded, **given)


def _samples_recipe(options: Namespace) -> Recipe:
    from magfem.fitting.recipe import Recipe, SamplesFile
    from magfem.geometry import load_geometry

    return Recipe(
        geometry=load_geometry(options.device) if options.device else None,
        family=options.family,
        circuit=options.circuit,
        samples=SamplesFile(Path(options.target), *columns_and_sigma(options)),
        free=dict.fromkeys(options.free or []),
        background=options.background,
    )


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
        *(_measured_rows(report) if "measurement" in report else [("FEM's share", _errors(report["fem"]))]),
        ("stated bound", _errors(report["bound"])),
        *(_scale_rows(report["scale"]) if "scale" in report else []),
        *([("moment", moment_text(model.moment))] if model.moment.any() else []),
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


def _scale_rows(scale: dict[str, Any]) -> list[tuple[str, str]]:
    """The factor that single readings ask for."""
    implied = ", ".join(f"{value:.4g}" for value in scale["implied"])
    rows = [("scale", f"{scale['factor']:.5g} ± {scale['deviation']:.2g}, the readings imply {implied}")]
    if (scale["standardised_residual"] or 0.0) > 2.0:
        rows.append(("", "the readings disagree by more than their uncertainties: distances or a background are off"))
    return rows


def _measured_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """What a fit of samples found besides the model."""
    from magfem.fitting.found_parameters import found_parameters

    uncertainty, heldout = report["uncertainty"], report["heldout"]["B"]
    residual = format_quantity(heldout["absolute_rms"], "flux density")
    noise, beyond = (format_quantity(uncertainty[key], "flux density") for key in ("noise", "model_error"))
    rows = [
        ("residual", f"{residual} RMS of held-out {report['held_out']}"),
        ("noise", f"{noise} by {uncertainty['noise_from']}, beyond it {beyond}"),
    ]
    if uncertainty["bias_dominates"]:
        rows.append(("", "the model's own error is larger than the noise: deviations say too little"))
    if not uncertainty["told_apart"]:
        rows.append(("", "noise and the model's own error are not told apart: state sigma, and look at the residuals"))
    for name, value, note in found_parameters(report["measurement"]):
        rows.append((name, f"{value}, {note}" if note else value))
    return rows


def _row(label: str, family: dict[str, Any], heldout: dict[str, Any]) -> tuple[str, ...]:
    errors = [f"{heldout[key][norm]:.1e}" for key in ("B", "gradient") for norm in ("max", "rms")]
    return (label, str(family["parameters"]), f"{family['condition']:.1e}", *errors)
