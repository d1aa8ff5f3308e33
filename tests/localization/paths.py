"""Paths of a motor past two sensors, and samples of the windows along them, for the tests of tracking."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.localization import Rotor, Sensor, simulated_samples
from magfem.typing import Floats, Points, Vectors

TIMES = np.arange(40) / 20  # two seconds at 20 Hz
PAIR = [Sensor(pose=RigidTransform.from_translation([x, 0, 0]), noise=3e-6, resolution=1e-7) for x in (-0.01, 0.01)]


def helix(count: int) -> tuple[Points, Vectors]:
    """Two turns of 8 mm radius, rising from 20 to 32 mm above the sensors, the axis along the way."""
    u = np.linspace(0, 1, count)
    position = np.stack([8e-3 * np.cos(4 * np.pi * u), 8e-3 * np.sin(4 * np.pi * u), 20e-3 + 12e-3 * u], axis=-1)
    return position, unit(np.gradient(position, axis=0))


def sinusoid(count: int) -> tuple[Points, Vectors]:
    """Along x, 24 mm above, to and fro by 4 mm, the axis along the way."""
    u = np.linspace(0, 1, count)
    position = np.stack([30e-3 * (u - 0.5), 4e-3 * np.sin(4 * np.pi * u), np.full(count, 24e-3)], axis=-1)
    return position, unit(np.gradient(position, axis=0))


def cube(count: int) -> tuple[Points, Vectors]:
    """Seven edges of a cube of 14 mm, its axis held in one direction."""
    corners = np.array(
        [[-7, -7, 19], [7, -7, 19], [7, 7, 19], [-7, 7, 19], [-7, 7, 33], [7, 7, 33], [7, -7, 33], [-7, -7, 33]]
    )
    along = np.linspace(0, 7, count)
    edge = np.minimum(along.astype(int), 6)
    part = (along - edge)[:, None]
    return 1e-3 * (corners[edge] * (1 - part) + corners[edge + 1] * part), np.tile([0.6, 0.0, 0.8], (count, 1))


def smooth_random(count: int, seed: int) -> tuple[Points, Vectors]:
    """About 28 mm above the sensors, wandering by some mm, the axis by some ten degrees."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, count)[:, None]
    waves = [
        rng.normal(size=3) * [5e-3, 5e-3, 2e-3] / k * np.sin(2 * np.pi * (k * u + rng.uniform(size=3))) for k in (1, 2)
    ]
    position = np.array([0.0, 0.0, 28e-3]) + sum(waves)
    axis = rng.normal(size=3) + 0.4 * rng.normal(size=3) * np.sin(2 * np.pi * (u + rng.uniform(size=3)))
    return position, unit(axis)


def seen(rotor: Rotor, position: Points, axis: Vectors, sensors: list[Sensor], seed: int) -> Floats:
    """Samples (w, s, n, 3) of windows at each pose, each with a phase of its own."""
    phase = np.random.default_rng(seed + 1000).uniform(-np.pi, np.pi, len(position))
    return simulated_samples(rotor, position, axis, TIMES, 1.0, sensors, phase=phase, seed=seed)


def unit(vectors: Vectors) -> Vectors:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def degrees_between(a: Vectors, b: Vectors) -> Floats:
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
