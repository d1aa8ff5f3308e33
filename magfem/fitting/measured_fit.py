"""From measured samples to a field model: families, order by held-out data, free parameters, noise and bias apart."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.fem import solve
from magfem.fields.region import SampledRegion, Shell
from magfem.fields.workspace_region import Ball, Box
from magfem.fitting.alignment import alignment_of
from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.families import SAMPLE_FAMILIES, family_of, members, sample_members, suitable_families
from magfem.fitting.field_fit import fit_field
from magfem.fitting.held_out import Tried, predicted, smallest_of_the_best
from magfem.fitting.measured_report import measured_report
from magfem.fitting.measurement import Measurement, solve_measurement
from magfem.fitting.model import FieldModel
from magfem.fitting.provenance import versions_and_date
from magfem.fitting.recipe import DEVICE, SEARCH, Recipe
from magfem.geometry import describe
from magfem.geometry.geometry import Geometry, Magnets
from magfem.samples import Samples

log = logging.getLogger("magfem")

_STRONGEST = 2.0  # T
_HALF = 0.5  # of the samples' field: a model that leaves more is none
_MANY = 200  # samples, from which regions are held out rather than single ones
_ENOUGH = 1.5  # measured components for each parameter: fewer leave nothing to judge a candidate by
_WORSE = 2  # candidates in a row that predict worse than the best end the search


def fit_samples(samples: Samples, recipe: Recipe | None = None) -> FieldModel:
    """Fit a field model to measured samples.

    recipe: family, free parameters, weighting and what else a Recipe says. With a device, its family in its region;
    the family "device" is the device's own field with one factor. Without one, interior harmonics about the middle of
    the samples, in a ball about them. The order is the smallest that predicts held-out samples as well as the best
    does, within one standard error; single samples are held out, or, from 200 on, whole regions.
    Raises InputError for what does not fit together, ConvergenceError when nothing describes the samples.
    """
    recipe = recipe or Recipe()
    _check(samples, recipe)
    weighting = recipe.weighting or ("sigma" if samples.sigma is not None else "absolute")
    heldout = recipe.heldout or ("regions" if samples.count >= _MANY else "samples")
    alignment = alignment_of(recipe.free, float(np.linalg.norm(samples.extent)))
    # What is known of the device is its strength or the sensor's gain: with the one free the other is fixed.
    strength_known = recipe.family == DEVICE and "gain" in alignment.names
    if strength_known:
        alignment = alignment.without("gain")
    tried: list[Tried] = []
    rows = int(np.count_nonzero(samples.measured))
    for family in _families(recipe):
        own: list[Tried] = []
        for member in _members(family, samples, recipe):
            measurement = Measurement(
                samples, member, alignment, recipe.background, weighting, recipe.ridge or "evidence", recipe.loss
            )
            linear = member.parameters + 3 * recipe.background
            if _ENOUGH * (linear + len(measurement.free)) > rows or (recipe.most_parameters or rows) < linear:
                continue
            solved = solve_measurement(measurement)
            if not np.isfinite(solved.solved.condition):  # the samples say nothing of some of its parameters
                continue
            own.append(Tried(solved, predicted(solved, heldout), strength_known))
            best = min(one.score for one in own)
            if len(own) > _WORSE and all(one.score > best for one in own[-_WORSE:]):
                break
        tried += own
    if not tried:
        raise ConvergenceError(
            f"{rows} measured components are too few, or in too few places, for any model of this family, which takes "
            f"{_ENOUGH:g} for each parameter; a symmetry (axial, diametric, plane_z, …) leaves fewer parameters "
            f"[{samples.source}]"
        )
    chosen = smallest_of_the_best(tried)
    if chosen.unexplained > _HALF:
        raise ConvergenceError(
            f"no model of the family {chosen.fit.candidate.family} describes these samples: of held-out ones "
            f"{chosen.unexplained:.0%} of the field remain; another family or a device will [{samples.source}]"
        )
    _say_what_was_left(tried, chosen)
    return _model(samples, recipe, tried, chosen, heldout)


def _check(samples: Samples, recipe: Recipe) -> None:
    """Raise InputError for samples that no model can be made of, or that do not go with the recipe."""
    where = f" [{samples.source}]" if samples.source else ""
    if recipe.weighting == "sigma" and samples.sigma is None:
        raise InputError(f"these samples state no standard deviations to weigh them by{where}")
    if not np.any(np.nan_to_num(samples.B)):
        raise InputError(f"the field of these samples is zero throughout: there is nothing to fit{where}")
    if not np.any(samples.extent):
        raise InputError(f"these samples lie all at one place: a field needs several{where}")
    if samples.unit == "T/A" and isinstance(recipe.geometry, Magnets):
        raise InputError(f"samples per ampere do not belong to a magnet, {recipe.geometry.name}{where}")


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
    region = recipe.region or _as_near_as(samples, geometry)
    yield from members(family, geometry, region, recipe.family_options(family))


def _as_near_as(samples: Samples, geometry: Geometry) -> Shell:
    """The device's region, from the nearest sample outside it to the farthest: what the sources must be made for."""
    region = geometry.region
    distance = region.hull.distance(samples.points)
    outside = distance[distance > 1e-3 * region.clearance]
    if not outside.size:
        return region
    near = float(outside.min())
    return replace(region, clearance=near, extent=max(float(outside.max()), 1.001 * near))


def _device(geometry: Geometry, recipe: Recipe) -> Candidate:
    """The device's own solved and fitted field, with one factor."""
    solution = solve(geometry, recipe.dimension, recipe.resolution)
    model = fit_field(solution, Recipe(geometry=geometry, region=recipe.region, circuit=recipe.circuit))
    parameter = np.zeros(model.lowered.coefficient.size, dtype=np.int64)
    return Candidate(DEVICE, f"the device's own field, {model.report['label']}", model.lowered, parameter)


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
    terms = chosen.terms
    terms.check_sources()
    own = fit.candidate.parameters
    model = FieldModel(
        name=recipe.name or (recipe.geometry.name if recipe.geometry else f"samples of {samples.source}"),
        lowered=terms,
        parameter=fit.candidate.parameter,
        covariance=np.zeros((own, own)) if chosen.strength_known else fit.covariance[:own, :own],
        region=_region(samples, recipe, chosen),
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
        share=fit.candidate.terms.coefficient,
    )
    report = measured_report(model, recipe, tried, chosen, heldout)
    remanence = report["measurement"].get("remanence", {"value": 0.0})["value"]
    if abs(remanence) > _STRONGEST:
        log.warning("fit: no magnet has a remanence of %.3g T: do the columns state their units?", remanence)
    if report["uncertainty"]["bias_dominates"]:
        log.warning("fit: the model's own error is larger than the noise: deviations of the field say too little")
    if fit.degenerate:
        log.warning(
            "fit: these data do not decide %s: no deviation is stated; fix what is known, or the sources' geometry",
            " and ".join(fit.degenerate),
        )
    log.info(
        "fit: %s, %d parameters, held-out residual %.2g mT RMS",
        fit.candidate.label,
        own,
        1e3 * report["heldout"]["B"]["absolute_rms"],
    )
    return replace(model, report=report)


def _region(samples: Samples, recipe: Recipe, chosen: Tried) -> SampledRegion:
    """Where the model is promised: as far as the samples reach, in the source's frame.

    With a device, its region, which must hold samples, for free coefficients only between the nearest and the
    farthest of them; without one a ball for interior harmonics, else a box.
    """
    fit = chosen.fit
    alignment = fit.measurement.alignment
    points = alignment.in_source_frame(samples.points, fit.theta[fit.theta.size - len(alignment.names) :])
    if recipe.geometry is not None:
        free = recipe.family != DEVICE and recipe.region is None
        region = recipe.region or (_as_near_as(samples, recipe.geometry) if free else recipe.geometry.region)
        inside = region.contains(points)
        if not inside.any():
            raise InputError(
                f"none of the samples lies in the region of {recipe.geometry.name} ({region.describe()}): state in the "
                f"recipe where the model is to hold [{samples.source}]"
            )
        if recipe.family == DEVICE:
            return region
        distance = region.hull.distance(points[inside])
        return replace(
            region, clearance=float(distance.min()), extent=float(max(distance.max(), 1.001 * distance.min()))
        )
    if fit.candidate.family == "interior_harmonics":
        x, y, z = fit.candidate.terms.centre[0].tolist()
        return Ball((x, y, z), float(np.linalg.norm(points - fit.candidate.terms.centre[0], axis=1).max()))
    low, high = points.min(axis=0), points.max(axis=0)
    thick = 0.02 * float(np.ptp(points, axis=0).max())  # a plane or a line of samples still has a volume
    flat = high - low < thick
    low, high = np.where(flat, low - thick / 2, low), np.where(flat, high + thick / 2, high)
    return Box(tuple(low.tolist()), tuple(high.tolist()))
