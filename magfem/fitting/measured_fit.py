"""From measured samples to a field model: families, order by held-out data, free parameters, noise and bias apart."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.fem import solve
from magfem.fields.region import SampledRegion
from magfem.fields.terms import Terms
from magfem.fields.workspace_region import Ball, Box
from magfem.fitting.alignment import alignment_of
from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.families import SAMPLE_FAMILIES, family_of, members, sample_members, suitable_families
from magfem.fitting.families.free import ball_about
from magfem.fitting.measurement import MeasuredFit, Measurement, solve_measurement
from magfem.fitting.model import FieldModel
from magfem.fitting.provenance import versions_and_date
from magfem.fitting.recipe import DEVICE, SEARCH, Recipe
from magfem.geometry import describe
from magfem.geometry.geometry import Geometry, Magnets
from magfem.samples import Samples
from magfem.typing import Floats, Integers

log = logging.getLogger("magfem")

_SAFETY = 1.5  # on the largest held-out error: other points may hit a little harder
_REGIONS = 8  # that samples are cut into where regions are held out
_MANY = 200  # samples, from which regions are held out rather than single ones
_FLOOR = 0.01  # of the largest field: smaller ones do not count relative to themselves
_AT_BOUND = 1e-4  # of the bounds' distance: nearer to one of them a free parameter has reached it
_WORSE = 2  # candidates in a row that predict worse than the best end the search


@dataclass(frozen=True)
class Tried:
    """A candidate fitted to samples. predicted: (n,) held-out residual of every sample, |ΔB| in units of its scale."""

    fit: MeasuredFit
    predicted: Floats

    @property
    def score(self) -> float:
        """Mean square of the held-out residuals."""
        return float(np.mean(self.predicted**2))

    @property
    def parameters(self) -> int:
        """Linear and nonlinear ones, background included."""
        return len(self.fit.solved.parameters) + self.fit.theta.size


def fit_samples(samples: Samples, recipe: Recipe | None = None) -> FieldModel:
    """Fit a field model to measured samples.

    recipe: family, free parameters, weighting and what else a Recipe says. With a device, its family in its region;
    the family "device" is the device's own field with one factor. Without one, interior harmonics about the middle of
    the samples, in a ball about them. The order is the smallest that predicts held-out samples as well as the best
    does, within one standard error; single samples are held out, or, from 200 on, whole regions.
    Raises InputError for what does not fit together, ConvergenceError when nothing describes the samples.
    """
    recipe = recipe or Recipe()
    weighting = recipe.weighting or ("sigma" if samples.sigma is not None else "absolute")
    if weighting == "sigma" and samples.sigma is None:
        raise InputError(f"these samples state no standard deviations to weigh them by [{samples.source}]")
    heldout = recipe.heldout or ("regions" if samples.count >= _MANY else "samples")
    alignment = alignment_of(recipe.free, float(np.linalg.norm(samples.extent)))
    tried: list[Tried] = []
    rows = int(np.count_nonzero(samples.measured))
    for family in _families(recipe):
        own: list[Tried] = []
        for member in _members(family, samples, recipe):
            measurement = Measurement(
                samples, member, alignment, recipe.background, weighting, recipe.ridge or "evidence", recipe.loss
            )
            linear = member.parameters + 3 * recipe.background
            if linear + len(measurement.free) >= rows or (recipe.most_parameters or rows) < linear:
                continue
            solved = solve_measurement(measurement)
            if not np.isfinite(solved.solved.condition):  # the samples say nothing of some of its parameters
                continue
            own.append(Tried(solved, _predicted(solved, heldout)))
            best = min(one.score for one in own)
            if len(own) > _WORSE and all(one.score > best for one in own[-_WORSE:]):
                break
        tried += own
    if not tried:
        raise ConvergenceError(
            f"{rows} measured components are too few, or in too few places, for any model of this family; a symmetry "
            f"leaves fewer parameters [{samples.source}]"
        )
    chosen = _smallest_of_the_best(tried)
    _say_what_was_left(tried, chosen)
    return _model(samples, recipe, tried, chosen, heldout)


def _families(recipe: Recipe) -> list[str]:
    """The family that the recipe names, what suits its device or its lack of one, or all that do."""
    if recipe.family == SEARCH:
        return suitable_families(recipe.geometry) if recipe.geometry else list(SAMPLE_FAMILIES)
    if recipe.family is not None:
        return [recipe.family]
    return [family_of(recipe.geometry) if recipe.geometry else "interior_harmonics"]


def _members(family: str, samples: Samples, recipe: Recipe) -> Iterator[Candidate | Displaceable]:
    if family in SAMPLE_FAMILIES:
        yield from sample_members(family, samples, recipe.options)
        return
    geometry = recipe.geometry
    if geometry is None:
        raise InputError(f"the family {family} needs a device: name one in the recipe")
    if family == DEVICE:
        yield _device(geometry, recipe)
        return
    yield from members(family, geometry, recipe.region or geometry.region, recipe.family_options(family))


def _device(geometry: Geometry, recipe: Recipe) -> Candidate:
    """The device's own solved and fitted field, with one factor."""
    from magfem.fitting.fit import fit  # which itself hands samples on to this module

    solution = solve(geometry, recipe.dimension, recipe.resolution)
    model = fit(solution, Recipe(geometry=geometry, region=recipe.region, circuit=recipe.circuit))
    parameter = np.zeros(model.lowered.coefficient.size, dtype=np.int64)
    return Candidate(DEVICE, f"the device's own field, {model.report['label']}", model.lowered, parameter)


def _predicted(fit: MeasuredFit, heldout: str) -> Floats:
    """|held-out residual| (n,) of every sample, in units of its scale."""
    measurement = fit.measurement
    point = measurement.point_of_row
    residual = fit.left_out
    if heldout == "regions":
        residual = np.empty_like(fit.left_out)
        fold = regions(measurement.samples.points)[point]
        for number in range(fold.max() + 1):
            out = fold == number
            residual[out] = fit.solved.without(measurement.target * fit.weight, out) / fit.weight[out]
    squares = np.bincount(point, (fit.weight * residual) ** 2, measurement.samples.count)
    return np.sqrt(squares)


def regions(points: Floats) -> Integers:
    """Eight regions (n,) of points (n, 3), by halving three times across the longest extent."""
    number = np.zeros(len(points), dtype=np.int64)
    for _ in range(3):
        halved = np.empty_like(number)
        for one in np.unique(number):
            own = np.flatnonzero(number == one)
            axis = int(np.argmax(np.ptp(points[own], axis=0)))
            order = own[np.argsort(points[own, axis], kind="stable")]
            halved[order[: len(order) // 2]] = 2 * one
            halved[order[len(order) // 2 :]] = 2 * one + 1
        number = np.unique(halved, return_inverse=True)[1]
    return number


def _smallest_of_the_best(tried: list[Tried]) -> Tried:
    """The smallest whose held-out squares exceed the best ones by no more than one standard error of the difference."""
    best = min(tried, key=lambda one: one.score)
    for one in sorted(tried, key=lambda one: one.parameters):
        difference = one.predicted**2 - best.predicted**2
        if difference.mean() <= difference.std() / np.sqrt(difference.size):
            return one
    return best


def _say_what_was_left(tried: list[Tried], chosen: Tried) -> None:
    larger = [one for one in tried if one.parameters > chosen.parameters]
    closer = [one for one in larger if np.mean(one.fit.residual**2) < np.mean(chosen.fit.residual**2)]
    if closer:
        log.info(
            "fit: %s; %s fits closer and predicts held-out samples %s",
            chosen.fit.candidate.label,
            closer[-1].fit.candidate.label,
            "worse" if closer[-1].score > chosen.score else "no better than chance makes it",
        )


def _model(samples: Samples, recipe: Recipe, tried: list[Tried], chosen: Tried, heldout: str) -> FieldModel:
    fit = chosen.fit
    candidate, solved, alignment = fit.candidate, fit.solved, fit.measurement.alignment
    own = candidate.parameters
    gain = alignment.values(fit.theta[fit.theta.size - len(alignment.names) :])["gain"]
    terms = candidate.with_parameters(gain * solved.parameters[:own])
    terms.check_sources()
    region = _region(samples, recipe, candidate)
    runner_up = min((one for one in tried if one is not chosen), key=lambda one: one.score, default=None)
    model = FieldModel(
        name=recipe.name or (recipe.geometry.name if recipe.geometry else f"samples of {samples.source}"),
        lowered=terms,
        parameter=candidate.parameter,
        covariance=gain**2 * fit.covariance[:own, :own],
        region=region,
        report={},
        provenance={
            "device": describe(recipe.geometry) if recipe.geometry else None,
            "source": "measured samples",
            "samples": {"source": samples.source, "points": samples.count},
            "solver": None,
            "solution": None,
            **versions_and_date(),
        },
        unit=samples.unit,
        share=candidate.terms.coefficient,
    )
    training, predicted = (_errors(chosen, values) for values in (_sizes(fit), chosen.predicted))
    gradient = _gradient_errors(model, runner_up)
    bound = {"B": _SAFETY * predicted["B"]["max"], "gradient": _SAFETY * gradient["max"]}
    uncertainty = _uncertainty(tried, chosen)
    if uncertainty["bias_dominates"]:
        log.warning("fit: the model's own error is larger than the noise: deviations of the field say too little")
    if fit.degenerate:
        log.warning(
            "fit: these data do not decide %s: no deviation is stated; fix what is known, or the sources' geometry",
            " and ".join(fit.degenerate),
        )
    worst = int(np.argmax(chosen.predicted * _scale_of_points(fit)))
    report = {
        "family": candidate.family,
        "label": candidate.label,
        "parameters": candidate.parameters,
        "condition": solved.condition,
        "objective": fit.measurement.weighting,
        "target": None,
        "training": {**training, "gradient": gradient},
        "heldout": {**predicted, "gradient": gradient},
        "held_out": heldout,
        "fem": None,
        "bound": bound,
        "worst": {
            "B": {"point": samples.points[worst].tolist(), "distance": None, "error": predicted["B"]["max"]},
        },
        "candidates": [_headline(one) for one in tried],
        "comparison": [],
        "measurement": _findings(fit, recipe, uncertainty),
        "uncertainty": uncertainty,
    }
    log.info(
        "fit: %s, %d parameters, held-out residual %.2g mT RMS",
        candidate.label,
        candidate.parameters,
        1e3 * predicted["B"]["absolute_rms"],
    )
    return replace(model, report=report)


def _region(samples: Samples, recipe: Recipe, candidate: Candidate) -> SampledRegion:
    """The device's region, or what the samples fill: a ball for interior harmonics, else a box."""
    if recipe.region is not None:
        return recipe.region
    if recipe.geometry is not None:
        return recipe.geometry.region
    if candidate.family == "interior_harmonics":
        _, radius = ball_about(samples)
        x, y, z = candidate.terms.centre[0].tolist()
        return Ball((x, y, z), radius)
    low, high = samples.points.min(axis=0), samples.points.max(axis=0)
    thick = 0.02 * float(np.ptp(samples.points, axis=0).max())  # a plane or a line of samples still has a volume
    flat = high - low < thick
    low, high = np.where(flat, low - thick / 2, low), np.where(flat, high + thick / 2, high)
    return Box(tuple(low.tolist()), tuple(high.tolist()))


def _sizes(fit: MeasuredFit) -> Floats:
    """|residual| (n,) of every sample, in units of its scale."""
    squares = np.bincount(fit.measurement.point_of_row, fit.solved.residual**2, fit.measurement.samples.count)
    return np.sqrt(squares)


def _scale_of_points(fit: MeasuredFit) -> Floats:
    """(n,) T per unit of scaled residual."""
    mean: Floats = np.nanmean(np.where(fit.measurement.measured, fit.measurement.scale, np.nan), axis=1)
    return mean


def _errors(tried: Tried, sizes: Floats) -> dict[str, Any]:
    """Residuals (n,) in units of their scale: relative to |B|, floored, and in T."""
    samples = tried.fit.measurement.samples
    absolute = sizes * _scale_of_points(tried.fit)
    field = np.sqrt(np.nansum(samples.B**2, axis=1))
    relative = absolute / np.maximum(field, _FLOOR * field.max())
    return {
        "points": samples.count,
        "B": {
            "max": float(relative.max()),
            "rms": float(np.sqrt(np.mean(relative**2))),
            "absolute_max": float(absolute.max()),
            "absolute_rms": float(np.sqrt(np.mean(absolute**2))),
        },
    }


def _gradient_errors(model: FieldModel, runner_up: Tried | None) -> dict[str, Any]:
    """What nobody measured: two standard deviations, and how far the next best model's gradient is from this one's."""
    points = model.region.layers(np.random.default_rng(0), layers=16, per_layer=16).reshape(-1, 3)
    gradient = model.gradient(points, "extrapolate")
    error = 2 * np.linalg.norm(model.deviation(points, "extrapolate")[1], axis=(1, 2))
    if runner_up is not None:
        candidate, solved = runner_up.fit.candidate, runner_up.fit.solved
        other: Terms = candidate.with_parameters(solved.parameters[: candidate.parameters])
        error = np.hypot(error, np.linalg.norm(other.jet(points, 1)[1] - gradient, axis=(1, 2)))
    size = np.linalg.norm(gradient, axis=(1, 2))
    relative = error / np.maximum(np.maximum(size, _FLOOR * size.max()), 1e-300)
    return {"max": float(relative.max()), "rms": float(np.sqrt(np.mean(relative**2))), "estimated": True}


def _headline(one: Tried) -> dict[str, Any]:
    candidate = one.fit.candidate
    return {
        "family": candidate.family,
        "label": candidate.label,
        "parameters": candidate.parameters,
        "condition": one.fit.solved.condition,
        "training_rms": float(np.sqrt(np.mean(one.fit.residual**2))),
        "heldout_rms": float(np.sqrt(one.score)),
    }


def _findings(fit: MeasuredFit, recipe: Recipe, uncertainty: dict[str, Any]) -> dict[str, Any]:
    """Free parameters with deviations, the background, outliers.

    Where the model's own error dominates, deviations are those of a noise that is as large as the residual.
    """
    linear = len(fit.solved.parameters)
    inflated = uncertainty["standardised_residual"] if uncertainty["bias_dominates"] else 1.0
    deviation = inflated * np.sqrt(np.diag(fit.covariance))
    low, high = fit.measurement.bounds
    at_bound = np.minimum(fit.theta - low, high - fit.theta) < _AT_BOUND * (high - low)
    free = {
        name: {
            "value": float(fit.theta[k]),
            "deviation": None if name in fit.degenerate else float(deviation[linear + k]),
            "at_bound": bool(at_bound[k]),
        }
        for k, name in enumerate(fit.measurement.free)
    }
    findings: dict[str, Any] = {
        "ridge": fit.solved.ridge,
        "effective_parameters": fit.solved.effective,
        "free": free,
        "degenerate": list(fit.degenerate),
        "outliers": int(np.count_nonzero(fit.weight < 0.5)),
    }
    if fit.measurement.background:
        findings["background"] = {
            "value": fit.solved.parameters[-3:].tolist(),
            "deviation": deviation[linear - 3 : linear].tolist(),
        }
    if recipe.family == DEVICE and isinstance(recipe.geometry, Magnets):
        nominal = recipe.geometry.bodies[0].material.remanence
        findings["remanence"] = {
            "value": float(fit.solved.parameters[0] * nominal),
            "deviation": float(deviation[0] * nominal),
        }
    return findings


def _uncertainty(tried: list[Tried], chosen: Tried) -> dict[str, Any]:
    """Noise of one component, and what the model leaves beyond it, T; whether that is more than the noise."""
    fit = chosen.fit
    rows = fit.residual.size
    spread = np.sqrt(np.sum(fit.solved.residual**2) / max(rows - fit.solved.effective - fit.theta.size, 1.0))
    typical = float(np.sqrt(np.nanmean(fit.measurement.scale**2)))
    stated = fit.measurement.variance is not None
    if stated:
        noise = 1.0
    else:  # what the richest candidates leave is the noise, as far as anybody can tell
        left = [
            float(np.sum(one.fit.solved.residual**2) / (rows - one.parameters))
            for one in tried
            if rows - one.parameters >= max(3, rows // 10)
        ]
        noise = float(np.sqrt(min([*left, float(spread) ** 2])))
    beyond = float(np.sqrt(max(float(spread) ** 2 - noise**2, 0.0)))
    dominates = beyond > noise
    return {
        "noise": noise * typical,
        "noise_from": "the samples' deviations" if stated else "what the richest candidates leave",
        "model_error": beyond * typical,
        "standardised_residual": float(spread / noise) if noise > 0 else None,
        "bias_dominates": bool(dominates),
    }
