"""Ribbons as lattices of points, and lattices as biquadratic patches."""

from __future__ import annotations

import numpy as np

from magfem.geometry.circuit import Stations
from magfem.typing import Floats


def lattice(stations: Stations, across: Floats, height: float = 0.0) -> Floats:
    """Points (2n+1, 2m+1, 3) m of a ribbon, `height` (m) above its middle surface.

    across: (2m+1,), −1 on the right edge, 1 on the left one.
    """
    middle = 0.5 * (stations.left + stations.right) + height * stations.normal
    half = 0.5 * (stations.left - stations.right)
    points: Floats = middle[:, None] + across[:, None] * half[:, None]
    return points


def places_across(elements: int, graded: bool) -> Floats:
    """The (2m+1,) places across a ribbon of m elements, −1 to 1; graded ones crowd at the edges."""
    share = np.linspace(-1.0, 1.0, elements + 1)
    ends = np.sin(0.5 * np.pi * share) if graded else share
    places = np.empty(2 * elements + 1)
    places[::2], places[1::2] = ends, 0.5 * (ends[1:] + ends[:-1])
    return places


def patches(lattice: Floats) -> Floats:
    """The biquadratic patches (n·m, 9, …) of a lattice (2n+1, 2m+1, …); node 3i + j stands at u = i/2, v = j/2."""
    n, m = lattice.shape[0] // 2, lattice.shape[1] // 2
    i = 2 * np.arange(n)[:, None, None] + np.arange(3)[None, :, None]
    columns = [lattice[i, 2 * j + np.arange(3)[None, None, :]].reshape(n, 9, *lattice.shape[2:]) for j in range(m)]
    return np.ascontiguousarray(np.stack(columns, axis=1).reshape(n * m, 9, *lattice.shape[2:]))


def shape_of(patches: Floats) -> tuple[float, float]:
    """How well patches (p, 9, 3) are shaped: the least sine of their corners' angles, and the largest aspect ratio.

    Long patches are meant to be long; what harms is a sine near 0.
    """
    corners = patches[:, [0, 6, 8, 2]]
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(sides, axis=-1)
    before = np.roll(sides, 1, axis=1)
    area = np.linalg.norm(np.cross(before, sides), axis=-1)
    sine = area / (length * np.roll(length, 1, axis=1))
    along, across = length[:, 0] + length[:, 2], length[:, 1] + length[:, 3]
    return float(sine.min()), float(np.maximum(along / across, across / along).max())
