"""A turning rotor seen by one sensor at the origin: by turning the rotor itself, sample by sample."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def seen(field, position, orientation, times, frequency=1.0, phase=0.0):
    """Samples (n, 3) T of a rotor at `position` whose frame is `orientation`, then turned right-handed about its z."""
    turned = orientation * Rotation.from_rotvec(np.outer(2 * np.pi * frequency * times + phase, [0, 0, 1]))
    return turned.apply(field.B(turned.inv().apply(-np.asarray(position)), outside="extrapolate"))


def placed(rng, distance, theta):
    """A random pose (position, orientation) from which the sensor is seen `theta` rad above the plane of rotation."""
    orientation = Rotation.random(random_state=rng)
    azimuth = rng.uniform(0, 2 * np.pi)
    sensor = [np.cos(theta) * np.cos(azimuth), np.cos(theta) * np.sin(azimuth), np.sin(theta)]
    return -distance * orientation.apply(sensor), orientation


def degrees_between(one, other):
    """Angles between vectors (..., 3), exact for small ones."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), (one * other).sum(axis=-1)))
