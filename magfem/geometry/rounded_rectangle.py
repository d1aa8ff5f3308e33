"""The closed path that swept windings follow: a rectangle with round corners, and its parallels further out."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, pi

import numpy as np

from magfem.typing import Floats

ELEMENTS_PER_STRAIGHT = 4  # at resolution 1
ELEMENTS_PER_CORNER = 6  # 15° each: a parabola through three points of such an arc strays by 3e-6 of its radius


@dataclass(frozen=True)
class RoundedRectangle:
    """About the origin of a plane (u, v), right-handed, from the beginning of its side at +u; m."""

    straight_u: float  # of the sides along u, without the corners; may be 0
    straight_v: float
    radius: float  # of the corners

    def length(self, offset: float = 0.0) -> float:
        """Of the parallel `offset` (m) further out, m."""
        return 2 * (self.straight_u + self.straight_v) + 2 * pi * (self.radius + offset)

    def stations(self, along_u: int, along_v: int, corner: int) -> tuple[Floats, Floats]:
        """Skeleton points (2n+1, 2) m and outward unit vectors (2n+1, 2) at the stations of n elements.

        along_u, along_v, corner: elements of each piece; sides without length get none. The path itself is the
        skeleton plus `radius` times outward, its parallels have a larger radius. The last station is the first.
        """
        u, v = 0.5 * self.straight_u, 0.5 * self.straight_v
        ends = [(u, -v), (u, v), (-u, v), (-u, -v), (u, -v)]
        skeleton, angles = [np.empty((0, 2))], [np.empty(0)]
        for side, (start, end) in enumerate(pairwise(ends)):
            elements = (along_v, along_u)[side % 2] if start != end else 0
            share = np.arange(2 * elements)[:, None] / max(2 * elements, 1)
            turn = np.arange(2 * corner) / (2 * corner)
            skeleton += [start + share * np.subtract(end, start), np.tile(end, (2 * corner, 1))]
            angles += [np.full(2 * elements, 0.5 * pi * side), 0.5 * pi * (side + turn)]
        angle = np.concatenate(angles)
        outward = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return _closed(np.concatenate(skeleton)), _closed(outward)


def element_count(resolution: float, at_one: float) -> int:
    """How many elements a piece gets that has `at_one` of them at resolution 1."""
    return max(1, ceil(at_one * resolution * (1 - 1e-9)))


def _closed(rows: Floats) -> Floats:
    closed: Floats = np.concatenate([rows, rows[:1]])
    return closed
