"""The field of a turning dipole, written out: the truth of many tests."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.constants import MU_0
from magfem.typing import Floats, Points, Vectors


def dipole_samples(
    position: Points,
    axis: Vectors,
    times: Floats,
    frequency: float = 1.0,
    moment: float = 2.6e-3,
    phase: float = 0.0,
    tilt: float = np.pi / 2,
    sensor: Points = (0.0, 0.0, 0.0),  # type: ignore[assignment]
) -> Floats:
    """(n, 3) T at `sensor`, of a moment that makes the angle `tilt` with the axis that it turns about.

    At phase zero its part across points where the shortest turn from +z to the axis takes +x.
    """
    axis = np.asarray(axis) / np.linalg.norm(axis)
    level = np.cross([0.0, 0.0, 1.0], axis)
    angle = np.arctan2(np.linalg.norm(level), axis[2])
    if np.linalg.norm(level) < 1e-12:
        upright = Rotation.identity() if axis[2] > 0 else Rotation.from_rotvec([np.pi, 0.0, 0.0])
    else:
        upright = Rotation.from_rotvec(angle * level / np.linalg.norm(level))
    start = upright.apply([np.sin(tilt), 0.0, np.cos(tilt)])
    turns = Rotation.from_rotvec((2 * np.pi * frequency * np.asarray(times) + phase)[:, None] * axis)
    m = moment * turns.apply(start)
    r = np.asarray(sensor) - np.asarray(position)
    d = np.linalg.norm(r)
    return MU_0 / (4 * np.pi) * (3 * r * (m @ r)[:, None] / d**5 - m / d**3)


def pose_at(beta: float, distance: float, generator: np.random.Generator) -> tuple[Points, Vectors]:
    """A random position (3,) m and axis (3,), the sensor at the origin `beta` rad above the rotation plane."""
    axis = generator.normal(size=3)
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, generator.normal(size=3))
    across /= np.linalg.norm(across)
    return -distance * (np.cos(beta) * across + np.sin(beta) * axis), axis
