"""Where sources with free places belong: variable projection.

For every vector of places the coefficients are a linear least squares; what is left, r(places), is minimised over the
places alone, within their bounds (Golub & Pereyra, Inverse Problems 19, R1 (2003)).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.least_squares import solve_least_squares
from magfem.fitting.objective import Objective, rows
from magfem.fitting.sampling import LayeredData
from magfem.typing import Floats

_REFINED = 2  # of the starts
_EVALUATIONS = 40  # of the residual's Jacobian
_MOST_POINTS = 150  # places are found on a part of the data: the coefficients then take all of it


def place(displaceable: Displaceable, data: LayeredData, objective: Objective) -> Candidate:
    """The candidate with the places that fit best, sought from the most promising starts."""
    few = _thinned(data)

    def residual(places: Floats) -> Floats:
        matrix, target = rows(displaceable.make(places), few, objective)
        return solve_least_squares(matrix, target).residual

    starts = np.clip(displaceable.start, displaceable.lower, displaceable.upper)
    promising = sorted(starts, key=lambda start: float(np.sum(residual(start) ** 2)))[:_REFINED]
    found = [
        least_squares(
            residual,
            start,
            bounds=(displaceable.lower, displaceable.upper),
            x_scale=displaceable.upper - displaceable.lower,
            max_nfev=_EVALUATIONS,
            xtol=1e-4,
            ftol=1e-4,
        )
        for start in promising
    ]
    return displaceable.make(min(found, key=lambda one: float(one.cost)).x)


def _thinned(data: LayeredData) -> LayeredData:
    """Every so many layers' points, some hundreds in all."""
    step = max(1, data.points[..., 0].size // _MOST_POINTS)
    return LayeredData(data.points[:, ::step], data.B[:, ::step], data.gradient[:, ::step], data.spread)
