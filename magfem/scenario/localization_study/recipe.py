"""Recipes of studies: TOML files of kind "localization_study" in `reports/`, or anywhere.

kind = "localization_study"
study = "isolines"                # or "range", "tracks", "curves", "stator", "workspace": a module of this package each
name = "…"
source = "…"
…                                 # what the study asks for: see its module's `read`
"""

from __future__ import annotations

import os
from types import ModuleType

from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path
from magfem.scenario.localization_study import curves, isolines, range_study, stator, tracks, workspace
from magfem.scenario.localization_study.study import Study
from magfem.threads import one_thread_for_algebra
from magfem.units import describe

KIND = "localization_study"
STUDIES: dict[str, ModuleType] = {
    "isolines": isolines,
    "range": range_study,
    "tracks": tracks,
    "curves": curves,
    "stator": stator,
    "workspace": workspace,
}
"""Each with `read` (recipe to settings), `run` (settings to result), `compared` and `arrays` (of the result)."""


def load_study(name_or_path: str | os.PathLike[str]) -> Study:
    """Run the study of a name in `reports/` or of a path. Raises InputError or CardError, naming file and key."""
    where = ("reports", name_or_path, ".toml")
    return run_study(read_table(resolve(*where), short_path(*where)))


def run_study(card: Table) -> Study:
    """Read a whole recipe and run it."""
    if "kind" not in card or card.text("kind") != KIND:
        got = describe(card.value("kind")) if "kind" in card else "none"
        raise card.error(f'a study is of kind "{KIND}", got {got}', "kind")
    kind = card.text("study")
    if kind not in STUDIES:
        raise card.error(f"study must be one of {', '.join(STUDIES)}, got {describe(kind)}", "study")
    module = STUDIES[kind]
    settings = module.read(card)
    with one_thread_for_algebra():
        result = module.run(settings)
    return Study(
        kind=kind,
        name=card.text("name"),
        source=card.text("source") if "source" in card else "",
        text=card.origin.text,
        result=result,
        comparisons=module.compared(result),
        arrays=module.arrays(result),
    )
