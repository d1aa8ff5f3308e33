"""Report recipes: which device a report is about, its title, and what was measured on it."""

from __future__ import annotations

import os
from dataclasses import dataclass

from magfem.fitting.readings import Reading, readings_from_table
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import SIMULATED, resolve, short_path


@dataclass(frozen=True)
class Recipe:
    """A report recipe."""

    device: str  # name or path of the device card
    title: str  # empty: the device's name
    measurements: tuple[Reading, ...]


def load_recipe(name_or_path: str | os.PathLike[str]) -> Recipe:
    """The recipe of a name in `reports/` or of a path. Raises InputError or CardError, naming file and key."""
    where = ("reports", name_or_path, ".toml")
    return recipe_from_table(read_table(resolve(*where), short_path(*where)))


def recipe_from_table(table: Table) -> Recipe:
    """Read a whole recipe file."""
    if table.values.get("kind") in SIMULATED:
        raise table.error("this is a scenario: magfem simulate runs it, and writes its page", "kind")
    table.only("device", "title", "measurement")
    return Recipe(
        device=table.text("device"),
        title=table.text("title") if "title" in table else "",
        measurements=readings_from_table(table),
    )
