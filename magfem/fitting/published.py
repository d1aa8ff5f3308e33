"""Models that somebody else fitted and published: their coefficients in our terms, with the error that they admit.

A recipe of published coefficients:

    published = "axial_multipole"
    name = "…"
    source = "…"
    coefficients = [6.4e-7, 1.9e-8]    # a_k in T·m^(k+2)/A

    [region]                           # about a small ball where the poles are, as in a fit recipe
    body = "1 mm"                      # its diameter
    clearance = "30 mm"
    extent = "140 mm"
    z = ["30 mm", "140 mm"]            # optional, and rho

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

from magfem.fields.hull import SphereHull
from magfem.fields.region import Shell
from magfem.fields.terms import HIGHEST_DEGREE, Terms, harmonics
from magfem.fitting.model import FieldModel
from magfem.fitting.provenance import versions_and_date
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path
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

    Nothing was fitted here: the report holds the stated bound and its ground, no errors at points, and the covariance
    is zero because none was published.
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
        covariance=np.zeros((count, count)),
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


def _region(table: Table) -> Shell:
    """Where the coefficients hold: a shell about a small ball, and its window."""
    table.only("body", "clearance", "extent", "z", "rho")
    body, clearance, extent = (table.quantity(key, "length") for key in ("body", "clearance", "extent"))
    z = _pair(table, "z") if "z" in table else (-inf, inf)
    rho = _pair(table, "rho") if "rho" in table else (0.0, inf)
    region = Shell(SphereHull(body), clearance, extent, z, rho)
    if not (body > 0 and 0 < clearance < extent and region.z[0] < region.z[1] and 0 <= region.rho[0] < region.rho[1]):
        raise table.error("lengths must be positive, lower limits smaller than upper ones, and rho not negative")
    return region


def _pair(table: Table, key: str) -> tuple[float, float]:
    value = table.value(key)
    if not isinstance(value, list) or len(value) != 2:
        raise table.error(f'{key} must be two lengths, such as ["1 mm", "6 mm"]', key)
    low, high = (Table(table.origin, {key: one}, table.path).quantity(key, "length") for one in value)
    return low, high
