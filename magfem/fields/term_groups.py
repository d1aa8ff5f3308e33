"""Several fields at once, each on its own: what every coil of a system does, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magfem.fields.packed import Packed
from magfem.fields.packing import BLOCK
from magfem.fields.terms import PARALLEL_FROM, Terms, concatenate
from magfem.fields.terms_kernel import evaluate_each
from magfem.threads import in_chunks
from magfem.typing import Integers, Jet, Points


class TermGroups:
    """g fields in one frame, each of its own terms."""

    packed: Packed
    start: Integers

    def __init__(self, groups: Sequence[Terms]) -> None:
        self.packed = concatenate(groups).packed
        rows = [len(terms.packed.layout) for terms in groups]
        self.start = np.concatenate([[0], np.cumsum(rows)]).astype(np.int64)

    def jets(self, points: Points, order: int = 1) -> Jet:
        """(B (g, n, 3), gradient (g, n, 3, 3)[, hessian (g, n, 3, 3, 3)]) at `points` (n, 3) m."""
        points = np.ascontiguousarray(points, dtype=float)
        g, n = self.start.size - 1, points.shape[0]
        parts = [
            np.empty((g, n, *(3,) * rank)) if rank <= order + 1 else np.empty((1, 0, *(3,) * rank))
            for rank in (1, 2, 3)
        ]
        B, gradient, hessian = parts

        def run(chunk: slice) -> None:
            evaluate_each(points, chunk.start, chunk.stop, self.start, *self.packed, order, B, gradient, hessian)

        if n < 2 * PARALLEL_FROM:
            run(slice(0, n))
        else:
            in_chunks(run, n, PARALLEL_FROM, BLOCK)
        return tuple(parts[: order + 1])
