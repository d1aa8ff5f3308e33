"""Models that somebody else fitted and published: their coefficients in our terms, with the error that they admit.

A recipe of published coefficients:

    published = "axial_multipole"
    name = "…"
    source = "…"
    coefficients = [6.4e-7, 1.9e-8]    # a_k in T·m^(k+2)/A

    [region]                           # a ball, in the model's frame
    centre = ["0 mm", "0 mm", "85 mm"]
    radius = "55 mm"

    [bound]                            # relative errors to be stated, and on which ground
    B = 0.5
    gradient = 1.0
    ground = "…"
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial, inf
from pathlib import Path

import numpy as np

from magfem.fields.terms import HIGHEST_DEGREE, Terms, harmonics
from magfem.fields.workspace_region import Ball
from magfem.fitting.model import FieldModel
from magfem.fitting.provenance import versions_and_date
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path
from magfem.geometry.vectors import three_lengths
from magfem.typing import Floats
from magfem.units import quoted

KIND = "axial_multipole"


def published_axial_multipole(coefficients: Floats | Sequence[float], radius: float = 0.0625) -> Terms:
    """The axial multipole of B = +∇Ψ, Ψ = Σ_k a_k ∂^k/∂z^k (1/r), about the origin, z its axis.

    coefficients: a_1, a_2, … in T·m^{k+2}, or per ampere.  radius: the harmonics' reference, m; a power of two keeps
    their digits. With ∂^k/∂z^k (1/r) = (−1)^k k! P_k(cos θ)/r^{k+1} and V = −Ψ, the harmonics are
    g_k = −(−1)^k k! a_k / radius^{k+2}; the dipole moment is 4π/µ₀ a_1.

    Source: Richter, dissertation, eqs. 2.6 to 2.9, whose axis is x.
    """
    degree = list(range(1, len(coefficients) + 1))
    values = [-((-1) ** k) * factorial(k) * a / radius ** (k + 2) for k, a in zip(degree, coefficients, strict=True)]
    return harmonics(radius, degree, [0] * len(degree), [False] * len(degree), values)


def is_published(name_or_path: str | Path) -> bool:
    """Whether a fit recipe holds published coefficients instead of a device to fit."""
    where = ("fits", name_or_path, ".toml")
    return "published" in read_table(resolve(*where), short_path(*where))


def load_published(name_or_path: str | Path) -> FieldModel:
    """The model of a recipe of published coefficients, per ampere. Raises InputError, CardError.

    Nothing was fitted here: the report holds the stated bound and its ground, no errors at points, and no
    covariance is known, because none was published.
    """
    where = ("fits", name_or_path, ".toml")
    table = read_table(resolve(*where), short_path(*where))
    table.only("published", "name", "source", "coefficients", "region", "bound")
    if (kind := table.text("published")) != KIND:
        raise table.error(f'published coefficients are those of an "{KIND}", got {quoted(kind)}', "published")
    given = table.value("coefficients")
    if not isinstance(given, list) or not given or not all(type(one) in (int, float) for one in given):
        raise table.error("coefficients must be a list of numbers a_k in T·m^(k+2)/A", "coefficients")
    if len(given) > HIGHEST_DEGREE or not np.isfinite(np.array(given, dtype=float)).all():
        raise table.error(f"coefficients must be finite, {HIGHEST_DEGREE} at most", "coefficients")
    bound = table.table("bound")
    bound.only("B", "gradient", "ground")
    stated = {key: bound.number(key) for key in ("B", "gradient")}
    for key, value in stated.items():
        if not 0 < value < inf:
            raise bound.error(f"{key} must be a relative error above 0", key)
    count, source = len(given), table.text("source")
    return FieldModel(
        name=table.text("name"),
        lowered=published_axial_multipole(given),
        parameter=np.arange(count),
        covariance=None,
        region=_region(table.table("region")),
        report={
            "family": "published",
            "label": f"axial multipole, {count} poles, as published",
            "parameters": count,
            "condition": None,
            "training": None,
            "heldout": None,
            "fem": None,
            "bound": stated,
            "ground": bound.text("ground"),
            "worst": None,
            "candidates": [],
            "comparison": [],
        },
        provenance={
            "device": None,
            "source": source,
            "solver": None,
            "solution": None,
            "recipe": {"path": table.origin.path, "sha256": table.origin.sha256},
            **versions_and_date(),
            "date": None,
        },
        unit="T/A",
    )


def _region(table: Table) -> Ball:
    """Where the coefficients hold."""
    table.only("centre", "radius")
    centre, radius = three_lengths(table, "centre"), table.quantity("radius", "length")
    if not radius > 0:
        raise table.error("radius must be positive", "radius")
    return Ball(centre, radius)
