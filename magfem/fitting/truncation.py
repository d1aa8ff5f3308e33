"""What a truncated expansion leaves out first: the degree above its highest."""

from __future__ import annotations

import numpy as np

from magfem.fields.term_kinds import HARMONIC
from magfem.fields.terms import HIGHEST_DEGREE, harmonics
from magfem.fitting.candidate import Candidate, independent


def next_degree(candidate: Candidate) -> Candidate | None:
    """The exterior harmonics one degree above those of an expansion about one centre; None for anything else.

    Moving the centre of an expansion changes coefficients up to the next degree: ∂/∂z of degree n is one of degree
    n + 1. Where all degrees from 1 to N ≥ 2 are free, the centre is therefore known only through the absence of degree
    N + 1, which is a choice and no knowledge. A dipole alone, or odd degrees alone (a body that is its own mirror
    image), do have a centre.
    """
    terms = candidate.terms
    if terms.kind.size != 1 or terms.kind[0] != HARMONIC or candidate.parameters != terms.coefficient.size:
        return None
    top = int(terms.degree.max())
    if not 2 <= top < HIGHEST_DEGREE or set(terms.degree.tolist()) != set(range(1, top + 1)):
        return None
    highest = terms.degree == top
    kinds = list(zip(terms.order[highest].tolist(), terms.sine[highest].tolist(), strict=True))
    kinds += [(top + 1, sine) for order, sine in kinds if order == top]
    orders, sines = (list(column) for column in zip(*kinds, strict=True))
    above = harmonics(
        float(terms.radius[0]),
        [top + 1] * len(kinds),
        orders,
        [bool(sine) for sine in sines],
        np.ones(len(kinds)),
        terms.centre[0],
        terms.frame[0],
    )
    return independent(candidate.family, f"degree {top + 1}", above)
