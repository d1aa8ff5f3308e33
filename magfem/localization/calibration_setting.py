"""A calibration's samples, known motions and nominal sensors, as arrays that belong together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.localization.calibration_fit import Readings
from magfem.localization.calibration_readings import FINDABLE, Layout, Motion, Unknowns
from magfem.localization.orientation import upright_frame
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.localization.sensor import Sensor, SensorArray, Sensors, is_one
from magfem.localization.signal import demodulate
from magfem.typing import ArrayLike, Floats, Points

FEWEST_SAMPLES = 6  # on each axis of a sensor, and half of what was taken


def checked_samples(samples: ArrayLike, sensors: Sensors, array: SensorArray) -> Floats:
    """(k, s, n, 3)."""
    b = real_numbers(samples, SAMPLES)
    if is_one(sensors) and b.ndim == 3:
        b = b[:, None]
    if b.ndim != 4 or b.shape[1] != len(array.sensors) or b.shape[-1] != 3 or not b.size:
        expected = "(poses, n, 3)" if is_one(sensors) else f"(poses, {len(array.sensors)}, n, 3)"
        raise InputError(f"samples of a calibration must be {expected}, got {np.shape(samples)}")
    return b


def carried(poses: RigidTransform | Sequence[RigidTransform] | None) -> tuple[int, ...]:
    return () if poses is None or (isinstance(poses, RigidTransform) and poses.single) else (len(poses),)


def setting(
    array: SensorArray,
    count: int,
    positions: ArrayLike,
    axes: ArrayLike,
    phase: ArrayLike | None,
    static: ArrayLike | None,
    sensor_poses: RigidTransform | Sequence[RigidTransform] | None,
    find: frozenset[str],
) -> tuple[Layout, Motion, Unknowns]:
    """What is to be found, how things move, and what everything nominally is."""
    if strange := sorted(find - set(FINDABLE)):
        raise InputError(f"find has {strange[0]!r}; it can have {', '.join(FINDABLE)}")
    if not find:
        raise InputError(f"find is empty; it can have {', '.join(FINDABLE)}")
    if "phase" in find and phase is None:
        raise InputError('find has "phase", a number added to stated phases: state them, or leave it out')
    if "rotor" in find and (np.ndim(positions) != 1 or np.ndim(axes) != 1):
        raise InputError('find has "rotor", which is for one at rest: give one position (3,) and one axis (3,)')
    place = _rows(positions, (count, 3), "positions", "m")
    axis = _rows(axes, (count, 3), "axes", "")
    if not np.linalg.norm(axis, axis=-1).all():
        raise InputError("axes must not be zero")
    turned = np.zeros(count) if phase is None else _rows(phase, (count,), "phase", "rad")
    field = np.zeros(3) if static is None else _rows(static, (3,), "static", "T")
    layout = Layout(
        sensors=len(array.sensors),
        poses=count,
        find=find,
        background=static is None and "offset" in find,
        each_phase=phase is None,
    )
    motion = Motion(*_carriers(sensor_poses, count), array.axes)
    unknowns = Unknowns(
        matrix=array.gains,
        gain=array.gains,
        place=array.positions,
        offset=np.array([one.offset for one in array.sensors], dtype=float),
        static=field,
        moment=1.0,
        rotor=place,
        upright=upright_frame(axis),
        phase=turned,
    )
    return layout, motion, unknowns


def _rows(value: ArrayLike, shape: tuple[int, ...], name: str, unit: str) -> Floats:
    words = f"{name} must be numbers {shape} {unit}".rstrip()
    given = real_numbers(value, words)
    try:
        found = np.broadcast_to(given, shape)
    except ValueError:
        raise InputError(f"{words}, got {given.shape}") from None
    if not np.isfinite(found).all():
        raise InputError(f"{name} must be finite numbers")
    return found


def _carriers(poses: RigidTransform | Sequence[RigidTransform] | None, count: int) -> tuple[Points, Floats]:
    if poses is None:
        return np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3))
    several = [poses] if isinstance(poses, RigidTransform) and poses.single else list(poses)
    if not all(isinstance(one, RigidTransform) and one.single for one in several) or len(several) not in (1, count):
        raise InputError(f"sensor_poses must be {count} RigidTransforms, one for each pose, got {len(several)}")
    places = np.array([one.translation for one in several])
    axes = np.array([one.rotation.as_matrix() for one in several])
    return np.broadcast_to(places, (count, 3)), np.broadcast_to(axes, (count, 3, 3))


def measured_readings(
    b: Floats, times: ArrayLike, frequency: float, array: SensorArray, layout: Layout
) -> tuple[Readings, Floats]:
    """Readings of samples (k, s, n, 3), and the noise (s, 3) T of a sample, where not stated found from all poses."""
    k, s, n, _ = b.shape
    t = real_numbers(times, TIMES)
    if t.shape not in ((n,), (k, n)):
        raise InputError(f"times must be ({n},) or ({k}, {n}) s for samples {b.shape}, got {t.shape}")
    first = 0 if layout.static_used else 3
    values, whitening, noise = np.zeros((k, s, 9)), np.zeros((k, s, 9 - first, 9 - first)), np.zeros((s, 3))
    for j, one in enumerate(array.sensors):
        usable = (~np.isnan(b[:, j]) & (np.abs(b[:, j]) < one.saturation)).sum(axis=1).min(axis=-1)
        used = np.flatnonzero(usable >= max(FEWEST_SAMPLES, n / 2))
        if not used.size:
            continue
        own = t if t.ndim == 1 else t[used]
        found, covariance, left = _demodulated(b[used, j], own, frequency, one, one.noise)
        if one.noise is None:  # all poses share one noise
            left = np.sqrt(np.mean(left**2, axis=0))
            found, covariance, left = _demodulated(b[used, j], own, frequency, one, left)
        noise[j] = np.sqrt(np.mean(left**2, axis=0))
        values[used, j] = found
        whitening[used, j] = np.linalg.inv(np.linalg.cholesky(covariance[:, first:, first:]))
    return Readings(values, whitening), noise


def _demodulated(
    b: Floats, t: Floats, frequency: float, sensor: Sensor, noise: ArrayLike | None
) -> tuple[Floats, Floats, Floats]:
    """(k, 9), (k, 9, 9) and noise (k, 3) of one sensor's samples (k, n, 3) at times (n,) or (k, n)."""
    resolution = 0.0 if sensor.noise is None else sensor.resolution  # noise that is found has it already
    pieces = [(b, t)] if t.ndim == 1 else zip(b[:, None], t, strict=True)
    fields = [
        demodulate(part, when, frequency, noise=noise, resolution=resolution, saturation=sensor.saturation)
        for part, when in pieces
    ]
    return (
        np.concatenate([np.concatenate([one.static, one.cosine, one.sine], axis=-1) for one in fields]),
        np.concatenate([one.joint_covariance for one in fields]),
        np.concatenate([one.noise for one in fields]),
    )
