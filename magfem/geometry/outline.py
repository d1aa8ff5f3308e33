"""The outlines along which planar spirals wind, and how each kind of them fills with turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from typing import Any, NamedTuple, Protocol

import numpy as np

from magfem.errors import InputError
from magfem.geometry.card import Table
from magfem.geometry.clearances import crosses_itself, signed_area, smallest_gap
from magfem.geometry.device import length_text
from magfem.geometry.foil_coil import Winding
from magfem.geometry.foil_ribbon import Ribbon
from magfem.geometry.limits import LONGEST, ROUNDING, InvalidValue, check_length, check_number
from magfem.geometry.polar_spiral import PolarSpiral, flower, narrowing
from magfem.geometry.polyline_track import (
    CrampedTrack,
    corner_radii,
    polyline_track,
    spiral_points,
    with_room_for_a_via,
)
from magfem.typing import Floats
from magfem.units import describe, format_quantity, quantity, quoted

LEAST_GAP = 0.8  # of the stated gap, that a winding which fills its window may come down to
_TIGHTEST = 0.6  # widths, the least radius of a bend of the centreline
_FINE = 2.0  # the resolution at which gaps between curved tracks are measured
_SHARPEST = 120.0  # degrees, the most that an outline may turn at a corner
_IN_LINE = 1e-6  # rad, the least
_AS_STATED = 0.95  # of the stated gap, as measured between facets
_MOST_POINTS = 1000
_ROOM = 1.01  # of a flower's pitch over that which its slope asks for


class Request(NamedTuple):
    """What a coil asks of its outline; lengths in m, None when not stated."""

    subject: str
    turns: float
    width: float
    gap: float
    outer_diameter: float | None
    inner_diameter: float | None
    direction: float  # rad

    @property
    def pitch(self) -> float:
        """As stated, m."""
        return self.width + self.gap

    def missing(self, key: str) -> InvalidValue:
        """The error about a diameter that must be stated."""
        return InvalidValue(f'{self.subject}: missing key "{key}"', f"dimensions.{key}")

    def unwanted(self, outline: str) -> None:
        """Raise InvalidValue for a diameter that an outline with a size of its own does not take."""
        for key in ("outer_diameter", "inner_diameter"):
            if getattr(self, key) is not None:
                raise InvalidValue(
                    f"{self.subject}: {key} goes with round outlines; that of kind {outline} has a size of its own",
                    f"dimensions.{key}",
                )


class Outline(Protocol):
    """The outer edge of a winding."""

    def check(self, request: Request) -> None:
        """Raise InvalidValue when there is no such outline, or the turns do not fit it."""
        ...

    def winding(self, request: Request) -> Winding:
        """The track along it."""
        ...

    def smallest_gap(self, request: Request) -> float:
        """Between neighbouring turns, m."""
        ...


@dataclass(frozen=True)
class Circle:
    """Archimedes' spiral between the inner and the outer diameter, which it fills evenly.

    The gap that this leaves must be at least 0.8 of the stated one, and the radial space within a pitch of
    turns × pitch.
    """

    def check(self, request: Request) -> None:
        for key in ("outer_diameter", "inner_diameter"):
            if getattr(request, key) is None:
                raise request.missing(key)
        check_window(request, self.smallest_gap(request))

    def winding(self, request: Request) -> Winding:
        spiral = self.spiral(request)
        size = request.outer_diameter or 0.0
        return Winding((spiral.track(request.width),), spiral.length, (size, size))

    def smallest_gap(self, request: Request) -> float:
        return self.spiral(request).pitch - request.width

    def spiral(self, request: Request) -> PolarSpiral:
        """The centreline."""
        outer, inner = request.outer_diameter or 0.0, request.inner_diameter or 0.0
        pitch = (0.5 * (outer - inner) - request.width) / request.turns
        return PolarSpiral(0.5 * (outer - request.width), pitch, request.turns, request.direction)


def check_window(request: Request, gap: float) -> None:
    """Raise InvalidValue unless turns fill the space between both diameters with about the stated gap; `gap` (m) is
    what they come to."""
    outer, inner = request.outer_diameter or 0.0, request.inner_diameter or 0.0
    if inner >= outer:
        raise InvalidValue(
            f"{request.subject}: inner_diameter must be smaller than outer_diameter "
            f"({format_quantity(outer, 'length')}), got {format_quantity(inner, 'length')}",
            "dimensions.inner_diameter",
        )
    window, wanted = 0.5 * (outer - inner), request.turns * request.pitch
    if abs(window - wanted) <= request.pitch * (1 + 1e-9) and gap >= LEAST_GAP * request.gap:
        return
    fitting = outer - 2 * (wanted + request.width)
    fits = (
        f"inner_diameter {format_quantity(fitting, 'length')} would fit"
        if fitting > 2 * request.width
        else f"at most {max(0, int((0.5 * outer - 2 * request.width) / request.pitch))} turns fit at all"
    )
    needed, space = (format_quantity(value, "length") for value in (wanted + request.width, window))
    raise InvalidValue(
        f"{request.subject}: the winding does not fit its window: {request.turns:g} turns of trace and gap take "
        f"{needed}, between inner and outer radius are {space}; {fits}",
        "dimensions.turns",
    )


@dataclass(frozen=True)
class Flower:
    """Petals around the origin, ρ = tip − depth (1 − cos(petals·φ))/2, shrinking towards it from turn to turn.

    `outer_diameter` is that of the circle through the tips. Without an `inner_diameter`, the same of the innermost
    turn's inner edge, the turns are as tight as the gap permits where the outline is steepest.
    """

    petals: int
    depth: float  # m, from the tips' circle to the valleys

    def check(self, request: Request) -> None:
        if request.outer_diameter is None:
            raise request.missing("outer_diameter")
        subject = request.subject
        check_number(subject, "outline.petals", self.petals)
        if self.petals != int(self.petals) or not 2 <= self.petals <= 100:
            raise InvalidValue(
                f"{subject}: petals must be a whole number from 2 to 100, got {describe(self.petals)}",
                "outline.petals",
            )
        check_length(subject, "outline.depth", self.depth)
        deepest = 0.4 * request.outer_diameter
        if self.depth > deepest:
            raise InvalidValue(
                f"{subject}: depth must be at most {format_quantity(deepest, 'length')}, 0.4 of the outer diameter, "
                f"got {format_quantity(self.depth, 'length')}",
                "outline.depth",
            )
        if request.inner_diameter is not None and request.inner_diameter >= request.outer_diameter:
            raise InvalidValue(
                f"{subject}: inner_diameter must be smaller than outer_diameter "
                f"({format_quantity(request.outer_diameter, 'length')}), "
                f"got {format_quantity(request.inner_diameter, 'length')}",
                "dimensions.inner_diameter",
            )
        gap = self.smallest_gap(request)
        if gap < LEAST_GAP * request.gap:
            most = most_turns(request, lambda fewer: self.smallest_gap(fewer) >= LEAST_GAP * request.gap)
            raise InvalidValue(
                f"{subject}: the winding does not fit its outline: "
                + (f"turns come as near as {format_quantity(gap, 'length')}" if gap else "its bends get too sharp")
                + (f"; at most {most} turns fit" if most else "; not even one turn fits"),
                "dimensions.turns",
            )

    def winding(self, request: Request) -> Winding:
        spiral = self.spiral(request)
        size = request.outer_diameter or 0.0
        return Winding((spiral.track(request.width),), spiral.length, (size, size))

    def smallest_gap(self, request: Request) -> float:
        """Measured on the track, m; zero when it turns too sharply, or comes too near to the middle."""
        spiral = self.spiral(request)
        valley = spiral.inner * (1 - self._share(request))
        if spiral.pitch <= 0 or valley < request.width or spiral.tightest() < _TIGHTEST * request.width:
            return 0.0
        track = spiral.track(request.width)
        return smallest_gap(Ribbon((track,)).open(_FINE), request.pitch)

    def spiral(self, request: Request) -> PolarSpiral:
        """The centreline."""
        outer, inner = request.outer_diameter or 0.0, request.inner_diameter
        share = self._share(request)
        if inner is None:  # the steepest places are nearer by a little more than their slope says
            pitch = _ROOM * request.pitch / narrowing(int(self.petals), share)
        else:
            pitch = (0.5 * (outer - inner) - request.width) / request.turns
        return PolarSpiral(
            outer=0.5 * (outer - request.width),
            pitch=pitch,
            turns=request.turns,
            direction=request.direction,
            shape=flower(int(self.petals), share),
            bends=int(self.petals),
        )

    def _share(self, request: Request) -> float:
        """The depth over the distance of the tips' centreline."""
        return self.depth / (0.5 * ((request.outer_diameter or 0.0) - request.width))


@dataclass(frozen=True)
class Rectangle:
    """A rectangle along x and y about the origin; turns are parallels of it, a gap apart."""

    size: tuple[float, float]  # m, along x and y
    corner_radius: float = 0.0  # m, of the outer edge; zero for mitred corners

    def check(self, request: Request) -> None:
        for value in self.size:
            check_length(request.subject, "outline.size", value)
        self._polygon.check(request)

    def winding(self, request: Request) -> Winding:
        return self._polygon.winding(request)

    def smallest_gap(self, request: Request) -> float:
        return self._polygon.smallest_gap(request)

    @property
    def _polygon(self) -> Polygon:
        x, y = (0.5 * value for value in self.size)
        return Polygon(((-x, -y), (x, -y), (x, y), (-x, y)), self.corner_radius, "rectangle")


@dataclass(frozen=True)
class Polygon:
    """Straight sides between points; turns are parallels of it, a gap apart.

    The middle of the rectangle along x and y that holds the points becomes the origin. The track begins at the first
    point and goes right-handed about +z whatever the order of the points. Corners are mitred, or arcs about the same
    centres; the track's two ends are then drawn back to where an arc of the first corner would begin or end.
    """

    points: tuple[tuple[float, float], ...]  # m, of the outer edge; the last joins the first
    corner_radius: float = 0.0  # m, of the outer edge; zero for mitred corners
    kind: str = "points"  # as cards name it

    def check(self, request: Request) -> None:
        subject, key = request.subject, f"outline.{'size' if self.kind == 'rectangle' else 'points'}"
        request.unwanted(self.kind)
        if request.direction:
            raise InvalidValue(
                f"{subject}: direction of the leads goes with round outlines; along others the track begins at the "
                "first corner",
                "leads.direction",
            )
        if request.turns != int(request.turns):
            raise InvalidValue(
                f"{subject}: turns along a polygon must be a whole number, got {describe(request.turns)}",
                "dimensions.turns",
            )
        check_number(subject, "outline.corner_radius", self.corner_radius)
        if self.corner_radius:
            check_length(subject, "outline.corner_radius", self.corner_radius)
        self._check_points(subject, key)
        if self._fits(request):
            return
        if not self._fits(request._replace(turns=1)):
            raise InvalidValue(f"{subject}: not a single turn of this width and corner radius fits the outline", key)
        raise InvalidValue(
            f"{subject}: the winding does not fit its outline: {request.turns:g} turns of trace and gap take "
            f"{format_quantity(request.turns * request.pitch, 'length')} from its edge inwards; at most "
            f"{most_turns(request, self._fits)} turns fit",
            "dimensions.turns",
        )

    def winding(self, request: Request) -> Winding:
        corners = self._corners
        points = spiral_points(corners, np.full(len(corners), request.pitch), request.width, int(request.turns))
        radii = corner_radii(points, len(corners), request.pitch, request.width, self.corner_radius)
        if self.corner_radius:
            points = _shortened(points, radii)
        points = with_room_for_a_via(points, request.pitch, request.width, int(request.turns))
        pieces, length = polyline_track(points, request.width, radii)
        x, y = np.ptp(corners, axis=0)
        return Winding(pieces, length, (float(x), float(y)))

    def smallest_gap(self, request: Request) -> float:
        """Measured on the track, m."""
        stations = Ribbon(self.winding(request).pieces).open(_FINE if self.corner_radius else 0.5)
        return smallest_gap(stations, request.pitch)

    def _check_points(self, subject: str, key: str) -> None:
        """Raise InvalidValue unless the points are those of a simple polygon without spikes."""
        for value in np.ravel(self.points):
            check_number(subject, key, float(value))
        if len(self.points) > _MOST_POINTS:
            raise InvalidValue(f"{subject}: an outline has at most {_MOST_POINTS} points", key)
        corners = self._corners
        if len(corners) < 3:
            raise InvalidValue(f"{subject}: an outline needs three points that are not in line", key)
        if np.abs(corners).max() > LONGEST:
            raise InvalidValue(f"{subject}: an outline must lie within {format_quantity(LONGEST, 'length')}", key)
        if crosses_itself(self._distinct):
            raise InvalidValue(f"{subject}: the outline crosses or touches itself", key)
        legs = np.roll(corners, -1, axis=0) - corners
        angles = np.arctan2(legs[:, 1], legs[:, 0])
        turns = np.abs((np.roll(angles, -1) - angles + np.pi) % (2 * np.pi) - np.pi)
        sharpest = int(np.argmax(turns))
        if turns[sharpest] > np.radians(_SHARPEST) + _IN_LINE:
            x, y = (format_quantity(value, "length") for value in np.roll(corners, -1, axis=0)[sharpest])
            raise InvalidValue(
                f"{subject}: the outline's corners must be at least {180 - _SHARPEST:g} deg wide, that at "
                f"({x}, {y}) from the outline's middle has {180 - np.degrees(turns[sharpest]):.3g} deg",
                key,
            )

    def _fits(self, request: Request) -> bool:
        try:
            return self.smallest_gap(request) >= _AS_STATED * request.gap
        except (CrampedTrack, InputError):
            return False

    @property
    def _distinct(self) -> Floats:
        """The points (n, 2) m about the origin, right-handed; those that repeat the one before left out."""
        points = np.array(self.points, dtype=float).reshape(-1, 2)
        points = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
        steps = np.abs(np.roll(points, -1, axis=0) - points).max(axis=1)
        if (steps > 0).any():
            points = points[steps > ROUNDING * np.abs(points).max()]
        if signed_area(points) < 0:
            points = np.roll(points[::-1], 1, axis=0)
        return points

    @property
    def _corners(self) -> Floats:
        """Those of the distinct points that are not in line with their neighbours, (n, 2) m."""
        points = self._distinct
        before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
        bend = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
        kept: Floats = points[bend > _IN_LINE * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)]
        return kept


def _shortened(points: Floats, radii: Floats) -> Floats:
    """A spiral's corners (n, 2) m, its ends drawn back to where an arc of the first corner would join them."""
    legs = np.diff(points[[0, 1, -2, -1]], axis=0)[::2]
    first, last = legs / np.linalg.norm(legs, axis=1)[:, None]
    half = np.sqrt((1 - first @ last) / (1 + first @ last))  # tangent of half the corner's turn
    ends = np.stack([points[0] + radii[0] * half * first, points[-1] - radii[-1] * half * last])
    return np.concatenate([ends[:1], points[1:-1], ends[1:]])


def most_turns(request: Request, fit: Callable[[Request], bool]) -> int:
    """The largest whole number of turns, below those requested, that fits."""
    fewest, most = 0, ceil(request.turns)
    while most - fewest > 1:
        middle = (fewest + most) // 2
        fewest, most = (middle, most) if fit(request._replace(turns=middle)) else (fewest, middle)
    return fewest


def is_outline(value: object) -> bool:
    """Whether a value is one of the outlines."""
    return isinstance(value, Circle | Flower | Rectangle | Polygon)


def outline_from_card(card: Table) -> Outline:
    """The outline that a card's [outline] describes; a circle without one. Raises CardError."""
    if "outline" not in card:
        return Circle()
    table = card.table("outline")
    kind = table.text("kind")
    if kind not in _READERS:
        raise table.error(f"unknown outline {quoted(kind)}; known: {', '.join(_READERS)}", "kind")
    return _READERS[kind](table)


def outline_table(outline: Outline) -> dict[str, Any]:
    """The [outline] table that reads back to this; empty for a circle."""
    if isinstance(outline, Flower):
        return {"kind": "flower", "petals": outline.petals, "depth": length_text(outline.depth)}
    if isinstance(outline, Rectangle | Polygon):
        table: dict[str, Any] = {"kind": "rectangle" if isinstance(outline, Rectangle) else "points"}
        if isinstance(outline, Rectangle):
            table["size"] = [length_text(value) for value in outline.size]
        else:
            table["points"] = [[length_text(value) for value in point] for point in outline.points]
        return table | ({"corner_radius": length_text(outline.corner_radius)} if outline.corner_radius else {})
    return {}


def _read_circle(table: Table) -> Circle:
    table.only("kind")
    return Circle()


def _read_flower(table: Table) -> Flower:
    table.only("kind", "petals", "depth")
    petals: Any = table.number("petals")
    return Flower(int(petals) if petals == petals // 1 else petals, table.quantity("depth", "length"))


def _read_rectangle(table: Table) -> Rectangle:
    table.only("kind", "size", "corner_radius")
    return Rectangle(_two_lengths(table, "size", table.value("size")), _corner_radius(table))


def _read_polygon(table: Table) -> Polygon:
    table.only("kind", "points", "corner_radius")
    points = table.value("points")
    if not isinstance(points, list) or len(points) < 3:
        raise table.error('points must be three or more of ["4 mm", "-2 mm"]', "points")
    if len(points) > _MOST_POINTS + 1:  # before the units of all are read; one for a closed outline
        raise table.error(f"an outline has at most {_MOST_POINTS} points, got {len(points)}", "points")
    places = tuple(_two_lengths(table, "points", point) for point in points)
    return Polygon(places[:-1] if places[0] == places[-1] else places, _corner_radius(table))


def _two_lengths(table: Table, key: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise table.error(f'{key}: expected two lengths such as ["10 mm", "6 mm"], got {describe(value)}', key)
    try:
        x, y = (quantity(one, "length") for one in value)
    except InputError as error:
        raise table.error(f"{key}: {error}", key) from None
    return x, y


def _corner_radius(table: Table) -> float:
    return table.quantity("corner_radius", "length") if "corner_radius" in table else 0.0


_READERS: dict[str, Callable[[Table], Outline]] = {
    "circle": _read_circle,
    "flower": _read_flower,
    "rectangle": _read_rectangle,
    "points": _read_polygon,
}
