"""A model before its fit: unit sources, and which free parameter each of their coefficients takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from magfem.fields.region import Region
from magfem.fields.terms import Terms
from magfem.typing import Floats, Integers


@dataclass(frozen=True)
class Candidate:
    """A model that is linear in its p free parameters.

    terms: c coefficients, of which each is its own value times that of its parameter: (c,) indices into the free ones,
    which coefficients may share.
    """

    family: str
    label: str
    terms: Terms
    parameter: Integers
    source: str = ""  # where the family comes from, when it is not ours
    window: Region | None = None  # the part of the device's region that the family is meant for

    @property
    def parameters(self) -> int:
        """How many are free."""
        return int(self.parameter.max()) + 1

    def with_parameters(self, values: Floats) -> Terms:
        """The terms for parameter values (p,)."""
        return self.terms.with_coefficients(self.terms.coefficient * values[self.parameter])

    def columns(self, points: Floats, order: int = 1) -> tuple[Floats, ...]:
        """What each parameter alone gives at points (n, 3): B (p, n, 3), gradients (p, n, 3, 3) and so on."""
        jets = [self.with_parameters(unit).without_zeros().jet(points, order) for unit in np.eye(self.parameters)]
        return tuple(np.array(parts) for parts in zip(*jets, strict=True))


@dataclass(frozen=True)
class Displaceable:
    """A family member whose sources have places yet to be found: a candidate for every vector of them.

    make: from places (q,) to the linear candidate.  start: (k, q), where to search from.  lower, upper: (q,) bounds.
    names: of the places, for people.
    """

    label: str
    parameters: int
    make: Callable[[Floats], Candidate]
    start: Floats
    lower: Floats
    upper: Floats
    names: tuple[str, ...] = field(default=())


def independent(family: str, label: str, terms: Terms, source: str = "", window: Region | None = None) -> Candidate:
    """A candidate whose coefficients are all free, each its own parameter."""
    return Candidate(family, label, terms, np.arange(terms.coefficient.size), source, window)
