"""What a report is about: from a card, a model or a recipe to a device, its solution, its model, measurements."""

from __future__ import annotations

import logging
import os
from dataclasses import dataclass
from pathlib import Path

from magfem.errors import InputError
from magfem.fem import Solution, solve
from magfem.fem.coil_solution import CoilSolution
from magfem.fields import Field
from magfem.fitting import FieldModel, fit, load_model
from magfem.fitting.readings import Reading
from magfem.geometry import Coil, Geometry, Magnets, geometry_from_text, load_geometry
from magfem.geometry.card import read_table
from magfem.geometry.catalogue import is_path, names
from magfem.report.recipe import Recipe, load_recipe
from magfem.samples import Samples

log = logging.getLogger("magfem")


@dataclass(frozen=True, eq=False)
class Subject:
    """Everything that a report draws from.

    usage: what a reader types to get the model: the name or path of a card or, if `is_model`, of the model.
    solution: None for a model that was not fitted to one; `geometry` is None too when it names no device.
    samples: measured ones to hold the model against.
    """

    title: str
    usage: str
    model: FieldModel
    is_model: bool = False
    geometry: Geometry | None = None
    solution: Solution | CoilSolution | None = None
    measurements: tuple[Reading, ...] = ()
    samples: Samples | None = None

    @property
    def truth(self) -> Field | None:
        """What to hold the model against: of a coil the model's circuit; scaled as measurements scaled the model."""
        field: Field | None = self.solution
        circuit = self.model.provenance.get("circuit")
        if isinstance(self.solution, CoilSolution) and circuit is not None:
            field = self.solution.circuit(circuit)
        factor = (self.model.report.get("scale") or {}).get("factor")
        return field if field is None or factor is None else factor * field


@dataclass(frozen=True, eq=False)
class CoilSubject:
    """Everything that the report of a coil draws from. usage: what a reader types: the name or path of its card."""

    title: str
    usage: str
    solution: CoilSolution


def gather(target: str | os.PathLike[str]) -> Subject | CoilSubject:
    """Solve and fit, or load, what `target` names.

    A name is a report recipe if there is one, else a model, else a card; a path is told apart by its ending and,
    for TOML, by whether it names a device (a recipe) or its kind (a card). Raises InputError, CardError.
    """
    shown = os.fspath(target)
    if is_path(target, ".toml") or is_path(target, ".json"):
        if shown.endswith(".json"):
            return _from_model(target)
        table = read_table(Path(target), shown)
        recipe = "device" in table and "kind" not in table
        return _from_recipe(load_recipe(Path(target)), Path(target).parent) if recipe else _from_card(shown)
    if shown in names("reports", ".toml"):
        return _from_recipe(load_recipe(shown), None)
    if shown in names("fits", ".json"):
        return _from_model(target)
    return _from_card(shown)


def _from_recipe(recipe: Recipe, folder: Path | None) -> Subject | CoilSubject:
    """A recipe's device is a catalogue name, or a path seen from the recipe's folder."""
    beside = folder is not None and is_path(recipe.device, ".toml")
    device = os.fspath(folder / recipe.device) if folder is not None and beside else recipe.device
    return _from_card(device, recipe)


def _from_card(device: str, recipe: Recipe | None = None) -> Subject | CoilSubject:
    geometry = load_geometry(device)
    title = (recipe and recipe.title) or geometry.name
    if not isinstance(geometry, Magnets) and recipe and recipe.measurements:
        raise InputError(f"{geometry.name}: measurements are compared for magnets only: leave them out of the recipe")
    solution = solve(geometry)
    if isinstance(solution, CoilSolution):
        return CoilSubject(title, device, solution)
    assert isinstance(geometry, Magnets)
    return Subject(
        title=title,
        usage=device,
        model=fit(solution),
        geometry=geometry,
        solution=solution,
        measurements=recipe.measurements if recipe else (),
    )


def _from_model(target: str | os.PathLike[str]) -> Subject:
    """The model as it is; its device is solved again, with the settings it was fitted at, to hold it against.

    Not solved again are devices of several circuits when the model does not say which of them it is of.
    """
    model = load_model(target)  # type: ignore[arg-type]
    device, solver = model.provenance.get("device"), model.provenance.get("solver")
    geometry = geometry_from_text(device["card"]["text"], device["card"]["path"]) if device else None
    solution = None
    circuits = len(geometry.circuits) if isinstance(geometry, Coil) else 1
    if geometry is not None and solver and (circuits == 1 or model.provenance.get("circuit") is not None):
        log.info("report: solving the model's device again")
        solution = solve(geometry, solver.get("dimension"), solver["resolution"], conduction=solver.get("conduction"))
    return Subject(model.name, os.fspath(target), model, True, geometry, solution)
