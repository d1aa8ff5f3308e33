"""From field data to a field model: sample, solve, choose family and order, and say how good the result is."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fem.coil_solution import CoilSolution, SolvedCircuit
from magfem.fields.field import Field
from magfem.fields.region import Everywhere
from magfem.fields.terms import Terms
from magfem.fields.terms_json import terms_to_list
from magfem.fitting.candidate import Candidate
from magfem.fitting.families import dissertation_families, family_of, members, suitable_families
from magfem.fitting.least_squares import solve_least_squares
from magfem.fitting.model import FieldModel
from magfem.fitting.provenance import provenance_of
from magfem.fitting.recipe import SEARCH, Recipe, check_for_fields
from magfem.fitting.sampling import LayeredData, layer_errors, sample, worst_places
from magfem.fitting.selection import Fitted, choose, climb
from magfem.geometry import Geometry

log = logging.getLogger("magfem")

_SAFETY = 1.5  # on the held-out maximum: other random points may hit a little harder


def fit_field(source: Field, recipe: Recipe) -> FieldModel:
    """Fit a field model to a solution, or to any Field of a device: `fit` says how, and what it raises."""
    geometry = _device(source, recipe)
    check_for_fields(recipe)
    recipe = recipe.of(geometry)
    field = _circuit(source, recipe)
    region = recipe.region
    assert region is not None
    data = sample(field, region, recipe.seed)
    log.info("field: %d sample points", sum(len(one.flat) for one in data.values()))
    tried: list[Fitted] = []
    most = recipe.most_parameters
    families = suitable_families(geometry) if recipe.family == SEARCH else [str(recipe.family)]
    for family in families:
        candidates = members(family, geometry, region, recipe.family_options(family))
        found = climb(candidates, data, recipe.objective, recipe.targets, most)
        tried += found
        if found and found[-1].score(recipe.targets) <= 0.5:  # what is larger need not be looked at any more
            most = found[-1].candidate.parameters - 1
    if not tried:
        raise _nothing_to_try(families, geometry, recipe)
    suiting = family_of(geometry)
    chosen = choose(tried, recipe.targets, None if suiting in families else suiting)
    terms = chosen.terms
    terms.check_sources()
    jets = {name: terms.jet(one.flat, 1) for name, one in data.items()}
    training, heldout = (layer_errors(jets[name], data[name]) for name in ("training", "heldout"))
    fem = _stated_error(source)
    bound = {key: _SAFETY * heldout[key]["max"] + (fem[key] if fem else 0.0) for key in ("B", "gradient")}
    log.info(
        "fit: %s, %d parameters, held-out error %.1e in B, %.1e in the gradient",
        chosen.candidate.label,
        chosen.candidate.parameters,
        heldout["B"]["max"],
        heldout["gradient"]["max"],
    )
    return FieldModel(
        name=recipe.name or geometry.name,
        lowered=terms,
        parameter=chosen.candidate.parameter,
        share=chosen.candidate.terms.coefficient,
        covariance=chosen.solved.covariance,
        region=region,
        report={
            **chosen.headline,
            "objective": recipe.objective,
            "target": recipe.targets,
            "training": training,
            "heldout": heldout,
            "fem": fem,
            "bound": bound,
            "worst": worst_places(jets["heldout"], data["heldout"], region),
            "candidates": [{**one.headline, "selection": one.selection} for one in tried],
            "comparison": [
                _compare(candidate, data, terms)
                for candidate in dissertation_families(geometry, region)
                if not region.windowed and _has_room(candidate, data)
            ],
        },
        provenance=provenance_of(source, geometry, _circuit_name(field)),
        unit=field.unit,
    )


def _nothing_to_try(families: list[str], geometry: Geometry, recipe: Recipe) -> InputError:
    """Why no candidate was looked at: all have more parameters than the recipe allows, or there are none."""
    region = recipe.region or geometry.region
    sizes = [
        member.parameters
        for family in families
        for member in members(family, geometry, region, recipe.family_options(family))
    ]
    of = f"the {'family' if len(families) == 1 else 'families'} {', '.join(families)}"
    if not sizes:
        return InputError(
            f"{geometry.name}: no model of {of} is small enough in the region {region.describe()}; "
            "a larger clearance takes fewer sources"
        )
    return InputError(
        f"no model of {of} has at most {recipe.most_parameters} parameters, as most_parameters asks; "
        f"the smallest has {min(sizes)}"
    )


def _device(source: Field, recipe: Recipe) -> Geometry:
    """The device that source and recipe speak of."""
    if isinstance(source, Geometry):
        raise InputError(f"fit takes a field, {source.name} is a device: fit its solution, magfem.fit(magfem.solve(…))")
    if not isinstance(source, Field):
        raise InputError(
            "fit takes a solution of magfem.solve, samples of magfem.samples.read_samples, or any object with the "
            "Field interface"
        )
    own: Geometry | None = getattr(source, "geometry", None)
    if own is None and recipe.geometry is None:
        raise InputError(
            "cannot tell which device this field belongs to: fit(source, recipe) with a recipe that names it"
        )
    if own is not None and recipe.geometry is not None and own != recipe.geometry:
        raise InputError(f"the recipe is for {recipe.geometry.name}, but the field is that of {own.name}")
    geometry = recipe.geometry or own
    assert geometry is not None
    return geometry


def _circuit(source: Field, recipe: Recipe) -> Field:
    """Of a coil with several circuits the one that the recipe names."""
    if not isinstance(source, CoilSolution):
        return source
    if recipe.circuit is None and len(source.circuits) > 1:
        names = ", ".join(circuit.name for circuit in source.circuits)
        raise InputError(
            f"{source.geometry.name} has {len(source.circuits)} circuits, a model is of one: name one of {names} "
            'as the recipe\'s "circuit"'
        )
    return source if recipe.circuit is None else source.circuit(recipe.circuit)


def _circuit_name(field: Field) -> str | None:
    """The circuit that a field is of."""
    if isinstance(field, CoilSolution):
        return field.circuits[0].name
    return field.name if isinstance(field, SolvedCircuit) else None


def _stated_error(source: Field) -> dict[str, float] | None:
    """What a solution says of itself."""
    error = getattr(source, "error", None)
    return {key: float(error[key]) for key in ("B", "gradient")} if isinstance(error, dict) else None


def _has_room(candidate: Candidate, data: dict[str, LayeredData]) -> bool:
    """Whether the candidate's window, if it has one, holds points enough to fit it and to judge it."""
    window = candidate.window or Everywhere()
    return all(
        np.count_nonzero(window.contains(data[name].points[: data[name].spread])) >= 5 * candidate.parameters
        for name in ("training", "heldout")
    )


def _compare(candidate: Candidate, data: dict[str, LayeredData], ours: Terms) -> dict[str, Any]:
    """A family of the dissertation, fitted to the same data its way: plain least squares on B (2.8).

    Where the family is meant for a part of the region, it is fitted and judged in its window only, and our
    model is judged there beside it.
    """
    training, heldout = data["training"], data["heldout"]
    window = candidate.window or Everywhere()
    seen = window.contains(training.points)
    (columns,) = candidate.columns(training.points[seen], 0)
    solved = solve_least_squares(columns.reshape(candidate.parameters, -1).T, training.B[seen].ravel())
    terms = candidate.with_parameters(solved.parameters)
    counted = window.contains(heldout.points)
    theirs = layer_errors(terms.jet(heldout.flat, 1), heldout, counted)
    same = layer_errors(ours.jet(heldout.flat, 1), heldout, counted)
    return {
        "family": candidate.family,
        "label": candidate.label,
        "source": candidate.source,
        "window": candidate.window.describe() if candidate.window else "the whole region",
        "parameters": candidate.parameters,
        "condition": solved.condition,
        "heldout": theirs,
        "ours": same,
        "terms": terms_to_list(terms),
    }
