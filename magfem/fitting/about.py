"""What every exported file holds: the terms of a field, and in words what it is and how far to trust it."""

from __future__ import annotations

import unicodedata
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field, Placed, Scaled
from magfem.fields.terms import Terms
from magfem.units import one_line
from magfem.version import __version__


def terms_of(field: Field, target: str) -> Terms:
    """The terms of a fitted model, or of placed, scaled and summed ones; `target` names the format for people.

    Raises InputError for a field that is no sum of terms, such as a solution, or whose numbers are not finite.
    """
    terms: Terms | None = getattr(field, "lowered", None)
    if terms is None:
        raise InputError(
            f"{target} holds terms, and a {type(field).__name__} has none: fit a model to it first (magfem.fit)"
        )
    for array in (terms.centre, terms.frame, terms.radius, terms.coefficient, terms.nodes):
        if not np.isfinite(array).all():
            raise InputError(f"{target} needs finite numbers, and this field's terms hold NaN or infinity")
    return terms


def facts(field: Field) -> dict[str, str]:
    """Name, unit, region, bound, device, solver and origin of a field, one line each; what is unknown is left out."""
    origin: Field = field
    while isinstance(origin, (Placed, Scaled)):  # relative errors stay what they are
        origin = origin.field
    report, provenance = _table(origin, "report"), _table(origin, "provenance")
    found = {
        "name": getattr(origin, "name", None) or "magnetic field",
        "unit": f"{field.unit}, gradient in {field.unit}/m",
        "region": field.region.describe(),
    }
    if field.unit == "T/A":
        found["unit"] = "T/A, gradient in T/m/A: the field of 1 A"
    bound = report.get("bound")
    if isinstance(bound, dict):
        found["bound"] = f"{bound['B']:.1e} of B and {bound['gradient']:.1e} of the gradient, relative, in the region"
    if "label" in report:
        found["terms"] = report["label"]
    device = provenance.get("device")
    if isinstance(device, dict):
        card = device.get("card")
        parts = [device.get("kind"), card.get("path") if isinstance(card, dict) else None]
        found["device"] = ", ".join(str(part) for part in parts if part) or "unknown"
    for key in ("source", "date"):
        if isinstance(provenance.get(key), str):
            found[key] = provenance[key]
    found["made by"] = f"magfem {__version__}"
    return {key: one_line(str(text)) for key, text in found.items()}


def _table(field: Field, name: str) -> dict[str, Any]:
    table = getattr(field, name, None)
    return table if isinstance(table, dict) else {}


_SPELT = str.maketrans({"×": "x", "–": "-", "−": "-", "µ": "u", "μ": "u", "·": " ", "’": "'"})


def ascii_text(text: str) -> str:
    """The text in ASCII, for programs that know no other."""
    return unicodedata.normalize("NFKD", text.translate(_SPELT)).encode("ascii", "replace").decode()
