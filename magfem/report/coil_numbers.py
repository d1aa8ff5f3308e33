"""The numbers of a coil report, each from a field per ampere, points and plain numbers: nothing is solved here."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from magfem.fields.field import Field
from magfem.geometry import Coil, CoilArray, FoilTrack, Stator
from magfem.typing import Floats, Points

_BALL = 1500  # points that stand for a ball
_RADII, _ANGLES, _LEVELS = 4, 16, 7  # points that stand for a cylinder
_DIRECTIONS, _DEPTHS = 120, 24  # rays in which the homogeneous volume is looked for, and places along each


@dataclass(frozen=True)
class ConductorNumbers:
    """What a card tells of a circuit's conductor. Lengths in m, volume in m³, estimate in Ω.

    turns: those of wire windings; None for foil.  length: of trace or wire, leads apart.  lead_length: of strips and
    vias.  estimate: resistivity times length over section, leads included: corners and widths that change are left
    out.
    """

    name: str
    turns: float | None
    length: float
    lead_length: float
    volume: float
    estimate: float


def conductor_numbers(geometry: Coil) -> tuple[ConductorNumbers, ...]:
    """For every circuit of a coil what follows from its card."""
    found = []
    for circuit in geometry.circuits:
        turns, length, leads, per_section = 0.0, 0.0, 0.0, 0.0
        wound = False
        for part in circuit.parts:
            if isinstance(part, FoilTrack):
                length += part.length
                leads += part.lead_length
                per_section += (part.length + part.lead_length) / (part.width * part.thickness)
            else:
                wound = True
                turns += abs(part.turns)
                length += part.wire_length
                per_section += part.wire_length / part.wire_area
        found.append(
            ConductorNumbers(
                name=circuit.name,
                turns=turns if wound else _turns(geometry, circuit.name),
                length=length,
                lead_length=leads,
                volume=circuit.volume,
                estimate=geometry.conductor.resistivity * per_section,
            )
        )
    return tuple(found)


def _turns(geometry: Coil, circuit: str) -> float | None:
    """Of a coil of foil, layers counted; None where the card states no number, as for meanders."""
    if isinstance(geometry, Stator):
        return float({"inner": geometry.inner, "outer": geometry.outer}[circuit].turns)
    coil = geometry.coil if isinstance(geometry, CoilArray) else geometry
    turns = getattr(coil, "turns", None)
    return None if turns is None else float(turns) * float(getattr(coil, "layers", 1))


def deviation(B: Floats, middle: Floats) -> Floats:
    """|B − B₀| / |B₀| (...) of fields B (..., 3) from that at the centre, `middle` (3,); infinite where B₀ vanishes."""
    size = float(np.linalg.norm(middle))
    apart: Floats = np.linalg.norm(B - middle, axis=-1)
    return apart / size if size > 0 else np.full(apart.shape, math.inf)


def ball(centre: Points, radius: float, count: int = _BALL) -> Points:
    """Points (count, 3) m that fill a ball evenly, a third of them on its surface, where harmonics are largest."""
    shell = np.arange(count) < count // 3
    share = np.where(shell, 1.0, ((np.arange(count) + 0.5 - count // 3) / (count - count // 3)).clip(0) ** (1 / 3))
    return centre + radius * share[:, None] * directions(count)


def directions(count: int) -> Floats:
    """Unit vectors (count, 3), spread evenly on the sphere: the golden spiral."""
    index = np.arange(count) + 0.5
    z = 1 - 2 * index / count
    angle = math.pi * (1 + 5**0.5) * index
    rho = np.sqrt(1 - z**2)
    return np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=-1)


def cylinder(diameter: float, length: float) -> Points:
    """Points (n, 3) m that fill a cylinder about z evenly and cover its wall and faces."""
    rho = 0.5 * diameter * np.sqrt(np.linspace(0.0, 1.0, _RADII))
    angle = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
    z = 0.5 * length * np.linspace(-1.0, 1.0, _LEVELS)
    r, a, h = np.meshgrid(rho, angle, z, indexing="ij")
    return np.stack([r * np.cos(a), r * np.sin(a), h], axis=-1).reshape(-1, 3)


def homogeneous_volume(field: Field, centre: Points, reach: float, limit: float = 0.01) -> float:
    """Volume (m³) around `centre` (3,) m, seen from there, in which B deviates by less than `limit`, relative.

    Rays go out to `reach` (m) in all directions; each counts to where the limit is first exceeded, places between
    which the deviation is interpolated.
    """
    rays = directions(_DIRECTIONS)
    step = reach / _DEPTHS
    middle = field.B(centre)
    radius = np.full(_DIRECTIONS, reach)
    inside = np.arange(_DIRECTIONS)  # the rays that have not exceeded the limit yet
    low = np.zeros(_DIRECTIONS)
    for depth in step * np.arange(1, _DEPTHS + 1):
        high = deviation(field.B(centre + depth * rays[inside]), middle)
        beyond = high > limit
        share = (limit - low[beyond]) / (high[beyond] - low[beyond])
        radius[inside[beyond]] = depth - step * (1 - share)
        inside, low = inside[~beyond], high[~beyond]
        if not inside.size:
            break
    return float(4 * math.pi / 3 * (radius**3).mean())


def field_per_watt(size: float, resistance: float) -> float:
    """T/√W of a field `size` (T/A) at the cost of a `resistance` (Ω): what a coil gives whatever its wire."""
    return size / math.sqrt(resistance)


def largest_current(density: float, limit: float) -> float:
    """The current (A) at which a current density `density` (A/m² per ampere) reaches a `limit` (A/m²)."""
    return limit / density


def coupling(inductance: Floats) -> Floats:
    """Coupling factors (c, c) of an inductance matrix (c, c) H: M / √(L₁ L₂)."""
    size = np.sqrt(np.diag(inductance))
    factors: Floats = inductance / np.outer(size, size)
    return factors
