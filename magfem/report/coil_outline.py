"""Coils as lines and outlines: where the metal lies in a plan or on a cut, and which way the current goes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from magfem.geometry import Circuit, CoaxialWinding, Coil, FoilTrack, Stations, SweptWinding
from magfem.typing import Floats, Points

_FINE = 8  # points to an element of a ribbon
_FLAT = 1e-9  # how far a flat coil's normals may lean
_TURN = 96  # points round a coaxial winding


@dataclass(frozen=True)
class Strip:
    """A piece of a track: its edges (n, 3) m, seen along the current, and whether it belongs to the leads."""

    left: Points
    right: Points
    lead: bool

    @property
    def middle(self) -> Points:
        """Points (n, 3) m halfway between the edges, along the current."""
        return 0.5 * (self.left + self.right)

    @property
    def outline(self) -> Points:
        """The closed outline (2n, 3) m."""
        return np.concatenate([self.left, self.right[::-1]])


@dataclass(frozen=True)
class Path:
    """A line (n, 3) m along the current of one part of a circuit, leads apart, and outward directions (n, 3) on it.

    width: m, of what carries the current there.
    """

    points: Points
    outward: Floats
    width: float


def is_flat(geometry: Coil) -> bool:
    """Whether all turns are foil in planes z = const."""
    for circuit in geometry.circuits:
        for part in circuit.parts:
            if not isinstance(part, FoilTrack) or part.curvature:
                return False
            stations = part.stations(0.5)
            normal = stations.normal[1::2][~stations.lead]
            if np.abs(normal[:, :2]).max() > _FLAT:
                return False
    return True


def strips(track: FoilTrack, resolution: float = 1.0) -> tuple[Strip, ...]:
    """A foil track cut where turns and leads meet, in the order of the current."""
    return tuple(_strips(track.stations(resolution)))


def _strips(stations: Stations) -> Iterator[Strip]:
    ends = np.flatnonzero(np.diff(stations.lead.astype(np.int8))) + 1
    for first, last in zip([0, *ends], [*ends, len(stations.lead)], strict=True):
        run = slice(2 * first, 2 * last + 1)
        yield Strip(_along(stations.left[run]), _along(stations.right[run]), bool(stations.lead[first]))


def _along(nodes: Points) -> Points:
    """Points (n, 3) m along a chain of quadratic elements, given by its nodes (2e+1, 3)."""
    local = np.linspace(0.0, 1.0, _FINE + 1)[:-1]
    shapes = np.stack([(1 - local) * (1 - 2 * local), 4 * local * (1 - local), local * (2 * local - 1)], axis=1)
    triples = np.stack([nodes[:-2:2], nodes[1::2], nodes[2::2]], axis=1)
    return np.concatenate([np.einsum("qa,nai->nqi", shapes, triples).reshape(-1, 3), nodes[-1:]])


def paths(circuit: Circuit, resolution: float = 1.0) -> tuple[Path, ...]:
    """Lines along the current on the outside of every part of a circuit, leads apart."""
    found: list[Path] = []
    for part in circuit.parts:
        if isinstance(part, FoilTrack):
            stations = part.stations(resolution)
            for strip in _strips(stations):
                if not strip.lead:
                    across = strip.left - strip.right
                    along = np.gradient(strip.middle, axis=0)
                    found.append(Path(strip.middle, _units(np.cross(along, across)), part.width))
        elif isinstance(part, CoaxialWinding):
            found.append(_turn(part))
        else:
            found += _swept(part, resolution)
    return tuple(found)


def _turn(winding: CoaxialWinding) -> Path:
    angle = np.sign(winding.turns) * np.linspace(0, 2 * np.pi, _TURN)
    outward = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    place = winding.outer_radius * outward + np.array([0.0, 0.0, winding.centre])
    width = max(winding.length, winding.outer_radius - winding.inner_radius, winding.wire_area**0.5)
    return Path(place, outward, width)


def _swept(winding: SweptWinding, resolution: float) -> tuple[Path, ...]:
    """Along the middles of the outermost wall and of both faces that the walls stand between."""
    ribbons = [stations for stations, _ in winding.layers(resolution)]
    order = slice(None, None, -1 if winding.turns < 0 else 1)
    outer, middle = ribbons[-1], ribbons[len(ribbons) // 2]
    left, right = _along(middle.left), _along(middle.right)
    faces = [
        (_along(0.5 * (outer.left + outer.right)), _along(outer.normal)),
        (left, left - right),
        (right, right - left),
    ]
    return tuple(Path(points[order], _units(outward[order]), min(winding.window)) for points, outward in faces)


def swept_lattices(winding: SweptWinding, resolution: float) -> tuple[Points, ...]:
    """The four faces of a winding's window, each a lattice (n, m, 3) m: the walls reach to Gauss's places only."""
    ribbons = [stations for stations, _ in winding.layers(resolution)]
    levels = np.polynomial.legendre.leggauss(len(ribbons))[0]
    sides = []
    for edges in ([ribbon.left for ribbon in ribbons], [ribbon.right for ribbon in ribbons]):
        rows = np.stack([_along(edge) for edge in edges], axis=1)
        slopes = (
            [
                (rows[:, -1] - rows[:, -2]) / (levels[-1] - levels[-2]),
                (rows[:, 1] - rows[:, 0]) / (levels[1] - levels[0]),
            ]
            if len(ribbons) > 1
            else [0 * rows[:, 0], 0 * rows[:, 0]]
        )
        last = rows[:, -1] + (1 - levels[-1]) * slopes[0]
        first = rows[:, 0] - (1 + levels[0]) * slopes[1]
        sides.append(np.concatenate([first[:, None], rows, last[:, None]], axis=1))
    left, right = sides
    return left, right, np.stack([left[:, 0], right[:, 0]], axis=1), np.stack([left[:, -1], right[:, -1]], axis=1)


def _units(vectors: Floats) -> Floats:
    """Unit vectors (n, 3); zeros stay."""
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    found: Floats = vectors / np.where(size > 0, size, 1.0)
    return found
