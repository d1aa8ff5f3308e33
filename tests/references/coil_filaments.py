"""Inductance of windings by sums over straight filaments: Neumann's double integral, one of them in closed form."""

from __future__ import annotations

import numpy as np

from magfem.constants import MU_0
from magfem.typing import Floats

GMD_SQUARE = 0.44705  # of a square, over its side: Rosa and Grover, Bull. Bureau of Standards 8 (1912), section 11


def segment_flux(corners: Floats, points: Floats, steps: Floats) -> float:
    """∮ A·dl (H per unit of both turns) of the closed polygon `corners` (k, 3) m over elements `steps` at `points`."""
    start, end = corners, np.roll(corners, -1, axis=0)
    length = np.linalg.norm(end - start, axis=1)
    ra = np.linalg.norm(points[:, None] - start, axis=2)
    rb = np.roll(ra, -1, axis=1)
    # A = µ0/4π e ln((ra + rb + l)/(ra + rb − l)) of a straight wire
    weight = 2 * np.arctanh(length / (ra + rb)) / length
    return float(MU_0 / (4 * np.pi) * np.einsum("pk,kc,pc->", weight, end - start, steps))


def racetrack_polygon(straight: float, radius: float, height: float, arcs: int) -> Floats:
    """Corners (k, 3) m of a racetrack about z, its straights along x; the arcs' polygons have the arcs' area."""
    bend = np.pi / arcs
    angle = -np.pi / 2 + bend * np.arange(arcs + 1)
    grown = radius * (1 + bend**2 / 12)  # between the inscribed polygon and the circumscribed one, arc length kept
    grown = radius * np.where((angle == angle[0]) | (angle == angle[-1]), 1.0, grown / radius)
    right = np.stack([straight / 2 + grown * np.cos(angle), grown * np.sin(angle)], axis=-1)
    left = -right
    plan = np.concatenate([right, left])
    return np.column_stack([plan, np.full(len(plan), height)])


def racetrack_inductance(
    straight: float, inner: float, build: float, height: float, turns: float, cells: int, arcs: int = 32
) -> float:
    """Self-inductance (H) of a racetrack whose square window is divided into `cells`² cells, a filament in each."""
    side = build / cells
    assert abs(side - height / cells) < 1e-9 * side  # the mean distance within is a square's
    nodes, weights = np.polynomial.legendre.leggauss(3)
    middles = side * (np.arange(cells) + 0.5)
    rows = [(inner + x, z - height / 2) for x in middles for z in middles]
    polygons = [racetrack_polygon(straight, radius, z, arcs) for radius, z in rows]
    total = 0.0
    for radius, z in rows:
        own = racetrack_polygon(straight, radius, z, arcs)
        ends = np.roll(own, -1, axis=0)
        points = own[:, None] + 0.5 * (1 + nodes)[:, None] * (ends - own)[:, None]
        steps = 0.5 * weights[:, None] * (ends - own)[:, None]
        points, steps = points.reshape(-1, 3), steps.reshape(-1, 3)
        for (other_radius, other_z), polygon in zip(rows, polygons, strict=True):
            same = other_radius == radius and other_z == z
            place = points + np.array([0, 0, GMD_SQUARE * side]) if same else points
            total += segment_flux(polygon, place, steps)
    return total * turns**2 / cells**4
