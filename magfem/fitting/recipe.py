"""Fit recipes: which device, which family, how good."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from magfem.errors import InputError
from magfem.fitting.families import FAMILIES
from magfem.geometry import Geometry, load_geometry
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path


@dataclass(frozen=True)
class Recipe:
    """What to fit and how well.

    geometry: the device; None takes the source's.  family: a name of `families.FAMILIES`; None takes what
    suits the device.  target_B, target_gradient: relative errors to stay below.  seed: of the sample points.
    dimension, resolution: how the command line solves the device first.
    """

    geometry: Geometry | None = None
    family: str | None = None
    target_B: float = 5e-4
    target_gradient: float = 5e-3
    seed: int = 0
    dimension: int | None = None
    resolution: float = 1.0

    def __post_init__(self) -> None:
        if self.family is not None and self.family not in FAMILIES:
            raise InputError(f"unknown family {self.family!r}; known: {', '.join(FAMILIES)}")
        for key in ("target_B", "target_gradient"):
            if not 0 < getattr(self, key) < 1:
                raise InputError(f"{key} must be a relative error between 0 and 1, got {getattr(self, key)}")


def load_recipe(name_or_path: str | Path) -> Recipe:
    """A fit recipe of the catalogue by name, or the file at a path. Raises InputError, CardError."""
    where = ("fits", name_or_path, ".toml")
    table = read_table(resolve(*where), short_path(*where))
    table.only("device", "family", "seed", "target", "solve")
    values: dict[str, Any] = {"geometry": load_geometry(_device_path(table, resolve(*where)))}
    if "family" in table:
        values["family"] = table.text("family")
        if values["family"] not in FAMILIES:
            raise table.error(f"unknown family; known: {', '.join(FAMILIES)}", "family")
    if "seed" in table:
        values["seed"] = int(table.number("seed"))
    if "target" in table:
        target = table.table("target")
        target.only("B", "gradient")
        for key in target.values:
            values[f"target_{key}"] = target.number(key)
            if not 0 < values[f"target_{key}"] < 1:
                raise target.error(f"{key} must be a relative error between 0 and 1", key)
    if "solve" in table:
        solve = table.table("solve")
        solve.only("dimension", "resolution")
        if "dimension" in solve:
            values["dimension"] = int(solve.number("dimension"))
        if "resolution" in solve:
            values["resolution"] = solve.number("resolution")
    return Recipe(**values)


def _device_path(table: Table, recipe: Path) -> str | Path:
    """The device's catalogue name, or its card's path seen from the recipe's folder."""
    device = table.text("device")
    return recipe.parent / device if device.endswith(".toml") else device
