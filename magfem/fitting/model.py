"""Fitted field models: a handful of harmonic terms, where they hold, and how good they are."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import CardError, InputError
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Shell, region_from_dict, region_to_dict
from magfem.fields.terms import HARMONIC, LOOP, Terms, concatenate, frame_about, harmonics, loops
from magfem.files import read_json, write_json
from magfem.geometry.catalogue import resolve, short_path
from magfem.typing import Floats, Integers, Jet, Points
from magfem.units import describe, one_line

FORMAT, VERSION = "magfem-model", 1
HIGHEST_DEGREE = 85
"""Of harmonics in a file; factorials of twice this still fit a float."""


@dataclass(frozen=True, eq=False, repr=False)
class FieldModel(Evaluated):
    """A fitted field; a Field in T.

    lowered: the terms.  covariance: (p, p) of the free parameters; parameter: (c,) the free parameter behind
    every coefficient.  region: where it holds.  report: what the fit measured about itself (training,
    heldout, fem, bound, condition, worst, candidates, comparison).  provenance: device with its card, solver
    settings, versions, date.
    """

    name: str
    lowered: Terms
    parameter: Integers
    covariance: Floats
    region: Shell
    report: dict[str, Any]
    provenance: dict[str, Any]
    unit: Unit = "T"

    def __repr__(self) -> str:
        bound, label = self.report["bound"], self.report.get("label", f"{self.lowered.kind.size} sources")
        return (
            f"<FieldModel {self.name!r}: {label}, {self.region.describe()}, "
            f"bound {bound['B']:.1e} in B, {bound['gradient']:.1e} in the gradient>"
        )

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.lowered.jet(points, order)

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m²."""
        return self.lowered.moment

    @cached_property
    def terms(self) -> tuple[dict[str, Any], ...]:
        """The terms as the model file lists them."""
        return tuple(terms_to_list(self.lowered))

    def save(self, path: str | Path) -> None:
        """Write the model file, whole or not at all."""
        write_json(Path(path), self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """The content of the model file."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "name": self.name,
            "unit": self.unit,
            "terms": list(self.terms),
            "parameter": [int(index) for index in self.parameter],
            "covariance": np.asarray(self.covariance).tolist(),
            "region": region_to_dict(self.region),
            "report": self.report,
            "provenance": self.provenance,
        }


def load_model(name_or_path: str | Path) -> FieldModel:
    """A model of the catalogue by name, or the model file at a path.

    Raises InputError when there is none, CardError (file and key) when the file is not a whole model.
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise InputError(f'load_model takes a name or path: "ring.json", got {describe(name_or_path)}')
    where = ("fits", name_or_path, ".json")
    path, shown = resolve(*where), short_path(*where)
    data = read_json(path, "the field model")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise CardError(f'this is not a field model: "format" must be "{FORMAT}"', f"{shown}: format")
    if data.get("version") != VERSION:
        raise CardError(
            f"version {data.get('version')!r} of the format is not known, expected {VERSION}",
            f"{shown}: version",
        )
    key = ""
    try:
        for key in ("name", "unit", "terms", "parameter", "covariance", "region", "report", "provenance"):
            data[key]
        for key, kind, words in (("name", str, "a text"), ("report", dict, "a table"), ("provenance", dict, "a table")):
            if not isinstance(data[key], kind):
                raise ValueError(words)
        key = "unit"
        if data["unit"] not in ("T", "T/A"):
            raise ValueError('"T" or "T/A"')
        key = "terms"
        lowered = terms_from_list(data["terms"])
        key = "parameter"
        parameter = np.array(data["parameter"])
        if parameter.shape != lowered.coefficient.shape or parameter.dtype.kind != "i" or parameter.min() < 0:
            raise ValueError("one index for each coefficient")
        key = "covariance"
        covariance = _numbers(data["covariance"])
        if covariance.shape != (parameter.max() + 1,) * 2:
            raise ValueError("one row and one column for each parameter")
        key = "region"
        region = region_from_dict(data["region"])
        if not isinstance(region, Shell):
            raise ValueError("a shell around a hull")
        key = "report.bound"
        if not all(_number(data["report"]["bound"][name]) >= 0 for name in ("B", "gradient")):
            raise ValueError("relative errors of B and gradient")
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, InputError) as error:
        reason = f"{key} is not laid out as in a field model"
        if isinstance(error, KeyError):
            reason = f"missing key {error}"
        elif isinstance(error, InputError):
            reason = str(error)
        elif isinstance(error, ValueError):
            reason = f"expected {error}"
        raise CardError(f"not a whole field model: {one_line(reason)}", f"{shown}: {key}") from None
    return FieldModel(
        name=data["name"],
        lowered=lowered,
        parameter=parameter,
        covariance=covariance,
        region=region,
        report=data["report"],
        provenance=data["provenance"],
        unit=data["unit"],
    )


def terms_to_list(terms: Terms) -> list[dict[str, Any]]:
    """Terms as JSON-ready objects, one per source; every float keeps all its bits."""
    result: list[dict[str, Any]] = []
    for k in range(terms.kind.size):
        run = slice(terms.start[k], terms.start[k + 1])
        term: dict[str, Any] = {
            "kind": "loop" if terms.kind[k] == LOOP else "harmonics",
            "centre": terms.centre[k].tolist(),
            "direction": terms.frame[k][:, 2].tolist(),
            "azimuth": terms.frame[k][:, 0].tolist(),
            "radius": float(terms.radius[k]),
        }
        if terms.kind[k] == HARMONIC:
            term["degrees"] = terms.degree[run].tolist()
            term["orders"] = terms.order[run].tolist()
            term["parts"] = ["sin" if sine else "cos" for sine in terms.sine[run]]
        term["coefficients"] = terms.coefficient[run].tolist()
        result.append(term)
    return result


def terms_from_list(data: list[dict[str, Any]]) -> Terms:
    """Inverse of `terms_to_list`; `azimuth` may be left out where it does not matter.

    Raises KeyError, TypeError, ValueError … for what is not a term.
    """
    if not isinstance(data, list) or not data:
        raise ValueError("a list of at least one term")
    return concatenate([_source(term) for term in data])


def _source(term: dict[str, Any]) -> Terms:
    if not isinstance(term, dict):
        raise ValueError("terms that are tables")
    if term["kind"] not in ("loop", "harmonics"):
        raise ValueError(f'kind "loop" or "harmonics", got {term["kind"]!r}')
    centre, direction, coefficients = (_numbers(term[key]) for key in ("centre", "direction", "coefficients"))
    radius = _number(term["radius"])
    if centre.shape != (3,) or direction.shape != (3,) or not np.linalg.norm(direction) > 0:
        raise ValueError("centre and direction of three numbers")
    if not radius > 0 or coefficients.ndim != 1:
        raise ValueError("a positive radius and a list of coefficients")
    if "azimuth" in term:
        x = _numbers(term["azimuth"])
        if x.shape != (3,):
            raise ValueError("azimuth of three numbers")
        # The stored axes are used as they are: making them orthogonal again would change bits.
        frame = np.stack([x, np.cross(direction, x), direction], axis=1)
        if not np.allclose(frame.T @ frame, np.eye(3), atol=1e-9):
            raise ValueError("direction and azimuth of length one and perpendicular")
    else:
        frame = frame_about(direction)
    if term["kind"] == "loop":
        if coefficients.size != 1:
            raise ValueError("one coefficient for a loop")
        return loops(centre[None], np.array([radius]), coefficients, frame)
    degrees, orders, parts = term["degrees"], term["orders"], term["parts"]
    if not len(degrees) == len(orders) == len(parts) == coefficients.size:
        raise ValueError("degrees, orders, parts and coefficients of one length")
    if not all(type(number) is int for number in (*degrees, *orders)):
        raise ValueError("whole numbers as degrees and orders")
    if any(not 0 <= m <= n or not 1 <= n <= HIGHEST_DEGREE for n, m in zip(degrees, orders, strict=True)):
        raise ValueError(
            f"orders between 0 and their degree, and degrees from 1 to {HIGHEST_DEGREE} (there is no monopole)"
        )
    if not set(parts) <= {"cos", "sin"}:
        raise ValueError('parts "cos" or "sin"')
    return harmonics(radius, degrees, orders, [part == "sin" for part in parts], coefficients, centre, frame)


def _numbers(data: Any) -> Floats:
    """A list of lists … of finite numbers as an array."""
    try:
        array = np.array(data)
    except ValueError:
        array = np.array(None)
    if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise ValueError("finite numbers, in lists of one length")
    return array.astype(float)


def _number(data: Any) -> float:
    array = _numbers(data)
    if array.shape != ():
        raise ValueError("one number")
    return float(array)
