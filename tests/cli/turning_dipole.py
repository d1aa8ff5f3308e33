"""Samples of dipoles that turn, by the formula of a dipole and nothing else of magfem, and their files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROTOR = Path(__file__).parents[2] / "fits" / "rotor_1x3.json"
MOMENT = 2.6e-3  # A·m², about that of the dissertation's rotor
EARTH = np.array([20e-6, -5e-6, 40e-6])  # T

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Turning:
    """position m, axis, phase rad, frequency Hz of a dipole that turns right-handed about its axis."""

    position: Sequence[float]
    axis: Sequence[float]
    phase: float = 0.4
    frequency: float = 0.5

    @property
    def unit(self) -> Array:
        return np.asarray(self.axis, dtype=float) / np.linalg.norm(self.axis)

    def moments(self, t: Array) -> Array:
        """Directions (n, 3): in the plane across the axis, from where the shortest turn takes x as it takes z to it."""
        a = self.unit
        v = np.cross([0.0, 0.0, 1.0], a)
        K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        turn = np.eye(3) + K + K @ K / (1 + a[2])
        angle = 2 * np.pi * self.frequency * np.asarray(t) + self.phase
        return np.cos(angle)[:, None] * turn[:, 0] + np.sin(angle)[:, None] * turn[:, 1]

    def field(self, place: Sequence[float], t: Array) -> Array:
        """B (n, 3) T at a place: µ₀/4π (3 (m·u) u − m)/r³."""
        away = np.asarray(place, dtype=float) - self.position
        r = np.linalg.norm(away)
        u, m = away / r, MOMENT * self.moments(t)
        return np.asarray(1e-7 * (3 * (m @ u)[:, None] * u - m) / r**3)


def write_dipole(path: Path) -> None:
    """A model file of a dipole along x: the rotor's, its higher harmonics none, the first by b = µ₀m/4πR³."""
    model = json.loads(ROTOR.read_text())
    (term,) = model["terms"]
    term["coefficients"] = [1e-7 * MOMENT / term["radius"] ** 3] + [0.0] * (len(term["coefficients"]) - 1)
    model["name"] = "dipole"
    path.write_text(json.dumps(model))


def write_samples(path: Path, t: Array, B: Array, header: str = "t,bx_uT,by_uT,bz_uT") -> None:
    """A CSV file of times (s) and fields (T) in µT."""
    np.savetxt(path, np.column_stack([t, 1e6 * B]), delimiter=",", header=header, comments="", fmt="%.17g")
