"""`magfem validate`: is a model's stated bound kept?"""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from magfem.cli.console import show_result, table
from magfem.cli.parser import CommandLine
from magfem.errors import CardError, InputError

if TYPE_CHECKING:
    from magfem.fields import Field
    from magfem.fitting import FieldModel, Validation
    from magfem.geometry import Geometry


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
        "another model.",
        [
            "magfem validate ring.json",
            "magfem validate ring.json --against exact",
            "magfem validate ring.json --against other.json --json",
        ],
    )
    parser.add_argument("model", metavar="MODEL", help="field model: a name or a path")
    parser.add_argument(
        "--against", default="fem", metavar="exact|fem|MODEL", help="the reference (default: fem, twice as fine)"
    )


def run(options: Namespace) -> int:
    """Compare; 1 when the bound is exceeded."""
    from magfem.fitting import load_model, validate

    model = load_model(options.model)
    reference, name = _reference(model, options.model, options.against)
    result = validate(model, reference, name)
    show_result(options, _text(model, result), result.to_dict())
    return 0 if result.passed else 1


def _reference(model: FieldModel, shown: str, against: str) -> tuple[Field, str]:
    """The field to hold the model against, and its name for people."""
    if against not in ("exact", "fem"):
        from magfem.fitting import load_model

        return load_model(against), f"the model {against}"
    geometry = _device(model, shown)
    if against == "exact":
        return _closed_form(geometry), "the closed form"
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
    return solve(geometry, dimension, resolution), name


def _device(model: FieldModel, shown: str) -> Geometry:
    """The device that the model was fitted to, from the card that it carries."""
    from magfem.geometry import geometry_from_text

    try:
        card = model.provenance["device"]["card"]
        text, path = card["text"], card["path"]
    except (KeyError, TypeError):
        raise CardError(
            "the model does not carry its device's card: validate it against another model",
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
    rows = [("relative error", "max", "RMS", "stated bound", "worst at", "from the hull")]
    for key in ("B", "gradient"):
        found, worst = result.found[key], result.worst[key]
        x, y, z = (coordinate * 1e3 for coordinate in worst["point"])
        rows.append(
            (
                key,
                f"{found['max']:.1e}",
                f"{found['rms']:.1e}",
                f"{result.bound[key]:.1e}",
                f"({x:.3f}, {y:.3f}, {z:.3f}) mm",
                f"{worst['distance'] * 1e3:.3f} mm",
            )
        )
    verdict = "the stated bound is kept" if result.passed else "the stated bound is EXCEEDED"
    heading = f"{model.name} against {result.reference}, {result.points} points"
    return f"{heading}\n{table(rows)}\n{verdict}"
