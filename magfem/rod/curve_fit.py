"""Least squares of a centreline to data whose places along the rod are known, or are found along.

Data are points, or pixels of cameras: anything with a position that the curve's own position maps to. Where places are
unknown only the distance across the curve counts, in the data's own space (Gauss–Newton on the distance to the tangent;
each datum's place moves along with the curve), and the rod's length holds: |p'| = 1 is fitted as well, weighted so
that a stretch of 1 weighs like a shift of all data by `STIFFNESS` lengths. Without it nothing would hold the tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from magfem.errors import ConvergenceError
from magfem.rod.centreline import Centreline
from magfem.rod.centreline_basis import CentrelineBasis
from magfem.rod.robust_scale import TUNING, biweight, biweight_spread, scale_of
from magfem.typing import Floats, Integers, Points

STIFFNESS = 3.0
_STEPS, _PATIENCE = 100, 30
_ROUGH_STEPS = {True: 8, False: 2}  # with weights 1/r, before Tukey's, from a start far off or near
_FARTHEST = 0.1  # of the length, that a datum's place moves in one step: where a rod points into a camera it would leap
_NO_OUTLIER = 1e-6  # times the data's extent: a scatter below which no datum is called wrong
_SETTLED, _NEARLY = 1e-3, 0.1  # squared step, in standard deviations of the estimate; the latter after some patience,
# where data leap to and fro between two branches of a folded picture
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


def nearest_of(data: Floats, candidates: Floats) -> Integers:
    """(n,) which of the candidates (m, d) is nearest to each datum (n, d)."""
    middle = data.mean(axis=0)
    shifted = candidates - middle
    found: Integers = np.argmin(np.sum(shifted**2, axis=-1) - 2 * (data - middle) @ shifted.T, axis=1)
    return found


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

    def curve(self, coefficients: Floats) -> Centreline:
        """The curve of coefficients (K, 3), without statistics."""
        size = coefficients.size
        return Centreline(self.basis, self.base, self.base_tangent, coefficients, np.zeros((size, size)))


def nearest_places(task: Task, curve: Centreline, samples: int = 97) -> Floats:
    """Arc lengths (n,) m, to one part in `samples`, at which the curve passes nearest to each datum."""
    s = np.linspace(0.0, curve.length, samples)
    return s[task.data.nearest(curve.position(s))]


def fit_curve(task: Task, coefficients: Floats | None, s: Floats, rough: bool) -> Centreline:
    """From coefficients (K, 3), or the straight rod, and places (n,) m of the data to the centreline.

    rough: whether the start may be far off. Raises ConvergenceError when the fit does not settle, or keeps less than
    half of the data.
    """
    basis, length = task.basis, task.basis.length
    data = task.data.values
    count, coordinates = len(data), data.shape[1] - task.slide
    c = np.zeros((basis.count, 3)) if coefficients is None else coefficients.copy()
    nodes, node_weights = basis.quadrature
    freedom = max(coordinates * count - c.size, 1) / (coordinates * count)
    extent = float(np.abs(data - data.mean(axis=0)).max())
    rounding, smallest = 1e-13 * extent, _NO_OUTLIER * extent
    rough_left = _ROUGH_STEPS[rough] if task.robust else 0
    scale, limit = np.inf, np.inf
    again = True  # once: were the scale to follow the weights at every step, it could shrink for ever
    for iteration in range(1, _STEPS + 1):
        curve = task.curve(c)
        piece, values = basis.local(s)
        functions = np.einsum("nd,ndk->nk", values, basis.tables[0, piece])
        position, slope = np.einsum("nd,jndc->jnc", values, curve.pieces[:2, piece])
        seen, view = task.data.seen(position + task.base)
        away = data - seen
        lengths = np.sqrt(np.sum(away**2, axis=-1))
        across = view
        if task.slide:
            along = np.einsum("ndc,nc->nd", view, slope)
            speed = np.sum(along**2, axis=-1)
            shift = np.sum(along * away, axis=-1) / speed
            away = away - along * shift[:, None]
            pull = np.einsum("nd,ndc->nc", along, view) / speed[:, None]
            across = view - along[:, :, None] * pull[:, None, :]
        weight = np.ones(count)
        if task.robust:
            if rough_left >= 0:
                scale = max(scale_of(lengths, coordinates) / np.sqrt(freedom), smallest)
                limit = TUNING[coordinates] * scale
            weight = biweight(lengths, limit) if rough_left <= 0 else 1 / np.maximum(lengths / scale, 0.3)
        information = np.einsum("nda,ndb->nab", across, across)
        hessian, stiffness = _normal_matrix(functions, weight[:, None, None] * information), 0.0
        rhs = functions.T @ (weight[:, None] * np.einsum("nda,nd->na", across, away))
        if task.slide:
            mean = float(np.einsum("n,naa->", weight, information)) / coordinates
            speed_there = np.einsum("qk,kc->qc", basis.slopes, c)
            if task.base_tangent is not None:
                speed_there = speed_there + task.base_tangent
            size = np.linalg.norm(speed_there, axis=-1)
            tangent = speed_there / size[:, None]
            pressing = mean * (STIFFNESS * length) ** 2 * node_weights
            stiffness = _normal_matrix(basis.slopes, pressing[:, None, None] * tangent[:, :, None] * tangent[:, None])
            hessian = hessian + stiffness
            rhs = rhs + basis.slopes.T @ ((pressing * (1 - size))[:, None] * tangent)
        hessian[np.diag_indices(c.size)] += 1e-12 * np.trace(hessian) / c.size
        step = np.linalg.solve(hessian, rhs.ravel()).reshape(c.shape)
        c = c + step
        if task.slide:
            farthest = _FARTHEST * length
            s = s + np.clip(shift - np.sum(pull * (functions @ step), axis=-1), -farthest, farthest)
            s = np.clip(s, 0.0, length)
        kept = lengths < limit
        noise = max(float(np.sqrt(np.mean(lengths[kept] ** 2) / coordinates)), rounding)
        move = float(rhs.ravel() @ step.ravel()) / noise**2
        rough_left -= 1
        settled = _SETTLED if iteration < _PATIENCE else _NEARLY
        if rough_left < 0 and (move < settled or np.linalg.norm(step) < 1e-12 * length):
            found = max(scale_of(lengths, coordinates) / np.sqrt(freedom), smallest)
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
    # Scatter of an M-estimate: D⁻¹ (A JᵀJ) D⁻¹ with D = B JᵀJ + the stiffness, over the data that count.
    if task.robust:
        square, bend = biweight_spread(lengths, limit, coordinates)
        weighted = float(np.mean(biweight(lengths[kept], limit) * lengths[kept] ** 2))
        variance = weighted / (coordinates * bend)
    else:
        square, bend = float(np.mean(lengths**2)) / coordinates, 1.0
        variance = square
    data_part = _normal_matrix(functions[kept], information[kept])
    inverse = np.linalg.inv(bend * data_part + stiffness)
    fitted = bend * float(np.sum(inverse * data_part))  # parameters that the data, not the length, decide
    correction = coordinates * kept.sum() / max(coordinates * kept.sum() - fitted, 1.0)
    covariance = square * correction * inverse @ data_part @ inverse
    return Centreline(
        basis, task.base, task.base_tangent, c, covariance, float(np.sqrt(variance * correction)), kept, iteration
    )


def _normal_matrix(functions: Floats, information: Floats) -> Floats:
    """Σ_n φ_n φ_nᵀ ⊗ M_n: (3K, 3K) from functions (n, K) and matrices (n, 3, 3)."""
    count = functions.shape[1]
    weighted = (functions[:, :, None, None] * information[:, None]).reshape(len(functions), -1)
    return (functions.T @ weighted).reshape(count, count, 3, 3).transpose(0, 2, 1, 3).reshape(3 * count, 3 * count)
