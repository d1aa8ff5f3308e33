"""Terms as the kernel reads them: a few flat arrays, each source sent to the fastest way of evaluating it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from magfem.fields.solid_harmonics import interior_scale, schmidt_scale
from magfem.fields.term_kinds import CHARGE_DISC, HARMONIC, LOOP, OBLATE, PATH
from magfem.typing import Complexes, Floats, Integers

if TYPE_CHECKING:
    from magfem.fields.terms import Terms

LOOPS, ZONAL, TRANSVERSE_COS, TRANSVERSE_SIN, MIXED, MIXED_INTERIOR, OBLATE_DISC, CONDUCTOR, DISC = range(9)
"""How a source is evaluated."""


class Packed(NamedTuple):
    """n sources as the kernel reads them.

    layout: (n, 5) how, first and last index into what the source owns, whether its frame is the common one, whether
    the next source's frame is another.  numbers: (n, 14) radius, centre, frame row by row, coefficient.
    reals, complexes: coefficients of harmonics.  indices: (c, 2) degrees and orders of mixed harmonics, in step with
    `complexes`.  nodes: (v, 3) of paths.
    """

    layout: Integers
    numbers: Floats
    reals: Floats
    complexes: Complexes
    indices: Integers
    nodes: Floats


@dataclass
class _Draft:
    """What has been packed so far: of every evaluation its source, how, its run of what it owns, its one number."""

    source: list[int] = field(default_factory=list)
    how: list[tuple[int, int, int]] = field(default_factory=list)
    value: list[float] = field(default_factory=list)
    reals: list[float] = field(default_factory=list)
    complexes: list[complex] = field(default_factory=list)
    indices: list[tuple[int, int]] = field(default_factory=list)

    def add(self, source: int, how: int, first: int, last: int, value: float = 0.0) -> None:
        self.source.append(source)
        self.how.append((how, first, last))
        self.value.append(value)

    def add_real(self, source: int, how: int, dense: Floats) -> None:
        first = len(self.reals)
        self.reals += dense.tolist()
        self.add(source, how, first, len(self.reals))

    def add_complex(self, source: int, how: int, values: Complexes, indices: list[tuple[int, int]]) -> None:
        first = len(self.complexes)
        self.complexes += values.tolist()
        self.indices += indices
        self.add(source, how, first, len(self.complexes))


def pack(terms: Terms) -> Packed:
    """The arrays of `terms`, sources in their order; cosines and sines of order 1 become two."""
    draft = _Draft()
    for k in range(terms.kind.size):
        run, kind = slice(terms.start[k], terms.start[k + 1]), terms.kind[k]
        if kind == PATH:
            first, last = int(terms.node_start[k]), int(terms.node_start[k + 1])
            draft.add(k, CONDUCTOR, first, last, float(terms.coefficient[run].sum()))
        elif kind in (LOOP, CHARGE_DISC):
            draft.add(k, LOOPS if kind == LOOP else DISC, 0, 0, float(terms.coefficient[run].sum()))
        else:
            degree, order, sine = terms.degree[run], terms.order[run], terms.sine[run]
            _add_harmonics(draft, k, int(kind), degree, order, sine, terms.coefficient[run])
    rows = draft.source
    frames = terms.frame[rows].reshape(len(rows), 9)
    layout = np.zeros((len(rows), 5), dtype=np.int64)
    layout[:, :3] = np.array(draft.how, dtype=np.int64).reshape(len(rows), 3)
    layout[:, 3] = np.all(frames == np.eye(3).ravel(), axis=1)
    layout[:-1, 4] = np.any(frames[1:] != frames[:-1], axis=1)
    layout[-1:, 4] = 1
    return Packed(
        layout,
        np.column_stack([terms.radius[rows], terms.centre[rows], frames, draft.value]),
        np.array(draft.reals, dtype=float),
        np.array(draft.complexes, dtype=complex),
        np.array(draft.indices, dtype=np.int64).reshape(-1, 2),
        np.ascontiguousarray(terms.nodes),
    )


def _add_harmonics(
    draft: _Draft, k: int, kind: int, degree: Integers, order: Integers, sine: Integers, coefficient: Floats
) -> None:
    """Harmonics of order 0 or 1 alone go the fast ways of real numbers, others that of complex ones."""
    kinds = list(zip(degree.tolist(), order.tolist(), strict=True))
    if kind in (HARMONIC, OBLATE):
        values = coefficient * [schmidt_scale(n, m) for n, m in kinds]
    else:
        values = coefficient * [interior_scale(n, m) for n, m in kinds]
    turned = values * np.where(sine == 1, -1j, 1.0).astype(complex)  # Re(−i h J) = h Im J
    if kind == OBLATE:
        dense = _dense(degree, turned)
        draft.add_complex(k, OBLATE_DISC, dense, [(0, 0)] * dense.size)
    elif kind == HARMONIC and np.all(order == 0):
        draft.add_real(k, ZONAL, _dense(degree, np.where(sine == 1, 0.0, values)).real)  # sin 0φ is nothing
    elif kind == HARMONIC and np.all(order == 1):
        for how, part in ((TRANSVERSE_COS, 0), (TRANSVERSE_SIN, 1)):
            if np.any(sine == part):
                draft.add_real(k, how, _dense(degree[sine == part], values[sine == part]).real)
    else:
        draft.add_complex(k, MIXED if kind == HARMONIC else MIXED_INTERIOR, turned, kinds)


def _dense(degree: Integers, values: Complexes | Floats) -> Complexes:
    """Coefficients by degree, at 3 + l, with the zeros around them that the kernels' derivatives reach into."""
    dense = np.zeros(int(degree.max()) + 6, dtype=complex)
    np.add.at(dense, 3 + degree, values)
    return dense
