"""Planar spiral coils: round, or along another outline."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from magfem.errors import InputError
from magfem.fields.hull import BoxHull, CylinderHull, Hull
from magfem.geometry.card import Table
from magfem.geometry.circuit import FoilTrack
from magfem.geometry.foil_coil import MOST_TURNS, FoilCoil, Winding
from magfem.geometry.limits import InvalidValue, check_number
from magfem.geometry.outline import Circle, Outline, Request, is_outline, outline_from_card, outline_table
from magfem.units import describe


@dataclass(frozen=True, kw_only=True)
class PlanarSpiralCoil(FoilCoil):
    """A track that winds inwards about z along an outline, a circle unless stated.

    outer_diameter, inner_diameter: of the turns' outer and inner edge. Together with turns, trace_width and gap they
    say more than is needed: the track fills the space between them evenly. How far it may be from `gap` then, and
    what other outlines take, is for `outline` to say.
    """

    kind = "planar_spiral_coil"
    dimensions: ClassVar[tuple[str, ...]] = ("trace_width", "gap", "thickness")
    optional: ClassVar[tuple[str, ...]] = ("outer_diameter", "inner_diameter")
    extras: ClassVar[tuple[str, ...]] = ("outline",)
    directed: ClassVar[bool] = True

    trace_width: float  # m
    gap: float  # m, between neighbouring turns, as stated; what it comes to: `smallest_gap`
    turns: float  # a circle's and a flower's may be fractional
    outer_diameter: float | None = None  # m; circle and flower
    inner_diameter: float | None = None  # m; circle and flower
    outline: Outline = field(default_factory=Circle)

    def check_count(self, key: str, value: object) -> None:
        check_number(self.words, key, value)
        if not 1 <= self.turns <= MOST_TURNS:
            raise InvalidValue(f"{self.words}: turns must lie between 1 and {MOST_TURNS}, got {describe(value)}", key)

    def check_shape(self) -> None:
        if not is_outline(self.outline):
            raise InputError(f"{self.words}: outline must be an Outline, got {describe(self.outline)}")
        self.outline.check(self._request)

    @property
    def track_width(self) -> float:
        return self.trace_width

    @cached_property
    def winding(self) -> Winding:
        return self.outline.winding(self._request)

    @property
    def smallest_gap(self) -> float:
        """Between neighbouring turns, m."""
        return self.outline.smallest_gap(self._request)

    @property
    def flat_hull(self) -> Hull:
        """A cylinder about a circle or a flower, else a box; without leads."""
        if self.outer_diameter is not None:
            return CylinderHull(self.outer_diameter, self.height)
        return BoxHull((*self.winding.size, self.height))

    @property
    def track(self) -> FoilTrack:
        """Of the lowest layer."""
        return self.tracks()[0]

    @property
    def _request(self) -> Request:
        return Request(
            self.words,
            self.turns,
            self.trace_width,
            self.gap,
            self.outer_diameter,
            self.inner_diameter,
            self.leads.direction,
        )

    @classmethod
    def extras_from_card(cls, card: Table) -> dict[str, Any]:
        return {"outline": outline_from_card(card)}

    def tables(self) -> dict[str, Any]:
        table = outline_table(self.outline)
        return super().tables() | ({"outline": table} if table else {})
