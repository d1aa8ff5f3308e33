"""The outlines along which planar spirals wind, and how each kind of them fills with turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from magfem.geometry.card import Table
from magfem.geometry.foil_coil import Winding
from magfem.geometry.limits import InvalidValue
from magfem.geometry.polar_spiral import PolarSpiral
from magfem.units import format_quantity

LEAST_GAP = 0.8  # of the stated gap, that a winding which fills its window may come down to


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


@runtime_checkable
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
    raise InvalidValue(
        f"{request.subject}: the winding does not fit its window: {request.turns:g} turns of trace and gap take "
        f"{format_quantity(wanted, 'length')}, between inner and outer radius are {format_quantity(window, 'length')}; "
        f"{fits}",
        "dimensions.turns",
    )


def is_outline(value: object) -> bool:
    """Whether a value is one of the outlines."""
    return isinstance(value, Outline) and not isinstance(value, type)


def outline_from_card(card: Table) -> Outline:
    """The outline that a card's [outline] describes; a circle without one. Raises CardError."""
    return Circle()


def outline_table(outline: Outline) -> dict[str, Any]:
    """The [outline] table that reads back to this; empty for a circle."""
    return {}
