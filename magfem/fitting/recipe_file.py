"""Fit recipes as TOML files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from magfem.errors import CardError, InputError
from magfem.fields.region import Shell
from magfem.fitting.alignment import alignment_of, dimension_of
from magfem.fitting.families.options import OPTIONS
from magfem.fitting.readings import readings_from_table
from magfem.fitting.recipe import Recipe, SamplesFile, complaint_about
from magfem.geometry import load_geometry
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path
from magfem.geometry.vectors import three_lengths
from magfem.units import describe

_KEYS = (
    "device",
    "samples",
    "name",
    "source",
    "family",
    "seed",
    "circuit",
    "terms",
    "region",
    "target",
    "solve",
    "fit",
    "free",
    "measurement",
)

_TABLES: dict[str, dict[str, str]] = {
    "target": {"B": "target_B", "gradient": "target_gradient"},
    "solve": {"dimension": "dimension", "resolution": "resolution"},
    "fit": {
        key: key for key in ("objective", "most_parameters", "weighting", "ridge", "loss", "heldout", "background")
    },
}
"""The tables of a recipe file, their keys, and the recipe's fields that these set."""

_WHOLE = ("dimension", "most_parameters", "seed")
_TEXTS = ("name", "source", "family", "circuit", "objective", "weighting", "ridge", "loss", "heldout")


def load_recipe(name_or_path: str | Path) -> Recipe:
    """A fit recipe of the catalogue by name, or the file at a path.

    It names a device, a file of samples, or both. Raises InputError, CardError.
    """
    where = ("fits", name_or_path, ".toml")
    file = resolve(*where)
    table = read_table(file, short_path(*where))
    table.only(*_KEYS)
    if "device" not in table and "samples" not in table:
        raise table.error('a recipe names a "device", a [samples] file, or both')
    values: dict[str, Any] = {}
    if "device" in table:
        values["geometry"] = load_geometry(_beside(table.text("device"), file, ".toml"))
    for key in ("name", "source", "family", "circuit", "seed"):
        if key in table:
            values[key] = _value(table, key, key)
    for name, keys in _TABLES.items():
        if name in table:
            part = table.table(name)
            part.only(*keys)
            values |= {target: _value(part, key, target) for key, target in keys.items() if key in part}
    if "terms" in table:
        values["options"] = _options(table.table("terms"))
    if "region" in table:
        if "geometry" not in values:
            raise table.error("a region is counted from a device: name one", "region")
        values["region"] = _region(table.table("region"), values["geometry"].region)
    if "samples" in table:
        values["samples"] = _samples(table.table("samples"), file)
    if "free" in table:
        values["free"] = _free(table.table("free"))
    values["measurements"] = readings_from_table(table)
    try:
        with table.locating():
            return Recipe(**values)
    except CardError:
        raise
    except InputError as error:  # the family is not one for this device
        raise table.error(str(error), "family" if "family" in table else "") from None


def _value(table: Table, key: str, target: str) -> Any:
    """The value at `key`, which must keep the rule of the recipe's field `target`."""
    if target == "background":
        value = table.value(key)
        if not isinstance(value, bool):
            raise table.error(f"{key} must be true or false, got {describe(value)}", key)
        return value
    value = table.text(key) if target in _TEXTS else table.number(key)
    if complaint := complaint_about(target, value):
        raise table.error(complaint, key)
    return int(value) if target in _WHOLE else value


def _options(table: Table) -> dict[str, Any]:
    """Options of a family in SI units: lengths are texts with their unit, all else is as it stands."""
    options = dict(table.values)
    for key in options:
        if key in OPTIONS and OPTIONS[key].length:
            options[key] = _length_option(table, key)
    return options


def _length_option(table: Table, key: str) -> Any:
    if key == "centre":
        return three_lengths(table, key)
    if key == "centres":
        value = table.value(key)
        if not isinstance(value, list):
            raise table.error(f'centres must be a list of triples such as ["1 mm", "0 mm", "0 mm"], got {value!r}', key)
        return [three_lengths(Table(table.origin, {key: one}, table.path), key) for one in value]
    return table.quantity(key, "length")


def _region(table: Table, device: Shell) -> Shell:
    """The device's region with the limits that the recipe states: clearance, extent, and pairs of z and rho."""
    table.only("clearance", "extent", "z", "rho")
    limits: dict[str, Any] = {}
    for key in ("clearance", "extent"):
        if key in table:
            limits[key] = table.quantity(key, "length")
    for key in ("z", "rho"):
        if key in table:
            limits[key] = _pair(table, key, "length", 'one or two lengths, such as ["1 mm", "6 mm"]')
    region = replace(device, **limits)
    if not (0 <= region.clearance < region.extent and region.z[0] < region.z[1] and 0 <= region.rho[0] < region.rho[1]):
        raise table.error("lower limits must be smaller than upper ones, clearance and rho not negative")
    return region


def _samples(table: Table, recipe: Path) -> SamplesFile:
    table.only("file", "columns", "sigma")
    columns: Mapping[str, str] = {}
    if "columns" in table:
        part = table.table("columns")
        columns = {key: part.text(key) for key in part.values}
    sigma = table.quantity("sigma", "flux density") if "sigma" in table else None
    if sigma is not None and sigma <= 0:
        raise table.error("sigma must be positive", "sigma")
    return SamplesFile(recipe.parent / table.text("file"), columns, sigma)


def _free(table: Table) -> dict[str, tuple[float, float] | None]:
    """Free parameters: true for sensible bounds, a quantity for either way, or a pair."""
    free: dict[str, tuple[float, float] | None] = {}
    for name, value in table.values.items():
        dimension = dimension_of(name)
        if value is True:
            free[name] = None
        elif isinstance(value, list):
            free[name] = _pair(table, name, dimension, "two values", fewest=2)
        elif isinstance(value, str) and dimension:
            size = table.quantity(name, dimension)
            if size <= 0:
                raise table.error(f"{name} must be positive: a bound either way", name)
            free[name] = (-size, size)
        else:
            raise table.error(f"{name} must be true, a bound either way, or two bounds, got {describe(value)}", name)
        try:
            alignment_of({name: free[name]}, 1.0)
        except InputError as error:
            raise table.error(str(error), name) from None
    return free


def _pair(table: Table, key: str, dimension: str, expected: str, fewest: int = 1) -> tuple[float, float]:
    value = table.value(key)
    if not isinstance(value, list) or not fewest <= len(value) <= 2:
        raise table.error(f"{key} must be {expected}, got {describe(value)}", key)
    parts = [Table(table.origin, {key: part}, table.path) for part in value]
    low, *high = [part.quantity(key, dimension) if dimension else part.number(key) for part in parts]
    return low, high[0] if high else math.inf


def _beside(name_or_path: str, recipe: Path, ending: str) -> str | Path:
    """A catalogue name, or a path seen from the recipe's folder."""
    return recipe.parent / name_or_path if name_or_path.endswith(ending) else name_or_path
