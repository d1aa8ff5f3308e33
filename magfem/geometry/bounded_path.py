"""Shortest ways in a plane, from one direction into another, that bend no tighter than a given radius."""

from __future__ import annotations

from itertools import product
from math import asin, atan2, cos, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from magfem.typing import Floats

_NOTHING = 1e-9  # rad or radii, what is left out


class Leg(NamedTuple):
    """A straight line or an arc: place (2,) m and direction (2,) where it begins, turn (rad; leftwards when positive,
    zero when straight), length (m)."""

    place: Floats
    along: Floats
    turn: float
    length: float


def bounded_paths(start: Floats, along: Floats, end: Floats, arriving: Floats, radius: float) -> list[tuple[Leg, ...]]:
    """Ways from `start` (2,) m to `end`, shortest first, of arcs of `radius` (m) and straight lines between them.

    They set out along the unit vector `along` (2,) and come in along `arriving`.

    Source: L. E. Dubins, Am. J. Math. 79 (1957) 497: the shortest of all is arc, line, arc when the ends are four radii
    apart. Three arcs, which may be shorter when they are nearer, are left out.
    """
    ways = []
    for first, second in product((1, -1), repeat=2):
        way = _way(start, along, end, arriving, radius, (first, second))
        if way is not None:
            ways.append(way)
    return sorted(ways, key=lambda way: sum(leg.length for leg in way))


def _way(
    start: Floats, along: Floats, end: Floats, arriving: Floats, radius: float, sides: tuple[int, int]
) -> tuple[Leg, ...] | None:
    """Arc, line and arc; sides: to which the arcs turn, 1 left, −1 right. None where the circles are too near."""
    first, second = sides
    centres = [
        place + side * radius * _left(way) for place, way, side in ((start, along, first), (end, arriving, second))
    ]
    x, y = (float(value) for value in centres[1] - centres[0])
    distance = hypot(x, y)
    heading = atan2(y, x)
    if first != second:  # the line passes between the circles
        if distance < 2 * radius:
            return None
        heading += first * asin(2 * radius / distance)
    straight = sqrt(max(distance**2 - (radius * (first - second)) ** 2, 0.0))
    if straight < _NOTHING * radius and first == second:
        heading = atan2(along[1], along[0])
    turns = [
        _turn(atan2(along[1], along[0]), heading, first),
        _turn(heading, atan2(arriving[1], arriving[0]), second),
    ]
    line = np.array([cos(heading), sin(heading)])
    tangent = centres[0] - first * radius * _left(line)
    legs = [
        Leg(start, along, turns[0], radius * abs(turns[0])),
        Leg(tangent, line, 0.0, straight),
        Leg(tangent + straight * line, line, turns[1], radius * abs(turns[1])),
    ]
    return tuple(leg for leg in legs if leg.length > _NOTHING * radius)


def _turn(before: float, after: float, side: int) -> float:
    """By how much to turn to a side, 1 left or −1 right, from one direction to another, rad."""
    turn = side * (after - before) % (2 * pi)
    return 0.0 if turn > 2 * pi - _NOTHING else side * turn


def _left(vector: Floats) -> Floats:
    return np.array([-vector[1], vector[0]])
