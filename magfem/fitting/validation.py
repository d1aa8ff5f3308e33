"""Holding a model against another field, or against samples: is its stated bound kept?"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fields.norms import relative_errors
from magfem.fitting.located_errors import QUANTITIES, LocatedErrors, distance_in, distance_name
from magfem.fitting.model import FieldModel
from magfem.fitting.sample_residuals import SampleResiduals, sample_residuals
from magfem.samples import Samples, SystemSamples
from magfem.typing import Floats


@dataclass(frozen=True)
class Validation:
    """What `validate` found.

    found: for `B` and `gradient` the `max` and `rms` relative error; `gradient` is None where only B was measured. Of
    samples B has also `absolute_max` and `absolute_rms` (T), and with known deviations `beyond_noise`, the largest
    relative error that noise cannot explain, and `standardised`, the root mean square residual in deviations.
    bound: the model's own.  worst: of each the worst place: `point`, `distance` (m) and `error`; worst_points: several,
    worst first.  by_distance: of each, errors of groups of points from near to far; distances count from
    `distance_from`.  divergence, curl: largest |∇·B| and |∇×B| over |∇B|, which harmonic terms keep at rounding.
    outside: samples that the region does not hold, left out.  aligned: whether samples were seen through the alignment
    of the sensor that the model's own fit has found.
    """

    reference: str
    points: int
    found: dict[str, Any]
    bound: dict[str, float]
    worst: dict[str, Any]
    divergence: float
    curl: float
    unit: str = "T"
    worst_points: dict[str, Any] = field(default_factory=dict)
    by_distance: dict[str, Any] = field(default_factory=dict)
    distance_from: str = "the hull"
    outside: int = 0
    aligned: bool = False

    @property
    def passed(self) -> bool:
        """Whether the errors stay within the model's stated bound, those of samples apart from their noise."""
        judged = {key: one for key, one in self.found.items() if one is not None}
        return all(one.get("beyond_noise", one["max"]) <= self.bound[key] for key, one in judged.items())

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return {**asdict(self), "passed": self.passed}


def validate(
    model: FieldModel, reference: Field | Samples, name: str = "", seed: int = 1, aligned: bool | None = None
) -> Validation:
    """Compare a model with `reference`: a field at 2304 random points of the region, none of them fitted; or samples.

    name: of the reference, for people.  aligned: of samples (`sample_residuals`). Raises InputError when the units
    differ or no sample lies in the region, OutsideRegionError when the reference does not cover it.
    """
    if isinstance(reference, SystemSamples):
        raise InputError(f"samples of a coil system are of no single model [{reference.source}]")
    if not isinstance(reference, Samples | Field):
        raise InputError("validate takes a field or samples as reference: a solution, a closed form, a model, Samples")
    if model.unit != reference.unit:
        what = "samples" if isinstance(reference, Samples) else "a field"
        raise InputError(f"a model in {model.unit} cannot be held against {what} in {reference.unit}")
    if isinstance(reference, Samples):
        return _against_samples(model, sample_residuals(model, reference, aligned), name or reference.source)
    return _against_field(model, reference, name or type(reference).__name__, seed)


def _against_field(model: FieldModel, reference: Field, name: str, seed: int) -> Validation:
    layers = model.region.layers(np.random.default_rng(seed), layers=64, per_layer=36)
    distance = distance_in(model.region, layers).ravel()
    jet = model.jet(layers, 1, outside="extrapolate")
    truths = reference.jet(layers, 1)
    if not all(np.isfinite(truth).all() for truth in truths):
        raise InputError(f"{name} holds values that are not finite in the model's region")
    errors = {
        key: LocatedErrors(layers.reshape(-1, 3), distance, relative_errors(ours, truth).ravel())
        for key, ours, truth in zip(QUANTITIES, jet, truths, strict=True)
    }
    return _validation(model, name, {key: one.norms for key, one in errors.items()}, errors, jet[1])


def _against_samples(model: FieldModel, residuals: SampleResiduals, name: str) -> Validation:
    sizes, over = residuals.sizes, residuals.standardised
    B = {
        **residuals.errors.norms,
        "absolute_max": float(sizes.max()),
        "absolute_rms": float(np.sqrt(np.mean(sizes**2))),
    }
    if over is not None:
        B["beyond_noise"] = residuals.beyond_noise.norms["max"]
        B["standardised"] = float(np.sqrt(np.mean(over**2)))
    gradient = model.gradient(residuals.points, outside="extrapolate")
    found = {"B": B, "gradient": None}
    return _validation(model, name, found, {"B": residuals.errors}, gradient, residuals.outside, residuals.aligned)


def _validation(
    model: FieldModel,
    name: str,
    found: dict[str, Any],
    errors: dict[str, LocatedErrors],
    gradient: Floats,
    outside: int = 0,
    aligned: bool = False,
) -> Validation:
    size = np.linalg.norm(gradient, axis=(-2, -1))
    size = np.where(size > 0, size, 1.0)
    skew = np.linalg.norm(gradient - np.swapaxes(gradient, -1, -2), axis=(-2, -1)) / np.sqrt(2)
    worst_points = {key: errors[key].worst() if key in errors else None for key in QUANTITIES}
    return Validation(
        reference=name,
        points=int(errors["B"].error.size),
        found=found,
        bound={key: float(model.report["bound"][key]) for key in QUANTITIES},
        worst={key: points[0] if points else None for key, points in worst_points.items()},
        divergence=float((np.abs(np.trace(gradient, axis1=-2, axis2=-1)) / size).max()),
        curl=float((skew / size).max()),
        unit=model.unit,
        worst_points=worst_points,
        by_distance={key: errors[key].by_distance() if key in errors else None for key in QUANTITIES},
        distance_from=distance_name(model.region),
        outside=outside,
        aligned=aligned,
    )
