"""The tables and the figure of docs/field-models.md: `python benchmarks/field_models.py`.

Every committed model is held against its device, solved anew at twice the resolution (the rigid ring against its closed
form), at points that no fit has seen; the dissertation's families beside ours, and its published ring fits. The figure
goes to docs/figures, or to the folder after `--figures`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from published_ring_fits import published_ring_fits
from tables import show

import magfem
from magfem.fem import CoilSolution
from magfem.fields import Field, Shell
from magfem.fields.norms import relative_errors
from magfem.fields.terms import Terms
from magfem.fitting import FieldModel
from magfem.fitting.recipe_file import load_recipe
from magfem.report.figures.style import BLUE, GREY, INK, ORANGE, drawing, figure

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
SEED = 77
PAIRS = (
    ("ring magnet, all round", "ring_magnet_4x1.5x1"),
    ("ring magnet, front window", "ring_magnet_4x1.5x1_front"),
    ("ring magnet, side window", "ring_magnet_4x1.5x1_side"),
    ("rotor", "rotor_1x3"),
    ("planar coil, from 0.2 mm", "planar_coil_12mm_above"),
    ("planar coil, from 1 mm", "planar_coil_12mm_from_1mm"),
    ("stator, inner coil", "stator_1.6x5.5_inner"),
    ("stator, outer coil", "stator_1.6x5.5_outer"),
    ("air-core solenoid, in front", "solenoid_24x48x60_front"),
    ("air-core solenoid, all round", "solenoid_24x48x60"),
)


@dataclass(frozen=True)
class Judged:
    """Largest and root-mean-square relative errors of B and gradient; microseconds for both at one of many points."""

    B: tuple[float, float]
    gradient: tuple[float, float]
    time: float


@cache
def solved(device: str) -> Field:
    """The device's field: closed form for the rigid ring, else finite elements twice as fine as the fits'."""
    geometry = magfem.load_geometry(device)
    if device.endswith("_rigid"):
        return magfem.exact(geometry)
    return magfem.solve(geometry, resolution=2.0)


def truth(name: str) -> Field:
    """What a recipe's model should be."""
    recipe = load_recipe(name)
    assert recipe.geometry is not None and recipe.geometry.origin is not None
    field = solved(Path(recipe.geometry.origin.path).stem)
    return field.circuit(recipe.circuit) if isinstance(field, CoilSolution) and recipe.circuit else field


def judge(terms: Terms, region: Shell, field: Field) -> Judged:
    """Errors at 64 × 36 fresh points of the region, and at 15 × 36 more on its near side."""
    points = region.layers(np.random.default_rng(SEED), 64, 36, 15)
    found, real = (source.jet(points.reshape(-1, 3), 1) for source in (terms, field))
    errors = []
    for ours, theirs in zip(found, real, strict=True):
        shape = (*points.shape[:2], *theirs.shape[1:])
        size = relative_errors(ours.reshape(shape), theirs.reshape(shape))
        errors.append((float(size.max()), float(np.sqrt(np.mean(size[:64] ** 2)))))
    many = np.concatenate([points.reshape(-1, 3)] * 2)
    started = perf_counter()
    terms.jet(many, 1)
    return Judged(errors[0], errors[1], 1e6 * (perf_counter() - started) / len(many))


def row(label: str, what: str, numbers: object, condition: object, judged: Judged) -> list[str]:
    errors = [f"{100 * value:.2g} %" for pair in (judged.B, judged.gradient) for value in pair]
    return [label, what, str(numbers), str(condition), *errors, f"{judged.time:.2g} µs"]


def of_model(label: str, name: str, field: Field) -> tuple[list[str], Judged, FieldModel]:
    model = magfem.load_model(name)
    assert isinstance(model.region, Shell)
    judged = judge(model.lowered, model.region, field)
    report: dict[str, Any] = model.report
    return row(label, report["label"], report["parameters"], f"{report['condition']:.0e}", judged), judged, model


def draw(pairs: list[tuple[str, Judged, Judged | None, Judged | None]]) -> None:
    """Every device's errors of B: ours, the dissertation's family refitted, and as published."""
    folder = Path(sys.argv[sys.argv.index("--figures") + 1]) if "--figures" in sys.argv else FIGURES
    with drawing():
        sheet = figure(3.4, 7.4)
        axes = sheet.subplots()
        for place, (_, ours, theirs, printed) in enumerate(reversed(pairs)):
            known = [one.B[0] for one in (ours, theirs, printed) if one is not None]
            axes.plot([min(known), max(known)], [place, place], color=GREY, linewidth=1, zorder=1)
            for one, colour, marker in ((ours, BLUE, "o"), (theirs, ORANGE, "s"), (printed, INK, "x")):
                if one is not None:
                    axes.plot(one.B[0], place, marker, color=colour, markersize=6, zorder=2)
        axes.set_yticks(range(len(pairs)), [label for label, *_ in reversed(pairs)])
        axes.set_xscale("log")
        axes.set_xlabel("largest relative error of B in the region")
        axes.xaxis.grid(True, color="#e6e6e6")
        axes.set_axisbelow(True)
        labels = (("magfem", BLUE, "o"), ("dissertation's family, refitted", ORANGE, "s"), ("as published", INK, "x"))
        for label, colour, marker in labels:
            axes.plot([], [], marker, color=colour, markersize=6, label=label)
        axes.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=3, frameon=False)
        sheet.savefig(folder / "field_models.png", dpi=150)


def main() -> None:
    rows: list[list[str]] = []
    drawn: list[tuple[str, Judged, Judged | None, Judged | None]] = []
    for label, name in PAIRS:
        field = truth(name)
        own, ours, model = of_model(label, name, field)
        rows.append(own)
        theirs = printed = None
        if f"{name}_dissertation" in magfem_models():
            beside, theirs, _ = of_model("", f"{name}_dissertation", field)
            rows.append([beside[0], f"dissertation: {beside[1]}", *beside[2:]])
        window = name.rpartition("_")[2]
        if window in ("front", "side") and name.startswith("ring"):
            terms, _ = published_ring_fits()[window]
            assert isinstance(model.region, Shell)
            printed = judge(terms, model.region, field)
            rows.append(row("", "dissertation, as published", terms.coefficient.size, "–", printed))
        drawn.append((label, ours, theirs, printed))
    header = [
        "device, region",
        "terms",
        "numbers",
        "condition",
        "B max",
        "B RMS",
        "gradient max",
        "gradient RMS",
        "time",
    ]
    show("Field models on held-out points", header, rows)
    draw(drawn)


@cache
def magfem_models() -> tuple[str, ...]:
    from magfem.geometry.catalogue import names

    return names("fits", ".json")


if __name__ == "__main__":
    main()
