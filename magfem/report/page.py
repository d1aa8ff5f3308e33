"""The report page: what the template is given, and the template filled in."""

from __future__ import annotations

import json
import logging
from typing import Any

import numpy as np

from magfem.fields import Shell
from magfem.fields.region import SampledRegion
from magfem.fields.region_parts import bounding_box
from magfem.fitting import FieldModel, validate
from magfem.fitting.found_parameters import found_parameters
from magfem.fitting.located_errors import middle
from magfem.geometry import Coil, Magnets, PermanentMagnet, describe
from magfem.report import measured, numbers
from magfem.report.coil_page import coil_facts
from magfem.report.environment import environment
from magfem.report.pictures import draw
from magfem.report.subject import Subject
from magfem.units import format_quantity

log = logging.getLogger("magfem")

TEMPLATE = "page.html.j2"

_MAYBE: dict[str, Any] = {
    **dict.fromkeys(("condition", "fem", "ground", "held_out", "objective", "scale")),
    **dict.fromkeys(("candidates", "comparison"), ()),
    "label": "fitted sources",
    "parameters": "",
}
"""What not every report of a model has."""

_ORIGINS: dict[str, Any] = {
    **dict.fromkeys(("circuit", "date", "device", "recipe", "samples", "solution", "solver")),
    "source": "unknown",
    "versions": {},
}
"""What not every provenance has."""


def render(subject: Subject) -> str:
    """The whole page as HTML; nothing in it is loaded from outside."""
    pictures = draw(subject)
    log.info("report: page")
    return environment().get_template(TEMPLATE).render(context(subject), pictures=pictures)


def context(subject: Subject) -> dict[str, Any]:
    """What the template reads, but for the pictures."""
    model = subject.model
    per_ampere = "/A" if model.unit == "T/A" else ""
    report = {**_MAYBE, **model.report}
    return {
        "title": subject.title,
        "subject": subject,
        "model": model,
        "report": report,
        "errors_of": {key: report.get(key) for key in ("training", "heldout")},
        "provenance": {**_ORIGINS, **model.provenance},
        "device": _device(subject),
        "unit": model.unit,
        "per_ampere": per_ampere,
        "moment": _moment(model),
        "middle": _middle(model),
        "range": _field_range(model),
        "worst": _worst(model),
        "evidence": _evidence(model),
        "coil": _coil_evidence(model),
        "rows": _coefficient_rows(model),
        "found": report.get("measurement"),
        "found_parameters": found_parameters(report["measurement"]) if report.get("measurement") else [],
        "uncertainty": report.get("uncertainty"),
        "judged": _judged(subject),
        "measured": _measured(subject),
        "settings": json.dumps(model.provenance.get("solver"), ensure_ascii=False),
        "python": _python(subject),
        "factor": _factor(model),
    }


def _device(subject: Subject) -> dict[str, Any] | None:
    """Facts of the device by their names."""
    geometry = subject.geometry
    if geometry is None:
        return None
    if isinstance(geometry, Coil):
        facts = coil_facts(geometry)["facts"]
        if (circuit := subject.model.provenance.get("circuit")) is not None:
            facts = [*facts, ("circuit", circuit)]
    else:
        assert isinstance(geometry, Magnets)
        facts = _magnet_facts(geometry)
    return {
        "kind": geometry.kind.replace("_", " "),
        "card": describe(geometry)["card"]["path"],
        "source": geometry.source,
        "facts": facts,
    }


def _magnet_facts(geometry: Magnets) -> list[tuple[str, str]]:
    facts = [(key.replace("_", " "), numbers.size(getattr(geometry, key), 6)) for key in geometry.dimensions]
    facts.append(("volume", f"{numbers.number(geometry.volume * 1e9)} mm³"))
    for material, names in _materials(geometry).items():
        prefix = f"{names}: " if len(geometry.bodies) > 1 else ""
        facts += [
            (f"{prefix}remanence", format_quantity(material.remanence, "flux density")),
            (f"{prefix}recoil permeability", f"{material.recoil_permeability:g}"),
            (f"{prefix}magnetisation", numbers.direction(material.magnetisation)),
        ]
    return facts


def _materials(geometry: Magnets) -> dict[PermanentMagnet, str]:
    """The names of the bodies of every material."""
    found: dict[PermanentMagnet, list[str]] = {}
    for body in geometry.bodies:
        found.setdefault(body.material, []).append(body.name)
    return {material: ", ".join(names) for material, names in found.items()}


def _moment(model: FieldModel) -> float | None:
    """Size of the dipole moment, A·m² or per ampere; None for fields whose sources lie outside the region."""
    size = float(np.linalg.norm(model.moment))
    return size if size > 0 and isinstance(model.region, Shell) else None


def _middle(model: FieldModel) -> dict[str, float] | None:
    """|B| and the size of its gradient in the middle of a workspace."""
    if isinstance(model.region, Shell):
        return None
    B, gradient = model.jet(middle(model.region), 1, outside="extrapolate")
    return {"B": float(np.linalg.norm(B)), "gradient": float(np.linalg.norm(gradient))}


def _field_range(model: FieldModel) -> dict[str, Any]:
    """Largest |B| at a shell's two limits; in a workspace its smallest and largest value."""
    region = model.region
    if not isinstance(region, Shell):
        size = np.linalg.norm(model.B(region.layers(np.random.default_rng(4)), outside="extrapolate"), axis=-1)
        return {"shell": False, "near": float(size.max()), "far": float(size.min())}
    if region.windowed:
        points = region.layers(np.random.default_rng(4))[[0, -1]]
    else:
        limits = np.array([region.clearance, region.extent])
        points = region.hull.offset_points(limits, 600, np.random.default_rng(4))
    near, far = np.linalg.norm(model.B(points, outside="extrapolate"), axis=-1).max(axis=1)
    return {"shell": True, "near": float(near), "far": float(far)}


def _worst(model: FieldModel) -> list[dict[str, Any]]:
    """The worst held-out points that the report names, by words."""
    worst = model.report.get("worst") or {}
    words = {"B": "B", "gradient": "the gradient"}
    return [{"what": words[key], **worst[key]} for key in words if worst.get(key)]


def _evidence(model: FieldModel) -> dict[str, Any] | None:
    """Numbers of the finite-element solution of magnets behind the model."""
    solution = model.provenance.get("solution")
    if not solution or "boundary_moment" not in (solution.get("quantities") or {}):
        return None
    moment, boundary = (np.array(solution["quantities"][key]) for key in ("moment", "boundary_moment"))
    difference = np.linalg.norm(moment - boundary) / np.linalg.norm(moment)
    return {**solution, "moments_apart": float(difference), "moment_size": float(np.linalg.norm(moment))}


def _coil_evidence(model: FieldModel) -> dict[str, Any] | None:
    """Numbers of the solution of a coil behind the model."""
    solution = model.provenance.get("solution")
    return solution if model.unit == "T/A" and solution else None


_ONE = {"loop": "loop", "path": "closed path", "charge_disc": "disc of magnetic charge"}


def _coefficient_rows(model: FieldModel) -> list[dict[str, Any]]:
    """One row for every coefficient of the model."""
    rows = []
    for number, term in enumerate(model.terms, 1):
        place = {
            "number": number,
            "centre": term["centre"],
            "direction": term["direction"],
            "radius": term.get("radius"),
        }
        kind = term["kind"]
        if kind in _ONE:
            nodes = f", {len(term['nodes'])} nodes" if kind == "path" else ""
            unit = "T" if kind == "charge_disc" else "A"
            rows.append({**place, "what": _ONE[kind] + nodes, "value": term["coefficients"][0], "unit": unit})
            continue
        orders = term.get("orders", [0] * len(term["degrees"]))
        prefix = "" if kind == "harmonics" else f"{kind} "
        for degree, order, part, value in zip(
            term["degrees"], orders, term["parts"], term["coefficients"], strict=True
        ):
            what = f"{prefix}degree {degree}, order {order} {part}"
            rows.append({**place, "what": what, "value": value, "unit": "T"})
    return rows


def _judged(subject: Subject) -> dict[str, Any] | None:
    """The model against the samples that the report was given."""
    if subject.samples is None:
        return None
    return validate(subject.model, subject.samples, subject.samples.source).to_dict()


def _measured(subject: Subject) -> dict[str, Any] | None:
    """Measurements beside predictions, for a device of one magnet."""
    if not subject.measurements or not isinstance(subject.geometry, Magnets):
        return None
    nominal = subject.geometry.bodies[0].material.remanence
    compared = measured.compare(subject.measurements, subject.truth or subject.model, nominal)
    return {
        "rows": compared,
        "nominal": nominal,
        "mean": float(np.mean([one.remanence for one in compared])),
        "reading": measured.reading(compared, nominal),
    }


def _factor(model: FieldModel) -> dict[str, int] | None:
    """How many times smaller this model's largest errors are than those of every other family, at least."""
    entries = model.report.get("comparison")
    if not entries:
        return None
    factor = {
        key: numbers.rounded_down(min(entry["heldout"][key]["max"] / entry["ours"][key]["max"] for entry in entries))
        for key in ("B", "gradient")
    }
    return factor if min(factor.values()) >= 2 else None


def _python(subject: Subject) -> str:
    """Five lines that load and evaluate the model, comments aligned."""
    usage = json.dumps(subject.usage, ensure_ascii=False)
    if subject.is_model:
        get = [(f"model = magfem.load_model({usage})", "")]
    else:
        get = [
            (f"solution = magfem.solve(magfem.load_geometry({usage}))", ""),
            ("model = magfem.fit(solution)", 'model.save("model.json") keeps it'),
        ]
    lines = [
        ("import magfem", ""),
        *get,
        (
            f"B, gradient = model.jet({_inside(subject.model.region)})",
            f"m in; {subject.model.unit} and {_gradient_unit(subject.model)} out",
        ),
        ('B = model.B([[0, 0, 1]], outside="nan")', 'outside the region: "raise", "nan", "extrapolate"'),
    ]
    column = max(len(code) for code, comment in lines if comment) + 2
    return "\n".join(f"{code:{column}}# {comment}" if comment else code for code, comment in lines)


def _gradient_unit(model: FieldModel) -> str:
    return "T/m/A" if model.unit == "T/A" else "T/m"


def _inside(region: SampledRegion) -> str:
    """A point of the region, as Python writes it: on the z axis if it meets it, in whole millimetres if possible."""
    low, high = bounding_box(region)
    height = np.linspace(max(float(low[2]), 0.0) if isinstance(region, Shell) else float(low[2]), float(high[2]), 20001)
    height = height[region.contains(np.stack([0 * height, 0 * height, height], axis=-1))]
    if height.size < 2:
        point = middle(region)
        if not region.contains(point):
            point = region.layers(np.random.default_rng(4))[0, 0]
        return "[" + ", ".join(f"{value + 0.0:.4g}" for value in point) + "]"
    whole = np.ceil(height[0] * 1e3 + 1e-9) * 1e-3
    chosen = whole if whole < height[-1] else (height[0] + height[-1]) / 2
    return f"[0, 0, {chosen + 0.0:.3g}]"
