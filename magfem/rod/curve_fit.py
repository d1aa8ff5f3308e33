"""Least squares of a centreline to data whose places along the rod are known, or are found along.

Data are points, or pixels of cameras: anything with a position that the curve's own position maps to. Where places are
unknown only the distance from the curve counts, in the data's own space (each datum's place moves along with the
curve), and the rod's length holds: |p'| = 1 is fitted as well, weighted so that a stretch of 1 weighs like a shift of
all data by `STIFFNESS` lengths. Without it nothing would hold the tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.rod.centreline import Centreline
from magfem.rod.centreline_basis import CentrelineBasis
from magfem.rod.robust_scale import TUNING, biweight, biweight_spread, scale_of
from magfem.typing import Booleans, Floats, Integers, Points, Vectors

STIFFNESS, _COLD = 0.05, 1.0  # the latter on the way from a start far off
_SAMPLES = 97
_STEPS, _PATIENCE = 100, 30
_ROUGH_STEPS = {True: 8, False: 2}  # with weights 1/r, before Tukey's, from a start far off or near
_FARTHEST = 0.1  # of the length, that a datum's place moves in one step: where a rod points into a camera it would leap
_NO_OUTLIER = 1e-4  # times the data's extent: a scatter below which no datum is called wrong; cameras see no finer
_SETTLED, _NEARLY = 1e-2, 0.1  # squared step, in standard deviations of the estimate; the latter when
# patience ends: data may leap to and fro between two branches of a folded picture
_UNDETERMINED = 1e-10  # smallest share of the largest eigenvalue of the functions, which are orthonormal over the rod
_SMALLER = 0.7  # a scale found this much smaller after Tukey's weights is worth another round


class Data(Protocol):
    """Data (n, d) of one unit, and how the curve's own points map to them."""

    @property
    def values(self) -> Floats:
        """(n, d)."""
        ...

    def seen(self, points: Points) -> tuple[Floats, Floats]:
        """What points (n, 3) m, one per datum, would be seen as, (n, d), and the derivatives (n, d, 3)."""
        ...

    def nearest(self, points: Points) -> Integers:
        """(n,) which of points (m, 3) m is seen nearest to each datum."""
        ...

    def gap(self, points: Points, used: Booleans) -> float:
        """How far the farthest of points (m, 3) m is seen from the nearest of the data used (n,)."""
        ...


@dataclass(frozen=True)
class PointCloud:
    """Points (n, 3) m, seen as they are."""

    values: Floats

    def seen(self, points: Points) -> tuple[Floats, Floats]:
        """The points themselves."""
        return points, np.broadcast_to(np.eye(3), (len(points), 3, 3))

    def nearest(self, points: Points) -> Integers:
        """By distance in space."""
        return nearest_of(self.values, points)

    def gap(self, points: Points, used: Booleans) -> float:
        """In space."""
        return farthest_from(self.values[used], points)


def nearest_of(data: Floats, candidates: Floats) -> Integers:
    """(n,) which of the candidates (m, d) is nearest to each datum (n, d)."""
    middle = data.mean(axis=0)
    shifted = candidates - middle
    found: Integers = np.argmin(np.sum(shifted**2, axis=-1) - 2 * (data - middle) @ shifted.T, axis=1)
    return found


def farthest_from(data: Floats, points: Floats) -> float:
    """How far the farthest of points (m, d) is from the nearest of data (n, d); infinite without data."""
    if not len(data):
        return np.inf
    return float(np.linalg.norm(points - data[nearest_of(points, data)], axis=-1).max())


@dataclass(frozen=True)
class Task:
    """What is fitted: data, on a rod of `basis` with its base (3,) m and unit tangent there, or None.

    slide: whether the data's places along the rod are found along.  robust: whether outliers are weighed down.
    """

    basis: CentrelineBasis
    base: Floats
    base_tangent: Floats | None
    data: Data
    slide: bool
    robust: bool

    @property
    def coordinates(self) -> int:
        """Of every datum, those that say something: where places are unknown, not the one along the curve."""
        return int(self.data.values.shape[1]) - self.slide

    def curve(self, coefficients: Floats) -> Centreline:
        """The curve of coefficients (K, 3), without statistics."""
        size = coefficients.size
        return Centreline(self.basis, self.base, self.base_tangent, coefficients, np.zeros((size, size)))


def nearest_places(task: Task, curve: Centreline) -> Floats:
    """Arc lengths (n,) m, to about a hundredth of the length, at which the curve passes nearest to each datum."""
    s = np.linspace(0.0, curve.length, _SAMPLES)
    return s[task.data.nearest(curve.position(s))]


def fit_curve(task: Task, coefficients: Floats | None, s: Floats, rough: bool) -> Centreline:
    """From coefficients (K, 3), or the straight rod, and places (n,) m of the data to the centreline.

    rough: whether the start may be far off. Raises ConvergenceError when the fit does not settle, or keeps less than
    half of the data, InputError when they leave part of the curve open.
    """
    c = np.zeros((task.basis.count, 3)) if coefficients is None else coefficients
    data, coordinates = task.data.values, task.coordinates
    extent = float(np.abs(data - data.mean(axis=0)).max())
    rounding, smallest = 1e-13 * extent, _NO_OUTLIER * extent
    free = 1 - min(c.size, coordinates * len(data) - 1) / (coordinates * len(data))
    rough_left = _ROUGH_STEPS[rough] if task.robust else 0
    scale, limit = np.inf, np.inf
    before: Floats = np.zeros(c.shape)
    again = True  # once: were the scale to follow the weights at every step, it could shrink for ever
    for iteration in range(1, _STEPS + 1):
        near = _linearised(task, c, s)
        weight = np.ones(len(data))
        if task.robust:
            found = max(scale_of(near.lengths, coordinates) / np.sqrt(free), smallest)
            if rough_left >= 0:
                scale, limit = found, TUNING[coordinates] * found
            weight = 1 / np.maximum(near.lengths / scale, 0.3) if rough_left > 0 else biweight(near.lengths, limit)
        hessian, rhs, _ = _equations(task, c, near, weight, _COLD if rough_left > 0 else STIFFNESS)
        step = np.asarray(np.linalg.solve(hessian, rhs.ravel()).reshape(c.shape))
        size = float(np.linalg.norm(step))
        if np.sum(step * before) < 0 and size > 0.5 * float(np.linalg.norm(before)):
            step *= 0.5  # to and fro
        before = step
        c = c + step
        if task.slide:
            moved = np.clip(near.shift - np.sum(near.pull * (near.functions @ step), axis=-1), -_FARTHEST, _FARTHEST)
            s = np.clip(s + moved * task.basis.length, 0.0, task.basis.length)
        kept = near.lengths < limit
        noise = max(float(np.sqrt(np.mean(near.lengths[kept] ** 2) / coordinates)), rounding)
        move = float(rhs.ravel() @ step.ravel()) / noise**2
        rough_left -= 1
        settled = _SETTLED if iteration < _PATIENCE else _NEARLY
        if rough_left < 0 and (move < settled or size < 1e-12 * task.basis.length):
            if not (task.robust and again and found < _SMALLER * scale):
                break
            again, scale, limit = False, found, TUNING[coordinates] * found
    else:
        raise ConvergenceError(
            f"centreline: the fit did not settle in {_STEPS} steps; a start nearer to the rod, a lower degree or "
            f"fewer outliers would help"
        )
    if np.mean(kept) < 0.5:
        raise ConvergenceError(
            f"centreline: only {np.mean(kept):.0%} of the data lie on one curve of this length, expected at least half"
        )
    covariance, deviation = _statistics(task, c, near, limit)
    gap = task.data.gap(task.curve(c).position(np.linspace(0, task.basis.length, _SAMPLES)), kept)
    return Centreline(task.basis, task.base, task.base_tangent, c, covariance, deviation, kept, gap, iteration)


@dataclass(frozen=True)
class _Linearised:
    """Data near a curve whose position changes.

    lengths: (n,) of the residuals.  functions: (n, K) at the data's places.  information: (n, 3, 3) and force (n, 3),
    what each residual's square is in a change of position, half its second derivative and minus half its first.
    across: (n, 3, 3), the information in the direction across the curve alone.  shift, pull: by how many lengths of the
    rod each place moves, (n,), and how much less for a change of position, (n, 3); zero where places are known.
    """

    lengths: Floats
    functions: Floats
    information: Floats
    force: Vectors
    across: Floats
    shift: Floats
    pull: Vectors


def _linearised(task: Task, c: Floats, s: Floats) -> _Linearised:
    """Places are eliminated by Newton's method: of r² with r = data − seen(p(s)) the half second derivative in s is
    g = |r'|² − r·r'', so that information and force lose their part along the curve, by viewᵀr' r'ᵀview/g.

    Where −r·r'' is negative it is left out, as by Gauss and Newton. Where it is positive it counts: a picture may bend
    as sharply as its noise is wide, and without it places would leap (Wang, Pottmann and Liu, Fitting B-spline curves
    to point clouds by curvature-based squared distance minimization, ACM Trans. Graph. 25, 2006).
    """
    piece, values = task.basis.local(s)
    functions = np.einsum("nd,ndk->nk", values, task.basis.tables[0, piece])
    position, slope, bend = np.einsum("nd,jndc->jnc", values, task.curve(c).pieces[:3, piece])
    seen, view = task.data.seen(position + task.base)
    away = task.data.values - seen
    lengths = np.sqrt(np.sum(away**2, axis=-1))
    whole, force = np.einsum("nda,ndb->nab", view, view), np.einsum("nda,nd->na", view, away)
    if not task.slide:
        return _Linearised(lengths, functions, whole, force, whole, np.zeros(len(s)), np.zeros((len(s), 3)))
    along = np.einsum("ndc,nc->nd", view, slope) * task.basis.length
    pull = np.einsum("nd,ndc->nc", along, view)
    speed = np.sum(along**2, axis=-1)
    steep = speed + np.maximum(-np.sum(force * bend, axis=-1) * task.basis.length**2, 0.0)
    shift = np.sum(along * away, axis=-1) / steep
    outer = pull[:, :, None] * pull[:, None, :]
    return _Linearised(
        lengths,
        functions,
        whole - outer / steep[:, None, None],
        force - pull * shift[:, None],
        whole - outer / speed[:, None, None],
        shift,
        pull / steep[:, None],
    )


def _equations(task: Task, c: Floats, near: _Linearised, weight: Floats, stiff: float) -> tuple[Floats, Floats, Floats]:
    """Gauss–Newton's matrix (3K, 3K), right-hand side (K, 3), and that part of the matrix which holds the length."""
    hessian = _normal_matrix(near.functions, weight[:, None, None] * near.information)
    rhs = near.functions.T @ (weight[:, None] * near.force)
    stiffness = np.zeros_like(hessian)
    if task.slide:
        speed = task.basis.slopes @ c + (0.0 if task.base_tangent is None else task.base_tangent)
        size = np.linalg.norm(speed, axis=-1)
        tangent = speed / size[:, None]
        mean = float(np.einsum("n,naa->", weight, near.across)) / task.coordinates
        pressing = mean * (stiff * task.basis.length) ** 2 * task.basis.quadrature[1]
        stiffness = _normal_matrix(task.basis.slopes, pressing[:, None, None] * tangent[:, :, None] * tangent[:, None])
        hessian = hessian + stiffness
        rhs = rhs + task.basis.slopes.T @ ((pressing * (1 - size))[:, None] * tangent)
    hessian[np.diag_indices(c.size)] += 1e-12 * np.trace(hessian) / c.size
    return hessian, rhs, stiffness


def _statistics(task: Task, c: Floats, near: _Linearised, limit: float) -> tuple[Floats, float]:
    """Covariance (3K, 3K) of the coefficients, D⁻¹ (A JᵀJ) D⁻¹ with D = B JᵀJ + stiffness, and the data's deviation.

    JᵀJ is over the data within the limit; what holds the length is exact and adds no scatter.
    """
    kept, coordinates = near.lengths < limit, task.coordinates
    square, bend = biweight_spread(near.lengths, limit, coordinates)
    pulled = float(np.mean(biweight(near.lengths[kept], limit) * near.lengths[kept] ** 2))
    data_part = _normal_matrix(near.functions[kept], near.across[kept])
    stiffness = _equations(task, c, near, kept.astype(float), STIFFNESS)[2]
    whole = bend * data_part + stiffness
    spread = np.linalg.eigvalsh(whole)
    if not spread[0] > _UNDETERMINED * spread[-1]:
        raise InputError(
            "centreline: the data lie on too little of the rod to fix its curve; a lower degree or data all along it "
            "would"
        )
    inverse = np.linalg.inv(whole)
    fitted = bend * float(np.sum(inverse * data_part))  # parameters that the data, not the length, decide
    values = coordinates * int(kept.sum())
    correction = values / max(values - fitted, 1.0)
    return square * correction * inverse @ data_part @ inverse, float(
        np.sqrt(pulled / (coordinates * bend) * correction)
    )


def _normal_matrix(functions: Floats, information: Floats) -> Floats:
    """Σ_n φ_n φ_nᵀ ⊗ M_n: (3K, 3K) from functions (n, K) and matrices (n, 3, 3)."""
    count = functions.shape[1]
    weighted = (functions[:, :, None, None] * information[:, None]).reshape(len(functions), -1)
    return (functions.T @ weighted).reshape(count, count, 3, 3).transpose(0, 2, 1, 3).reshape(3 * count, 3 * count)
