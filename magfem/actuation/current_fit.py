"""Linear fits of currents and places, judged by parts of space that were left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from magfem.actuation.current_design import CurrentDesign, Triangles, reduced, values_of
from magfem.fields.term_kinds import INTERIOR
from magfem.fields.terms import Terms, concatenate, harmonics
from magfem.fitting.families.harmonics import all_orders
from magfem.fitting.least_squares import LeastSquares, Ridge, solve_least_squares
from magfem.fitting.measurement import CONDITION
from magfem.typing import Floats, Integers, Points


@dataclass(frozen=True)
class CurrentFit:
    """A solution.

    label, degree: of what was fitted.  functions: the K functions; the first `given` of them are coils' own models,
    each for its coil, the others harmonics about one centre.  design: whose first functions these are.
    table: (K, D) parameters of every function and drive; covariance: (K·D, K·D) of them.  solved: the least squares.
    left_out: (n, 3) T residuals of all samples, each by a fit that did not see its part of space.
    """

    label: str
    degree: int
    functions: tuple[Terms, ...]
    given: int
    design: CurrentDesign
    table: Floats
    covariance: Floats
    solved: LeastSquares
    left_out: Floats

    @property
    def parameters(self) -> int:
        """How many were free."""
        return self.solved.parameters.size

    @property
    def by_place(self) -> Floats:
        """Mean weighted square of the held-out residuals at every place (q,)."""
        squares = np.sum((self.left_out * self.design.weight) ** 2, axis=1)
        place = self.design.place
        means: Floats = np.bincount(place, squares) / np.bincount(place)
        return means

    @property
    def score(self) -> float:
        """Mean of them."""
        return float(self.by_place.mean())

    def of_drive(self, drive: int) -> Terms | None:
        """The field of one coil at one ampere, or of the background; None where nothing of it was fitted."""
        own = self.table[:, drive]
        parts = [one.scaled(c) for one, c in zip(self.functions, own[: self.given].tolist(), strict=False) if c != 0]
        if own[self.given :].any():
            parts.append(_joined(self.functions[self.given :], own[self.given :]))
        return concatenate(parts) if parts else None

    def deviation(self, points: Points, drive: Floats) -> Floats:
        """Standard deviation (n, 3) T of the field at points (n, 3) m for drives (D,)."""
        return field_deviation(self.functions, self.covariance, points, drive)


def field_deviation(functions: Sequence[Terms], covariance: Floats, points: Points, drive: Floats) -> Floats:
    """Standard deviation (n, 3) T at points (n, 3) m for drives (D,): the (K·D)² covariance carried there."""
    count = len(functions)
    table = covariance.reshape(count, drive.size, count, drive.size)
    carried = np.einsum("kdlf,d,f->kl", table, drive, drive, optimize=True)
    values = values_of(functions, points)
    squares = np.einsum("nak,kl,nal->na", values, carried, values, optimize=True)
    deviation: Floats = np.sqrt(np.maximum(squares, 0.0))
    return deviation


def harmonic_units(top: int, radius: float, centre: Points) -> tuple[Terms, ...]:
    """Interior harmonics up to degree `top`, each alone, in the order of degrees: top · (top + 2) of them."""
    return tuple(
        harmonics(radius, [degree], [order], [sine], [1.0], centre, kind=INTERIOR)
        for degree, order, sine in all_orders(range(1, top + 1))
    )


def _joined(units: Sequence[Terms], coefficients: Floats) -> Terms:
    """Harmonics about one centre as one source."""
    degree, order, sine = (
        np.concatenate([getattr(one, name) for one in units]) for name in ("degree", "order", "sine")
    )
    first = units[0]
    return harmonics(
        float(first.radius[0]),
        degree.tolist(),
        order.tolist(),
        sine.tolist(),
        coefficients,
        first.centre[0],
        kind=INTERIOR,
    )


def fit_degrees(
    units: Sequence[Terms],
    design: CurrentDesign,
    B: Floats,
    part: Integers,
    degrees: Sequence[int],
    ridge: Ridge,
    variance: float | None,
) -> list[CurrentFit]:
    """Harmonics up to each of the degrees; one reduction serves all.

    units: as `harmonic_units` gives them, the functions of the design.  B: (n, 3) T.  part: (n,) of space.
    variance: of a weighted row, where it is known.
    """
    triangles = reduced(design, B, part)
    drives = design.drive.shape[1]
    fits = []
    for degree in degrees:
        count = degree * (degree + 2)
        solved = _Solved(design, triangles, np.arange(count * drives), B, part, ridge, variance)
        label = f"interior harmonics up to degree {degree}"
        fits.append(solved.fit(label, degree, tuple(units[:count]), 0))
    return fits


def fit_gains(
    models: Sequence[Terms],
    units: Sequence[Terms],
    design: CurrentDesign,
    B: Floats,
    part: Integers,
    variance: float | None,
) -> CurrentFit:
    """One factor for each coil's own model; the three `units` of degree 1 are a uniform background.

    The design's functions are those of the models, then of the units.
    """
    coils, drives = len(models), design.drive.shape[1]
    picked = np.arange(coils) * (drives + 1)
    if drives > coils:
        picked = np.concatenate([picked, (coils + np.arange(3)) * drives + coils])
    triangles = reduced(design, B, part, picked)
    functions = (*models, *units)[: int(picked.max()) // drives + 1]
    solved = _Solved(design, triangles, picked, B, part, "none", variance)
    return solved.fit("the given models, a gain each", 0, functions, coils)


def smallest_of_the_best(fits: Sequence[CurrentFit]) -> CurrentFit:
    """The smallest whose held-out squares exceed the best ones by no more than one standard error of the difference."""
    best = min(fits, key=lambda one: one.score)
    for one in sorted(fits, key=lambda one: one.parameters):
        difference = one.by_place - best.by_place
        if difference.mean() <= difference.std() / np.sqrt(difference.size):
            return one
    return best


@dataclass(frozen=True)
class _Solved:
    """A design reduced to triangles of the parameters `picked`, on its way to a fit."""

    design: CurrentDesign
    triangles: Triangles
    picked: Integers
    B: Floats
    part: Integers
    ridge: Ridge
    variance: float | None

    def fit(self, label: str, degree: int, functions: tuple[Terms, ...], given: int) -> CurrentFit:
        """Parameters, and the residuals of every part without it."""
        design, drives = self.design, self.design.drive.shape[1]
        matrix, target, part_of_row = self.triangles.leading(self.picked.size)
        solved = solve_least_squares(matrix, target, self.ridge, self.variance, CONDITION, 3 * design.samples)
        count = len(functions) * drives

        def spread(parameters: Floats) -> Floats:
            full = np.zeros(count)
            full[self.picked] = parameters
            return full

        left_out = np.empty_like(self.B)
        for number in range(len(self.triangles.parts)):
            own = self.part == number
            without = spread(solved.parameters_without(part_of_row == number))
            left_out[own] = self.B[own] - design.subset(own).field(without)
        covariance = np.zeros((count, count))
        covariance[np.ix_(self.picked, self.picked)] = solved.covariance
        table = spread(solved.parameters).reshape(-1, drives)
        return CurrentFit(label, degree, functions, given, design, table, covariance, solved, left_out)
