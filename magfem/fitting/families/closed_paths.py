"""Closed conductors where they lie: tracks of foil with their leads, windings carried along a path, wound loops."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from magfem.errors import InputError
from magfem.fem.conduction import solve_sheet
from magfem.fields.region import Shell
from magfem.fields.terms import Terms, closed_path, concatenate, loops
from magfem.fitting.candidate import Candidate
from magfem.fitting.families.tubes import gauss
from magfem.geometry import Coil, Geometry
from magfem.geometry.circuit import Circuit, CoaxialWinding, FoilTrack, Stations, SweptWinding
from magfem.geometry.limits import InvalidValue
from magfem.typing import Floats

MOST_NODES = 40_000
"""Of all paths together: more would make a model slower than it is worth."""

_LADDER = (
    (0.5, 1),
    (0.5, 2),
    (0.5, 3),
    (1.0, 2),
    (1.0, 3),
    (1.0, 4),
    (1.4, 2),
    (1.4, 3),
    (2.0, 2),
    (2.0, 3),
    (2.0, 4),
    (2.0, 6),
)
"""Resolutions and filaments across the width, from small models to large ones."""

_ACROSS = 6  # elements over a track's width, at resolution 1, to find the lines of its current

_SHARPEST = np.radians(40)  # corners that turn more are corners, not arcs cut into chords


def closed_paths(geometry: Geometry, region: Shell, circuit: str | None = None) -> Iterator[Candidate]:
    """Filaments along the conductors of one circuit, leads and return strips included.

    A track of foil is 1, 2, 3, … closed filaments along the lines that its solved current flows on, at Gauss–Legendre
    points of the stream function, each with a current that the fit finds; a winding is filaments or loops in known
    shares of one current. Nodes lie on the conductor's stations, moved out of arcs so that the chords enclose what the
    arc does.
    """
    coil, chosen = _circuit(geometry, circuit)
    for resolution, across in _LADDER:
        parts: list[Terms] = []
        parameter: list[int] = []
        for part in chosen.parts:
            if isinstance(part, FoilTrack):
                conduction = solve_sheet(part, coil.conductor.resistivity, resolution, _ACROSS)
                for stream in gauss(across, 0.0, 1.0):
                    parts.append(closed_path(_nodes(conduction.stations, conduction.places(stream))))
                    parameter.append(max(parameter, default=-1) + 1)
                continue
            terms = _winding(part, resolution) if isinstance(part, CoaxialWinding) else _swept(part, resolution, across)
            parts += terms
            parameter += [max(parameter, default=-1) + 1] * sum(one.coefficient.size for one in terms)
        together = concatenate(parts)
        if len(together.nodes) > MOST_NODES:
            return
        yield Candidate(
            "closed_paths",
            f"{across} across the conductor, {len(together.nodes)} nodes",
            together,
            np.array(parameter),
        )


def _circuit(geometry: Geometry, name: str | None) -> tuple[Coil, Circuit]:
    """The coil, and its circuit of that name or its only one."""
    if not isinstance(geometry, Coil):
        raise InputError(f"{geometry.name}: closed paths are for coils")
    for circuit in geometry.circuits:
        if circuit.name == name or (name is None and len(geometry.circuits) == 1):
            return geometry, circuit
    names = ", ".join(circuit.name for circuit in geometry.circuits)
    raise InvalidValue(f"{geometry.name} has {len(geometry.circuits)} circuits: name one of {names}", "circuit")


def _nodes(stations: Stations, across: Floats | float) -> Floats:
    """Nodes (v, 3) m of the filament `across` the width, −1 right edge, 1 left; the last station is the first."""
    middle, half = 0.5 * (stations.left + stations.right), 0.5 * (stations.left - stations.right)
    nodes: Floats = (middle + np.reshape(across, (-1, 1)) * half)[:-1]
    kept = np.linalg.norm(nodes - np.roll(nodes, 1, axis=0), axis=1) > 1e-9 * np.ptp(nodes, axis=0).max()
    nodes = nodes[kept]
    # In the mean, chords lie a twelfth of the second difference inside their arc.
    before, after = nodes - np.roll(nodes, 1, axis=0), np.roll(nodes, -1, axis=0) - nodes
    lengths = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    turn = np.arccos(np.clip(np.sum(before * after, axis=1) / (lengths[0] * lengths[1]), -1.0, 1.0))
    even = np.minimum(*lengths) > 0.5 * np.maximum(*lengths)
    bend = np.where(((turn < _SHARPEST) & even)[:, None], after - before, 0.0)
    rounded: Floats = np.round(nodes - bend / 12, 10)  # a tenth of a nanometre: model files stay short
    return rounded


def _winding(winding: CoaxialWinding, resolution: float) -> list[Terms]:
    """Loops with Gauss–Legendre shares of a winding's turns, one parameter for all."""
    along = max(4, round(24 * resolution)) if winding.length else 1
    across = max(2, round(6 * resolution)) if winding.outer_radius > winding.inner_radius else 1
    (z, wz), (r, wr) = (np.polynomial.legendre.leggauss(count) for count in (along, across))
    radius = (winding.inner_radius + winding.outer_radius) / 2 + (winding.outer_radius - winding.inner_radius) / 2 * r
    height = winding.centre + winding.length / 2 * z
    share = winding.turns * np.outer(wz, wr) / 4
    centres = np.column_stack([np.zeros((along * across, 2)), np.repeat(height, across)])
    return [loops(centres, np.tile(radius, along), share.ravel())]


def _swept(winding: SweptWinding, resolution: float, across: int) -> list[Terms]:
    """Filaments with Gauss–Legendre shares of a winding's turns, one parameter for all."""
    places, weights = np.polynomial.legendre.leggauss(2 * across + 2)
    return [
        closed_path(_nodes(stations, place), turns * weight / 2)
        for stations, turns in winding.layers(resolution)
        for place, weight in zip(places, weights, strict=True)
    ]
