"""What a fit of samples says of itself: residuals, noise and bias apart, bounds, and what else it found."""

from __future__ import annotations

from typing import Any

import numpy as np

from magfem.fields.norms import FLOOR
from magfem.fitting.held_out import Tried
from magfem.fitting.measurement import MeasuredFit
from magfem.fitting.model import FieldModel
from magfem.fitting.recipe import DEVICE, Recipe
from magfem.geometry.geometry import Magnets
from magfem.typing import Floats

_SAFETY = 1.5  # on the largest estimated error: other points may be a little worse
_ALLOWED = 3.0  # standard deviations of one component that noise may be without being called an error
_AT_BOUND = 1e-4  # of the bounds' distance: nearer to one of them a free parameter has reached it


def measured_report(
    model: FieldModel, recipe: Recipe, tried: list[Tried], chosen: Tried, heldout: str
) -> dict[str, Any]:
    """The report of `model`, the field of `chosen` among `tried`."""
    fit, samples = chosen.fit, chosen.fit.measurement.samples
    uncertainty = _uncertainty(tried, chosen)
    estimated = _estimated_errors(model, tried, chosen, uncertainty)
    training, held = (_errors(fit, values) for values in (_sizes(fit), chosen.predicted))
    worst = int(np.argmax(chosen.predicted * _scale_of_points(fit)))
    return {
        "family": fit.candidate.family,
        "label": fit.candidate.label,
        "parameters": fit.candidate.parameters,
        "condition": fit.solved.condition,
        "objective": fit.measurement.weighting,
        "target": None,
        "training": {**training, "gradient": estimated["gradient"]},
        "heldout": {**held, "gradient": estimated["gradient"]},
        "held_out": heldout,
        "estimated": estimated,
        "fem": None,
        "bound": {key: _SAFETY * estimated[key]["max"] for key in ("B", "gradient")},
        "worst": {"B": {"point": samples.points[worst].tolist(), "distance": None, "error": held["B"]["max"]}},
        "candidates": [_headline(one) for one in tried],
        "comparison": [],
        "measurement": _findings(chosen, recipe, uncertainty),
        "uncertainty": uncertainty,
    }


def _sizes(fit: MeasuredFit) -> Floats:
    """|residual| (n,) of every sample, in units of its scale."""
    squares = np.bincount(fit.measurement.point_of_row, fit.solved.residual**2, fit.measurement.samples.count)
    return np.sqrt(squares)


def _scale_of_points(fit: MeasuredFit) -> Floats:
    """(n,) T per unit of scaled residual."""
    mean: Floats = np.nanmean(np.where(fit.measurement.measured, fit.measurement.scale, np.nan), axis=1)
    return mean


def _relative(fit: MeasuredFit, absolute: Floats) -> Floats:
    """Errors (n,) T at the samples over |B| there, floored."""
    field = np.sqrt(np.nansum(fit.measurement.samples.B**2, axis=1))
    relative: Floats = absolute / np.maximum(field, FLOOR * field.max())
    return relative


def _errors(fit: MeasuredFit, sizes: Floats) -> dict[str, Any]:
    """Residuals (n,) in units of their scale, noise and all: relative to |B|, and in T."""
    absolute = sizes * _scale_of_points(fit)
    relative = _relative(fit, absolute)
    return {
        "points": fit.measurement.samples.count,
        "B": {
            "max": float(relative.max()),
            "rms": float(np.sqrt(np.mean(relative**2))),
            "absolute_max": float(absolute.max()),
            "absolute_rms": float(np.sqrt(np.mean(absolute**2))),
        },
    }


def _estimated_errors(
    model: FieldModel, tried: list[Tried], chosen: Tried, uncertainty: dict[str, Any]
) -> dict[str, Any]:
    """Errors of the field itself over the region, which nobody measured: relative, `max` and `rms` of B and gradient.

    Two standard deviations, those of a noise as large as the residual where bias dominates; how far the next best
    model's field is from this one's; and for B what the residuals at the samples show beyond their noise.
    """
    points = model.region.layers(np.random.default_rng(0), layers=16, per_layer=16).reshape(-1, 3)
    inflated = max(1.0, uncertainty["standardised_residual"] or 1.0)
    jet, deviations = model.jet(points, 1, "extrapolate"), model.deviation(points, "extrapolate")
    rival = min((one for one in tried if one is not chosen), key=lambda one: one.score, default=None)
    others = rival.terms.jet(points, 1) if rival else jet
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    largest = float(np.linalg.norm(jet[0], axis=1).max())
    result: dict[str, Any] = {}
    for key, ours, deviation, theirs in zip(("B", "gradient"), jet, deviations, others, strict=True):
        axes = tuple(range(1, ours.ndim))
        error = np.hypot(2 * inflated * _norm(deviation, axes), _norm(theirs - ours, axes))
        size = _norm(ours, axes)
        # A uniform field has no gradient to be relative to: one that changes it by a hundredth over the region counts.
        least = FLOOR * (size.max() if key == "B" else max(size.max(), largest / extent))
        relative = error / np.maximum(size, least)
        result[key] = {"max": float(relative.max()), "rms": float(np.sqrt(np.mean(relative**2)))}
    beyond = np.maximum(_sizes(chosen.fit) * _scale_of_points(chosen.fit) - _allowance(chosen.fit, uncertainty), 0.0)
    result["B"]["max"] = max(result["B"]["max"], float(_relative(chosen.fit, beyond).max()))
    return result


def _allowance(fit: MeasuredFit, uncertainty: dict[str, Any]) -> Floats:
    """What noise may do to every sample (n,), T: nothing where it is not told apart from the model's own error."""
    measured = fit.measurement.measured
    if not uncertainty["told_apart"]:
        return np.zeros(len(measured))
    if fit.measurement.variance is not None:
        sigma = np.where(measured, fit.measurement.scale, 0.0)
        return _ALLOWED * _norm(sigma, (1,))
    share: Floats = fit.measurement.scale / np.sqrt(np.nanmean(fit.measurement.scale**2))
    noise = float(uncertainty["noise"])
    return _ALLOWED * noise * _norm(np.where(measured, share, 0.0), (1,))


def _norm(values: Floats, axes: tuple[int, ...]) -> Floats:
    size: Floats = np.sqrt(np.sum(values**2, axis=axes))
    return size


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


def _findings(chosen: Tried, recipe: Recipe, uncertainty: dict[str, Any]) -> dict[str, Any]:
    """Free parameters with deviations, the background, outliers, a magnet's remanence.

    Where the model's own error dominates, deviations are those of a noise that is as large as the residual.
    """
    fit = chosen.fit
    linear = len(fit.solved.parameters)
    inflated = uncertainty["standardised_residual"] if uncertainty["bias_dominates"] else 1.0
    deviation = inflated * np.sqrt(np.diag(fit.covariance))
    low, high = fit.measurement.bounds
    at_bound = np.minimum(fit.theta - low, high - fit.theta) < _AT_BOUND * (high - low)
    free: dict[str, Any] = {
        name: {
            "value": float(fit.theta[k]),
            "deviation": None if name in fit.degenerate else float(deviation[linear + k]),
            "at_bound": bool(at_bound[k]),
        }
        for k, name in enumerate(fit.measurement.free)
    }
    strength = {"value": float(fit.solved.parameters[0]), "deviation": float(deviation[0])}
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
    if chosen.strength_known:
        free["gain"] = {**strength, "at_bound": False}
    elif recipe.family == DEVICE and isinstance(recipe.geometry, Magnets):
        nominal = recipe.geometry.bodies[0].material.remanence
        findings["remanence"] = {key: value * nominal for key, value in strength.items()}
    elif recipe.family == DEVICE and fit.measurement.samples.unit == "T":
        findings["current"] = strength  # of a coil whose own field is per ampere
    return findings


def _uncertainty(tried: list[Tried], chosen: Tried) -> dict[str, Any]:
    """Noise of one component, and what the model leaves beyond it, T; whether that is more than the noise."""
    fit = chosen.fit
    rows = fit.residual.size
    spread = np.sqrt(np.sum(fit.solved.residual**2) / max(rows - fit.solved.effective - fit.theta.size, 1.0))
    typical = float(np.sqrt(np.nanmean(fit.measurement.scale**2)))
    left = [
        float(np.sum(one.fit.solved.residual**2) / (rows - one.parameters))
        for one in tried
        if rows - one.parameters >= max(3, rows // 10)
    ]
    if fit.measurement.variance is not None:
        noise, ground, told_apart = 1.0, "the samples' deviations", True
    else:  # what the richest candidates leave is the noise, as far as anybody can tell
        noise = float(np.sqrt(min([*left, float(spread) ** 2])))
        told_apart = len(left) > 1  # one model alone cannot say which part of what it leaves is its own
        ground = "what the richest candidates leave" if told_apart else "what the only candidate leaves"
    beyond = float(np.sqrt(max(float(spread) ** 2 - noise**2, 0.0)))
    return {
        "noise": noise * typical,
        "noise_from": ground,
        "told_apart": told_apart,
        "model_error": beyond * typical,
        "standardised_residual": float(spread / noise) if noise > 0 else None,
        "bias_dominates": bool(beyond > noise),
    }
