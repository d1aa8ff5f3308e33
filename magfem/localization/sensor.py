"""Three-axis magnetic sensors: where they are, how they read, how well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.localization.real_numbers import real_numbers
from magfem.typing import ArrayLike, Floats, Vectors

MOST_NOISE = 100.0
"""T: a noise or a step beyond it is in another unit."""


def stated_deviation(noise: ArrayLike, name: str) -> Floats:
    """(3,) T of one standard deviation, or of three. Raises InputError for what is none, beginning with `name`."""
    words = f"{name} must be one or three standard deviations in T"
    sigma = real_numbers(noise, words)
    if sigma.shape not in ((), (3,)) or not np.all((sigma >= 0) & (sigma <= MOST_NOISE)):
        raise InputError(f"{words}, got {noise!r}")
    return np.broadcast_to(sigma, (3,)).copy()


def stated_step(resolution: float, name: str) -> float:
    """T, the step of readings. Raises InputError for what is none, beginning with `name`."""
    words = f"{name} must be a step in T, or zero"
    step = real_numbers(resolution, words)
    if step.ndim or not 0 <= step <= MOST_NOISE:
        raise InputError(f"{words}, got {resolution!r}")
    return float(step)


def stated_limit(saturation: float, name: str) -> float:
    """T, where readings end. Raises InputError for what is no limit, beginning with `name`."""
    words = f"{name} must be a positive field in T"
    limit = real_numbers(saturation, words)
    if limit.ndim or not limit > 0:
        raise InputError(f"{words}, got {saturation!r}")
    return float(limit)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensor:
    """A three-axis sensor; it reads gain @ B + offset of the field B (3,) T in its own frame.

    pose: maps its frame to the common one.  noise: standard deviation of a sample, T, one number or (3,) for its axes;
    None where it is to be found from the data.  resolution: T, the step that readings are rounded to.  saturation: T,
    readings at or beyond it are not believed.  gain: (3, 3), sensitivities and cross axes.  offset: (3,) T.

    Raises InputError for what no sensor can be.
    """

    pose: RigidTransform = field(default_factory=RigidTransform.identity)
    noise: ArrayLike | None = None
    resolution: float = 0.0
    saturation: float = np.inf
    gain: ArrayLike = field(default_factory=lambda: np.eye(3))
    offset: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not isinstance(self.pose, RigidTransform) or not self.pose.single:
            raise InputError("sensor: pose must be one scipy.spatial.transform.RigidTransform")
        if self.noise is not None:
            object.__setattr__(self, "noise", stated_deviation(self.noise, "sensor: noise"))
        object.__setattr__(self, "resolution", stated_step(self.resolution, "sensor: resolution"))
        object.__setattr__(self, "saturation", stated_limit(self.saturation, "sensor: saturation"))
        for name, shape in (("gain", (3, 3)), ("offset", (3,))):
            value = real_numbers(getattr(self, name), f"sensor: {name} must be {shape} finite numbers")
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f"sensor: {name} must be {shape} finite numbers")
            object.__setattr__(self, name, value)
        if abs(np.linalg.det(np.asarray(self.gain))) < 1e-6:
            raise InputError("sensor: gain cannot be undone: its axes must not lie in a plane")

    @cached_property
    def place(self) -> Floats:
        """(3,) m, of the pose."""
        return np.asarray(self.pose.translation)

    @cached_property
    def axes(self) -> Floats:
        """(3, 3), its axes as columns in the common frame."""
        return np.asarray(self.pose.rotation.as_matrix())

    def readings(self, B: Vectors) -> Vectors:
        """What the sensor reads, without noise and rounding, of fields B (..., 3) T in its own frame."""
        return np.asarray(B @ np.asarray(self.gain).T + self.offset)


Sensors: TypeAlias = Sensor | RigidTransform | Sequence[Sensor | RigidTransform | Sequence[float]] | Floats | None
"""One sensor or several. A pose, or a place (3,) m, stands for a sensor of which nothing else is known; places (s, 3) m
for several, their axes those of the common frame; None for one at the origin."""


@dataclass(frozen=True, eq=False)
class SensorArray:
    """Sensors as arrays: positions (s, 3) m and axes (s, 3, 3), their columns in the common frame."""

    sensors: tuple[Sensor, ...]
    positions: Floats
    axes: Floats

    @property
    def gains(self) -> Floats:
        """(s, 3, 3)."""
        return np.array([one.gain for one in self.sensors])


def as_sensors(sensors: Sensors) -> SensorArray:
    """Sensors as arrays. Raises InputError for what are none."""
    if sensors is None:
        return as_sensors(Sensor())
    if isinstance(sensors, Sensor | RigidTransform):
        sensors = [sensors] if is_one(sensors) else list(sensors)  # type: ignore[arg-type]
    elif isinstance(sensors, str) or np.ndim(np.asarray(sensors, dtype=object)) == 0:
        raise _no_sensors()
    elif is_one(sensors):
        sensors = [sensors]
    found = tuple(_as_sensor(one) for one in sensors)
    if not found:
        raise _no_sensors()
    return SensorArray(
        found,
        np.array([one.place for one in found]),
        np.array([one.axes for one in found]),
    )


def _as_sensor(one: object) -> Sensor:
    if isinstance(one, Sensor):
        return one
    if isinstance(one, RigidTransform):
        return Sensor(pose=one)
    try:
        place = np.asarray(one, dtype=float)
    except (TypeError, ValueError):
        raise _no_sensors() from None
    if place.shape != (3,) or not np.isfinite(place).all():
        raise _no_sensors()
    return Sensor(pose=RigidTransform.from_translation(place))


def _no_sensors() -> InputError:
    return InputError("sensors must be a Sensor, a pose (RigidTransform), a place (3,) in m, or a sequence of these")


def is_one(sensors: Sensors) -> bool:
    """Whether `sensors` stands for one sensor, whose samples have no axis of sensors."""
    if isinstance(sensors, RigidTransform):
        return bool(sensors.single)
    if sensors is None or isinstance(sensors, Sensor):
        return True
    return len(sensors) == 3 and all(isinstance(one, float | int | np.number) for one in sensors)
