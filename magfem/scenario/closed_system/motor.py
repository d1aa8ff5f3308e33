"""The motor in its tube: where it truly lies, and what sensors on the arm see of it while it turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.localization import Rotor, Sensor
from magfem.localization.orientation import orientation
from magfem.localization.sensor import SensorArray
from magfem.localization.stator_influence import Stator
from magfem.scenario.closed_system.network import Way
from magfem.typing import Floats, Points, Vectors

_WAVES = (23e-3, 41e-3, 9e-3)  # m, lengths of the waves that the motor's play follows along a tube
_YAW, _PITCH = np.radians(4.0), np.radians(2.0)


@dataclass(frozen=True, eq=False)
class TrueMotor:
    """position (3,) m of its centre, axis (3,), lateral: m that it lies to the left of the centre line."""

    position: Points
    axis: Vectors
    lateral: float


@dataclass(frozen=True, eq=False)
class Play:
    """How a motor of `diameter` (m) lies in a tube of `inner_diameter` (m): on the floor, somewhere, a little askew.

    phases: (3, 3) rad, of the waves along the tube that yaw, pitch and lateral place follow.
    """

    diameter: float
    inner_diameter: float
    phases: Floats

    def at(self, way: Way, s: float) -> TrueMotor:
        """The motor's centre at arc length `s` of a way."""
        room = 0.5 * (self.inner_diameter - self.diameter)
        waves = np.mean(np.sin(2 * np.pi * s / np.array(_WAVES) + self.phases), axis=1)
        tangent = way.tangent(s)
        left = np.array([-tangent[1], tangent[0], 0.0])
        yaw, pitch = _YAW * waves[0], _PITCH * waves[1]
        axis = np.cos(pitch) * (np.cos(yaw) * tangent + np.sin(yaw) * left) + np.sin(pitch) * np.array([0.0, 0.0, 1.0])
        lateral = 0.6 * room * float(waves[2])
        floor = -np.sqrt(room**2 - lateral**2)
        return TrueMotor(way.place(s) + lateral * left + np.array([0.0, 0.0, floor]), axis, lateral)


def turning_field(
    motor: TrueMotor, phase: float, rotor: Rotor, stator: Stator | None, array: SensorArray, turns: Floats
) -> Floats:
    """Samples (s, n, 3) T in the sensors' frames of the motor's field after `turns` (n,), without noise or offset.

    phase: rad, as in `Pose`. The stator's currents are those that the rotor follows: in phase with it.
    """
    R = orientation(motor.axis, np.asarray(phase))
    q = (array.positions - motor.position) @ R
    C, S, *_ = rotor.quadratures(q)
    if stator is not None:
        added = stator.quadratures(q)
        C, S = C + added[0], S + added[1]
    angle = 2 * np.pi * turns
    B = (
        np.cos(angle)[:, None] * C[:, None, :] + np.sin(angle)[:, None] * S[:, None, :]
    )  # (s, n, 3) in the rotor's frame
    return np.asarray(np.einsum("sij,snk,ik->snj", array.axes, B, R))


def read_by(sensors: tuple[Sensor, ...], field: Floats, generator: np.random.Generator) -> Floats:
    """Readings (s, n, 3) of fields (s, n, 3) T: with noise, rounded, full at saturation."""
    found = []
    for one, own in zip(sensors, field, strict=True):
        noise = np.zeros(3) if one.noise is None else np.asarray(one.noise)
        read = one.readings(own) + noise * generator.standard_normal(own.shape)
        if one.resolution > 0:
            read = one.resolution * np.round(read / one.resolution)
        found.append(np.clip(read, -one.saturation, one.saturation))
    return np.stack(found)
