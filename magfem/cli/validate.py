"""`magfem validate`: is a model's stated bound kept?"""

from __future__ import annotations

import argparse
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, show_result, table
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.cli.samples import add_samples_options, is_samples, read_model_samples, refuse_samples_options
from magfem.errors import CardError, InputError
from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.fields import Field
    from magfem.fitting import FieldModel, Validation
    from magfem.geometry import Geometry
    from magfem.samples import Samples

_SHOWN = 3  # worst points of each quantity in the text; all are in the JSON


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "validate",
        run,
        "check a model's own error statement; exit code 1 when it is exceeded",
        "Compares a field model with a reference at random points of its region, none of them fitted, and\n"
        "checks that the errors stay within the bound that the model states. The reference is by default its\n"
        "device, solved anew by finite elements at twice the resolution, which tests the model's own finite\n"
        "elements as well as its fit; or the closed form (`exact`, which holds for recoil permeability 1), or\n"
        "another model, or measured samples. Models of measured or published data need one of the latter two.\n"
        "With -o, maps of the errors.",
        [
            "magfem validate ring.json",
            "magfem validate ring.json --against exact -o map.png",
            "magfem validate ring.json --against other.json --json",
            "magfem validate field.json --against samples.csv --sigma '0.1 mT'",
        ],
    )
    parser.add_argument("model", metavar="MODEL", help="field model: a name or a path")
    parser.add_argument(
        "--against", metavar="exact|fem|MODEL|SAMPLES.csv", help="the reference (default: fem, twice as fine)"
    )
    parser.add_argument("-o", "--output", metavar="MAP.png", help="a picture of the errors and where they are")
    samples = parser.add_argument_group("samples")
    add_samples_options(samples)
    samples.add_argument(
        "--aligned",
        action=argparse.BooleanOptionalAction,
        help="see the model through the sensor's alignment that its fit found (default: for the samples it was fitted "
        "to)",
    )


def run(options: Namespace) -> int:
    """Compare; 1 when the bound is exceeded."""
    picture = output_file(options.output, [".png"]) if options.output else None
    from magfem.fitting import load_model, validate
    from magfem.samples import Samples

    model = load_model(options.model)
    reference, name = _reference(model, options)
    aligned = options.aligned if isinstance(reference, Samples) else None
    result = validate(model, reference, name, aligned=aligned)
    text, data = _text(model, result), result.to_dict()
    if picture:
        from magfem.report.validation import write_validation

        write_validation(model, reference, result, picture)
        text += f"\nmap in {picture}"
        data["output"] = str(picture)
    show_result(options, text, data)
    return 0 if result.passed else 1


def _reference(model: FieldModel, options: Namespace) -> tuple[Field | Samples, str]:
    """What to hold the model against, and its name for people."""
    against, shown = options.against, options.model
    if against is None:
        _check_device(model, shown)
        against = "fem"
    if is_samples(against):
        return read_model_samples(against, options, "--against"), f"the samples {Path(against).name}"
    refuse_samples_options(options, "--against")
    if options.aligned is not None:
        raise InputError("--aligned is for samples: --against a file that ends in .csv or .txt")
    if against not in ("exact", "fem"):
        from magfem.fitting import load_model

        return load_model(against), f"the model {against}"
    geometry = _device(model, shown)
    field, name = (_closed_form(geometry), "the closed form") if against == "exact" else _solved(model, shown, geometry)
    factor = (model.report.get("scale") or {}).get("factor")
    if factor is None:
        return field, name
    return factor * field, f"{name}, times the {factor:.4g} that its measurements ask for"


def _check_device(model: FieldModel, shown: str) -> None:
    """Raise InputError for a model that no device's solution is the natural reference of."""
    if model.provenance.get("device") is None or "measurement" in model.report:
        what = "measured samples" if "measurement" in model.report else "no device"
        raise InputError(
            f"this model comes from {what}, so samples are needed to validate it: --against SAMPLES.csv, "
            f"or another model [{shown}]"
        )


def _solved(model: FieldModel, shown: str, geometry: Geometry) -> tuple[Field, str]:
    """The device solved anew, finer, and of a coil the circuit that the model is of."""
    from magfem.fem.coil_solution import CoilSolution
    from magfem.fem.solve import check_resolution, choose_dimension, resolutions, solve

    solver = model.provenance.get("solver") or {}
    if not isinstance(solver, dict):
        raise CardError("expected the settings of the model's solver", f"{shown}: provenance.solver")
    dimension = choose_dimension(geometry, solver.get("dimension"))
    own = solver.get("resolution", 1.0)
    check_resolution(own, geometry, dimension)
    resolution = min(2 * own, resolutions(geometry, dimension)[1])
    finer = "twice the" if resolution == 2 * own else f"{resolution / own:g} times the"
    where = "" if dimension is None else f"dimension {dimension}, "
    name = f"finite elements at {finer} resolution ({where}resolution {resolution:g})"
    circuit = model.provenance.get("circuit")
    if circuit is None and (several := [one.name for one in getattr(geometry, "circuits", ())][1:]):
        raise CardError(
            f"the model does not say which circuit of {geometry.name} it is of, which has {len(several) + 1}: fit it "
            "again, or validate it against another model",
            f"{shown}: provenance.circuit",
        )
    solution = solve(geometry, dimension, resolution, conduction=solver.get("conduction"))
    if circuit is None or not isinstance(solution, CoilSolution):
        return solution, name
    return solution.circuit(circuit), name if len(solution.circuits) == 1 else f"{name}, circuit {circuit}"


def _device(model: FieldModel, shown: str) -> Geometry:
    """The device that the model was fitted to, from the card that it carries."""
    from magfem.geometry import geometry_from_text

    try:
        card = model.provenance["device"]["card"]
        text, path = card["text"], card["path"]
    except (KeyError, TypeError):
        raise CardError(
            "the model does not carry its device's card: validate it against samples or another model",
            f"{shown}: provenance.device.card",
        ) from None
    return geometry_from_text(text, path)


def _closed_form(geometry: Geometry) -> Field:
    from magfem.closed_form import exact

    for body in getattr(geometry, "bodies", ()):
        recoil = body.material.recoil_permeability
        if recoil != 1.0:
            raise InputError(
                f"the closed form holds for recoil permeability 1, this device has {recoil:g}: "
                "validate against fem, or fit the device with recoil_permeability = 1.0 in its card"
            )
    return exact(geometry)


def _text(model: FieldModel, result: Validation) -> str:
    """The error table, the worst places, the errors from near to far, the verdict."""
    count = f"{result.points} {'samples' if result.found['gradient'] is None else 'points'}"
    lines = [f"{model.name} against {result.reference}, {count}"]
    if result.outside:
        lines.append(f"{result.outside} samples lie outside the model's region and are left out")
    if result.aligned:
        lines.append("the model is seen through the sensor's alignment and background that its fit found")
    rows = [("relative error", "max", "RMS", "stated bound")]
    for key, found in result.found.items():
        errors = ("not measured", "") if found is None else (f"{found['max']:.1e}", f"{found['rms']:.1e}")
        rows.append((key, *errors, f"{result.bound[key]:.1e}"))
    lines.append(table(rows))
    if result.found["gradient"] is None:
        lines.append(listing(_sample_rows(result)))
    places = [("worst places", "error", "at", f"from {result.distance_from}")]
    for key, worst in result.worst_points.items():
        for one in (worst or [])[:_SHOWN]:
            x, y, z = (f"{1e3 * coordinate + 0.0:.3f}" for coordinate in one["point"])
            places.append((key, f"{one['error']:.1e}", f"({x}, {y}, {z}) mm", f"{1e3 * one['distance']:.3f} mm"))
    lines += [table(places), table(_distance_rows(result)), listing(_physics_rows(result)), _verdict(result)]
    return "\n".join(lines)


def _sample_rows(result: Validation) -> list[tuple[str, str]]:
    B = result.found["B"]
    per_ampere = "/A" if result.unit == "T/A" else ""
    largest, rms = (format_quantity(B[key], "flux density") for key in ("absolute_max", "absolute_rms"))
    rows = [("residual", f"{largest}{per_ampere} max, {rms}{per_ampere} RMS")]
    if "standardised" in B:
        rows.append(("in standard deviations", f"{B['standardised']:.3g} RMS of all components, 1 if noise is all"))
        rows.append(("beyond the noise", f"{B['beyond_noise']:.1e} of B at most: this is judged"))
    return rows


def _distance_rows(result: Validation) -> list[tuple[str, ...]]:
    """Errors against distance."""
    keys = [key for key, groups in result.by_distance.items() if groups]
    rows: list[tuple[str, ...]] = [
        (f"from {result.distance_from}", *(f"{key} {norm}" for key in keys for norm in ("max", "RMS")))
    ]
    for groups in zip(*(result.by_distance[key] for key in keys), strict=True):
        errors = [f"{group[norm]:.1e}" for group in groups for norm in ("max", "rms")]
        rows.append((f"{1e3 * groups[0]['distance']:.3f} mm", *errors))
    return rows


def _physics_rows(result: Validation) -> list[tuple[str, str]]:
    return [("|∇·B| and |∇×B|", f"{result.divergence:.1e} and {result.curl:.1e} of |∇B| at most")]


def _verdict(result: Validation) -> str:
    if result.passed:
        return "the stated bound is kept"
    exceeded: list[Any] = [
        key
        for key, found in result.found.items()
        if found is not None and found.get("beyond_noise", found["max"]) > result.bound[key]
    ]
    return f"the stated bound is EXCEEDED for {' and '.join(exceeded)}"
