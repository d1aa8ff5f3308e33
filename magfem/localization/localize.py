"""`localize`: from samples of a turning magnet's field to its pose."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.fields import Field
from magfem.localization.branches import best_pose
from magfem.localization.dipole_pose import dipole_poses
from magfem.localization.frequency import Frequency, find_frequency
from magfem.localization.pose import Branch, Pose
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.localization.refinement import Measured, refine
from magfem.localization.rotor import Model, Rotor, as_rotor
from magfem.localization.sensor import SensorArray, Sensors, as_sensors, is_one
from magfem.localization.signal import RotatingField, demodulate, demodulate_several
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Booleans, Floats, Points

STARTING_SENSORS = 3
"""How many sensors, those with the strongest field, give four starts each."""

GIVEN_UP = 100.0
"""Above the least misfit, in squared deviations: branches as far behind are not followed to their end."""


def localize(
    samples: ArrayLike,
    times: ArrayLike,
    model: Model,
    frequency: ArrayLike | None = None,
    sensors: Sensors = None,
    *,
    near: ArrayLike | Branch | None = None,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
    drift: bool = False,
    swing: bool = False,
    strict: bool = True,
) -> Pose:
    """The pose of a magnet that turns, from samples of its field.

    samples: (..., n, 3) T of one sensor, in its frame; (..., s, n, 3) of a sequence of s sensors. NaN are missing.
    times: (n,) s; or (s, n), one sensor that is moved from place to place while the magnet goes on turning.
    model: of the magnet's field: a model, its name or file, or a `Rotor`.  frequency: Hz; None to find it.
    sensors: None, one, or a sequence: of `Sensor`, of poses in the common frame, or of places (3,) m in it.
    near: where the rotor is about, (..., 3) m, or an earlier or expected pose: the branch closest to it is taken among
    those that are about as likely. Without it, one sensor's branch is the one with z > 0 and the axis nearest to +z.
    rotation_axis: (3,), in the model's frame.  drift: the frequency changes steadily, from near `frequency`.
    swing: the magnet may turn unevenly, as one that follows the field of two unequal coils does: its swing twice a turn
    is found, by the third harmonic of the field, and undone. More than six samples a turn are needed.
    strict: raise ConvergenceError where a refinement did not converge, instead of telling by `converged`.

    The magnet turns right-handed about `axis`; its moment across the axis points along `moment_direction(t)`.
    Raises InputError for samples that do not determine a pose.
    """
    rotor, array = as_rotor(model, rotation_axis), as_sensors(sensors)
    with one_thread_for_algebra():
        b = _with_sensors(samples, sensors, array)
        fields = _demodulated(b, real_numbers(times, TIMES), array, frequency, drift, swing)
        return _located(fields, rotor, array, near, strict)


def localize_several(
    samples: ArrayLike,
    times: ArrayLike,
    models: Model | Sequence[Model],
    frequencies: Sequence[float] | Floats,
    sensors: Sensors = None,
    *,
    near: Sequence[ArrayLike | Branch | None] | None = None,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
    strict: bool = True,
) -> tuple[Pose, ...]:
    """The poses of several magnets that turn at different frequencies, seen by the same sensors at once.

    models: one for all of `frequencies` (m,) Hz, or one for each.  near: for each, or None.  Otherwise as `localize`.
    Raises InputError as well where the samples cannot tell the frequencies from each other.
    """
    if isinstance(models, str | os.PathLike | Rotor | Field):
        models = [models] * len(frequencies)
    prior = [None] * len(frequencies) if near is None else list(near)
    if not len(models) == len(prior) == len(frequencies):
        raise InputError(f"{len(frequencies)} frequencies need as many models and priors")
    array = as_sensors(sensors)
    with one_thread_for_algebra():
        b = _with_sensors(samples, sensors, array)
        each = [
            demodulate_several(
                b[..., k, :, :],
                times,
                frequencies,
                noise=one.noise,
                resolution=one.resolution,
                saturation=one.saturation,
            )
            for k, one in enumerate(array.sensors)
        ]
        return tuple(
            _located(tuple(of_sensor[j] for of_sensor in each), as_rotor(one, rotation_axis), array, where, strict)
            for j, (one, where) in enumerate(zip(models, prior, strict=True))
        )


def locate_field(
    fields: Sequence[RotatingField],
    model: Model,
    sensors: Sensors = None,
    *,
    near: ArrayLike | Branch | None = None,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
    strict: bool = True,
) -> Pose:
    """The pose from what each sensor saw, as `demodulate` gives it; otherwise as `localize`."""
    array = as_sensors(sensors)
    if len(fields) != len(array.sensors):
        raise InputError(f"{len(array.sensors)} sensors need as many fields, got {len(fields)}")
    with one_thread_for_algebra():
        return _located(tuple(fields), as_rotor(model, rotation_axis), array, near, strict)


def _with_sensors(samples: ArrayLike, sensors: Sensors, array: SensorArray) -> Floats:
    """Samples (..., s, n, 3)."""
    b = real_numbers(samples, SAMPLES)
    if is_one(sensors):
        if b.ndim < 2 or b.shape[-1] != 3:
            raise InputError(f"samples of one sensor must be (..., n, 3), got {b.shape}")
        return b[..., None, :, :]
    if b.ndim < 3 or b.shape[-1] != 3 or b.shape[-3] != len(array.sensors):
        raise InputError(
            f"samples of {len(array.sensors)} sensors must be (..., {len(array.sensors)}, n, 3), got {b.shape}"
        )
    return b


def _demodulated(
    b: Floats, times: Floats, array: SensorArray, frequency: ArrayLike | None, drift: bool, swing: bool
) -> tuple[RotatingField, ...]:
    """What each sensor saw of one motor: one frequency for all of them."""
    count = len(array.sensors)
    if times.ndim == 2 and times.shape[0] != count:
        raise InputError(f"times must be (n,) for all sensors or (sensors, n), got {times.shape} with {count} sensors")
    turning: ArrayLike | Frequency | None = frequency
    if frequency is None or drift or swing:
        if times.ndim == 2:
            raise InputError("state the frequency, and no drift or swing, for samples taken one sensor after another")
        full = np.abs(b) >= np.array([one.saturation for one in array.sensors])[:, None, None]
        columns = np.moveaxis(np.where(full, np.nan, b), -3, -2).reshape(*b.shape[:-3], b.shape[-2], 3 * count)
        noise = [one.noise for one in array.sensors if one.noise is not None and np.all(one.noise)]
        weight = 1 / np.concatenate(noise) ** 2 if len(noise) == count else None
        known = frequency is not None and not drift
        turning = find_frequency(columns, times, frequency, drift=drift, swing=swing, known=known, weight=weight)
    return tuple(
        demodulate(
            b[..., k, :, :],
            times if times.ndim == 1 else times[k],
            turning,
            noise=one.noise,
            resolution=one.resolution,
            saturation=one.saturation,
        )
        for k, one in enumerate(array.sensors)
    )


def _located(
    fields: tuple[RotatingField, ...], rotor: Rotor, array: SensorArray, near: ArrayLike | Branch | None, strict: bool
) -> Pose:
    measured = whitened(fields, array)
    position, frame, clamped = _starts(measured, rotor, array)
    repeated = Measured(measured.quadratures[..., None, :, :], measured.whitening[..., None, :, :, :])
    refined = refine(rotor, array, repeated, position, frame, GIVEN_UP)
    pose = best_pose(fields, rotor, array, measured, refined, clamped, near)
    if strict and not pose.converged.all():
        raise ConvergenceError(
            f"{np.count_nonzero(~pose.converged)} of {pose.converged.size} poses did not converge in "
            f"{int(pose.iterations.max())} steps, residuals up to {float(pose.residual[~pose.converged].max()):.3g} "
            "deviations; pass strict=False to see them all the same"
        )
    return pose


def whitened(fields: Sequence[RotatingField], array: SensorArray) -> Measured:
    """Quadratures and whitening of all sensors, their gains undone."""
    undo = np.linalg.inv(array.gains)
    both = np.zeros((len(undo), 6, 6))
    both[:, :3, :3] = both[:, 3:, 3:] = undo
    values = np.stack([np.concatenate([one.cosine, one.sine], axis=-1) for one in fields], axis=-2)
    covariance = np.stack([one.covariance for one in fields], axis=-3)
    values = np.einsum("sab,...sb->...sa", both, values)
    covariance = both @ covariance @ np.swapaxes(both, -1, -2)
    if not np.all(np.einsum("...ii->...i", covariance) > 0):
        raise InputError("the samples are all zero: there is no field to localize by")
    return Measured(values, np.linalg.inv(np.linalg.cholesky(covariance)))


def _starts(measured: Measured, rotor: Rotor, array: SensorArray) -> tuple[Points, Floats, Booleans]:
    """Closed-form poses (..., k, 3), (..., k, 3, 3) in the common frame, and whether each was clamped (..., k)."""
    values = measured.quadratures
    poses = dipole_poses(values[..., :3], values[..., 3:], rotor.moment)  # (..., s, 4, …)
    position = array.positions[:, None, :] + np.einsum("sij,...sbj->...sbi", array.axes, poses.position)
    frame = array.axes[:, None] @ poses.frame
    clamped = np.broadcast_to(poses.clamped[..., None], position.shape[:-1])
    if len(array.sensors) > STARTING_SENSORS:
        strength = np.linalg.norm(values, axis=-1)
        chosen = np.argsort(-strength, axis=-1)[..., :STARTING_SENSORS]
        position = np.take_along_axis(position, chosen[..., None, None], axis=-3)
        frame = np.take_along_axis(frame, chosen[..., None, None, None], axis=-4)
        clamped = np.take_along_axis(clamped, chosen[..., None], axis=-2)
    lead = values.shape[:-2]
    return position.reshape(*lead, -1, 3), frame.reshape(*lead, -1, 3, 3), clamped.reshape(*lead, -1)
