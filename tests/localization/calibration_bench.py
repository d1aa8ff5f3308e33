"""A bench on paper: a dipole that turns, and sensors of known faults, by the textbook formula alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.localization import Sensor

EARTH = np.array([2e-5, -1e-5, 4e-5])  # T
TIMES = np.arange(200) / 20  # s
FREQUENCY = 1.03  # Hz: no whole turns, so that the static field and the quadratures are not told independently


def dipole(moment, away):
    """µ0/4π (3 (m·r) r/r⁵ − m/r³), T."""
    r = np.linalg.norm(away, axis=-1, keepdims=True)
    along = np.sum(moment * away, axis=-1, keepdims=True)
    return 1.25663706127e-6 / (4 * np.pi) * (3 * along * away / r**5 - moment / r**3)


def samples(moment, position, axis, phase, sensors, carriers=None, static=EARTH, noise=0.0, rng=None, times=TIMES):
    """(k, s, n, 3) T of a rotor with `moment` (across, along) at k positions and axes, by the formula, step by step."""
    k = max(len(np.atleast_2d(position)), len(carriers) if carriers else 1)
    position, axis = np.broadcast_to(position, (k, 3)), np.broadcast_to(axis, (k, 3))
    phase = np.broadcast_to(phase, k)
    read = np.empty((k, len(sensors), len(times), 3))
    for i in range(k):
        up = axis[i] / np.linalg.norm(axis[i])
        shortest, _ = Rotation.align_vectors([up], [[0, 0, 1]])
        angle = 2 * np.pi * FREQUENCY * times + phase[i]
        across = shortest.apply(np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)]))
        for j, one in enumerate(sensors):
            pose = one.pose if carriers is None else carriers[i] * one.pose
            field = dipole(moment[0] * across + moment[1] * up, pose.translation - position[i])
            local = pose.rotation.inv().apply(field + static)
            read[i, j] = local @ np.asarray(one.gain).T + one.offset
    return read if rng is None else read + noise * rng.standard_normal(read.shape)


def around(rng, count, nearest=0.018, farthest=0.032):
    """(count, 3) m in all directions."""
    place = rng.normal(size=(count, 3))
    return place * (rng.uniform(nearest, farthest, count) / np.linalg.norm(place, axis=-1))[:, None]


def units(rng, count):
    """(count, 3)."""
    vector = rng.normal(size=(count, 3))
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def faulty(rng, place, noise=None):
    """A sensor with 5 % of gain and cross axes, mounted a millimetre and six degrees off, 20 µT of offset."""
    gain = np.eye(3) + 0.05 * rng.normal(size=(3, 3))
    turn = Rotation.from_rotvec(0.1 * rng.normal(size=3))
    return Sensor(
        pose=RigidTransform.from_components(np.asarray(place) + 1e-3 * rng.normal(size=3), turn),
        gain=0.5 * (gain + gain.T),
        offset=2e-5 * rng.normal(size=3),
        noise=noise,
    )


def nominal(place, noise=None):
    return Sensor(pose=RigidTransform.from_translation(place), noise=noise)


def off_by(found, true):
    """How far a sensor is off: gain, rotation rad, position m, offset T."""
    turn = true.pose.rotation.inv() * found.pose.rotation
    return (
        np.abs(np.asarray(found.gain) - true.gain).max(),
        turn.magnitude(),
        np.linalg.norm(found.pose.translation - true.pose.translation),
        np.abs(np.asarray(found.offset) - true.offset).max(),
    )
