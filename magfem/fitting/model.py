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
from magfem.fields.region import SampledRegion, Shell
from magfem.fields.region_json import region_from_dict, region_to_dict
from magfem.fields.terms import Terms
from magfem.fields.terms_json import number, numbers, terms_from_list, terms_to_list
from magfem.fields.workspace_region import Ball, Box
from magfem.files import not_whole, read_json, write_json
from magfem.fitting.uncertainty import predictive_deviation
from magfem.geometry.catalogue import resolve, short_path
from magfem.typing import ArrayLike, Floats, Integers, Jet, Outside, Points
from magfem.units import describe

FORMAT, VERSION = "magfem-model", 1


@dataclass(frozen=True, eq=False, repr=False)
class FieldModel(Evaluated):
    """A fitted field; a Field in T.

    lowered: the terms.  covariance: (p, p) of the free parameters, None where it is not known; parameter: (c,) the
    free parameter behind every coefficient, share: (c,) what the coefficient is of it.  region: where it holds.
    report: what the fit measured about itself (training, heldout, fem, bound, condition, worst, candidates,
    comparison).  provenance: device with its card, solver settings, versions, date.
    """

    name: str
    lowered: Terms
    parameter: Integers
    covariance: Floats | None
    region: SampledRegion
    report: dict[str, Any]
    provenance: dict[str, Any]
    unit: Unit = "T"
    share: Floats | None = None  # None: ones

    def __repr__(self) -> str:
        bound, label = self.report["bound"], self.report.get("label", f"{self.lowered.kind.size} sources")
        return (
            f"<FieldModel {self.name!r}: {label}, {self.region.describe()}, "
            f"bound {bound['B']:.1e} in B, {bound['gradient']:.1e} in the gradient>"
        )

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.lowered.jet(points, order)

    def deviation(self, points: ArrayLike, outside: Outside = "raise") -> tuple[Floats, Floats]:
        """Standard deviations of B (..., 3) T and of the gradient (..., 3, 3) T/m at `points` (..., 3) m.

        What the noise of the fitted data makes of the coefficients, by their covariance; not what the model cannot
        describe. Of models of samples `report["uncertainty"]` says whether that dominates. Closed forms and solutions
        have no noise: there the fit's residual is taken for it, as if it were independent from row to row, and
        `report["bound"]` is what to trust.

        Raises as `jet` does, and InputError for a model whose covariance is not known, such as published coefficients.
        """
        return predictive_deviation(self, points, outside)

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m²."""
        return self.lowered.moment

    @property
    def _shares(self) -> Floats | None:
        """The shares where they are not all one."""
        return None if self.share is None or np.all(self.share == 1.0) else self.share

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
            **({} if self._shares is None else {"share": self._shares.tolist()}),
            "covariance": None if self.covariance is None else np.asarray(self.covariance).tolist(),
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
        key = "share"
        share = numbers(data["share"]) if "share" in data else None
        if share is not None and share.shape != parameter.shape:
            raise ValueError("one number for each coefficient")
        key = "covariance"
        covariance = None if data["covariance"] is None else numbers(data["covariance"])
        if covariance is not None and covariance.shape != (parameter.max() + 1,) * 2:
            raise ValueError("one row and one column for each parameter")
        key = "region"
        region = region_from_dict(data["region"])
        if not isinstance(region, Shell | Ball | Box):
            raise ValueError("a shell around a hull, a ball or a box")
        key = "report.bound"
        if not all(number(data["report"]["bound"][name]) >= 0 for name in ("B", "gradient")):
            raise ValueError("relative errors of B and gradient")
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, InputError) as error:
        raise not_whole("field model", error, shown, key) from None
    return FieldModel(
        name=data["name"],
        lowered=lowered,
        parameter=parameter,
        covariance=covariance,
        region=region,
        report=data["report"],
        provenance=data["provenance"],
        unit=data["unit"],
        share=share,
    )
