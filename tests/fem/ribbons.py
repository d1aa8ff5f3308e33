"""Closed ribbons, edge points (left, right) m: a band, a planar spiral, a rectangular spiral rolled on a cylinder.

The spirals are closed by a return strip of the same width below the turns, with a vertical strip at either end.
"""

from __future__ import annotations

import numpy as np

from magfem.mesh.coil_in_air import Ribbon
from magfem.typing import Floats


def band(radius: float, width: float, stations: int = 361) -> Ribbon:
    """A strip round a cylinder about z: a solenoid of one turn without thickness."""
    angle = np.linspace(0, 2 * np.pi, stations)
    angle[-1] = 0.0
    middle = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    half = np.array([0, 0, width / 2])
    return middle + half, middle - half


def spiral(
    turns: int = 24,
    inner_radius: float = 1e-3,
    width: float = 1e-4,
    gap: float = 1e-4,
    depth: float = 60e-6,
    per_turn: int = 360,
) -> Ribbon:
    """A round spiral from the inside out, counter-clockwise, that starts on the x axis.

    Its end lies two widths before it; there it goes down, turns to the left, runs below all turns, turns to the
    right and comes up at the start.
    """
    pitch = width + gap
    first = inner_radius + width / 2
    last = first + pitch * turns
    turn = np.linspace(0, turns - np.arcsin(2 * width / last) / (2 * np.pi), turns * per_turn + 1)
    angle = 2 * np.pi * turn
    outwards = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    # Cross-lines are radial: they miss the normal of the steepest, innermost turn by 0.03 rad, the width by 5e-4.
    sides = [(first + pitch * turn + side * width / 2)[:, None] * outwards for side in (-1, 1)]
    under = []
    for side, edges in zip((-1, 1), sides, strict=True):
        y = -width + side * width / 2
        x = np.array([np.hypot(*edges[-1, :2]), first + side * width / 2])
        corners = np.stack([x, [y, y], [-depth, -depth]], axis=-1)
        down = np.array([0, 0, -depth])
        under.append(np.concatenate([edges[-1:] + down, corners, edges[:1] + down, edges[:1]]))
    left, right = (np.concatenate(pair) for pair in zip(sides, under, strict=True))
    return left, right


def rolled_rectangle(
    turns: int = 12,
    size: tuple[float, float] = (4.35e-3, 5.5e-3),
    width: float = 0.13e-3,
    gaps: tuple[float, float] = (0.05e-3, 0.07e-3),
    radius: float = 0.70e-3,
    depth: float = 60e-6,
    spacing: float = 20e-6,
) -> Ribbon:
    """A rectangular spiral from the inside out, its first `size` rolled round the z axis, its second along it.

    gaps: between strands along z, and between those around it. The end lies half-way along the last strand, two
    widths before the strand where the return strip turns to the left and runs along z to the start.
    """
    a, b = ((size[n] - width) / 2 - (width + gaps[n]) * np.arange(turns)[::-1] for n in (0, 1))
    middle = [[a[0], -b[0] + 1.5 * width]]
    for n in range(turns):
        middle += [[a[n], b[n]], [-a[n], b[n]], [-a[n], -b[n]], [a[min(n + 1, turns - 1)], -b[n]]]
    middle[-1] = [a[0] - 2 * width, -b[-1]]
    flat = np.column_stack([middle, np.zeros(len(middle))])
    under = np.array([middle[-1], [a[0], -b[-1]], middle[0]])
    flat = np.concatenate([flat, np.column_stack([under, np.full(3, -depth)]), flat[:1]])
    sides = []
    for side in (1, -1):
        edge = flat.copy()
        edge[:, :2] += side * width / 2 * _mitres(flat[:, :2])
        edge[-1] = edge[0]
        edge = _dense(edge, flat, spacing)
        rho, angle = radius + edge[:, 2], edge[:, 0] / radius
        sides.append(np.stack([rho * np.cos(angle), rho * np.sin(angle), edge[:, 1]], axis=-1))
    return sides[0], sides[1]


def _mitres(path: Floats) -> Floats:
    """Of every point (k, 2) of a flat path the way to its left edge over half a width."""
    steps = np.diff(path, axis=0)
    length = np.linalg.norm(steps, axis=1, keepdims=True)
    normal = np.column_stack([-steps[:, 1], steps[:, 0]]) / np.where(length > 0, length, 1.0)
    still = length[:, 0] == 0
    before, after = np.vstack([normal[:1], normal]), np.vstack([normal, normal[-1:]])
    # The vertical strips: the same cross-line above and below.
    before[1:][still], after[:-1][still] = after[1:][still], before[:-1][still]
    return (before + after) / (1 + np.einsum("ki,ki->k", before, after))[:, None]


def _dense(edge: Floats, guide: Floats, spacing: float) -> Floats:
    """Points along the polygon `edge` (k, 3), as many on each side as the side of `guide` (k, 3) needs."""
    counts = np.maximum(1, np.ceil(np.linalg.norm(np.diff(guide, axis=0), axis=1) / spacing)).astype(int)
    at = np.concatenate([n + np.arange(count) / count for n, count in enumerate(counts)] + [[len(counts)]])
    return np.stack([np.interp(at, np.arange(edge.shape[0]), edge[:, i]) for i in range(3)], axis=-1)
