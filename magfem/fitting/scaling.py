"""One factor for a whole model, from single measured components: a magnet's true strength (6.1.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from magfem.errors import InputError
from magfem.fitting.model import FieldModel
from magfem.fitting.readings import Reading, check_readings
from magfem.typing import Floats


@dataclass(frozen=True)
class Scale:
    """A factor that single measurements ask of a model.

    factor: their weighted mean.  deviation: its standard deviation.  implied: (n,) the factor that each alone asks for.
    scatter: standard deviation of the implied factors beyond what the readings' uncertainties explain.  chi: root mean
    square of the readings' residuals over their uncertainties, had they no other error; None where these are not known.
    """

    factor: float
    deviation: float
    implied: Floats
    scatter: float
    chi: float | None

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "factor": self.factor,
            "deviation": self.deviation,
            "implied": self.implied.tolist(),
            "scatter": self.scatter,
            "standardised_residual": self.chi,
        }


def scale_to(model: FieldModel, measurements: Sequence[Reading]) -> Scale:
    """The factor that single components agree on best.

    Each implies a factor with the deviation of its reading. Where they disagree by more than that, distances or
    backgrounds are off as well, and a scatter common to all is added until their squares are what chance makes them
    (Paule & Mandel, J. Res. Natl. Bur. Stand. 87, 377 (1982)); else the nearest reading alone would decide.

    Raises InputError for none, for components that the model says vanish, and where nothing says how sure the factor
    is: a single measurement or one of zero without an uncertainty; OutsideRegionError outside the model's region.
    """
    if not measurements:
        raise InputError("a scale needs one measurement or more")
    if model.unit != "T":
        raise InputError("measurements in T do not scale a model per ampere: state the current instead")
    check_readings(measurements)
    known = measurements[0].uncertainty is not None
    value = np.array([one.value for one in measurements])
    predicted = np.array([float(model.B(one.position) @ one.direction) for one in measurements])
    if not np.all(np.abs(predicted) > 1e-9 * np.abs(predicted).max()):
        raise InputError("a scale cannot be told from a component that vanishes in the model")
    implied = value / predicted
    reading = np.array([one.uncertainty or 0.0 for one in measurements]) / np.abs(predicted)

    def excess(variance: float) -> float:
        """Sum of squares over what chance makes it, less one, with a common `variance` added."""
        weight = 1.0 / (reading**2 + variance)
        mean = float(weight @ implied / weight.sum())
        return float(weight @ (implied - mean) ** 2) - float(implied.size - 1)

    smallest, largest = 1e-12 * float(implied @ implied), 10 * float(np.ptp(implied) ** 2)
    alike = implied.size < 2 or largest <= smallest or excess(smallest) <= 0
    if alike and not known:
        raise InputError("measurements that agree exactly need their uncertainty: nothing says how sure the factor is")
    scatter2 = 0.0 if alike else float(brentq(excess, smallest, largest))
    weight = 1.0 / (reading**2 + scatter2)
    factor = float(weight @ implied / weight.sum())
    chi = float(np.sqrt((excess(0.0) + implied.size - 1) / max(implied.size - 1, 1))) if known else None
    return Scale(factor, float(1 / np.sqrt(weight.sum())), implied, float(np.sqrt(scatter2)), chi)


def scaled(model: FieldModel, scale: Scale) -> FieldModel:
    """The model times the factor; the factor's own deviation goes into covariance and bound."""
    covariance = model.covariance
    if covariance is not None:
        values = np.zeros(len(covariance))
        share = np.ones(model.parameter.size) if model.share is None else model.share
        values[model.parameter] = model.lowered.coefficient / np.where(share == 0, 1.0, share)
        covariance = scale.factor**2 * covariance + scale.deviation**2 * np.outer(values, values)
    share_of_bound = abs(scale.deviation / scale.factor)
    bound = {key: value + 2 * share_of_bound for key, value in model.report["bound"].items()}
    return replace(
        model,
        lowered=model.lowered.scaled(scale.factor),
        covariance=covariance,
        report={**model.report, "bound": bound, "scale": scale.to_dict()},
    )
