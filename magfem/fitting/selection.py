"""Which candidate: the smallest whose errors, on data that did not fit it, stay below half the targets."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from magfem.errors import ConvergenceError
from magfem.fields.terms import Terms
from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.displacement import place
from magfem.fitting.least_squares import LeastSquares, solve_least_squares
from magfem.fitting.objective import Objective, rows
from magfem.fitting.sampling import LayeredData, layer_errors

log = logging.getLogger("magfem")

CONDITION = 1e7
"""Largest condition number of the scaled columns that a model may have."""


@dataclass(frozen=True)
class Fitted:
    """A candidate with its parameters, and its errors on the points that choose among candidates."""

    candidate: Candidate
    solved: LeastSquares
    selection: dict[str, Any]

    @property
    def terms(self) -> Terms:
        """The fitted terms."""
        return self.candidate.with_parameters(self.solved.parameters)

    @property
    def headline(self) -> dict[str, Any]:
        """What reports say first."""
        return {
            "family": self.candidate.family,
            "label": self.candidate.label,
            "parameters": self.candidate.parameters,
            "condition": self.solved.condition,
        }

    def score(self, targets: dict[str, float]) -> float:
        """Largest error against its target."""
        return max(float(self.selection[key]["max"]) / target for key, target in targets.items())


def climb(
    members: Iterable[Candidate | Displaceable],
    data: dict[str, LayeredData],
    objective: Objective,
    targets: dict[str, float],
    most: int | None = None,
) -> list[Fitted]:
    """Fit a family's candidates, from few parameters to many, until one is good enough; at most `most` parameters."""
    tried: list[Fitted] = []
    for member in members:
        if most is not None and member.parameters > most:
            continue
        candidate = place(member, data["training"], objective) if isinstance(member, Displaceable) else member
        solved = solve_least_squares(*rows(candidate, data["training"], objective), most_condition=0.99 * CONDITION)
        terms = candidate.with_parameters(solved.parameters)
        tried.append(Fitted(candidate, solved, layer_errors(terms.jet(data["selection"].flat, 1), data["selection"])))
        if tried[-1].score(targets) <= 0.5:
            break
    return tried


def choose(tried: list[Fitted], targets: dict[str, float], suiting: str | None = None) -> Fitted:
    """The first candidate below half the targets, else the best of those tried, one or more; says when that misses.

    suiting: the family that suits the device, where it was not among those tried; None where a larger clearance is
    what would help.
    Raises ConvergenceError when even the best is no model: its error of B is above 100 %.
    """
    good = [one for one in tried if one.score(targets) <= 0.5]
    chosen = min(good, key=lambda one: one.candidate.parameters) if good else min(tried, key=lambda o: o.score(targets))
    B, gradient = (chosen.selection[key]["max"] for key in ("B", "gradient"))
    family = chosen.candidate.family
    if not B < 1:
        raise ConvergenceError(
            f"no model of the family {family} describes this field: the best of {len(tried)} errs by {B:.1e} in B; "
            + (
                f"its options, or the family itself, do not suit: {suiting} is what suits this device"
                if suiting
                else "a larger clearance in the card's region is what helps"
            )
        )
    if chosen.score(targets) > 1:
        log.warning(
            "the targets are missed: %.1e in B (wanted %.1e), %.1e in the gradient (wanted %.1e); "
            "the stated bound says how good the model is, %s",
            *(B, targets["B"], gradient, targets["gradient"]),
            f"{family} with these options describes the field no better: {suiting} is what suits this device"
            if suiting
            else "a larger clearance makes it better",
        )
    return chosen
