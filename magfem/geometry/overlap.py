"""Whether magnets overlap: told before any meshing, without Gmsh."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from magfem.geometry.part import Part
from magfem.typing import Points

_SAMPLES = 4000
_SLACK = 1e-6  # of the smaller part: touching faces overlap by rounding


def overlapping(parts: Sequence[Part]) -> tuple[str, str] | None:
    """The names of two parts that overlap, None when none are found to.

    A pair that a plane separates does not overlap; of the others, one overlaps surely when it holds points of the
    other. What neither shows, a thin overlap of curved bodies, is left to the mesh, which refuses it as well.
    """
    balls = [_ball(part) for part in parts]
    for (i, one), (j, other) in combinations(enumerate(parts), 2):
        (centre, radius), (other_centre, other_radius) = balls[i], balls[j]
        if np.linalg.norm(centre - other_centre) >= radius + other_radius or _separated(one, other):
            continue
        if other.contains(_inside(one)).any() or one.contains(_inside(other)).any():
            return one.name, other.name
    return None


def _ball(part: Part) -> tuple[Points, float]:
    corners = part.corners
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return centre, float(np.linalg.norm(corners - centre, axis=1).max()) + part.shape.bulge


def _separated(one: Part, other: Part) -> bool:
    """Whether some plane has the two on its two sides; a linear program for the plane of the widest margin."""
    from scipy.optimize import linprog

    a, b = one.corners, other.corners
    scale = np.ptp(np.concatenate([a, b]), axis=0).max()
    a, b = a / scale, b / scale
    # Unknown: normal (3), offset, margin. n·a − c + t ≤ 0, c − n·b + t ≤ 0, |n_i| ≤ 1.
    rows = np.concatenate(
        [
            np.column_stack([a, -np.ones(len(a)), np.ones(len(a))]),
            np.column_stack([-b, np.ones(len(b)), np.ones(len(b))]),
        ]
    )
    bounds = [(-1, 1)] * 3 + [(None, None), (None, 1)]
    solved = linprog([0, 0, 0, 0, -1], A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds)
    normal, margin = solved.x[:3], float(solved.x[4])
    length = float(np.linalg.norm(normal))
    bulge = (one.shape.bulge + other.shape.bulge) / scale
    return length > 0.1 and 2 * margin / length >= bulge - _SLACK


def _inside(part: Part) -> Points:
    """Points (n, 3) inside a part, well off its surface by `_SLACK`, dense near it: random and on its hull's rays."""
    rng = np.random.default_rng(0)
    corners = part.shape.corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    points = low + (high - low) * rng.random((_SAMPLES, 3))
    # Points shrunk towards the middle of the box reach into corners and edges, where overlaps begin.
    weights = rng.dirichlet(np.full(3, 0.5), _SAMPLES)
    chosen = corners[rng.integers(0, len(corners), (_SAMPLES, 3))]
    skin = np.einsum("nk,nki->ni", weights, chosen)
    middle = (low + high) / 2
    local = np.concatenate([points, middle + (skin - middle) * (1 - 1e-3)])
    kept = local[part.shape.contains(local)]
    placed: Points = part.pose.apply(kept) if len(kept) else np.empty((0, 3))
    return placed
