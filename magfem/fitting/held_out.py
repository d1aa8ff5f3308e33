"""Which candidate samples speak for: the smallest that predicts held-out ones as well as the best does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from magfem.fields.terms import Terms
from magfem.fitting.measurement import MeasuredFit
from magfem.typing import Floats, Integers


@dataclass(frozen=True)
class Tried:
    """A candidate fitted to samples.

    predicted: (n,) held-out residual of every sample, |ΔB| in units of its scale.  strength_known: the candidate's one
    parameter is the sensor's gain, the source being what it is.
    """

    fit: MeasuredFit
    predicted: Floats
    strength_known: bool = False

    @property
    def score(self) -> float:
        """Mean square of the held-out residuals."""
        return float(np.mean(self.predicted**2))

    @property
    def unexplained(self) -> float:
        """Root mean square of the held-out residuals over that of the data."""
        target = self.fit.measurement.target * self.fit.weight
        return float(np.sqrt(np.sum(self.predicted**2) / np.sum(target**2)))

    @property
    def parameters(self) -> int:
        """Linear and nonlinear ones, background included."""
        return len(self.fit.solved.parameters) + self.fit.theta.size

    @cached_property
    def terms(self) -> Terms:
        """The source's field: what the sensor reads without its gain, turn and background."""
        candidate = self.fit.candidate
        values = self.fit.solved.parameters[: candidate.parameters]
        return candidate.with_parameters(np.ones_like(values) if self.strength_known else values)


def predicted(fit: MeasuredFit, heldout: str) -> Floats:
    """|held-out residual| (n,) of every sample, in units of its scale; `heldout` "samples" or "regions"."""
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


def smallest_of_the_best(tried: list[Tried]) -> Tried:
    """The smallest whose held-out squares exceed the best ones by no more than one standard error of the difference."""
    best = min(tried, key=lambda one: one.score)
    for one in sorted(tried, key=lambda one: one.parameters):
        difference = one.predicted**2 - best.predicted**2
        if difference.mean() <= difference.std() / np.sqrt(difference.size):
            return one
    return best
