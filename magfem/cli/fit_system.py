"""`magfem fit` on samples of a coil system: a system file."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, show_result, table
from magfem.cli.outputs import output_file
from magfem.errors import InputError
from magfem.units import format_quantity, quoted

if TYPE_CHECKING:
    from magfem.actuation import Calibration
    from magfem.samples import SystemSamples

_DEVICES = ("device", "circuit", "family", "dimension", "resolution", "free")


def fit_system(samples: SystemSamples, options: Namespace) -> int:
    """Calibrate, write, print what was found."""
    for option in _DEVICES:
        if getattr(options, option) is not None:
            raise InputError(f"--{option} is for single devices, and {quoted(options.target)} is of a coil system")
    path = output_file(options.output or f"{Path(options.target).stem}.json", [".json"])
    from magfem.actuation import calibrate
    from magfem.actuation.system_file import system_to_dict

    calibration = calibrate(samples)
    calibration.system.save(path)
    content = system_to_dict(calibration.system)
    data = {key: content[key] for key in ("name", "background", "workspace", "report", "provenance")}
    show_result(options, _text(calibration, path), {"output": str(path), **data})
    return 0


def _text(calibration: Calibration, path: Path) -> str:
    report, system = calibration.report, calibration.system
    heldout, uncertainty = report["heldout"]["B"], report["uncertainty"]
    residual, worst = (_field(heldout[key]) for key in ("absolute_rms", "absolute_max"))
    rows = [
        ("parameters", f"{report['parameters']}, condition {report['condition']:.1e}"),
        ("workspace", system.workspace.describe()),
        ("held out", f"{residual} RMS, {worst} max, of {report['rows']} rows at {report['positions']} positions"),
        (
            "noise",
            f"{_field(uncertainty['noise'])} by {uncertainty['noise_from']}, beyond it "
            f"{_field(uncertainty['model_error'])}",
        ),
    ]
    if uncertainty["bias_dominates"]:
        rows.append(("", "the model's own error is larger than the noise: deviations say too little"))
    rows += [
        ("background", _background(report["background"])),
        ("linearity", _linearity(report["linearity"])),
        ("saturation", _saturation(report["saturation"])),
        ("stated bound", f"{_field(report['bound']['absolute'])}, {report['bound']['B']:.1e} of |B|"),
        ("system", str(path)),
    ]
    coils = [("coil", "field at the centre per A", "±", "driven up to", "cubic loss there", "±", "linear to 1 % up to")]
    for coil, loss in zip(report["coils"], report["saturation"]["coils"], strict=True):
        known = loss["loss"] is not None
        coils.append(
            (
                coil["name"],
                _vector(coil["field_per_ampere"]),
                _field(max(coil["deviation"])),
                _current(coil["largest_current"]),
                f"{loss['loss']:.2%}" if known else "cannot be told",
                f"{loss['deviation']:.2%}" if known else "",
                _current(loss["linear_up_to"]) if known else "",
            )
        )
    return f"{system.name}: {report['label']}\n{listing(rows)}\n\n{table(coils)}"


def _background(found: dict[str, Any] | None) -> str:
    if found is None:
        return "none asked for"
    deviation = f"{_vector(found['centre'])} at the centre, ± {_field(max(found['deviation']))}"
    return deviation if found["significant"] else f"{deviation}: none that shows"


def _linearity(found: dict[str, Any]) -> str:
    text = f"{_field(found['rms'])} RMS, {_field(found['max'])} max, {found['relative_rms']:.1e} of |B| RMS"
    text += f", from {found['from']}"
    if found["noise"] is None:
        return f"{text}; noise is in it"
    verdict = f"{_field(found['beyond_noise'])} more than noise" if found["significant"] else "no more than noise"
    return f"{text}; {verdict}"


def _saturation(found: dict[str, Any]) -> str:
    if found["saturates"]:
        return f"{', '.join(found['saturates'])}"
    if all(coil["loss"] is None for coil in found["coils"]):
        return "cannot be told: vary the size of the currents"
    return "none that shows"


def _vector(components: list[float]) -> str:
    """Three flux densities in one unit."""
    largest = format_quantity(max(map(abs, components)), "flux density")
    number, unit = largest.split(" ")
    scale = float(number) / max(map(abs, components)) if any(components) else 1.0
    return f"({', '.join(f'{scale * one:.4g}' for one in components)}) {unit}"


def _field(value: float) -> str:
    return format_quantity(float(f"{value:.3g}"), "flux density")


def _current(value: float) -> str:
    return format_quantity(float(f"{value:.4g}"), "current")
