"""Tracks along polylines, their corners mitred or rounded, and spirals of parallels to a polygon."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from magfem.geometry.foil_ribbon import Curved, Piece, Straight
from magfem.typing import Floats

SHORTEST_STRAND = 0.25  # widths, what must be left of a side between its corners
_ROUNDEST = 0.75  # widths, the least radius of a rounded corner's centreline


class CrampedTrack(ValueError):
    """A side of a polyline has no room for its corners; `side` counts from 0."""

    def __init__(self, side: int) -> None:
        self.side = side
        super().__init__(f"side {side} is too short")


def polyline_track(points: Floats, width: float, radii: Floats | None = None) -> tuple[tuple[Piece, ...], float]:
    """Pieces of a track through `points` (n, 2) m, and the closed-form length of its centreline, m.

    radii: (n,) m, of the centreline at the corners; zero for a mitre. Those of both ends count for nothing.
    Raises CrampedTrack.
    """
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    if (short := np.flatnonzero(lengths < 1e-9 * lengths.max())).size:
        raise CrampedTrack(int(short[0]))
    along = legs / lengths[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    turns = np.zeros(len(points))
    turns[1:-1] = np.arctan2((across[:-1] * along[1:]).sum(axis=1), (along[:-1] * along[1:]).sum(axis=1))
    radii = np.zeros(len(points)) if radii is None else np.where(turns == 0, 0.0, radii)
    halves = np.abs(np.tan(0.5 * turns))
    cut = radii * halves  # from a corner to where its arc begins
    taken = np.where(radii > 0, cut, 0.5 * width * halves)
    spare = lengths - taken[:-1] - taken[1:] - np.where((radii[:-1] > 0) | (radii[1:] > 0), 0, SHORTEST_STRAND * width)
    if (spare < -1e-9 * width).any():
        raise CrampedTrack(int(np.argmin(spare)))
    pieces: list[Piece] = []
    length = 0.0
    for i in range(len(legs)):
        start, end = points[i] + cut[i] * along[i], points[i + 1] - cut[i + 1] * along[i]
        rest = lengths[i] - cut[i] - cut[i + 1]
        if rest > 1e-9 * width:
            pieces.append(Straight(_lifted(start), _lifted(end), _lifted(across[i]), (width, width)))
            length += float(rest)
        if i + 1 < len(legs) and radii[i + 1] > 0:
            bend = arc(end, across[i], float(turns[i + 1]), float(radii[i + 1]), width)
            pieces.append(bend)
            length += bend.length
    return tuple(pieces), length


def spiral_points(outline: Floats, pitches: Floats, width: float, turns: int) -> Floats:
    """Corners (n, 2) m of a spiral inwards whose sides are parallels of an outline.

    outline: (m, 2) m, corners of the outer edge, right-handed about +z; side j begins at corner j.  pitches: (m,) m, by
    which each side moves inwards from turn to turn.  width: m, of the track.

    The track begins above the outline's corner 0; the last side of a turn ends on the first of the next.
    Raises CrampedTrack where a side has shrunk to nothing.
    """
    sides = len(outline)
    legs = np.roll(outline, -1, axis=0) - outline
    along = legs / np.linalg.norm(legs, axis=1)[:, None]
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
    number = np.arange(-1, turns * sides + 1)
    turn, side = np.maximum(number // sides, 0), number % sides
    level = (inward[side] * outline[side]).sum(axis=1) + 0.5 * width + turn * pitches[side]
    first, second = inward[side[:-1]], inward[side[1:]]
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    x = level[:-1] * second[:, 1] - level[1:] * first[:, 1]
    y = level[1:] * first[:, 0] - level[:-1] * second[:, 0]
    points: Floats = np.stack([x, y], axis=1) / cross[:, None]
    forward = (np.diff(points, axis=0) * along[side[1:-1]]).sum(axis=1)
    if (forward <= 0).any():
        raise CrampedTrack(int(np.argmax(forward <= 0)))
    return points


def with_room_for_a_via(points: Floats, pitch: float, width: float, turns: int) -> Floats:
    """A spiral's corners (n, 2) m, its last strand cut short when few turns lie between both ends.

    The return strip needs four widths to get from one to the other. At most half of the strand is cut off.
    """
    last = points[-1] - points[-2]
    length = float(np.linalg.norm(last))
    cut = min(max(4 * width - turns * pitch, 0.0), 0.5 * length)
    return np.concatenate([points[:-1], [points[-1] - cut / length * last]])


def corner_radii(points: Floats, sides: int, pitch: float, width: float, radius: float) -> Floats:
    """Radii (n,) m of the centreline at a spiral's corners, for arcs of neighbouring turns to share their centres.

    radius: m, of the outer edge at the outermost corners; zero for mitres.  Where the turns have shrunk so much that
    no arc of this centre is left, a small one stands for it, which leaves a wider gap.
    """
    if radius == 0:
        return np.zeros(len(points))
    turn = np.arange(len(points)) // sides
    legs = np.diff(points, axis=0)
    bends = np.zeros(len(points))
    bends[1:-1] = [a[0] * b[1] - a[1] * b[0] for a, b in pairwise(legs)]
    convex = np.maximum(radius - 0.5 * width - turn * pitch, _ROUNDEST * width)
    concave = max(radius - 0.5 * width, _ROUNDEST * width) + width + turn * pitch
    return np.where(bends >= 0, convex, concave)


def arc(
    start: Floats, across: Floats, turn: float, radius: float, width: float, *, level: float = 0.0, lead: bool = False
) -> Curved:
    """An arc from the plan's place `start` (2,) m that turns by `turn` (rad), leftwards when positive.

    across: (2,), to its left at the start.  level: m, of its plane.
    """
    side = 1.0 if turn > 0 else -1.0
    centre = start + side * radius * across
    begin = float(np.arctan2(*(start - centre)[::-1]))

    def path(angles: Floats) -> tuple[Floats, Floats]:
        c, s = np.cos(begin + side * angles), np.sin(begin + side * angles)
        return centre + radius * np.stack([c, s], axis=1), side * radius * np.stack([-s, c], axis=1)

    return Curved(path, (0.0, abs(turn)), width, radius * abs(turn), 32, lead, level)


def _lifted(plan: Floats) -> Floats:
    """A place or a vector of the plan in space."""
    return np.append(plan, 0.0)
