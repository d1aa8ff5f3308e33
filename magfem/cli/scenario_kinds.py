"""What `magfem simulate` runs, by the `kind` of its recipe."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import SIMULATED, resolve, short_path
from magfem.units import describe


@dataclass(frozen=True)
class Kind:
    """How a kind of recipe is run.

    files: all names that its folder may hold.  simulate: from the recipe to what is found.  write: that into a folder,
    with pictures or without.  summary: of what is found, plain data with `passed`.  text: the summary in words, with
    the folder's name.
    """

    files: frozenset[str]
    simulate: Callable[[Table], Any]
    write: Callable[[Any, Path, bool], None]
    summary: Callable[[Any], dict[str, Any]]
    text: Callable[[dict[str, Any], str], str]


def read_recipe(name_or_path: str | os.PathLike[str]) -> Table:
    """The recipe of a name in `reports/` or of a path. Raises InputError or CardError."""
    where = ("reports", name_or_path, ".toml")
    return read_table(resolve(*where), short_path(*where))


def kind_of(recipe: Table) -> Kind:
    """How this recipe is run. Raises CardError for a kind that cannot be simulated."""
    kind = recipe.value("kind") if "kind" in recipe else None
    if kind == "scenario":
        from magfem.cli import steering_text
        from magfem.report import run_folder
        from magfem.scenario import simulate
        from magfem.scenario.scenario_file import read_scenario
        from magfem.scenario.summary import summary

        return Kind(
            run_folder.FILES,
            lambda table: simulate(read_scenario(table)),
            run_folder.write_run,
            summary,
            steering_text.text,
        )
    if kind == "localize_and_steer":
        from magfem.cli import closed_system_text
        from magfem.report import closed_system_folder
        from magfem.scenario.closed_system import ClosedRun, read_closed_system, simulate_closed_system

        return Kind(
            closed_system_folder.FILES,
            lambda table: simulate_closed_system(read_closed_system(table)),
            closed_system_folder.write_closed_run,
            ClosedRun.summary,
            closed_system_text.text,
        )
    if kind == "localization_study":
        from magfem.cli import study_text
        from magfem.report import study_folder
        from magfem.scenario.localization_study import Study
        from magfem.scenario.localization_study.recipe import run_study

        return Kind(study_folder.FILES, run_study, study_folder.write_study, Study.summary, study_text.text)
    got = describe(kind) if "kind" in recipe else "none"
    known = ", ".join(f'"{one}"' for one in SIMULATED)
    raise recipe.error(f"what is simulated is of kind {known}, got {got}", "kind")
