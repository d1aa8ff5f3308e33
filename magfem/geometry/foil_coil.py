"""What coils etched from foil share: a track of one width, leads, layers in series, and rolling on a cylinder."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, pi
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from magfem.errors import InputError
from magfem.fields.hull import BoxHull, CylinderHull, Hull
from magfem.geometry.card import Table
from magfem.geometry.circuit import Circuit, FoilTrack, Stations
from magfem.geometry.conductor import Conductor
from magfem.geometry.device import Device, header_from_card, length_text, two_digits
from magfem.geometry.foil_ribbon import Curved, Piece, Placed, Ribbon
from magfem.geometry.leads import Leads
from magfem.geometry.limits import InvalidValue, check_length, check_number, check_thickness
from magfem.geometry.rolled import WIDEST, RolledRibbon
from magfem.units import describe, format_quantity

MOST_TURNS = 1000
MOST_LAYERS = 100


class Winding(NamedTuple):
    """A track in the plan, from its beginning to its end.

    length: of the centreline, m, closed form.  size: of the rectangle that holds the turns, x and y, m.
    """

    pieces: tuple[Piece, ...]
    length: float
    size: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class FoilCoil(Device):
    """A coil etched from foil, in air: its middle plane z = 0, its normal +z, its middle at the origin.

    Positive current turns right-handed about +z. A kind adds its dimensions and gives `track_width` and `winding`.

    Layers are equal, stacked evenly about z = 0 and in series; each has vias and a return strip of its own, so that
    each is a closed path and all their fields add.

    Rolled, the plan's x goes around the z axis and its y along it: the plan's middle comes to lie on +x, its normal
    points outwards, and the middle of the foil keeps its lengths. `rolled_radius` is that of the middle.
    Leads keep their depth, towards the axis.

    Raises InputError when a value is of the wrong type, not finite or impossible.
    """

    optional: ClassVar[tuple[str, ...]] = ()  # lengths that may be None
    counts: ClassVar[tuple[str, ...]] = ("turns",)  # bare numbers of a card's [dimensions]
    extras: ClassVar[tuple[str, ...]] = ()  # further tables of the card, read by `extras_from_card`
    directed: ClassVar[bool] = False  # whether the leads' direction can be chosen

    thickness: float  # m, of the metal
    leads: Leads = field(default_factory=Leads)
    conductor: Conductor = field(default_factory=Conductor)
    layers: int = 1
    spacing: float | None = None  # m, between the middles of neighbouring layers; None: a single one
    rolled_radius: float | None = None  # m; None: flat

    def __post_init__(self) -> None:
        for key, kind in (("leads", Leads), ("conductor", Conductor)):
            if not isinstance(getattr(self, key), kind):
                raise InputError(f"{self.words}: {key} must be a {kind.__name__}, got {describe(getattr(self, key))}")
        self.check_header()
        stated = [key for key in (*self.dimensions, *self.optional) if getattr(self, key) is not None]
        for key in stated:
            check_length(self.words, f"dimensions.{key}", getattr(self, key))
        for key in self.counts:
            self.check_count(f"dimensions.{key}", getattr(self, key))
        self.leads.check(self.words, self.thickness)
        if self.leads.direction and not self.directed:
            raise InvalidValue(f"{self.words}: direction of the leads follows from the winding", "leads.direction")
        self.check_shape()
        largest = max(self.winding.size)
        check_thickness(self.words, "dimensions", "the track's width", 10 * self.track_width, largest)
        if self.leads.depth is not None and abs(self.leads.depth) > largest:
            raise InvalidValue(
                f"{self.words}: depth must be at most the winding's largest dimension "
                f"({format_quantity(largest, 'length')}), got {format_quantity(self.leads.depth, 'length')}",
                "leads.depth",
            )
        self._check_layers()
        self._check_rolling()
        Ribbon(self._closed, self._bend)(0.25)  # a track that cannot be laid out is refused here
        self.check_region(largest)

    def check_count(self, key: str, value: object) -> None:
        """Raise InvalidValue unless `value` is a whole number that a coil can have."""
        check_number(self.words, key, value)
        if value != int(value) or not 1 <= value <= MOST_TURNS:  # type: ignore[call-overload,operator]
            name = key.rpartition(".")[2]
            raise InvalidValue(
                f"{self.words}: {name} must be a whole number from 1 to {MOST_TURNS}, got {describe(value)}", key
            )

    @abstractmethod
    def check_shape(self) -> None:
        """Raise InvalidValue for dimensions that do not go together."""

    @property
    @abstractmethod
    def track_width(self) -> float:
        """m"""

    @property
    @abstractmethod
    def winding(self) -> Winding:
        """One layer's track, flat, in the plane z = 0."""

    @classmethod
    def from_card(cls, card: Table) -> Self:
        """Make the coil that a whole card describes. Raises CardError."""
        values = header_from_card(card, *cls.tables_of_card())
        with card.locating():
            return cls(**values, **cls.values_from_card(card))

    @classmethod
    def tables_of_card(cls) -> tuple[str, ...]:
        """The tables that a card of this kind may have, but [region]."""
        return ("dimensions", "leads", "layers", "rolled", "conductor", *cls.extras)

    @classmethod
    def values_from_card(cls, card: Table) -> dict[str, Any]:
        """The fields that a card's tables state, but header and region. Raises CardError."""
        dimensions = card.table("dimensions")
        dimensions.only(*cls.dimensions, *cls.optional, *cls.counts)
        values: dict[str, Any] = {key: dimensions.quantity(key, "length") for key in cls.dimensions}
        values |= {key: dimensions.quantity(key, "length") for key in cls.optional if key in dimensions}
        values |= {key: dimensions.number(key) for key in cls.counts}
        values["leads"] = Leads.from_card(card, directed=cls.directed)
        values["conductor"] = Conductor.from_card(card)
        if "layers" in card:
            layers = card.table("layers")
            layers.only("count", "spacing")
            values |= {"layers": layers.number("count"), "spacing": layers.quantity("spacing", "length")}
        if "rolled" in card:
            values["rolled_radius"] = _radius_from_card(card.table("rolled"))
        return values | cls.extras_from_card(card)

    @classmethod
    def extras_from_card(cls, card: Table) -> dict[str, Any]:
        """The fields that the kind's own tables state. Raises CardError."""
        return {}

    def tables(self) -> dict[str, Any]:
        keys = (*self.dimensions, *(key for key in self.optional if getattr(self, key) is not None))
        dimensions: dict[str, Any] = {key: length_text(getattr(self, key)) for key in keys}
        dimensions |= {key: getattr(self, key) for key in self.counts}
        tables: dict[str, Any] = {"dimensions": dimensions, "conductor": self.conductor.table()}
        if self.leads.table():
            tables["leads"] = self.leads.table()
        if self.spacing is not None:
            tables["layers"] = {"count": self.layers, "spacing": length_text(self.spacing)}
        if self.rolled_radius is not None:
            tables["rolled"] = {"radius": length_text(self.rolled_radius)}
        return tables

    @property
    def axisymmetric(self) -> bool:
        """Never: the track winds, and its leads break the symmetry."""
        return False

    @cached_property
    def circuits(self) -> tuple[Circuit, ...]:
        """The one circuit, called `coil`; its parts are the layers, lowest first."""
        return (Circuit("coil", self.tracks()),)

    def tracks(self, angle: float = 0.0) -> tuple[FoilTrack, ...]:
        """The layers' tracks, turned about z by `angle` (rad)."""
        width, length = self.track_width, self.winding.length
        spacing = self.spacing or 0.0
        lead_length = self._lead_length
        curvature = 0.0 if self.rolled_radius is None else 1.0 / self.rolled_radius
        tracks = []
        for layer in range(self.layers):
            height = (layer - 0.5 * (self.layers - 1)) * spacing
            ribbon: Callable[[float], Stations] = Ribbon(self._closed, self._bend)
            if self.rolled_radius is not None:
                ribbon = RolledRibbon(ribbon, self.rolled_radius)
            elif height:
                ribbon = Placed(ribbon, (0.0, 0.0, height))
            if angle:
                ribbon = Placed(ribbon, angle=angle)
            tracks.append(FoilTrack(ribbon, width, self.thickness, length, width * length, lead_length, curvature))
        return tuple(tracks)

    @property
    def volume(self) -> float:
        """Of the metal of all turns and layers, without leads, m³."""
        return self.layers * self.winding.length * self.track_width * self.thickness

    @property
    def height(self) -> float:
        """Of the stack of layers, without leads, m."""
        return self.thickness + (self.layers - 1) * (self.spacing or 0.0)

    @property
    def hull(self) -> Hull:
        """The convex hull of turns without leads: a box, or a full cylinder when rolled."""
        if self.rolled_radius is not None:
            return CylinderHull(2 * self.rolled_radius + self.height, self.winding.size[1])
        return self.flat_hull

    @property
    def flat_hull(self) -> Hull:
        """The hull when not rolled."""
        return BoxHull((*self.winding.size, self.height))

    @property
    def default_region(self) -> tuple[float, float]:
        """Clearance and extent (m): twice the track's width, half the largest dimension, to two digits."""
        near = two_digits(2 * self.track_width)
        return near, max(two_digits(0.5 * max(self.winding.size)), 2 * near)

    @cached_property
    def _closed(self) -> tuple[Piece, ...]:
        """One layer's track and its leads, flat."""
        turns = self.winding.pieces
        return (*turns, *self.leads.strips(self.words, turns[-1].ends[1], turns[0].ends[0], self._depth))

    @property
    def _lead_length(self) -> float:
        """Of vias and return strip, m; around a cylinder the strip's level counts."""
        leads = [piece for piece in self._closed if piece.lead]
        if self.rolled_radius is None:
            return sum(piece.length for piece in leads)
        return sum(_rolled_length(piece, self.rolled_radius) for piece in leads)

    @property
    def _depth(self) -> float:
        """Of the return strip, m."""
        if self.leads.depth is None and self.spacing is not None:
            return min(self.leads.depth_below(self.thickness), 0.5 * self.spacing)
        return self.leads.depth_below(self.thickness)

    @property
    def _bend(self) -> float:
        return inf if self.rolled_radius is None else self.rolled_radius

    def _check_layers(self) -> None:
        check_number(self.words, "layers.count", self.layers)
        if self.layers != int(self.layers) or not 1 <= self.layers <= MOST_LAYERS:
            raise InvalidValue(
                f"{self.words}: count of layers must be a whole number from 1 to {MOST_LAYERS}, "
                f"got {describe(self.layers)}",
                "layers.count",
            )
        object.__setattr__(self, "layers", int(self.layers))
        if self.spacing is None:
            if self.layers > 1:
                raise InvalidValue(f"{self.words}: several layers need their spacing", "layers.spacing")
            return
        check_length(self.words, "layers.spacing", self.spacing)
        needed = abs(self._depth) + self.thickness if self.leads.depth is not None else 2 * self.thickness
        if self.layers > 1 and self.spacing <= needed:
            what = "a return strip" if self.leads.depth is not None else "one return strip"
            raise InvalidValue(
                f"{self.words}: spacing of layers must exceed {format_quantity(needed, 'length')} for {what} to fit "
                f"between them, got {format_quantity(self.spacing, 'length')}",
                "layers.spacing",
            )

    def _check_rolling(self) -> None:
        if self.rolled_radius is None:
            return
        check_length(self.words, "rolled.radius", self.rolled_radius)
        if self.layers > 1:
            raise InvalidValue(f"{self.words}: only a single layer can be rolled", "rolled")
        x, _ = self.winding.size
        around = 2 * pi * self.rolled_radius
        if x >= around:
            raise InvalidValue(
                f"{self.words}: the winding is {format_quantity(x, 'length')} wide and does not fit around a cylinder "
                f"of radius {format_quantity(self.rolled_radius, 'length')} "
                f"({format_quantity(around, 'length')} around); its radius must exceed "
                f"{format_quantity(x / (2 * pi), 'length')}",
                "rolled.radius",
            )
        if self.track_width > WIDEST * self.rolled_radius:
            raise InvalidValue(
                f"{self.words}: radius must be at least {1 / WIDEST:.3g} times the track's width "
                f"({format_quantity(self.track_width, 'length')}), "
                f"got {format_quantity(self.rolled_radius, 'length')}",
                "rolled.radius",
            )
        inside = self._depth + 0.5 * self.thickness
        if self.rolled_radius <= inside:
            raise InvalidValue(
                f"{self.words}: radius must exceed the depth of the return strip "
                f"({format_quantity(inside, 'length')}), got {format_quantity(self.rolled_radius, 'length')}",
                "rolled.radius",
            )


def _rolled_length(piece: Piece, radius: float) -> float:
    """Of a level piece or a via after rolling to `radius` (m), m."""
    first, last = piece.ends
    around = 1 + 0.5 * (first.place[2] + last.place[2]) / radius
    if not isinstance(piece, Curved):
        return float(np.linalg.norm((last.place - first.place) * [around, 1, 1]))
    nodes, weights = np.polynomial.legendre.leggauss(16)
    half = 0.5 * (piece.span[1] - piece.span[0])
    slopes = piece.path(piece.span[0] + half * (1 + nodes))[1] * [around, 1]
    return float(half * np.linalg.norm(slopes, axis=1) @ weights)


def _radius_from_card(rolled: Table) -> float:
    """The [rolled] table's radius or half its diameter, m."""
    rolled.only("radius", "diameter")
    if ("radius" in rolled) == ("diameter" in rolled):
        raise rolled.error("rolled takes either radius or diameter, of the middle of the metal")
    return rolled.quantity("radius", "length") if "radius" in rolled else 0.5 * rolled.quantity("diameter", "length")
