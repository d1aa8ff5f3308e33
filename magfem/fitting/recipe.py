"""Fit recipes: which device, which family, how good."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from magfem.errors import InputError
from magfem.fitting.families import FAMILIES
from magfem.geometry import Coil, Geometry, Magnets, load_geometry
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path


@dataclass(frozen=True)
class Recipe:
    """What to fit and how well.

    geometry: the device; None takes the source's.  family: a name of `families.FAMILIES`; None takes what
    suits the device.  target_B, target_gradient: relative errors to stay below.  seed: of the sample points.
    dimension, resolution: how the command line solves the device first.
    """

    geometry: Magnets | None = None
    family: str | None = None
    target_B: float = 5e-4
    target_gradient: float = 5e-3
    seed: int = 0
    dimension: int | None = None
    resolution: float = 1.0

    def __post_init__(self) -> None:
        if self.geometry is not None:
            fittable(self.geometry)
        for key in _RULES:
            if complaint := _complaint(key, getattr(self, key)):
                raise InputError(f"{complaint}, got {getattr(self, key)!r}")
        if self.family and self.geometry:
            next(FAMILIES[self.family](self.geometry))  # refuses a device that the family is not made for


def fittable(geometry: Geometry) -> Magnets:
    """The device, as one that models are fitted to. Raises InputError for coils."""
    if isinstance(geometry, Coil):
        raise InputError(
            f"{geometry.name}: models of coils are not fitted yet; the solution of magfem.solve is a field itself"
        )
    assert isinstance(geometry, Magnets)
    return geometry


def load_recipe(name_or_path: str | Path) -> Recipe:
    """A fit recipe of the catalogue by name, or the file at a path. Raises InputError, CardError."""
    where = ("fits", name_or_path, ".toml")
    table = read_table(resolve(*where), short_path(*where))
    table.only("device", "family", "seed", "target", "solve")
    values: dict[str, Any] = {"geometry": fittable(load_geometry(_device_path(table, resolve(*where))))}
    if "family" in table:
        values["family"] = _checked(table, "family", table.text("family"))
    if "seed" in table:
        values["seed"] = int(_checked(table, "seed", table.number("seed")))
    if "target" in table:
        target = table.table("target")
        target.only("B", "gradient")
        for key in target.values:
            values[f"target_{key}"] = _checked(target, key, target.number(key), f"target_{key}")
    if "solve" in table:
        solve = table.table("solve")
        solve.only("dimension", "resolution")
        if "dimension" in solve:
            values["dimension"] = int(_checked(solve, "dimension", solve.number("dimension")))
        if "resolution" in solve:
            values["resolution"] = _checked(solve, "resolution", solve.number("resolution"))
    return Recipe(**values)


_RULES: dict[str, tuple[Callable[[Any], bool], str]] = {
    "family": (lambda value: value is None or value in FAMILIES, f"unknown family; known: {', '.join(FAMILIES)}"),
    "target_B": (lambda value: 0 < value < 1, "target_B must be a relative error between 0 and 1"),
    "target_gradient": (lambda value: 0 < value < 1, "target_gradient must be a relative error between 0 and 1"),
    "seed": (lambda value: 0 <= value < math.inf and value == int(value), "seed must be a whole number, 0 or more"),
    "dimension": (lambda value: value in (None, 2, 3), "dimension must be 2 or 3"),
    "resolution": (lambda value: 0 < value < math.inf, "resolution must be positive and finite"),
}


def _complaint(key: str, value: Any) -> str:
    """What is wrong with a recipe's value; empty when nothing is."""
    holds, sentence = _RULES[key]
    return "" if holds(value) else sentence


def _checked(table: Table, key: str, value: Any, field: str = "") -> Any:
    """A value of the file, which must keep the rule of the recipe's `field` (default: `key`)."""
    if complaint := _complaint(field or key, value):
        raise table.error(complaint, key)
    return value


def _device_path(table: Table, recipe: Path) -> str | Path:
    """The device's catalogue name, or its card's path seen from the recipe's folder."""
    device = table.text("device")
    return recipe.parent / device if device.endswith(".toml") else device
