"""The error statement of a solution: it is held against a second one on elements of twice the size."""

from __future__ import annotations

import logging
import resource
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from magfem.errors import ConvergenceError
from magfem.fields.norms import relative_errors
from magfem.fields.region import Shell
from magfem.typing import Jet, Points

log = logging.getLogger("magfem")
Solved = TypeVar("Solved")


@dataclass(frozen=True)
class Refined(Generic[Solved]):
    """What was solved last, on which resolution, with the stated errors of B and of the gradient."""

    solved: Solved
    resolution: float
    error: tuple[float, float]


def refine(
    solve: Callable[[float], Solved],
    jet: Callable[[Solved, Points], Jet],
    stated: Callable[[float, Solved], float],
    region: Shell,
    resolution: float,
    tolerance: float | None,
    finest: float,
) -> Refined[Solved]:
    """Solve at `resolution` and at half of it; double it until the stated error of B is below `tolerance`.

    stated: makes a statement out of the largest relative difference between both, over random points of `region`.
    Raises ConvergenceError when a tolerance asks for more than the `finest` resolution.
    """
    layers = region.layers(np.random.default_rng(0), layers=32, per_layer=40)
    points = layers.reshape(-1, 3)
    coarse: Jet | None = None
    while True:
        solved = solve(resolution)  # before the coarse one, so that a mesh that does not fit is refused at once
        fine = jet(solved, points)
        if coarse is None:
            coarse = jet(solve(resolution / 2), points)
        error = [stated(_difference(*pair, layers), solved) for pair in zip(coarse, fine, strict=True)]
        log.info("solution: stated error %.1e in B, %.1e in the gradient", *error)
        if tolerance is None or error[0] <= tolerance:
            return Refined(solved, resolution, (error[0], error[1]))
        if 2 * resolution > finest:
            raise ConvergenceError(
                f"the stated error of B is {error[0]:.1e} at resolution {resolution:g}, and twice of that is "
                f"beyond {finest:g}; a tolerance of {tolerance:g} is out of reach"
            )
        resolution, coarse = 2 * resolution, fine


def _difference(before: Points, after: Points, layers: Points) -> float:
    shape = (*layers.shape[:2], *after.shape[1:])
    return float(relative_errors(before.reshape(shape), after.reshape(shape)).max())


def peak_bytes() -> int:
    """Peak memory of this process."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)
