"""The unknowns of a calibration that explain the readings best, and which of them the readings determine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from magfem.localization.calibration_readings import Layout, Motion, Unknowns, changed, readings
from magfem.localization.rotor import Rotor
from magfem.typing import Booleans, Floats

MOST_ITERATIONS = 200
FIRST_DAMPING = 1e-3  # of the squared columns' lengths
LIGHT = 1e-2  # damping below which a step with little gain tells of a minimum
NEGLIGIBLE = 1e-8  # gain in the sum of squared residuals, each over its deviation
UNTOLD = 1e-7
"""Unknowns some combination of which changes the readings by less than this share of what each of them does alone are
not determined. What geometry leaves open comes to 1e-12 or less."""

EFFICIENT = 1.5
"""Readings whose root mean square residual is beyond this many deviations lose weight in a robust calibration
(Huber's rule). Of those of nine good numbers 0.2 % are."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What s sensors read at k poses: values (k, s, 9) T, static before C before S, and whitening (k, s, c, c) 1/T of
    those that count: all nine, or the last six. Whitening is zero where a sensor's samples are not used."""

    values: Floats
    whitening: Floats

    @property
    def used(self) -> Booleans:
        """(k, s)."""
        return self.whitening[..., 0, 0] > 0


@dataclass(frozen=True, eq=False)
class CalibrationFit:
    """unknowns: the best.  residual (k, s, c) and jacobian (k, s, c, unknowns): whitened, and times the root of the
    weight (k, s)."""

    unknowns: Unknowns
    residual: Floats
    jacobian: Floats
    weight: Floats
    converged: bool
    iterations: int


def fit_unknowns(
    rotor: Rotor, motion: Motion, start: Unknowns, layout: Layout, measured: Readings, robust: bool
) -> CalibrationFit:
    """Levenberg–Marquardt from `start`; damping in the scale of the Jacobian's columns."""
    at, damping, growth = start, FIRST_DAMPING, 2.0
    residual, J = whitened_jacobian(rotor, motion, at, layout, measured)
    weight, cost = _weighed(residual, robust)
    x = motion.places[:, None] + np.einsum("kij,sj->ksi", motion.axes, at.place)
    longest = layout.longest(float(np.linalg.norm(x - at.rotor[:, None], axis=-1).min()))
    converged, iterations = False, 0
    while iterations < MOST_ITERATIONS and damping < 1e12 and not converged:
        iterations += 1
        rows = (np.sqrt(weight)[..., None, None] * J).reshape(-1, J.shape[-1])
        size = np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
        rows = rows / size
        normal = rows.T @ rows
        gradient = rows.T @ (np.sqrt(weight)[..., None] * residual).reshape(-1)
        scaled = -np.linalg.solve(normal + damping * np.eye(len(normal)), gradient)
        over = float(np.max(np.abs(scaled / size) / longest, initial=1.0))
        scaled = scaled / over
        tried = changed(at, scaled / size, layout)
        tried_residual, tried_J = whitened_jacobian(rotor, motion, tried, layout, measured)
        tried_weight, tried_cost = _weighed(tried_residual, robust)
        predicted = -float(scaled @ (2 * gradient + normal @ scaled))
        gain = cost - tried_cost
        done = over == 1.0 and predicted < max(NEGLIGIBLE, 1e-14 * cost)
        if gain >= 0:
            at, residual, J, weight, cost = tried, tried_residual, tried_J, tried_weight, tried_cost
            # Nielsen's rule: less damping the better the prediction was.
            ratio = min(gain / max(predicted, np.finfo(float).tiny), 1.0)
            less = damping * max(0.1, 1 - (2 * ratio - 1) ** 3)
            done, damping, growth = done and damping <= LIGHT, max(less, 1e-15), 2.0
        else:
            damping, growth = damping * growth, 2 * growth
        converged = done
    root = np.sqrt(weight)
    return CalibrationFit(at, root[..., None] * residual, root[..., None, None] * J, weight, converged, iterations)


def whitened_jacobian(
    rotor: Rotor, motion: Motion, at: Unknowns, layout: Layout, measured: Readings
) -> tuple[Floats, Floats]:
    """Residuals (k, s, c), each over its deviation, and their derivatives (k, s, c, unknowns)."""
    values, J = readings(rotor, motion, at, layout)
    left, W = values - measured.values, measured.whitening
    if not layout.static_used:
        left, J = left[..., 3:], J[..., 3:, :]
    return np.einsum("ksab,ksb->ksa", W, left), W @ J


def _weighed(residual: Floats, robust: bool) -> tuple[Floats, float]:
    """Weights (k, s) and what is to be least: the sum of squares, or Huber's of the readings' root mean squares."""
    square = np.einsum("ksa,ksa->ks", residual, residual)
    if not robust:
        return np.ones(square.shape), float(square.sum())
    bound = EFFICIENT * np.sqrt(residual.shape[-1])
    length = np.sqrt(square)
    cost = np.where(length <= bound, square, 2 * bound * length - bound**2)
    return np.minimum(1.0, bound / np.maximum(length, bound)), float(cost.sum())


@dataclass(frozen=True, eq=False)
class Determined:
    """covariance (unknowns, unknowns), without meaning where untold: the names of those that are not determined.

    condition: of the Jacobian with columns scaled to the same length.
    """

    covariance: Floats
    untold: tuple[str, ...]
    condition: float


def determined(jacobian: Floats, names: Sequence[str]) -> Determined:
    """What readings with this whitened Jacobian (..., unknowns) determine; `names` of its columns."""
    rows = jacobian.reshape(-1, jacobian.shape[-1])
    size = np.linalg.norm(rows, axis=0)
    idle = size == 0
    size = np.where(idle, 1.0, size)
    # The triangle has the same null space, and all of it also where there are fewer rows than columns.
    _, values, directions = np.linalg.svd(np.linalg.qr(rows / size, mode="r"))
    values = np.pad(values, (0, len(names) - values.size))
    nothing = values < UNTOLD
    tied = idle | (np.abs(directions[nothing]) > 0.05).any(axis=0)
    untold = tuple(dict.fromkeys(name for name, one in zip(names, tied, strict=True) if one))
    inverse = np.where(nothing, 0.0, 1 / np.where(nothing, 1.0, values))
    factor = (directions.T * inverse) / size[:, None]
    condition = float("inf") if untold else float(values[0] / values[-1])
    return Determined(factor @ factor.T, untold, condition)


def held_out(fit: CalibrationFit, covariance: Floats, whitening: Floats) -> Floats:
    """(k, s) T, root mean square error of the quadratures predicted at each pose by a fit to all the other poses.

    To first order: the residual of a pose is (1 − H) times the error of its prediction, H the pose's own block of the
    hat matrix. A phase that only this pose tells is taken as best fits.
    """
    k, s, c = fit.residual.shape
    J = fit.jacobian.reshape(k, s * c, -1)
    own = np.eye(s * c) - J @ covariance @ np.swapaxes(J, -1, -2)
    error = np.einsum("kab,kb->ka", np.linalg.pinv(own, rcond=1e-9, hermitian=True), fit.residual.reshape(k, -1))
    used = whitening[..., 0, 0] > 0
    undo = np.linalg.inv(np.where(used[..., None, None], whitening, np.eye(c)))
    field = np.einsum("ksab,ksb->ksa", undo, error.reshape(k, s, c) / np.sqrt(fit.weight)[..., None])
    return np.where(used, np.sqrt(np.mean(field[..., -6:] ** 2, axis=-1)), np.nan)
