"""Direct current in a closed ribbon of metal: where it flows, and the resistance it meets.

A foil's current needs two coordinates, s along the ribbon (closed on itself) and t across. With the form
a(u, w) = ∫ ∇u·∇w dS on the ribbon and the sheet resistance R_s = resistivity/thickness there are two descriptions:

- the stream function ψ, K = ∇ψ × n, with ψ = 0 and 1 on the two edges (1 A): the power is R_s a(ψ, ψ), which no other
  ψ makes smaller, so that a finite-element solution gives the resistance from above;
- the potential V, K = −∇V/R_s, with a jump of 1 V round the ribbon and no flow across the edges: the power is
  a(V, V)/R_s, the conductance from above and the resistance from below.

The truth lies between the two, and the current of ψ is free of divergence exactly. Folds cost nothing, since only
lengths along the ribbon count; corners crowd the current, which graded elements follow.

In a thick track the current has three coordinates and only V is left, J = −σ∇V. Its field needs no integral over the
volume: J has no curl inside, and with r from the source to the point,

    ∫ J × r/r³ dV = −σ ∫ ∇V × ∇(1/r) dV = σ ∮ (n × ∇V)/r dS,

an integral over the surface that asks only for V on it, exact inside the metal as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.errors import ConvergenceError
from magfem.fem.lattice_form import LatticeForm
from magfem.fem.sheet_currents import SheetCurrents
from magfem.geometry.circuit import FoilTrack, Stations
from magfem.mesh.lattice import lattice, patches, places_across
from magfem.typing import Floats

_FINE = 32  # places of an element between which a line of constant ψ is straight


@dataclass(frozen=True)
class SheetConduction:
    """The current of 1 A in a foil.

    stations: the ribbon.  across: (2m+1,) places of the lattice across, −1 right edge, 1 left edge.
    stream: (2n+1, 2m+1) A, on the lattice.  bounds: of the resistance, from below and from above, Ω.
    lead_share: of the power in leads.  crowding: largest sheet current over 1 A per width.  unknowns: of one solve.
    """

    stations: Stations
    across: Floats
    stream: Floats
    bounds: tuple[float, float]
    lead_share: float
    crowding: float
    unknowns: int

    @property
    def resistance(self) -> float:
        """Ω, leads included."""
        return 0.5 * (self.bounds[0] + self.bounds[1])

    def places(self, stream: float) -> Floats:
        """Where the line ψ = `stream` (A, between 0 and 1) crosses the stations: (2n+1,) across, −1 to 1."""
        m = (self.across.size - 1) // 2
        local = np.linspace(0.0, 1.0, _FINE, endpoint=False)
        shapes = np.stack([(1 - local) * (1 - 2 * local), 4 * local * (1 - local), local * (2 * local - 1)], axis=1)
        triples = 2 * np.arange(m)[:, None] + np.arange(3)
        psi = np.einsum("qa,nma->nmq", shapes, self.stream[:, triples]).reshape(len(self.stream), -1)
        psi = np.concatenate([psi, self.stream[:, -1:]], axis=1)
        across = np.append(np.einsum("qa,ma->mq", shapes, self.across[triples]).ravel(), self.across[-1])
        after = np.clip(np.sum(psi < stream, axis=1), 1, across.size - 1)
        row = np.arange(len(psi))
        low, high = psi[row, after - 1], psi[row, after]
        share = np.divide(stream - low, high - low, out=np.full_like(low, 0.5), where=high > low)
        found: Floats = across[after - 1] + share * (across[after] - across[after - 1])
        return found

    def currents(self, thickness: float, layers: int = 2) -> SheetCurrents:
        """The current of 1 A as sheets at Gauss's points of the foil's `thickness` (m).

        Two layers have moments through the thickness right up to the third: what is left out falls with the fourth
        power of thickness over distance.
        """
        levels, weights = np.polynomial.legendre.leggauss(layers)
        sheets = [patches(lattice(self.stations, self.across, 0.5 * thickness * level)) for level in levels]
        stream = patches(self.stream)
        return SheetCurrents(np.concatenate(sheets), np.concatenate([0.5 * weight * stream for weight in weights]))


def solve_sheet(track: FoilTrack, resistivity: float, resolution: float, elements: int) -> SheetConduction:
    """The current in a foil track, `elements` (times the resolution) across its width.

    resistivity: Ω·m. Raises ConvergenceError when the two bounds of the resistance contradict each other.
    """
    stations = track.stations(resolution)
    across = places_across(max(2, round(elements * resolution)), graded=True)
    points = lattice(stations, across)
    form = LatticeForm.of(points)
    stream = form.minimum({0.0: form.unknown[:-1, 0], 1.0: form.unknown[:-1, -1]}, jump=0.0)
    power = form.energy(stream)
    sheet_resistance = resistivity / track.thickness
    above = sheet_resistance * float(power.sum())
    below = sheet_resistance / float(form.energy(form.minimum({}, jump=1.0)).sum())
    if not below <= above * (1 + 1e-9):
        raise ConvergenceError(f"the bounds of a track's resistance contradict each other: {below:g} and {above:g} ohm")
    return SheetConduction(
        stations=stations,
        across=across,
        stream=stream,
        bounds=(below, above),
        lead_share=float(power[stations.lead].sum() / power.sum()),
        crowding=_crowding(points, stream),
        unknowns=form.size,
    )


def solve_solid(
    track: FoilTrack, sheet: SheetConduction, resistivity: float, resolution: float, elements: int
) -> tuple[SheetCurrents, float, int]:
    """The surface of a thick track that carries 1 A, with σV for its stream function; the resistance (Ω, from below);
    the number of unknowns.

    sheet: the same track solved as a foil, for its lattice. The thickness gets half as many elements as the width.
    The layer integral of what is returned is B, see above.
    """
    through = places_across(solid_elements(elements, resolution), graded=True)
    levels = [lattice(sheet.stations, sheet.across, 0.5 * track.thickness * level) for level in through]
    points = np.stack(levels, axis=2)
    form = LatticeForm.of(points)
    potential = form.minimum({}, jump=1.0)
    conductance = float(form.energy(potential).sum())  # over σ
    # For 1 A, σV falls by 1/conductance along the ribbon; normals point outwards.
    stream = potential / conductance
    sides = [
        (points[:, :, -1], stream[:, :, -1]),
        (points[:, ::-1, 0], stream[:, ::-1, 0]),
        (points[:, -1, ::-1], stream[:, -1, ::-1]),
        (points[:, 0], stream[:, 0]),
    ]
    faces = SheetCurrents(
        np.concatenate([patches(place) for place, _ in sides]),
        np.concatenate([patches(value) for _, value in sides]),
    )
    return faces, resistivity / conductance, form.size


def solid_elements(elements: int, resolution: float) -> int:
    """Elements through the thickness of a thick track that has `elements`, times the resolution, across."""
    return max(2, round(0.5 * elements * resolution))


def evenly_spread(stations: Stations, turns: float) -> SheetCurrents:
    """A winding's layer: `turns` A per ampere, spread evenly over the ribbon's width."""
    across = places_across(1, graded=False)
    points = lattice(stations, across)
    stream = np.broadcast_to(turns * 0.5 * (1 + across), points.shape[:2])
    return SheetCurrents(patches(points), patches(np.ascontiguousarray(stream)))


def _crowding(points: Floats, stream: Floats) -> float:
    """Largest sheet current in the middles of elements over 1 A per width, the median one of the ribbon."""
    nodes, psi = patches(points), patches(stream)
    xu, xv = nodes[:, 7] - nodes[:, 1], nodes[:, 5] - nodes[:, 3]
    pu, pv = (psi[:, 7] - psi[:, 1])[:, None], (psi[:, 5] - psi[:, 3])[:, None]
    K = np.linalg.norm(xu * pv - xv * pu, axis=1) / np.linalg.norm(np.cross(xu, xv), axis=1)
    width = np.linalg.norm(np.diff(points[1::2, ::2], axis=1), axis=-1).sum(axis=1)
    return float(K.max() * np.median(width))
