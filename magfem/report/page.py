"""The report page: what the template is given, and the template filled in."""

from __future__ import annotations

import json
import logging
from typing import Any

import numpy as np

from magfem.fields import Shell
from magfem.fitting import FieldModel
from magfem.geometry import Magnets, PermanentMagnet, describe
from magfem.report import measured, numbers
from magfem.report.environment import environment
from magfem.report.pictures import draw
from magfem.report.subject import Subject
from magfem.units import format_quantity

log = logging.getLogger("magfem")

TEMPLATE = "page.html.j2"


def render(subject: Subject) -> str:
    """The whole page as HTML; nothing in it is loaded from outside."""
    pictures = draw(subject)
    log.info("report: page")
    return environment().get_template(TEMPLATE).render(context(subject), pictures=pictures)


def context(subject: Subject) -> dict[str, Any]:
    """What the template reads, but for the pictures."""
    model = subject.model
    return {
        "subject": subject,
        "model": model,
        "report": model.report,
        "provenance": model.provenance,
        "device": _device(subject),
        "moment": float(np.linalg.norm(model.moment)),
        "range": _field_range(model),
        "evidence": _evidence(model),
        "rows": _coefficient_rows(model),
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
    facts = [(key.replace("_", " "), numbers.size(getattr(geometry, key), 6)) for key in geometry.dimensions]
    facts.append(("volume", f"{numbers.number(geometry.volume * 1e9)} mm³"))
    for material, names in _materials(geometry).items():
        prefix = f"{names}: " if len(geometry.bodies) > 1 else ""
        facts += [
            (f"{prefix}remanence", format_quantity(material.remanence, "flux density")),
            (f"{prefix}recoil permeability", f"{material.recoil_permeability:g}"),
            (f"{prefix}magnetisation", numbers.direction(material.magnetisation)),
        ]
    return {
        "kind": geometry.kind.replace("_", " "),
        "card": describe(geometry)["card"]["path"],
        "source": geometry.source,
        "facts": facts,
    }


def _materials(geometry: Magnets) -> dict[PermanentMagnet, str]:
    """The names of the bodies of every material."""
    found: dict[PermanentMagnet, list[str]] = {}
    for body in geometry.bodies:
        found.setdefault(body.material, []).append(body.name)
    return {material: ", ".join(names) for material, names in found.items()}


def _field_range(model: FieldModel) -> dict[str, float]:
    """Largest |B| (T) at the region's two limits."""
    limits = np.array([model.region.clearance, model.region.extent])
    points = model.region.hull.offset_points(limits, 600, np.random.default_rng(4))
    near, far = np.linalg.norm(model.B(points, outside="extrapolate"), axis=-1).max(axis=1)
    return {"near": float(near), "far": float(far)}


def _evidence(model: FieldModel) -> dict[str, Any] | None:
    """Numbers of the finite-element solution behind the model."""
    solution = model.provenance.get("solution")
    if not solution:
        return None
    moment, boundary = (np.array(solution["quantities"][key]) for key in ("moment", "boundary_moment"))
    difference = np.linalg.norm(moment - boundary) / np.linalg.norm(moment)
    return {**solution, "moments_apart": float(difference), "moment_size": float(np.linalg.norm(moment))}


def _coefficient_rows(model: FieldModel) -> list[dict[str, Any]]:
    """One row for every coefficient of the model."""
    rows = []
    for number, term in enumerate(model.terms, 1):
        place = {"number": number, "centre": term["centre"], "direction": term["direction"], "radius": term["radius"]}
        if term["kind"] == "loop":
            rows.append({**place, "what": "loop", "value": term["coefficients"][0], "unit": "A"})
            continue
        for degree, order, part, value in zip(
            term["degrees"], term["orders"], term["parts"], term["coefficients"], strict=True
        ):
            rows.append({**place, "what": f"degree {degree}, order {order} {part}", "value": value, "unit": "T"})
    return rows


def _measured(subject: Subject) -> dict[str, Any] | None:
    """Measurements beside predictions, for a device of one magnet."""
    if not subject.measurements or subject.geometry is None:
        return None
    nominal = subject.geometry.bodies[0].material.remanence
    compared = measured.compare(subject.measurements, subject.solution or subject.model, nominal)
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
        (f"B, gradient = model.jet({_inside(subject.model.region)})", "m in; T and T/m out"),
        ('B = model.B([[0, 0, 1]], outside="nan")', 'outside the region: "raise", "nan", "extrapolate"'),
    ]
    column = max(len(code) for code, comment in lines if comment) + 2
    return "\n".join(f"{code:{column}}# {comment}" if comment else code for code, comment in lines)


def _inside(region: Shell) -> str:
    """A point of the region, as Python writes it: on the z axis, whole millimetres where there are any."""
    height = np.linspace(0, region.hull.radius + region.extent, 20001)
    height = height[region.contains(np.stack([0 * height, 0 * height, height], axis=-1))]
    whole = np.ceil(height[0] * 1e3 + 1e-9) * 1e-3
    chosen = whole if whole < height[-1] else (height[0] + height[-1]) / 2
    return f"[0, 0, {chosen:.3g}]"
