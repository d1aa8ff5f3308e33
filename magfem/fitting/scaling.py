"""One factor for a whole model, from single measured components: a magnet's true strength (6.1.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fitting.model import FieldModel
from magfem.samples.single_components import Measurement
from magfem.typing import Floats


@dataclass(frozen=True)
class Scale:
    """A factor that single measurements ask of a model.

    factor: weighted least squares.  deviation: its standard deviation, the larger of what the readings' uncertainties
    and what their scatter make it.  implied: (n,) the factor that each alone asks for.  chi: root mean square of the
    residuals over the uncertainties; None where these are not known.
    """

    factor: float
    deviation: float
    implied: Floats
    chi: float | None

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "factor": self.factor,
            "deviation": self.deviation,
            "implied": self.implied.tolist(),
            "standardised_residual": self.chi,
        }


def scale_to(model: FieldModel, measurements: Sequence[Measurement]) -> Scale:
    """The factor that fits single components best, each weighted by its uncertainty, or by its size without one.

    Raises InputError for none, for components that the model says vanish, and where nothing says how sure the factor
    is: a single measurement or one of zero without an uncertainty; OutsideRegionError outside the model's region.
    """
    if not measurements:
        raise InputError("a scale needs one measurement or more")
    if len(measurements) == 1 and measurements[0].uncertainty is None:
        raise InputError("a scale from a single measurement needs its uncertainty")
    if any(one.uncertainty is None and one.value == 0 for one in measurements):
        raise InputError("a measurement of zero needs an uncertainty: it cannot be weighed by its size")
    value = np.array([one.value for one in measurements])
    predicted = np.array([float(model.B(one.position) @ one.direction) for one in measurements])
    if not np.all(np.abs(predicted) > 1e-9 * np.abs(predicted).max()):
        raise InputError("a scale cannot be told from a component that vanishes in the model")
    known = all(one.uncertainty is not None for one in measurements)
    sigma = np.array([one.uncertainty or abs(one.value) for one in measurements])
    weight = (predicted / sigma) ** 2
    implied = value / predicted
    factor = float(weight @ implied / weight.sum())
    freedom = max(len(value) - 1, 1)
    spread = float(np.sqrt(np.sum(((value - factor * predicted) / sigma) ** 2) / freedom))
    stated = 1.0 if known else 0.0
    return Scale(factor, float(max(spread, stated) / np.sqrt(weight.sum())), implied, spread if known else None)


def scaled(model: FieldModel, scale: Scale) -> FieldModel:
    """The model times the factor; the factor's own deviation goes into covariance and bound."""
    values = np.zeros(len(model.covariance))
    share = np.ones(model.parameter.size) if model.share is None else model.share
    values[model.parameter] = model.lowered.coefficient / np.where(share == 0, 1.0, share)
    covariance = scale.factor**2 * model.covariance + scale.deviation**2 * np.outer(values, values)
    share_of_bound = abs(scale.deviation / scale.factor)
    bound = {key: value + 2 * share_of_bound for key, value in model.report["bound"].items()}
    return replace(
        model,
        lowered=model.lowered.scaled(scale.factor),
        covariance=covariance,
        report={**model.report, "bound": bound, "scale": scale.to_dict()},
    )
