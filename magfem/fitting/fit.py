"""From field data to a field model: sample, solve, choose the order, and say how good the result is."""

from __future__ import annotations

import datetime
import importlib.metadata
import logging
import platform
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.fem.solution import Solution, describe
from magfem.fields.field import Field
from magfem.fields.norms import relative_errors
from magfem.fields.region import Everywhere, Shell
from magfem.fields.terms import Terms
from magfem.fields.terms_json import terms_to_list
from magfem.fitting.families import FAMILIES, Candidate, dissertation_families, family_of
from magfem.fitting.least_squares import LeastSquares, solve_least_squares
from magfem.fitting.model import FieldModel
from magfem.fitting.recipe import Recipe, fittable
from magfem.geometry import Coil, Geometry, Magnets
from magfem.typing import Booleans, Floats, Points
from magfem.version import __version__

log = logging.getLogger("magfem")

CONDITION = 1e7
"""Largest condition number of the scaled columns that a model may have."""

_GRADIENT_WEIGHT = 0.1  # relative errors of the gradient weigh a tenth of those of B, as the targets do
_SAFETY = 1.5  # on the held-out maximum: other random points may hit a little harder
_SAMPLES = {"training": (28, 24, 0), "selection": (24, 24, 10), "heldout": (64, 34, 15)}
"""Layers, points in each, and further layers at the clearance itself: there errors are largest, and local."""


@dataclass(frozen=True)
class Samples:
    """Field data on layers of equal hull distance: points, B and gradient, shapes (l, p, …).

    The first `spread` layers are spread over the region, the others lie at its clearance.
    """

    points: Points
    B: Floats
    gradient: Floats
    spread: int


@dataclass(frozen=True)
class Fitted:
    """A candidate with its parameters, and its errors on the points that chose it and on held-out ones."""

    candidate: Candidate
    solved: LeastSquares
    selection: dict[str, Any]


def fit(source: Field, recipe: Recipe | None = None) -> FieldModel:
    """Fit a field model to a solution, or to any Field of a device.

    recipe: family, targets and seed; by default what suits the device. A source that is not a Solution must
    bring its device as `source.geometry`, or the recipe must name one.
    The order is the smallest whose errors stay below half the targets on points of their own, with a
    condition number up to 1e7. Raises InputError for a source without a device,
    and for a field that is not finite or vanishes.
    """
    recipe = recipe or Recipe()
    if not isinstance(recipe, Recipe):
        raise InputError("fit takes a Recipe: magfem.fitting.load_recipe reads one from a file")
    geometry = _device(source, recipe)
    region = geometry.region
    seeds = np.random.SeedSequence(recipe.seed).spawn(len(_SAMPLES))
    samples = {
        name: _sample(source, region, np.random.default_rng(seed), *shape)
        for (name, shape), seed in zip(_SAMPLES.items(), seeds, strict=True)
    }
    log.info("field: %d sample points", sum(data.points[..., 0].size for data in samples.values()))
    tried = _climb(geometry, recipe, samples)
    chosen = _choose(tried, recipe)
    terms = chosen.candidate.with_parameters(chosen.solved.parameters)
    jets = {name: terms.jet(data.points.reshape(-1, 3), 1) for name, data in samples.items()}
    training, heldout = (_errors(jets[name], samples[name]) for name in ("training", "heldout"))
    fem = {key: source.error[key] for key in ("B", "gradient")} if isinstance(source, Solution) else None
    bound = {key: _SAFETY * heldout[key]["max"] + (fem[key] if fem else 0.0) for key in ("B", "gradient")}
    log.info(
        "fit: %s, %d parameters, held-out error %.1e in B, %.1e in the gradient",
        chosen.candidate.label,
        chosen.candidate.parameters,
        heldout["B"]["max"],
        heldout["gradient"]["max"],
    )
    return FieldModel(
        name=geometry.name,
        lowered=terms,
        parameter=chosen.candidate.parameter,
        covariance=chosen.solved.covariance,
        region=region,
        report={
            **_headline(chosen),
            "target": {"B": recipe.target_B, "gradient": recipe.target_gradient},
            "training": training,
            "heldout": heldout,
            "fem": fem,
            "bound": bound,
            "worst": _worst(jets["heldout"], samples["heldout"], region),
            "candidates": [{**_headline(one), "selection": one.selection} for one in tried],
            "comparison": [
                _compare(candidate, samples, terms)
                for candidate in dissertation_families(geometry)
                if _has_room(candidate, samples)
            ],
        },
        provenance=_provenance(source, geometry),
        unit=source.unit,
    )


def _device(source: Field, recipe: Recipe) -> Magnets:
    """The device that source and recipe speak of."""
    if isinstance(source, Coil):
        fittable(source)
    if not isinstance(source, Field):
        raise InputError("fit takes a field: a solution of magfem.solve, or any object with the Field interface")
    own: Geometry | None = getattr(source, "geometry", None)
    if own is None and recipe.geometry is None:
        raise InputError(
            "cannot tell which device this field belongs to: fit(source, recipe) with a recipe that names it"
        )
    if own is not None:
        fittable(own)
    if own is not None and recipe.geometry is not None and own != recipe.geometry:
        raise InputError(f"the recipe is for {recipe.geometry.name}, but the field is that of {own.name}")
    geometry = recipe.geometry or own
    assert geometry is not None
    return fittable(geometry)


def _sample(
    source: Field, region: Shell, rng: np.random.Generator, layers: int, per_layer: int, nearest: int
) -> Samples:
    spread = region.layers(rng, layers, per_layer)
    closest = np.full(nearest, region.clearance)
    points = np.concatenate([spread, region.hull.marked_points(closest, per_layer, rng)])
    B, gradient = source.jet(points, 1)
    if not (np.isfinite(B).all() and np.isfinite(gradient).all()):
        raise InputError("cannot fit this field: it holds values that are not finite in the device's region")
    if not (B.any(axis=(1, 2)).all() and gradient.any(axis=(1, 2, 3)).all()):
        raise InputError("cannot fit this field: it vanishes at some distance from the device, or does not change")
    return Samples(points, B, gradient, layers)


def _climb(geometry: Magnets, recipe: Recipe, samples: dict[str, Samples]) -> list[Fitted]:
    """Fit the family's candidates, from few parameters to many, until one is good enough."""
    family = recipe.family or family_of(geometry)
    tried: list[Fitted] = []
    for candidate in FAMILIES[family](geometry):
        solved = _solve(candidate, samples["training"])
        if solved.condition > CONDITION:
            continue
        terms = candidate.with_parameters(solved.parameters)
        selection = _errors(terms.jet(samples["selection"].points.reshape(-1, 3), 1), samples["selection"])
        tried.append(Fitted(candidate, solved, selection))
        if _score(tried[-1], recipe) <= 0.5:
            break
    return tried


def _choose(tried: list[Fitted], recipe: Recipe) -> Fitted:
    """The first candidate below half the targets, else the best; says so when that misses them.

    Raises ConvergenceError when even the best is no model: its error of B is above 100 %.
    """
    if not tried:
        raise ConvergenceError(
            f"no model of this device has a condition number up to {CONDITION:.0e}: its terms are too alike"
        )
    chosen = min(tried, key=lambda one: _score(one, recipe))
    B, gradient = (chosen.selection[key]["max"] for key in ("B", "gradient"))
    if not B < 1:
        raise ConvergenceError(
            f"no model of the family {chosen.candidate.family} describes this field: the best of {len(tried)} errs by "
            f"{B:.1e} in B; a larger clearance in the card's region is what helps"
        )
    if _score(chosen, recipe) > 1:
        log.warning(
            "the targets are missed: %.1e in B (wanted %.1e), %.1e in the gradient (wanted %.1e); "
            "the stated bound says how good the model is, a larger clearance makes it better",
            *(B, recipe.target_B, gradient, recipe.target_gradient),
        )
    return chosen


def _score(fitted: Fitted, recipe: Recipe) -> float:
    """Largest error against its target."""
    B, gradient = (float(fitted.selection[key]["max"]) for key in ("B", "gradient"))
    return max(B / recipe.target_B, gradient / recipe.target_gradient)


def _solve(candidate: Candidate, samples: Samples) -> LeastSquares:
    """Least squares on B and gradient, each layer against its own root mean square, so that far points count."""
    rows, targets = [], []
    columns = candidate.columns(samples.points.reshape(-1, 3))
    for column, data, weight in zip(columns, (samples.B, samples.gradient), (1.0, _GRADIENT_WEIGHT), strict=True):
        per_point = tuple(range(2, data.ndim))
        mean_square = np.mean(np.sum(data**2, axis=per_point), axis=1)
        scale = weight / np.sqrt(mean_square).reshape(-1, *[1] * (data.ndim - 1))
        rows.append((column.reshape(-1, *data.shape) * scale).reshape(candidate.parameters, -1))
        targets.append((data * scale).ravel())
    return solve_least_squares(np.concatenate(rows, axis=1).T, np.concatenate(targets))


def _errors(jet: tuple[Floats, ...], samples: Samples, counted: Booleans | None = None) -> dict[str, Any]:
    """Largest relative errors over the `counted` (l, p) samples (default: all); root mean square of the spread ones."""
    counted = np.ones(samples.points.shape[:2], dtype=bool) if counted is None else counted
    spread = counted & (np.arange(counted.shape[0]) < samples.spread)[:, None]
    result: dict[str, Any] = {"points": int(np.count_nonzero(counted))}
    for key, found, truth in zip(("B", "gradient"), jet, (samples.B, samples.gradient), strict=True):
        errors = relative_errors(found.reshape(truth.shape), truth)
        result[key] = {"max": float(errors[counted].max()), "rms": float(np.sqrt(np.mean(errors[spread] ** 2)))}
    return result


def _worst(jet: tuple[Floats, ...], samples: Samples, region: Shell) -> dict[str, Any]:
    """Where the largest errors are: point and hull distance, m."""
    worst: dict[str, Any] = {}
    for key, found, truth in zip(("B", "gradient"), jet, (samples.B, samples.gradient), strict=True):
        errors = relative_errors(found.reshape(truth.shape), truth)
        point = samples.points[np.unravel_index(np.argmax(errors), errors.shape)]
        distance = float(region.hull.distance(point))
        worst[key] = {"point": point.tolist(), "distance": distance, "error": float(errors.max())}
    return worst


def _headline(fitted: Fitted) -> dict[str, Any]:
    candidate = fitted.candidate
    return {
        "family": candidate.family,
        "label": candidate.label,
        "parameters": candidate.parameters,
        "condition": fitted.solved.condition,
    }


def _has_room(candidate: Candidate, samples: dict[str, Samples]) -> bool:
    """Whether the candidate's window, if it has one, holds points enough to fit it and to judge it."""
    window = candidate.window or Everywhere()
    return all(
        np.count_nonzero(window.contains(samples[name].points[: samples[name].spread])) >= 5 * candidate.parameters
        for name in ("training", "heldout")
    )


def _compare(candidate: Candidate, samples: dict[str, Samples], ours: Terms) -> dict[str, Any]:
    """A family of the dissertation, fitted to the same data its way: plain least squares on B (2.8).

    Where the family is meant for a part of the region, it is fitted and judged in its window only, and our
    model is judged there beside it.
    """
    training, heldout = samples["training"], samples["heldout"]
    window = candidate.window or Everywhere()
    seen = window.contains(training.points)
    columns, _ = candidate.columns(training.points[seen])
    solved = solve_least_squares(columns.reshape(candidate.parameters, -1).T, training.B[seen].ravel())
    terms = candidate.with_parameters(solved.parameters)
    counted = window.contains(heldout.points)
    points = heldout.points.reshape(-1, 3)
    theirs = _errors(terms.jet(points, 1), heldout, counted)
    same = _errors(ours.jet(points, 1), heldout, counted)
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


def _provenance(source: Field, geometry: Geometry) -> dict[str, Any]:
    packages = ("numpy", "scipy", "numba", "gmsh", "scikit-fem", "pyamg")
    solution = source if isinstance(source, Solution) else None
    return {
        "device": describe(geometry),
        "source": "finite elements" if solution else type(source).__name__,
        "solver": solution and solution.settings,
        "solution": solution and {"error": solution.error, "quantities": solution.quantities, "stats": solution.stats},
        "versions": {
            "python": platform.python_version(),
            "magfem": __version__,
            **{package: _version(package) for package in packages},
        },
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
