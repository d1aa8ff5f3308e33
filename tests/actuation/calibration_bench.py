"""Synthetic measurements of coil systems, made by the formula of MPEM files in tests/references, not by magfem."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from references.mpem_formula import coil_field

from magfem.samples import SystemSamples

OCTOMAG = yaml.safe_load(
    (Path(__file__).parents[2] / "geometries" / "systems" / "OctoMag_Calibration.yaml").read_text()
)
COILS = [f"Coil_{k}" for k in range(8)]
BACKGROUND = np.array([20e-6, -10e-6, 45e-6])  # T, as the Earth's
NOISE = 50e-6  # T
LARGEST = 10.0  # A


def unit_fields(points, content=OCTOMAG, coils=COILS):
    """(n, 3, c) T/A."""
    return np.stack([coil_field(points, content, coil) for coil in coils], axis=-1)


def grid(half=5e-3, count=5):
    """A cube about the origin. OctoMag's file has sources at the corners of ±10 mm: ±5 mm keeps away from them."""
    one = np.linspace(-half, half, count)
    return np.stack(np.meshgrid(one, one, one, indexing="ij"), axis=-1).reshape(-1, 3)


GRID = grid()
ON_GRID = unit_fields(GRID)


def octomag_samples(seed, per=8, noise=NOISE, sigma=None, response=lambda currents: currents, currents=None):
    """`per` rows at every point of the grid, random currents; `response`: what of them the field follows."""
    rng = np.random.default_rng(seed)
    if currents is None:
        currents = rng.uniform(-LARGEST, LARGEST, (per * len(GRID), 8))
    B = np.einsum("nac,nc->na", np.repeat(ON_GRID, per, axis=0), response(currents)) + BACKGROUND
    B += rng.normal(scale=noise, size=B.shape) if noise else 0.0
    return SystemSamples(np.repeat(GRID, per, axis=0), currents, B, sigma, "octomag.csv")


def saturating(coil, loss):
    """A response whose `coil` loses that share at the largest current: x = tanh(x)/x by bisection."""
    low, high = 1e-6, 3.0
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if 1 - np.tanh(middle) / middle < loss else (low, middle)

    def response(currents):
        followed = currents.copy()
        followed[:, coil] = LARGEST / low * np.tanh(low * currents[:, coil] / LARGEST)
        return followed

    return response
