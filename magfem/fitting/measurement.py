"""A measurement as a separable least squares: linear coefficients, and free parameters of source and sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from scipy import linalg
from scipy.optimize import least_squares
from scipy.stats.qmc import Halton

from magfem.fitting.alignment import Alignment
from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.least_squares import LeastSquares, Ridge, solve_least_squares
from magfem.fitting.truncation import next_degree
from magfem.samples import Samples
from magfem.typing import Booleans, Floats, Integers

Weighting: TypeAlias = Literal["sigma", "absolute", "relative"]
Loss: TypeAlias = Literal["squares", "huber"]

_HUBER = 1.345  # standard deviations: 95 % as sharp as plain squares where the noise is normal
_SPREAD = 32  # starts over the bounds of the alignment
_MOST_POINTS = 300  # samples that a search takes; what it finds is refined on all
_STEP = 1e-6  # of the bounds' distance, for the derivatives by the free parameters
_REFINED = 3  # of the starts, besides the first
_AS_LITTLE = 1e-3  # of the least squares: places that leave so little more are as good
CONDITION = 1e7


@dataclass(frozen=True)
class Measurement:
    """What is fitted to samples.

    member: a candidate, or one whose places are free as well.  alignment: the free parameters of source and sensor.
    background: whether a static field in the sensor's axes is added.  weighting: rows over their own deviation, plain
    (T), or over |B| (5.3).  loss: plain squares, or Huber's, which outliers pull less.
    """

    samples: Samples
    member: Candidate | Displaceable
    alignment: Alignment
    background: bool
    weighting: Weighting
    ridge: Ridge
    loss: Loss

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the nonlinear parameters: places of sources, then those of the alignment."""
        places = self.member.names if isinstance(self.member, Displaceable) else ()
        return (*places, *self.alignment.names)

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Of the nonlinear parameters, (q,) each."""
        own = [(self.member.lower, self.member.upper)] if isinstance(self.member, Displaceable) else []
        low, high = zip(*own, (self.alignment.lower, self.alignment.upper), strict=True)
        return np.concatenate(low), np.concatenate(high)

    @cached_property
    def starts(self) -> Floats:
        """Where to search from (k, q): the members' own, and places spread over the bounds of the alignment."""
        places = self.member.start if isinstance(self.member, Displaceable) else np.empty((1, 0))
        own = np.hstack([places, np.tile(self.alignment.start, (len(places), 1))])
        if not self.alignment.names:
            return own
        share = Halton(len(self.alignment.names), scramble=False).random(_SPREAD + 1)[1:]  # the first is a corner
        spread = self.alignment.lower + share * (self.alignment.upper - self.alignment.lower)
        return np.vstack([own, np.hstack([places[np.arange(_SPREAD) % len(places)], spread])])

    @cached_property
    def thinned(self) -> Measurement:
        """The same with some hundreds of the samples at most, to search with."""
        step = -(-self.samples.count // _MOST_POINTS)
        return self if step == 1 else replace(self, samples=self.samples.subset(slice(None, None, step)))

    @cached_property
    def scale(self) -> Floats:
        """What every component (n, 3) is divided by before squares are summed, T or one."""
        B = self.samples.B
        if self.weighting == "sigma":
            assert self.samples.sigma is not None
            return self.samples.sigma
        if self.weighting == "relative":
            size = np.sqrt(np.nansum(B**2, axis=1, keepdims=True))
            return np.broadcast_to(np.maximum(size, 0.01 * size.max()), B.shape)
        return np.ones_like(B)

    @property
    def measured(self) -> Booleans:
        """Which components (n, 3) there are; the others have no row."""
        return self.samples.measured

    @property
    def point_of_row(self) -> Integers:
        """The sample (r,) that each row belongs to."""
        return np.nonzero(self.measured)[0]

    def candidate(self, theta: Floats) -> Candidate:
        """The linear candidate for nonlinear parameters (q,)."""
        if isinstance(self.member, Displaceable):
            return self.member.make(theta[: len(self.member.names)])
        return self.member

    def seen(self, candidate: Candidate, theta: Floats) -> Floats:
        """What each parameter of a candidate makes the sensor read: (r, p), scaled."""
        own = theta[len(theta) - len(self.alignment.names) :]
        columns = self.alignment.columns(candidate, self.samples.points, own)
        scaled: Floats = (columns / self.scale)[:, self.measured].T
        return scaled

    def matrix(self, theta: Floats) -> Floats:
        """Columns of all linear parameters, background last: (r, p), scaled."""
        columns = self.seen(self.candidate(theta), theta)
        if self.background:
            background = np.broadcast_to(np.eye(3)[:, None], (3, *self.samples.points.shape))
            columns = np.hstack([columns, (background / self.scale)[:, self.measured].T])
        return columns

    def slopes(self, theta: Floats, parameters: Floats) -> Floats:
        """Derivatives (r, q) of the scaled rows by the nonlinear parameters, the linear ones (p,) held."""
        low, high = self.bounds
        columns = []
        for k, step in enumerate(_STEP * (high - low)):
            up, down = theta.copy(), theta.copy()
            up[k], down[k] = min(theta[k] + step, high[k]), max(theta[k] - step, low[k])
            values = (self.seen(_held(self.candidate(places), parameters), places) for places in (up, down))
            columns.append(np.subtract(*values)[:, 0] / (up[k] - down[k]))
        return np.column_stack(columns)

    @cached_property
    def target(self) -> Floats:
        """Rows (r,) to be met, scaled."""
        scaled: Floats = (self.samples.B / self.scale)[self.measured]
        return scaled

    @property
    def variance(self) -> float | None:
        """Of a row, where the samples say it."""
        return 1.0 if self.weighting == "sigma" else None

    def solve(self, theta: Floats, weight: Floats) -> LeastSquares:
        """Linear parameters for nonlinear ones (q,), rows times `weight` (r,)."""
        matrix, target = self.matrix(theta) * weight[:, None], self.target * weight
        return solve_least_squares(matrix, target, self.ridge, self.variance, CONDITION)


def _held(candidate: Candidate, parameters: Floats) -> Candidate:
    """The candidate as one source: its parameters, the first of (p,), in fixed ratio."""
    terms = candidate.with_parameters(parameters[: candidate.parameters])
    return Candidate(candidate.family, candidate.label, terms, np.zeros_like(candidate.parameter))


@dataclass(frozen=True)
class MeasuredFit:
    """A measurement solved.

    theta: (q,) nonlinear parameters.  solved: the linear ones, background last.  weight: (r,) of the rows, below one
    for outliers.  covariance: (p + q, p + q), the degenerate parameters held: NaN in their rows and columns.
    degenerate: names of nonlinear parameters that the data do not decide (`_degenerate`).
    left_out: (r,) residual of every row had its sample not been fitted, in units of its scale.
    """

    measurement: Measurement
    theta: Floats
    solved: LeastSquares
    weight: Floats
    covariance: Floats
    degenerate: tuple[str, ...]
    left_out: Floats

    @property
    def candidate(self) -> Candidate:
        """Linear candidate at the places found."""
        return self.measurement.candidate(self.theta)

    @property
    def residual(self) -> Floats:
        """(r,) data less model, scaled, unweighted."""
        return self.solved.residual / self.weight


_STOPS = ("xtol", "ftol", "gtol")
_ALIKE = 5e-3  # of a nonlinear parameter's effect: where the linear ones leave less, a model's own error decides
_DECIDED = 1 / 3  # of the bounds' half distance: a deviation above that is made by the bounds and not by the data
_ROUNDING = 1e-6  # of the data: no noise is smaller, for the slopes are no better


def solve_measurement(measurement: Measurement) -> MeasuredFit:
    """Fit all parameters; outliers weigh less where the loss says so."""
    weight = np.ones(measurement.target.size)
    few = measurement.thinned
    theta = _project(few, np.ones(few.target.size), measurement.starts, 1e-6)
    theta = _project(measurement, weight, theta[None])
    for _ in range(20 if measurement.loss == "huber" else 0):
        residual = measurement.solve(theta, weight).residual / weight
        spread = 1.0 if measurement.variance else max(1.4826 * float(np.median(np.abs(residual))), 1e-300)
        new = np.sqrt(np.minimum(1.0, _HUBER * spread / np.maximum(np.abs(residual), 1e-300)))
        if np.abs(new - weight).max() < 1e-3:
            break
        weight = new
        theta = _project(measurement, weight, theta[None])
    solved = measurement.solve(theta, weight)
    return _judged(measurement, theta, solved, weight) if measurement.free else _linear(measurement, solved, weight)


def _project(measurement: Measurement, weight: Floats, starts: Floats, tolerance: float = 1e-12) -> Floats:
    """The nonlinear parameters (q,) that leave the least, by variable projection from the most promising starts.

    The first start is among them. Of places that leave as little as the best the one nearest to it is taken: where
    the data leave a whole valley, that is the least that has to be believed.
    """
    if not measurement.free:
        return np.empty(0)
    low, high = measurement.bounds
    # While places are sought the ridge must not move with them.
    plain = replace(measurement, ridge="none")

    last: dict[bytes, LeastSquares] = {}

    def solved(theta: Floats) -> LeastSquares:
        key = theta.tobytes()
        if key not in last:
            last.clear()
            last[key] = plain.solve(theta, weight)
        return last[key]

    def residual(theta: Floats) -> Floats:
        return solved(theta).residual

    def jacobian(theta: Floats) -> Floats:
        """Kaufman's: what the columns cannot follow of the slopes (BIT 15, 49 (1975))."""
        one = solved(theta)
        slopes = measurement.slopes(theta, one.parameters) * weight[:, None]
        followed: Floats = one.basis @ (one.basis.T @ slopes)
        return followed - slopes

    promising = [starts[0], *sorted(starts[1:], key=lambda start: float(np.sum(residual(start) ** 2)))[:_REFINED]]
    found = [
        least_squares(residual, start, jacobian, (low, high), x_scale=high - low, **dict.fromkeys(_STOPS, tolerance))
        for start in promising
    ]
    least = min(float(one.cost) for one in found) * (1.0 + _AS_LITTLE)
    alike = [one.x for one in found if float(one.cost) <= least]
    nearest: Floats = min(alike, key=lambda theta: float(np.sum(((theta - starts[0]) / (high - low)) ** 2)))
    return nearest


def _linear(measurement: Measurement, solved: LeastSquares, weight: Floats) -> MeasuredFit:
    """Without nonlinear parameters the decomposition of the linear ones says it all."""
    kept = solved.singular**2 / (solved.singular**2 + solved.ridge)
    left_out = _left_out(measurement, solved.basis * np.sqrt(kept), solved.residual)
    return MeasuredFit(measurement, np.empty(0), solved, weight, solved.covariance, (), left_out / weight)


def _judged(measurement: Measurement, theta: Floats, solved: LeastSquares, weight: Floats) -> MeasuredFit:
    """Covariance of all parameters together, what cannot be told apart, and leave-one-out residuals."""
    matrix = measurement.matrix(theta) * weight[:, None]
    slopes = measurement.slopes(theta, solved.parameters) * weight[:, None]
    told, parameters = np.flatnonzero(matrix.any(axis=0)), matrix.shape[1] + theta.size
    joint = np.column_stack([matrix[:, told], slopes])
    length = np.linalg.norm(joint, axis=0)
    length[length == 0] = 1.0
    scaled = joint / length
    free = ~_degenerate(measurement, theta, solved, weight, scaled, length)
    kept = np.concatenate([np.ones(told.size, dtype=bool), free])
    # The ridge is the prior of the linear parameters, in the same units as in `solve_least_squares`.
    prior = np.sqrt(solved.ridge) * np.eye(int(np.count_nonzero(kept)))[: told.size]
    _, s, vt = linalg.svd(np.vstack([scaled[:, kept], prior]), full_matrices=False)
    root = vt.T / np.maximum(s, np.finfo(float).tiny)
    covariance = np.full((parameters, parameters), np.nan)
    known = np.concatenate([told, matrix.shape[1] + np.flatnonzero(free)])
    covariance[np.ix_(known, known)] = solved.variance * root @ root.T / np.outer(length[kept], length[kept])
    return MeasuredFit(
        measurement=measurement,
        theta=theta,
        solved=solved,
        weight=weight,
        covariance=covariance,
        degenerate=tuple(name for name, decided in zip(measurement.free, free, strict=True) if not decided),
        left_out=_left_out(measurement, scaled[:, kept] @ root, solved.residual) / weight,
    )


def _degenerate(
    measurement: Measurement, theta: Floats, solved: LeastSquares, weight: Floats, scaled: Floats, length: Floats
) -> Booleans:
    """Which nonlinear parameters (q,) the data do not decide.

    scaled: (r, p + q) derivatives by all parameters, over their lengths (p + q,).
    One whose effect the linear parameters follow to half a per cent, for the centre of an expansion with one degree
    more; and one that stays as uncertain as its bounds make it, the others being free within theirs.
    """
    q = theta.size
    linear = scaled.shape[1] - q
    low, high = measurement.bounds
    followers = scaled[:, :linear]
    above = next_degree(measurement.candidate(theta))
    left = _unfollowed(followers, scaled[:, linear:])
    if above is not None:
        more = measurement.seen(above, theta) * weight[:, None]
        more = more / np.linalg.norm(more, axis=0)
        centre = [k for k, name in enumerate(measurement.free) if name.startswith("centre")]
        left[centre] = _unfollowed(np.hstack([followers, more]), scaled[:, linear:][:, centre])
    # The bounds as priors, of half their distance as the deviation, make room where the data leave it.
    noise = max(np.sqrt(solved.variance), _ROUNDING * float(np.sqrt(np.mean(measurement.target**2))))
    half = 0.5 * (high - low)
    prior = np.concatenate([np.full(linear, np.sqrt(solved.ridge)), noise / (half * length[linear:])])
    _, s, vt = linalg.svd(np.vstack([scaled, np.diag(prior)]), full_matrices=False)
    root = vt.T / np.maximum(s, np.finfo(float).tiny)
    deviation = noise * np.linalg.norm(root[linear:], axis=1) / length[linear:]
    undecided: Booleans = (left < _ALIKE) | (deviation > _DECIDED * half)
    return undecided


def _unfollowed(columns: Floats, wanted: Floats) -> Floats:
    """Length (k,) of what is left of `wanted` (r, k) when `columns` (r, p) follow as well as they can."""
    basis, _ = linalg.qr(columns, mode="economic")
    left: Floats = np.linalg.norm(wanted - basis @ (basis.T @ wanted), axis=0)
    return left


def _left_out(measurement: Measurement, root: Floats, residual: Floats) -> Floats:
    """Leave-one-out residuals (r,), a sample with all its components at a time: (1 − H_i)⁻¹ r_i, H_i its leverages.

    root: (r, k), whose product with its own transpose is the hat matrix.
    """
    point = measurement.point_of_row
    result = np.empty_like(residual)
    order = np.argsort(point, kind="stable")
    bounds = np.flatnonzero(np.diff(point[order], prepend=-1, append=-2))
    counts = np.diff(bounds)
    for size in np.unique(counts):
        rows = order[bounds[:-1][counts == size][:, None] + np.arange(size)]  # (k, size)
        block = root[rows]
        remaining = (1.0 + 1e-12) * np.eye(size) - block @ np.swapaxes(block, 1, 2)
        result[rows] = np.linalg.solve(remaining, residual[rows][..., None])[..., 0]
    return result
