"""From a coil to its solution: conduction in every circuit, then the field of the current by integration."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fem.coil_currents import CoilCurrents
from magfem.fem.coil_solution import CoilSolution, SolvedCircuit
from magfem.fem.conduction import evenly_spread, solid_elements, solve_sheet, solve_solid
from magfem.fem.refinement import peak_bytes, refine
from magfem.fem.sheet_currents import SheetCurrents
from magfem.fields.filament import Filaments
from magfem.geometry import Circuit, CircuitPart, CoaxialWinding, Coil, FoilTrack, Stations
from magfem.geometry.foil_ribbon import check_ribbon
from magfem.mesh.lattice import lattice, shape_of
from magfem.typing import Jet, Points
from magfem.units import describe

Conduction: TypeAlias = Literal["filament", "sheet", "solid", "winding"]

RESOLUTIONS = (0.5, 4.0)
"""Smallest and largest resolution: below, bends are not resolved; above, memory runs out."""

_STATED = 0.5
"""Stated error over the difference between solutions on elements of full and of twice the size. Errors fall at least
fourfold from one to the next, so that a third would do; what is more covers points that were not sampled."""
MOST_UNKNOWNS, MOST_SOLID_UNKNOWNS = 1e6, 2e5
"""What one track may ask for as a sheet, and as a solid: about 2 GB of memory and a minute."""

_ROUNDING = 1e-9  # closed forms of windings are not stated to be better than this
_ACROSS, _ACROSS_CORNERS = 4, 8  # elements across a track at resolution 1, and across one that turns corners
_FILAMENT_ERROR = 1e-5  # of the field at the clearance: tracks so narrow that this holds are filaments
_MOST_LAYERS = 8  # sheets through the thickness of a foil
_GMD = 0.2235  # geometric mean distance within a rectangle over the sum of its sides (Maxwell; 0.22313 to 0.22369)


@dataclass(frozen=True)
class _Found:
    """What one part of a circuit contributes."""

    currents: CoilCurrents
    model: Conduction
    model_error: float
    bounds: tuple[float, float]  # of the resistance, Ω
    lead_resistance: float
    crowding: float
    section: float
    unknowns: int


def solve_coil(
    geometry: Coil, resolution: float, tolerance: float | None, conduction: Conduction | None
) -> CoilSolution:
    """Solve a coil: see `magfem.solve`."""
    started = time.perf_counter()
    if conduction is not None and conduction not in ("filament", "sheet", "solid"):
        raise InputError(f'conduction must be "filament", "sheet" or "solid", got {describe(conduction)}')
    parts = [part for circuit in geometry.circuits for part in circuit.parts]
    if conduction is not None and not any(isinstance(part, FoilTrack) for part in parts):
        raise InputError("conduction is a choice for coils of foil: in a winding the turns spread the current evenly")
    refined = refine(
        solve=lambda fineness: [
            _solve_circuit(circuit, geometry, fineness, conduction) for circuit in geometry.circuits
        ],
        jet=_jet,
        stated=lambda difference, _: max(_STATED * difference, _ROUNDING),
        region=geometry.region,
        resolution=resolution,
        tolerance=tolerance,
        finest=RESOLUTIONS[1],
    )
    circuits = refined.solved
    return CoilSolution(
        geometry=geometry,
        circuits=tuple(circuits),
        error={
            "B": refined.error[0],
            "gradient": refined.error[1],
            "region": geometry.region.describe(),
            "model": max(circuit.model_error for circuit in circuits),
        },
        stats={
            "unknowns": sum(circuit.unknowns for circuit in circuits),
            "cells": sum(circuit.currents.cells for circuit in circuits),
            "quality": _quality(circuits),
            "seconds": time.perf_counter() - started,
            "peak_bytes": peak_bytes(),
        },
        settings={"resolution": float(refined.resolution), "conduction": conduction},
    )


def _quality(circuits: list[SolvedCircuit]) -> dict[str, float]:
    """Shape of the worst patch of all circuits; nothing for coils of closed forms only."""
    currents = [circuit.currents for circuit in circuits]
    solved = [own.faces if own.faces.count else own.sheets for own in currents]
    sheets = [patches.nodes for patches in solved if patches.count]
    if not sheets:
        return {}
    sine, aspect = shape_of(np.concatenate(sheets))
    return {"least_sine": sine, "largest_aspect": aspect}


def _jet(circuits: list[SolvedCircuit], points: Points) -> Jet:
    jets = [circuit.evaluate(points, 1) for circuit in circuits]
    return tuple(np.sum(parts, axis=0) for parts in zip(*jets, strict=True))


def _solve_circuit(circuit: Circuit, geometry: Coil, resolution: float, wanted: Conduction | None) -> SolvedCircuit:
    """One circuit at 1 A, all its parts in series."""
    resistivity, clearance = geometry.conductor.resistivity, geometry.region.clearance
    parts = [_solve_part(part, resistivity, clearance, resolution, wanted) for part in circuit.parts]
    low, high = (sum(part.bounds[side] for part in parts) for side in (0, 1))
    narrowest = max(parts, key=lambda part: part.crowding / part.section)
    return SolvedCircuit(
        name=circuit.name,
        currents=CoilCurrents.joined([part.currents for part in parts]),
        model=" and ".join(sorted({part.model for part in parts})),
        model_error=max(part.model_error for part in parts),
        resistance=0.5 * (low + high),
        resistance_error=0.5 * (high - low) / high,
        lead_resistance=sum(part.lead_resistance for part in parts),
        crowding=narrowest.crowding,
        section=narrowest.section,
        unknowns=sum(part.unknowns for part in parts),
    )


def _solve_part(
    part: CircuitPart, resistivity: float, clearance: float, resolution: float, wanted: Conduction | None
) -> _Found:
    if isinstance(part, FoilTrack):
        return _solve_track(part, resistivity, clearance, resolution, wanted)
    resistance = resistivity * part.wire_length / part.wire_area
    if isinstance(part, CoaxialWinding):
        wire = math.sqrt(part.wire_area / math.pi)
        sizes = [part.inner_radius, part.outer_radius, part.length, part.centre, part.turns, wire]
        currents = CoilCurrents(windings=np.array([sizes]))
        height, build = part.length, part.outer_radius - part.inner_radius
    else:
        layers = [evenly_spread(stations, turns) for stations, turns in part.layers(resolution)]
        sheets = SheetCurrents.joined(layers)
        height, build = part.window
        turn = part.wire_length / abs(part.turns)
        excess = part.turns**2 * turn / height * build * _flatness(len(layers))
        currents = CoilCurrents(sheets=sheets, within=sheets, excess=excess)
    # Turns a pitch apart leave a ripple in the field that falls as exp(−2π distance/pitch).
    pitch = (height * build / abs(part.turns)) ** 0.5
    return _Found(
        currents=currents,
        model="winding",
        model_error=math.exp(-2 * math.pi * clearance / pitch) if pitch > 0 else 0.0,
        bounds=(resistance, resistance),
        lead_resistance=0.0,
        crowding=1.0,
        section=part.wire_area,
        unknowns=0,
    )


def _solve_track(
    track: FoilTrack, resistivity: float, clearance: float, resolution: float, wanted: Conduction | None
) -> _Found:
    errors = {"filament": _filament_error(track, clearance), "sheet": _sheet_error(track, clearance), "solid": 0.0}
    model = wanted or choose_conduction(track, clearance)
    # What the error statement alone is made from may be coarser than any mesh that users get.
    stations = check_ribbon(track, resolution) if resolution >= RESOLUTIONS[0] else track.stations(resolution)
    across = _ACROSS_CORNERS if _has_corners(stations) else _ACROSS
    _check_size(len(stations.left) * (2 * across * resolution + 1), resolution, MOST_UNKNOWNS)
    if model == "solid":
        through = solid_elements(across, resolution)
        solid = len(stations.left) * (2 * across * resolution + 1) * (2 * through + 1)
        _check_size(solid, resolution, MOST_SOLID_UNKNOWNS)
    sheet = solve_sheet(track, resistivity, resolution, across)
    bounds, unknowns = sheet.bounds, sheet.unknowns
    if model == "filament":
        currents = _centreline(track, resolution)
    else:
        coarse = solve_sheet(track, resistivity, resolution / 2, _ACROSS)
        if model == "solid":
            faces, resistance, unknowns = solve_solid(track, sheet, resistivity, resolution, across)
            bounds = (resistance, max(resistance, bounds[1]))  # the even current of a sheet dissipates no less
            currents = CoilCurrents(faces=faces, within=coarse.currents(track.thickness, layers=5))
        else:
            layers = _layers(track, clearance)
            within = coarse.currents(track.thickness)
            excess = (track.length + track.lead_length) / track.width * track.thickness * _flatness(2)
            currents = CoilCurrents(sheets=sheet.currents(track.thickness, layers), within=within, excess=excess)
    return _Found(
        currents=currents,
        model=model,
        model_error=errors[model],
        bounds=bounds,
        lead_resistance=sheet.lead_share * sheet.resistance,
        crowding=sheet.crowding,
        section=track.width * track.thickness,
        unknowns=unknowns,
    )


def _check_size(unknowns: float, resolution: float, most: float) -> None:
    """Raise InputError for a track that would not fit into memory."""
    if unknowns > most:
        raise InputError(
            f"about {unknowns:.1e} unknowns would be needed for one track at resolution {resolution:g}, and at most "
            f"{most:.0e} fit: lower the resolution to {resolution * (most / unknowns) ** 0.5:.2g}"
        )


def _has_corners(stations: Stations) -> bool:
    """Whether the coil itself, leads apart, has mitred corners: they are longer than the track is wide."""
    across = np.linalg.norm(stations.left - stations.right, axis=1)[:-2:2][~stations.lead]
    return bool(across.max() > 1.05 * across.min())


def choose_conduction(track: FoilTrack, clearance: float) -> Conduction:
    """How a foil track is described, by its thickness: a filament far from all it is wanted for; else a sheet; a solid
    when it is thicker than wide, or so thick on its roll that paths inside are 5 % shorter than outside.

    In a flat track of one thickness the current does not depend on the depth: the sheet's current is the true one.
    """
    if _filament_error(track, clearance) < _FILAMENT_ERROR:
        return "filament"
    thick = track.thickness > track.width or track.thickness * track.curvature > 0.05
    return "solid" if thick else "sheet"


def _layers(track: FoilTrack, clearance: float) -> int:
    """Sheets at Gauss points of the thickness that integrate the field at the clearance to 1e-7."""
    reach = math.asinh(2 * clearance / track.thickness)  # n points leave exp(−2n·reach)
    return min(max(2, math.ceil(math.log(1e7) / (2 * reach))), _MOST_LAYERS)


def _flatness(layers: int) -> float:
    """Inductance (H) that sheets at Gauss points have more than a conductor of unit thickness, for one square of it.

    Between planes a distance d apart the vector potential falls by µ0 K d/2, so that an inductance falls with the mean
    distance within the conductor: 1/3 of the thickness, of which the sheets, each without thickness, have less.
    """
    places, weights = (0.5 * values for values in np.polynomial.legendre.leggauss(layers))
    mean = float(weights @ np.abs(places[:, None] - places) @ weights)
    return 0.5 * MU_0 * (1 / 3 - mean)


def _filament_error(track: FoilTrack, clearance: float) -> float:
    """A line current in place of one spread over width w: w²/24 times the second derivative of 1/d over 1/d."""
    return max(track.width, track.thickness) ** 2 / (12 * clearance**2)


def _sheet_error(track: FoilTrack, clearance: float) -> float:
    """What its layers leave out of the thickness, and on a roll of radius R the current's centre, which moves by t²/12R
    since inner paths are shorter."""
    left_out = math.exp(-2 * _layers(track, clearance) * math.asinh(2 * clearance / track.thickness))
    return left_out + track.curvature * track.thickness**2 / (12 * clearance)


def _centreline(track: FoilTrack, resolution: float) -> CoilCurrents:
    """Chords of the centreline, eight to an element; for the self-inductance a place at the mean distance within."""
    points = lattice(track.stations(resolution), np.array([0.0]))[:, 0]
    normal = track.stations(resolution).normal
    local = np.linspace(0.0, 1.0, 9)[:-1]
    shapes = np.stack([(1 - local) * (1 - 2 * local), 4 * local * (1 - local), local * (2 * local - 1)], axis=1)
    triples = np.stack([points[:-2:2], points[1::2], points[2::2]], axis=1)
    chain = np.einsum("qa,nai->nqi", shapes, triples).reshape(-1, 3)
    chain = np.concatenate([chain, points[-1:]])
    away = np.repeat(normal[1::2], 8, axis=0)
    away = away / np.linalg.norm(away, axis=1, keepdims=True) * _GMD * (track.width + track.thickness)
    return CoilCurrents(filaments=Filaments(chain[:-1].copy(), chain[1:].copy(), np.ones(len(away))), offset=away)
