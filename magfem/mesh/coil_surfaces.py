"""The surfaces of a coil's conductors as biquadratic patches: for mesh files and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from magfem.geometry import CircuitPart, CoaxialWinding, Coil, FoilTrack, Stations
from magfem.mesh.lattice import lattice, patches
from magfem.typing import Floats, Integers

_AROUND = 24  # patches round a coaxial winding at resolution 1

_QUAD9 = np.array([0, 6, 8, 2, 3, 7, 5, 1, 4])  # meshio's order of a patch's nine nodes


@dataclass(frozen=True)
class CoilSurface:
    """One circuit's surface. name: the circuit's.  nodes: (p, 9, 3) m, node 3i + j at u = i/2, v = j/2.

    lead: (p,), which patches belong to leads.
    """

    name: str
    nodes: Floats
    lead: Integers


def coil_surfaces(geometry: Coil, resolution: float = 1.0) -> tuple[CoilSurface, ...]:
    """Every circuit: the whole surface of foils and of windings, whose window stands for the wires."""
    found = []
    for circuit in geometry.circuits:
        pieces = [_surface(part, resolution) for part in circuit.parts]
        nodes, lead = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
        found.append(CoilSurface(circuit.name, nodes, lead))
    return tuple(found)


def quadrilaterals(surfaces: tuple[CoilSurface, ...]) -> tuple[Floats, Integers, Integers]:
    """Points (n, 3) m, cells (p, 9) in meshio's order of "quad9", and the circuit's number (p,) of each cell."""
    nodes = np.concatenate([surface.nodes for surface in surfaces])
    size = float(np.ptp(nodes.reshape(-1, 3), axis=0).max())
    _, first, number = np.unique(
        np.rint(nodes.reshape(-1, 3) / (1e-9 * size)), axis=0, return_index=True, return_inverse=True
    )
    circuit = np.repeat(np.arange(len(surfaces)), [len(surface.nodes) for surface in surfaces])
    return nodes.reshape(-1, 3)[first], number.reshape(-1, 9)[:, _QUAD9], circuit


def _surface(part: CircuitPart, resolution: float) -> tuple[Floats, Integers]:
    if isinstance(part, CoaxialWinding):
        nodes = _tube(part, resolution)
        return nodes, np.zeros(len(nodes), dtype=np.int64)
    if isinstance(part, FoilTrack):
        return _shell(part.stations(resolution), part.thickness)
    ribbons = [_shell(stations, 0.0) for stations, _ in part.layers(resolution)]
    nodes, lead = (np.concatenate(arrays) for arrays in zip(*ribbons, strict=True))
    return nodes, lead


def _shell(stations: Stations, thickness: float) -> tuple[Floats, Integers]:
    """The four faces of a ribbon, or the ribbon itself when it has no thickness."""
    across = np.array([-1.0, 0.0, 1.0])
    lead = stations.lead.astype(np.int64)
    if thickness == 0:
        return patches(lattice(stations, across)), lead
    low, middle, high = (lattice(stations, across, 0.5 * thickness * level) for level in (-1, 0, 1))
    sides = [
        high,
        low[:, ::-1],
        np.stack([high[:, -1], middle[:, -1], low[:, -1]], axis=1),
        np.stack([low[:, 0], middle[:, 0], high[:, 0]], axis=1),
    ]
    return np.concatenate([patches(side) for side in sides]), np.tile(lead, 4)


def _tube(winding: CoaxialWinding, resolution: float) -> Floats:
    """The four walls of a winding's window, seen from outside; a thin torus of square section for a bare loop."""
    inner, outer, length = winding.inner_radius, winding.outer_radius, winding.length
    if outer == inner and length == 0:
        half = 0.5 * winding.wire_area**0.5
        inner, outer, length = inner - half, outer + half, 2 * half
    steps = 2 * max(8, round(_AROUND * resolution)) + 1
    angle = np.linspace(0, 2 * np.pi, steps)
    low, high = winding.centre - length / 2, winding.centre + length / 2
    corners = [(outer, low), (outer, high), (inner, high), (inner, low), (outer, low)]
    walls = []
    for (r0, z0), (r1, z1) in pairwise(corners):
        if (r0, z0) == (r1, z1):
            continue
        share = np.linspace(0.0, 1.0, 3)
        rho, z = r0 + (r1 - r0) * share, z0 + (z1 - z0) * share
        place = [np.outer(np.cos(angle), rho), np.outer(np.sin(angle), rho), np.tile(z, (steps, 1))]
        walls.append(patches(np.stack(place, axis=-1)))
    return np.concatenate(walls)
