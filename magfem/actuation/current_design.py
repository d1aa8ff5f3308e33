"""Rows that are products: field data of a coil system, linear in the currents and in functions of the place.

    B(p, I) = Σ_j I_j Σ_k c_jk φ_k(p) + Σ_k b_k φ_k(p)

With d = (I_1, …, I_c, 1) a row is φ(p) ⊗ d, and its parameters are X (K, c + 1): column j holds a coil's coefficients,
the last one the background's. The rows are never held all at once. Orthogonal transformations keep sums of squares, so
the rows of a part of space are reduced to one triangle, R of their QR decomposition; parameters are sorted by function
first, so that the leading columns of the same triangles are the problem with fewer functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from magfem.fields.terms import Terms
from magfem.typing import Booleans, Floats, Integers, Points

_BLOCK = 2048  # rows of samples reduced at a time


def values_of(functions: Sequence[Terms], points: Points) -> Floats:
    """B (n, 3, K) of every function at points (n, 3) m."""
    return np.stack([one.jet(points, 0)[0] for one in functions], axis=-1)


@dataclass(frozen=True)
class CurrentDesign:
    """n samples at q places, at D drives: the currents and, for a background, a one.

    functions: (q, 3, K) of the places.  place: (n,) of every sample.  drive: (n, D).  weight: (n, 3), one over the
    scale of every component.
    """

    functions: Floats
    place: Integers
    drive: Floats
    weight: Floats

    @property
    def samples(self) -> int:
        """How many."""
        return len(self.place)

    def subset(self, which: Booleans) -> CurrentDesign:
        """The samples of a mask (n,)."""
        return replace(self, place=self.place[which], drive=self.drive[which], weight=self.weight[which])

    def rows(self, which: Integers) -> Floats:
        """Weighted rows (3·m, K·D) of the samples `which` (m,)."""
        product = self.functions[self.place[which]][..., None] * self.drive[which][:, None, None, :]
        product *= self.weight[which][..., None, None]
        return product.reshape(3 * len(which), -1)

    def per_ampere(self, parameters: Floats) -> Floats:
        """What every drive gives (n, 3, D) at one ampere, unweighted, from parameters (K'·D,) of the first K'."""
        table = parameters.reshape(-1, self.drive.shape[1])
        columns: Floats = (self.functions[..., : len(table)] @ table)[self.place]
        return columns

    def field(self, parameters: Floats) -> Floats:
        """B (n, 3), unweighted."""
        total: Floats = np.einsum("nad,nd->na", self.per_ampere(parameters), self.drive)
        return total

    def adjoint(self, values: Floats, functions: int) -> Floats:
        """AᵀW v (K'·D, m) of values (n, 3, m), unweighted, for the first K' functions."""
        total = np.zeros((functions, self.drive.shape[1], values.shape[2]))
        for begin in range(0, self.samples, _BLOCK):
            own = slice(begin, begin + _BLOCK)
            weighted = values[own] * self.weight[own][..., None] ** 2
            carried = np.einsum("nak,nam->nkm", self.functions[self.place[own], :, :functions], weighted, optimize=True)
            total += np.einsum("nd,nkm->kdm", self.drive[own], carried, optimize=True)
        return total.reshape(-1, values.shape[2])


@dataclass(frozen=True)
class Triangles:
    """Weighted rows and their target, part by part reduced to triangles (r, p + 1), the target last."""

    parts: tuple[Floats, ...]

    def leading(self, p: int) -> tuple[Floats, Floats, Integers]:
        """Matrix (r, p), target (r,) and part (r,) for the first p parameters alone."""
        matrices, targets, part = [], [], []
        for number, triangle in enumerate(self.parts):
            # Below row p the matrix is zero: of these rows only the target's size counts.
            kept = triangle[:p, :p]
            below = np.linalg.norm(triangle[p:, -1])
            matrices += [kept, np.zeros((1, p))]
            targets += [triangle[:p, -1], np.array([below])]
            part += [number] * (len(kept) + 1)
        return np.concatenate(matrices), np.concatenate(targets), np.array(part, dtype=np.int64)


def reduced(design: CurrentDesign, B: Floats, part: Integers, picked: Integers | None = None) -> Triangles:
    """The triangles of every part (n,) of the samples, for values B (n, 3) and all parameters, or those `picked`."""
    triangles = []
    for number in range(int(part.max()) + 1):
        own = np.flatnonzero(part == number)
        blocks: list[Floats] = []
        for begin in range(0, own.size, _BLOCK):
            which = own[begin : begin + _BLOCK]
            rows = design.rows(which)
            rows = rows if picked is None else rows[:, picked]
            blocks.append(np.column_stack([rows, (B[which] * design.weight[which]).ravel()]))
            (triangle,) = linalg.qr(np.concatenate(blocks), mode="r", overwrite_a=True, check_finite=False)
            blocks = [triangle[: triangle.shape[1]]]
        triangles.append(blocks[0])
    return Triangles(tuple(triangles))
