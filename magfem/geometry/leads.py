"""How a foil coil's current comes back: down a via, along a strip below the turns, and up to where they begin."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product
from math import tan
from typing import Any

import numpy as np

from magfem.geometry.card import Table
from magfem.geometry.device import length_text
from magfem.geometry.foil_ribbon import Frame, Straight
from magfem.geometry.limits import InvalidValue, check_length, check_number
from magfem.typing import Floats
from magfem.units import format_quantity

BELOW = 50e-6  # m, from the turns' metal to the strip's middle where none is stated: a common foil
_STEEPEST = 150.0  # degrees, a corner of the strip


@dataclass(frozen=True)
class Leads:
    """The return strip. What is None follows from the coil."""

    depth: float | None = None  # m, between the middles of turns and strip; negative: above the turns
    width: float | None = None  # m; None: the trace's
    direction: float = 0.0  # rad, from the x axis: where a spiral about the origin begins, and its strip runs

    @classmethod
    def from_card(cls, card: Table, *, directed: bool = False) -> Leads:
        """Read the [leads] table of a card, if there is one. `directed`: whether it may state a direction."""
        if "leads" not in card:
            return cls()
        table = card.table("leads")
        table.only("depth", "width", *(("direction",) if directed else ()))
        values = {key: table.quantity(key, "length") for key in ("depth", "width") if key in table}
        if "direction" in table:
            values["direction"] = table.quantity("direction", "angle")
        return cls(**values)

    def table(self) -> dict[str, Any]:
        """The [leads] table that reads back to this; empty when nothing is stated."""
        table = {key: length_text(getattr(self, key)) for key in ("depth", "width") if getattr(self, key) is not None}
        return table | ({"direction": f"{self.direction!r} rad"} if self.direction else {})

    def check(self, subject: str, thickness: float) -> None:
        """Raise InvalidValue for what no strip can have, or a strip that touches turns of `thickness` (m)."""
        check_number(subject, "leads.direction", self.direction)
        if self.width is not None:
            check_length(subject, "leads.width", self.width)
        if self.depth is None:
            return
        check_length(subject, "leads.depth", abs(self.depth) if _is_real(self.depth) else self.depth)
        if abs(self.depth) <= thickness:
            raise InvalidValue(
                f"{subject}: depth must exceed the foil's thickness ({format_quantity(thickness, 'length')}) for the "
                f"return strip not to touch the turns, got {format_quantity(self.depth, 'length')}",
                "leads.depth",
            )

    def depth_below(self, thickness: float) -> float:
        """The strip's depth (m) under turns of `thickness` (m)."""
        return thickness + BELOW if self.depth is None else self.depth

    def strips(self, subject: str, end: Frame, start: Frame, depth: float) -> tuple[Straight, ...]:
        """Via, return strip and via, from the `end` of the turns to their `start`. Raises InvalidValue."""
        down = np.array([0.0, 0.0, -depth])
        width = end.width if self.width is None else self.width
        points = [np.append(point, -depth) for point in return_route(subject, end, start, max(width, end.width))]
        widths = [end.width, *[width] * (len(points) - 2), start.width]
        strips = [Straight(end.place, end.place + down, end.across, (end.width, end.width), lead=True)]
        for (first, last), pair in zip(pairwise(points), pairwise(widths), strict=True):
            along = (last - first) / np.linalg.norm(last - first)
            strips.append(Straight(first, last, np.array([-along[1], along[0], 0.0]), pair, lead=True))
        strips.append(Straight(start.place + down, start.place, start.across, (start.width, start.width), lead=True))
        return tuple(strips)


def return_route(subject: str, end: Frame, start: Frame, width: float) -> list[Floats]:
    """The shortest polyline (n, 2) m in the plan that goes on from `end` and comes to `start` from behind.

    It has room for a strip of `width` (m) with mitred corners. Raises InvalidValue when there is none.
    """
    routes = []
    for forward, aside in product((1.5, 2.5, 4.0, 6.0), (0.0, 2.0, 4.0, 8.0)):
        for sides in product((-1, 0, 1), repeat=2) if aside else ((0, 0),):
            points = [end.place[:2], end.place[:2] + forward * width * end.along[:2]]
            points += [points[-1] + aside * width * sides[0] * end.across[:2]] if sides[0] else []
            before = start.place[:2] - forward * width * start.along[:2]
            points += [before + aside * width * sides[1] * start.across[:2]] if sides[1] else []
            routes.append([*points, before, start.place[:2]])
    for route in sorted(routes, key=lambda points: sum(np.linalg.norm(b - a) for a, b in pairwise(points))):
        if _has_room(route, width):
            return route
    raise InvalidValue(
        f"{subject}: a return strip {format_quantity(width, 'length')} wide finds no way from the end of the turns to "
        "their beginning",
        "leads.width",
    )


def _has_room(points: list[Floats], width: float) -> bool:
    """Whether mitres fit between the corners and no two parts of the strip touch."""
    from shapely import LineString

    legs = [b - a for a, b in pairwise(points)]
    if any(np.linalg.norm(leg) < 0.5 * width for leg in legs):
        return False
    angles = [np.arctan2(leg[1], leg[0]) for leg in legs]
    turns = np.abs((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi)
    if turns.max(initial=0.0) > np.radians(_STEEPEST):
        return False
    mitres = [0.0, *(0.5 * width * tan(0.5 * turn) for turn in turns), 0.0]
    for leg, (first, last) in zip(legs, pairwise(mitres), strict=True):
        if np.linalg.norm(leg) < first + last + 0.25 * width:
            return False
    lines = [LineString(pair) for pair in pairwise(points)]
    return all(first.distance(second) > 1.02 * width for i, first in enumerate(lines) for second in lines[i + 2 :])


def _is_real(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
