"""Holding a model against another field: is its stated bound kept?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fields.norms import relative_errors
from magfem.fitting.model import FieldModel


@dataclass(frozen=True)
class Validation:
    """What `validate` found.

    found: for `B` and `gradient` the `max` and `rms` relative error.  worst: where, m.  bound: the model's own.
    divergence, curl: largest |∇·B| and |∇×B| over |∇B|, which harmonic terms keep at rounding.
    """

    reference: str
    points: int
    found: dict[str, Any]
    bound: dict[str, float]
    worst: dict[str, Any]
    divergence: float
    curl: float

    @property
    def passed(self) -> bool:
        """Whether both errors stay within the model's stated bound."""
        return all(self.found[key]["max"] <= self.bound[key] for key in ("B", "gradient"))

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return {**asdict(self), "passed": self.passed}


def validate(model: FieldModel, reference: Field, name: str = "", seed: int = 1) -> Validation:
    """Compare a model with `reference` at 2304 random points of the model's region, none of them fitted.

    name: of the reference, for people. Raises InputError when the units differ, OutsideRegionError when the
    reference does not cover the model's region.
    """
    if model.unit != reference.unit:
        raise InputError(f"a model in {model.unit} cannot be held against a field in {reference.unit}")
    layers = model.region.layers(np.random.default_rng(seed), layers=64, per_layer=36)
    found: dict[str, Any] = {}
    worst: dict[str, Any] = {}
    jet = model.jet(layers, 1, outside="extrapolate")
    for key, ours, truth in zip(("B", "gradient"), jet, reference.jet(layers, 1), strict=True):
        errors = relative_errors(ours, truth)
        place = np.unravel_index(np.argmax(errors), errors.shape)
        found[key] = {"max": float(errors.max()), "rms": float(np.sqrt(np.mean(errors**2)))}
        worst[key] = {
            "point": layers[place].tolist(),
            "distance": float(model.region.hull.distance(layers[place])),
            "error": float(errors.max()),
        }
    gradient = jet[1]
    size = np.linalg.norm(gradient, axis=(-2, -1))
    skew = np.linalg.norm(gradient - np.swapaxes(gradient, -1, -2), axis=(-2, -1)) / np.sqrt(2)
    return Validation(
        reference=name or type(reference).__name__,
        points=int(layers[..., 0].size),
        found=found,
        bound={key: float(model.report["bound"][key]) for key in ("B", "gradient")},
        worst=worst,
        divergence=float((np.abs(np.trace(gradient, axis1=-2, axis2=-1)) / size).max()),
        curl=float((skew / size).max()),
    )
