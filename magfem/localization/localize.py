"""`localize`: from samples of a turning magnet's field to its pose."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.fields import Field
from magfem.localization.dipole_pose import dipole_poses
from magfem.localization.frequency import Frequency, find_frequency
from magfem.localization.orientation import phase_of
from magfem.localization.pose import Branch, Pose
from magfem.localization.refinement import Measured, Refined, refine
from magfem.localization.rotor import Model, Rotor, as_rotor
from magfem.localization.sensor import SensorArray, Sensors, as_sensors, is_one
from magfem.localization.signal import RotatingField, demodulate, demodulate_several
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Points

MOST_BRANCHES = 4
STARTING_SENSORS = 3
"""How many sensors, those with the strongest field, give four starts each."""

AS_LIKELY = 3.0
"""Branches are about as likely when their log likelihoods differ by less: a factor of twenty."""

GIVEN_UP = 100.0
"""Above the least misfit, in squared deviations: branches as far behind are not followed to their end."""

PLAUSIBLE = 10.0
"""Within this log likelihood of the best a branch may be preferred for lying near where the rotor was."""


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
        fields = _demodulated(b, np.asarray(times, dtype=float), array, frequency, drift, swing)
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
    try:
        b = np.asarray(samples, dtype=float)
    except (TypeError, ValueError):
        raise InputError("samples must be real numbers (..., n, 3) in T") from None
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
        known = all(one.noise is not None for one in array.sensors)
        weight = None
        if known:
            noise = np.concatenate([np.asarray(one.noise, dtype=float) for one in array.sensors])
            weight = 1 / np.maximum(noise, np.finfo(float).tiny) ** 2 if noise.all() else None
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
    pose = _pose(fields, rotor, array, measured, refined, clamped, near)
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


def _pose(
    fields: tuple[RotatingField, ...],
    rotor: Rotor,
    array: SensorArray,
    measured: Measured,
    refined: Refined,
    clamped: Booleans,
    near: ArrayLike | Branch | None,
) -> Pose:
    # log det of the covariance is −2 log det of its whitening, a triangular matrix.
    log_determinant = -2 * np.log(np.abs(np.einsum("...saa->...sa", measured.whitening))).sum(axis=(-2, -1))
    constant = -0.5 * (log_determinant + 6 * len(fields) * np.log(2 * np.pi))
    log_likelihood = constant[..., None] - 0.5 * refined.misfit
    # What was given up is no branch; where nothing converged, all that there is must do.
    ended = refined.converged | ~refined.converged.any(axis=-1, keepdims=True)
    log_likelihood = np.where(ended, log_likelihood, -np.inf)
    order, distinct = _ranked(refined, log_likelihood, near)
    kept = int(min(MOST_BRANCHES, distinct.sum(axis=-1).max()))
    order, distinct = order[..., :kept], np.take_along_axis(distinct, order, axis=-1)[..., :kept]

    position = np.take_along_axis(refined.position, order[..., None], axis=-2)
    frame = np.take_along_axis(refined.frame, order[..., None, None], axis=-3)
    information = np.take_along_axis(refined.information, order[..., None, None], axis=-3)
    likelihood = np.where(distinct, np.take_along_axis(log_likelihood, order, axis=-1), -np.inf)
    covariance = _covariance(information, fields[0])
    phase = phase_of(frame)
    branches = tuple(
        Branch(position[..., k, :], frame[..., k, :, 2], phase[..., k], covariance[..., k, :, :], likelihood[..., k])
        for k in range(kept)
    )
    best = branches[0]
    others = likelihood[..., 1:].max(axis=-1, initial=-np.inf)
    one = len(fields) == 1
    away = np.einsum("...ij,...si->...sj", frame[..., 0, :, :], array.positions - best.position[..., None, :])
    first = order[..., :1]
    misfit = np.take_along_axis(refined.misfit, first, axis=-1)[..., 0]
    return Pose(
        best.position,
        best.axis,
        best.phase,
        best.covariance,
        best.log_likelihood,
        branches=branches,
        turning=fields[0].turning,
        fields=fields,
        ambiguous=np.asarray(others > best.log_likelihood - AS_LIKELY),
        singular=np.asarray(
            _singular(best, away[..., 0, :], np.asarray(clamped.any(axis=-1)))
            if one
            else np.zeros(misfit.shape, dtype=bool)
        ),
        inside=np.asarray(rotor.region.contains(away).all(axis=-1)),
        converged=np.take_along_axis(refined.converged, first, axis=-1)[..., 0],
        iterations=np.take_along_axis(refined.iterations, first, axis=-1)[..., 0],
        residual=np.sqrt(misfit / (6 * len(fields))),
    )


def _ranked(refined: Refined, log_likelihood: Floats, near: ArrayLike | Branch | None) -> tuple[Integers, Booleans]:
    """The order (..., k) of the candidates, best first, and which of them (..., k) are no repetitions of a better one.

    Log likelihoods are compared in steps of a tenth, so that rounding does not order what is equal.
    """
    position, axis = refined.position, refined.frame[..., 2]
    best = log_likelihood.max(axis=-1, keepdims=True)
    behind = np.floor((best - log_likelihood) / 0.1 + 1e-6)
    if near is None:
        prefer = -np.sign(position[..., 2]) + 0.1 * (1 - axis[..., 2])
    else:
        where = near.position if isinstance(near, Branch) else np.asarray(near, dtype=float)
        if where.shape[-1:] != (3,) or not np.isfinite(where).all():
            raise InputError("near must be positions (..., 3) in m, or a pose")
        size = np.linalg.norm(position, axis=-1)
        prefer = np.linalg.norm(position - where[..., None, :], axis=-1) / np.maximum(size, 1e-12)
        if isinstance(near, Branch):
            prefer = prefer + np.linalg.norm(axis - near.axis[..., None, :], axis=-1)
        behind = np.where(best - log_likelihood < PLAUSIBLE, 0.0, behind)
    order = np.lexsort((prefer, behind), axis=-1)
    sorted_position = np.take_along_axis(position, order[..., None], axis=-2)
    sorted_axis = np.take_along_axis(axis, order[..., None], axis=-2)
    size = np.linalg.norm(sorted_position, axis=-1)[..., :, None]
    same = np.linalg.norm(sorted_position[..., :, None, :] - sorted_position[..., None, :, :], axis=-1) < 1e-4 * size
    same &= np.linalg.norm(sorted_axis[..., :, None, :] - sorted_axis[..., None, :, :], axis=-1) < 1e-3
    repeated = np.any(np.tril(same, -1), axis=-1) | np.isinf(np.take_along_axis(log_likelihood, order, axis=-1))
    # Repetitions go to the end.
    last = np.argsort(repeated, axis=-1, kind="stable")
    order = np.take_along_axis(order, last, axis=-1)
    distinct = np.empty(order.shape, dtype=bool)
    np.put_along_axis(distinct, order, ~np.take_along_axis(repeated, last, axis=-1), axis=-1)
    return order, distinct


def _covariance(information: Floats, field: RotatingField) -> Floats:
    """(..., k, 6, 6), with what an uncertain frequency adds to the phase at time zero."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", information), np.finfo(float).tiny))
    scaled = information / (size[..., :, None] * size[..., None, :])
    values, vectors = np.linalg.eigh(scaled)
    values = np.maximum(values, 1e-15)  # where information is singular, a covariance that is huge and finite
    covariance = np.einsum("...ik,...k,...jk->...ij", vectors, 1 / values, vectors)
    covariance = covariance / (size[..., :, None] * size[..., None, :])
    turning = field.turning
    covariance[..., 5, 5] += (2 * np.pi * turning.middle * np.asarray(turning.deviation))[..., None] ** 2
    return np.asarray(covariance)


def _singular(best: Branch, away: Points, clamped: Booleans) -> Booleans:
    """Whether β is within two of its deviations of 0 or 90°; `away` (..., 3) is the sensor in the rotor's frame."""
    towards = away / np.linalg.norm(away, axis=-1, keepdims=True)
    beta = np.arcsin(np.minimum(np.abs(towards[..., 2]), 1.0))
    deviation = best.axis_deviation
    return np.asarray(clamped | (beta < 2 * deviation) | (np.pi / 2 - beta < 2 * deviation))
