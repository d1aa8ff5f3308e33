"""Ribbons of foil: from straight and curved pieces of track, joined by corners and folds, to stations.

A track etched from foil has one width and runs in a plane; where it goes to another level, through a via, it is folded
as a strip of paper would be. Unfolded it is a plane strip again, so that its current knows corners but no folds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, pi
from typing import NamedTuple, Protocol

import numpy as np

from magfem.errors import InputError, MeshError
from magfem.geometry.circuit import FoilTrack, Stations
from magfem.typing import Booleans, Floats

TURNING = pi / 24
"""Most turning of a curved element at resolution 1: a parabola through its three stations leaves an arc by (half the
angle)⁴/32 of the radius, 6e-7."""
LONGEST = 12.0  # widths, an element at resolution 1
FINEST = 0.05  # widths, the element next to a corner at resolution 1; the next ones double
_UPRIGHT = 1.25  # widths from a corner, over which stations turn from the mitre to square
_BESIDE = 0.1  # radii of a bend, the element of a straight piece next to it; the next ones double
_EVENLY = 1.4  # the same of a curved piece, whose elements are of one size where it bends as much as its neighbour
_NEARBY = 17  # samples of a curve
_SHARP = np.cos(np.radians(2.0))  # bends by less crowd no current
AGREEMENT = 1e-4  # of the meshed area and length with their closed forms


class Frame(NamedTuple):
    """An end of a piece: place (3,) m, unit vectors (3,) along the current and to its left, width and radius (m)."""

    place: Floats
    along: Floats
    across: Floats
    width: float
    radius: float = inf  # of the centreline's bend

    @property
    def normal(self) -> Floats:
        """(3,), upwards"""
        return _cross(self.along, self.across)


class Joint(NamedTuple):
    """What two pieces share.

    offset: from the centreline to the left edge, (3,) m.  normal: (3,), leaning at a fold.  finest: m, the element next
    to it; infinite where the current does not change.
    """

    offset: Floats
    normal: Floats
    finest: float


class Piece(Protocol):
    """A part of a ribbon without corners and folds."""

    @property
    def lead(self) -> bool:
        """Whether it belongs to the leads."""
        ...

    @property
    def length(self) -> float:
        """Of the centreline, m."""
        ...

    @property
    def ends(self) -> tuple[Frame, Frame]:
        """Where it begins and where it ends."""
        ...

    def rows(self, resolution: float, joints: tuple[Joint, Joint], bend: float) -> tuple[Floats, Floats, Floats]:
        """Centres, offsets to the left edge and normals at its stations, each (2n+1, 3) m.

        bend: m, radius of the cylinder that x will be rolled about.
        """
        ...


@dataclass(frozen=True, eq=False)
class Straight:
    """A straight strip between two places (3,) m, its left towards `across`; the width may change along it."""

    start: Floats
    end: Floats
    across: Floats
    widths: tuple[float, float]
    lead: bool = False

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.end - self.start))

    @property
    def ends(self) -> tuple[Frame, Frame]:
        along = (self.end - self.start) / self.length
        first, last = self.widths
        return Frame(self.start, along, self.across, first), Frame(self.end, along, self.across, last)

    def rows(self, resolution: float, joints: tuple[Joint, Joint], bend: float) -> tuple[Floats, Floats, Floats]:
        length, width = self.length, min(self.widths)
        along = (self.end - self.start) / length
        longest = min(LONGEST * width, bend * TURNING / max(abs(along[0]), 1e-9))
        marks = _refined(_graded(length, joints[0].finest, joints[1].finest, longest), resolution)
        slants = [float(joint.offset @ along) for joint in joints]
        slant = _slants(marks, length, max(self.widths), slants[0], slants[1])
        s, slant = _with_middles(marks)[:, None], _with_middles(slant)[:, None]
        half = 0.5 * (self.widths[0] + (self.widths[1] - self.widths[0]) * s / length)
        if not (np.diff(s + slant, axis=0) > 0).all() or not (np.diff(s - slant, axis=0) > 0).all():
            raise InputError("a track of foil turns twice within less than its width")
        normals = np.tile(_cross(along, self.across), (len(s), 1))
        normals[0], normals[-1] = joints[0].normal, joints[1].normal
        return self.start + s * along, half * self.across + slant * along, normals


Path = Callable[[Floats], tuple[Floats, Floats]]
"""Places (n, 2) m and derivatives (n, 2) of a plane curve at parameters (n,)."""


@dataclass(frozen=True, eq=False)
class Curved:
    """A strip along a smooth curve in the plane z = `level` (m), joined to others without corners.

    span: the parameter at either end.  samples: steps of the parameter, some 64 from one bend to the next.
    """

    path: Path
    span: tuple[float, float]
    width: float
    length: float
    samples: int
    lead: bool = False
    level: float = 0.0

    @property
    def ends(self) -> tuple[Frame, Frame]:
        places, along, across = self._frames(np.array(self.span))
        step = (self.span[1] - self.span[0]) / self.samples
        radii = []
        for t in self.span[0], self.span[1] - step:
            nearby, (before, after) = self.path(np.array([t, t + step]))
            turn = abs(np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after))
            radii.append(float(np.linalg.norm(nearby[1] - nearby[0]) / max(turn, 1e-9)))
        first, last = (Frame(places[i], along[i], across[i], self.width, radii[i]) for i in (0, 1))
        return first, last

    def rows(self, resolution: float, joints: tuple[Joint, Joint], bend: float) -> tuple[Floats, Floats, Floats]:
        places, across = self._frames(self._parameters(resolution, joints, bend))[::2]
        return places, 0.5 * self.width * across, _normals(places.shape, joints)

    def _frames(self, parameters: Floats) -> tuple[Floats, Floats, Floats]:
        """Places, directions along and across, (n, 3) each."""
        places, slopes = self.path(parameters)
        along = slopes / np.linalg.norm(slopes, axis=1)[:, None]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        spatial = [np.pad(vectors, ((0, 0), (0, 1))) for vectors in (places, along, across)]
        spatial[0][:, 2] = self.level
        return spatial[0], spatial[1], spatial[2]

    def _parameters(self, resolution: float, joints: tuple[Joint, Joint], bend: float) -> Floats:
        """The parameters (2n+1,) of the stations."""
        from scipy.interpolate import PchipInterpolator
        from scipy.ndimage import maximum_filter1d, uniform_filter1d

        t = np.linspace(*self.span, self.samples + 1)
        slopes = self.path(t)[1]
        speed = np.linalg.norm(slopes, axis=1)
        bending = np.abs(np.gradient(np.unwrap(np.arctan2(slopes[:, 1], slopes[:, 0])), t))
        # Elements between bends must follow how the bending changes: they take what it is nearby.
        bending = uniform_filter1d(maximum_filter1d(bending, _NEARBY), _NEARBY)
        density = np.maximum(bending / TURNING, speed / (LONGEST * self.width))
        density = np.maximum(density, np.abs(slopes[:, 0]) / (bend * TURNING))
        even = len(t)
        t, density = self._graded(t, density, speed, (joints[0].finest, joints[1].finest))
        elements = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(t))])
        count = ceil(max(1, ceil(elements[-1] - 1e-6)) * resolution - 1e-6)
        wanted = np.linspace(0.0, elements[-1], 2 * count + 1)
        parameters: Floats = PchipInterpolator(elements, t)(wanted)
        parameters[[0, -1]] = self.span
        if len(t) > even:  # a parabola is the nearer to an arc, the nearer its middle to the arc's
            parameters[1::2] = 0.5 * (parameters[:-1:2] + parameters[2::2])
        return parameters

    def _graded(self, t: Floats, density: Floats, speed: Floats, finest: tuple[float, float]) -> tuple[Floats, Floats]:
        """Parameters and elements per parameter, more of both where elements next to an end are to be smaller.

        finest: m, at the ends; sizes grow with the distance from there.
        """
        sizes = [_EVENLY * size for size in finest]
        steps = np.geomspace(1e-3, 1.0, 40) * (t[-1] - t[0])
        wanted = [bool(density[end] * size < speed[end]) for end, size in zip((0, -1), sizes, strict=True)]
        if not any(wanted):
            return t, density
        finer = np.concatenate([t, *([t[0] + steps] if wanted[0] else []), *([t[-1] - steps] if wanted[1] else [])])
        apart = 1e-6 * (t[-1] - t[0])
        finer = np.sort(finer[(finer > t[0] + apart) & (finer < t[-1] - apart)])
        finer = np.concatenate([t[:1], finer[np.diff(finer, prepend=-inf) > apart], t[-1:]])
        density, speed = np.interp(finer, t, density), np.interp(finer, t, speed)
        for end, size, needed in zip((0, -1), sizes, wanted, strict=True):
            if needed:
                distance = speed[end] * np.abs(finer - finer[end])
                density = np.maximum(density, speed / (size + distance))
        return finer, density


@dataclass(frozen=True, eq=False)
class Ribbon:
    """Pieces one after the other, the last one meeting the first: calling it with a resolution gives the stations."""

    pieces: tuple[Piece, ...]
    bend: float = inf  # m, radius of the cylinder that x will be rolled about

    def __call__(self, resolution: float) -> Stations:
        """The stations. Raises InputError where the track turns within less than its width."""
        joints = [
            _joint(before.ends[1], after.ends[0])
            for before, after in zip((self.pieces[-1], *self.pieces[:-1]), self.pieces, strict=True)
        ]
        return self._stations(resolution, self._smoothed([*joints, joints[0]]))

    def open(self, resolution: float) -> Stations:
        """The stations of pieces whose ends do not meet, cut off square there."""
        first, last = self.pieces[0].ends[0], self.pieces[-1].ends[1]
        joints = [_joint(before.ends[1], after.ends[0]) for before, after in pairwise(self.pieces)]
        return self._stations(resolution, self._smoothed([_joint(first, first), *joints, _joint(last, last)]))

    def _smoothed(self, joints: list[Joint]) -> list[Joint]:
        """Joints, their elements no larger than what a corner or bend beyond a short piece asks for.

        Uneven current goes through folds unhindered, and a via is too short for it to settle.
        """
        finest = [joint.finest for joint in joints]
        lengths = [piece.length for piece in self.pieces]
        for _ in range(2):  # twice for what comes round the seam of a closed ribbon
            finest[0] = finest[-1] = min(finest[0], finest[-1])
            for i, length in enumerate(lengths):
                finest[i + 1] = min(finest[i + 1], finest[i] + length)
            for i, length in reversed(list(enumerate(lengths))):
                finest[i] = min(finest[i], finest[i + 1] + length)
        return [joint._replace(finest=size) for joint, size in zip(joints, finest, strict=True)]

    def _stations(self, resolution: float, joints: list[Joint]) -> Stations:
        found: list[tuple[Floats, Floats, Floats]] = []
        lead: list[Booleans] = []
        for piece, pair in zip(self.pieces, pairwise(joints), strict=True):
            rows = piece.rows(resolution, pair, self.bend)
            end = None if piece is self.pieces[-1] else -1
            found.append((rows[0][:end], rows[1][:end], rows[2][:end]))
            lead.append(np.full(len(rows[0]) // 2, piece.lead))
        centre, offset, normal = (np.concatenate(rows) for rows in zip(*found, strict=True))
        return Stations(centre + offset, centre - offset, normal, np.concatenate(lead))


@dataclass(frozen=True)
class Placed:
    """A ribbon moved by `shift` (m) and then turned about z by `angle` (rad)."""

    ribbon: Callable[[float], Stations]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angle: float = 0.0

    def __call__(self, resolution: float) -> Stations:
        stations = self.ribbon(resolution)
        c, s = np.cos(self.angle), np.sin(self.angle)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        left, right = ((edge + np.array(self.shift)) @ turn for edge in (stations.left, stations.right))
        return Stations(left, right, stations.normal @ turn, stations.lead)


def check_ribbon(track: FoilTrack, resolution: float = 1.0) -> Stations:
    """The stations of a track, its elements' area and length (leads excluded) held against the closed forms.

    Raises MeshError when one of them is off by more than 1e-4, or the ribbon is not closed.
    """
    stations = track.stations(resolution)
    gap = max(np.abs(edge[-1] - edge[0]).max() for edge in (stations.left, stations.right))
    if gap > 1e-9 * track.width:
        raise MeshError(f"a track of foil is not closed: its ends are {gap:.3g} m apart")
    length, area = ribbon_size(stations)
    for what, found, expected in (("length", length, track.length), ("area", area, track.area)):
        if abs(found - expected) > AGREEMENT * expected:
            raise MeshError(f"the mesh of a track of foil has {what} {found:.8g}, expected {expected:.8g} (SI)")
    return stations


def ribbon_size(stations: Stations, lead: bool = False) -> tuple[float, float]:
    """Length (m) of the centreline and area (m²) of a ribbon's elements, its leads' or the others', by Gauss's rule."""
    u, weights = np.polynomial.legendre.leggauss(4)
    shapes = np.stack([0.5 * u * (u - 1), 1 - u**2, 0.5 * u * (u + 1)])
    slopes = np.stack([u - 0.5, -2 * u, u + 0.5])
    chosen = stations.lead == lead

    def elements(rows: Floats) -> Floats:
        nodes: Floats = np.stack([rows[:-1:2], rows[1::2], rows[2::2]], axis=1)[chosen]
        return nodes

    middle = elements(0.5 * (stations.left + stations.right))
    half = elements(0.5 * (stations.left - stations.right))
    along, turning = (np.einsum("kq,nki->nqi", slopes, rows) for rows in (middle, half))
    across = np.einsum("kq,nki->nqi", shapes, half)
    length = float((np.linalg.norm(along, axis=-1) @ weights).sum())
    surface = [np.linalg.norm(np.cross(along + v * turning, across), axis=-1) for v in u]
    area = sum(float(weight * (part @ weights).sum()) for weight, part in zip(weights, surface, strict=True))
    return length, area


def _joint(before: Frame, after: Frame) -> Joint:
    """The mitre of a corner or the crease of a fold."""
    turn = float(before.across @ after.across)
    offset = 0.5 * before.width * (before.across + after.across) / (1.0 + turn)
    normal = (before.normal + after.normal) / (1.0 + float(before.normal @ after.normal))
    if turn < _SHARP:
        return Joint(offset, normal, FINEST * before.width)
    tightest = min(before.radius, after.radius)
    return Joint(offset, normal, max(FINEST * before.width, _BESIDE * tightest))


def _graded(length: float, first: float, last: float, longest: float) -> Floats:
    """Element ends along a piece: sizes double away from its ends, from `first` and `last` up to `longest`, m."""
    left, right = [0.0], [length]
    while min(first, last) < longest and right[-1] - left[-1] > 2.5 * min(first, last):
        if first <= last:
            left.append(left[-1] + first)
            first *= 2
        else:
            right.append(right[-1] - last)
            last *= 2
    room = right[-1] - left[-1]
    inner = max(1, ceil(room / min(first, last, longest) - 0.5), ceil(room / longest - 1e-6))
    marks: Floats = np.concatenate([left[:-1], np.linspace(left[-1], right[-1], inner + 1), right[-2::-1]])
    return marks


def _refined(marks: Floats, resolution: float) -> Floats:
    """Element ends at another resolution: every element halved when it is 2."""
    count = ceil((len(marks) - 1) * resolution - 1e-6)
    return np.interp(np.linspace(0, len(marks) - 1, count + 1), np.arange(len(marks)), marks)


def _slants(marks: Floats, length: float, width: float, first: float, last: float) -> Floats:
    """How far the left edge is ahead of the centreline at element ends, m: the mitres' share, fading out."""
    reaches = [max(_UPRIGHT * width, 2.2 * abs(mitre)) for mitre in (first, last)]
    if length < sum(reaches):
        return first + (last - first) * marks / length
    begin, end = np.maximum(1 - marks / reaches[0], 0), np.maximum(1 - (length - marks) / reaches[1], 0)
    slants: Floats = first * begin + last * end
    return slants


def _with_middles(ends: Floats) -> Floats:
    rows = np.empty(2 * len(ends) - 1)
    rows[::2], rows[1::2] = ends, 0.5 * (ends[1:] + ends[:-1])
    return rows


def _normals(shape: tuple[int, ...], joints: tuple[Joint, Joint]) -> Floats:
    """Upright between the joints."""
    normals = np.zeros(shape)
    normals[:, 2] = 1.0
    normals[0], normals[-1] = joints[0].normal, joints[1].normal
    return normals


def _cross(a: Floats, b: Floats) -> Floats:
    product: Floats = np.cross(a, b)
    return product
