"""How a foil coil's current comes back: down a via, along a strip below the turns, and up to where they begin."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from magfem.geometry.bounded_path import bounded_paths
from magfem.geometry.card import Table
from magfem.geometry.device import length_text
from magfem.geometry.foil_ribbon import Curved, Frame, Piece, Straight
from magfem.geometry.limits import InvalidValue, check_length, check_number
from magfem.geometry.polyline_track import arc
from magfem.typing import Floats
from magfem.units import format_quantity

BELOW = 50e-6  # m, from the turns' metal to the strip's middle where none is stated: a common foil
_RADII = (1.5, 1.25, 1.0, 0.75, 0.625)  # widths, of the strip's bends
_WORTH = 4.0  # of length, that a gentler bend may cost for each width of radius
_FORWARD = (0.0, 1.0, 2.0, 4.0)  # widths, from a via to the first bend
_TAPER = 1.5  # widths, over which the strip gets its own
_OFF = 0.1  # widths, between parts of the strip
_SLIVER = 0.05  # widths, the shortest piece


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

    def strips(self, subject: str, end: Frame, start: Frame, depth: float) -> tuple[Piece, ...]:
        """Via, return strip and via, from the `end` of the turns to their `start`. Raises InvalidValue."""
        down = np.array([0.0, 0.0, -depth])
        width = end.width if self.width is None else self.width
        return (
            Straight(end.place, end.place + down, end.across, (end.width, end.width), lead=True),
            *_return_strip(subject, end, start, width, -depth),
            Straight(start.place + down, start.place, start.across, (start.width, start.width), lead=True),
        )


def _return_strip(subject: str, end: Frame, start: Frame, width: float, level: float) -> list[Piece]:
    """The shortest way in the plane z = `level` (m) that goes on from `end` and comes to `start` from behind.

    Bends are arcs: the current crowds in corners, and all the more the sharper they are. Next to a via the strip
    widens or narrows to its `width` (m). Raises InvalidValue when it finds no way that keeps off itself.
    """
    widest = max(width, end.width, start.width)
    tapers = [_TAPER * widest if abs(width - frame.width) > 1e-9 * widest else 0.0 for frame in (end, start)]
    found = []
    for radius, forward in product(_RADII, _FORWARD):
        first, last = (taper + forward * widest for taper in tapers)
        departure, arrival = end.place[:2] + first * end.along[:2], start.place[:2] - last * start.along[:2]
        for way in bounded_paths(departure, end.along[:2], arrival, start.along[:2], radius * widest):
            length = first + last + sum(leg.length for leg in way)
            found.append((length - _WORTH * radius * widest, radius * widest, departure, way, arrival))
    for _, radius, departure, way, arrival in sorted(found, key=lambda each: each[0]):
        pieces: list[Piece] = []
        if (departure != end.place[:2]).any():
            pieces.append(_strip(end.place[:2], departure, (end.width, width), level))
        for place, along, turn, length in way:
            across = np.array([-along[1], along[0]])
            if turn:
                pieces.append(arc(place, across, turn, radius, width, level=level, lead=True))
            else:
                pieces.append(_strip(place, place + length * along, (width, width), level))
        if (arrival != start.place[:2]).any():
            pieces.append(_strip(arrival, start.place[:2], (width, start.width), level))
        if _has_room(pieces, widest):
            return pieces
    raise InvalidValue(
        f"{subject}: a return strip {format_quantity(width, 'length')} wide finds no way from the end of the turns to "
        "their beginning",
        "leads.width",
    )


def _strip(first: Floats, last: Floats, widths: tuple[float, float], level: float) -> Straight:
    """A straight piece between two places (2,) m of the plan."""
    along = (last - first) / np.linalg.norm(last - first)
    return Straight(
        np.append(first, level), np.append(last, level), np.array([-along[1], along[0], 0.0]), widths, lead=True
    )


def _has_room(pieces: list[Piece], width: float) -> bool:
    """Whether a strip of `width` (m) nowhere touches itself or its vias, and no piece is a mere sliver.

    Where it did, it would cover less than its length times its width.
    """
    from shapely import LineString

    if min(piece.length for piece in pieces) < _SLIVER * width:
        return False
    begin, end = pieces[0].ends[0], pieces[-1].ends[1]
    behind, beyond = begin.place - _OFF * width * begin.along, end.place + _OFF * width * end.along
    line = LineString(np.concatenate([[behind], *(_places(piece) for piece in pieces), [beyond]])[:, :2])
    room = (1 + _OFF) * width
    return bool(line.buffer(0.5 * room, cap_style="flat").area > room * (line.length - _SLIVER * width))


def _places(piece: Piece) -> Floats:
    """Along the centreline, (n, 3) m."""
    if not isinstance(piece, Curved):
        return np.stack([frame.place for frame in piece.ends])
    plan = piece.path(np.linspace(*piece.span, 65))[0]
    return np.pad(plan, ((0, 0), (0, 1)), constant_values=piece.level)


def _is_real(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
