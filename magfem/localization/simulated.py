"""Samples as sensors would take them of a rotor that turns."""

from __future__ import annotations

import numpy as np

from magfem.errors import InputError
from magfem.localization.orientation import orientation
from magfem.localization.real_numbers import real_numbers
from magfem.localization.rotor import Model, as_rotor
from magfem.localization.sensor import Sensors, as_sensors, is_one
from magfem.typing import ArrayLike, Floats, Outside


def simulated_samples(
    model: Model,
    position: ArrayLike,
    axis: ArrayLike,
    times: ArrayLike,
    frequency: float,
    sensors: Sensors = None,
    *,
    phase: ArrayLike = 0.0,
    static: ArrayLike = (0.0, 0.0, 0.0),
    seed: int | np.random.Generator = 0,
    outside: Outside = "raise",
) -> Floats:
    """Samples (..., n, 3) T of one sensor, (..., sensors, n, 3) of a sequence of them, in their own frames.

    The whole field of the rotor, turned to where it is at every single time, with all that is not a pure sinusoid.
    position (..., 3) m, axis (..., 3), phase (...) rad: as in `Pose`; they broadcast.  times: (n,) s.  frequency: Hz.
    static: (3,) T, in the common frame.  Gaussian noise, rounding and clipping are those of the sensors.  outside: what
    happens where a sensor lies outside the region that the model holds in, as in `Field`.

    Raises InputError for arrays of other shapes, OutsideRegionError as `outside` says.
    """
    rotor, array = as_rotor(model), as_sensors(sensors)
    words = "simulated samples need times (n,), a position (..., 3), an axis (..., 3), a phase (...) and a static (3,)"
    instants, place, upright, turned, steady = (
        real_numbers(one, words) for one in (times, position, axis, phase, static)
    )
    if instants.ndim != 1 or place.shape[-1:] != (3,) or upright.shape[-1:] != (3,) or steady.shape != (3,):
        raise InputError(words)
    try:
        np.broadcast_shapes(place.shape[:-1], upright.shape[:-1], turned.shape)
    except ValueError:
        raise InputError(
            f"positions {place.shape}, axes {upright.shape} and phases {turned.shape} do not fit each other"
        ) from None
    rate = real_numbers(frequency, "the frequency of simulated samples must be one number in Hz")
    if rate.ndim or not all(np.isfinite(one).all() for one in (rate, instants, place, upright, turned, steady)):
        raise InputError("simulated samples need finite numbers, and one frequency in Hz")
    if not np.linalg.norm(upright, axis=-1).all():
        raise InputError("an axis must have a direction, got one of length zero")
    try:
        generator = np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise InputError(f"seed must be a whole number, not negative, or a numpy Generator, got {seed!r}") from None
    angles = turned[..., None] + 2 * np.pi * rate * instants  # (..., n)
    frames = orientation(upright[..., None, :], angles)[..., None, :, :, :]  # (..., 1, n, 3, 3)
    away = array.positions - place[..., None, :]  # (..., s, 3)
    seen = np.einsum("...nij,...ni->...nj", frames, np.broadcast_to(away[..., None, :], _shape(away, frames)))
    B = np.einsum("...nij,...nj->...ni", frames, rotor.field.B(seen, outside))
    local = np.einsum("sij,...sni->...snj", array.axes, B + steady)
    samples = np.stack([one.readings(local[..., k, :, :]) for k, one in enumerate(array.sensors)], axis=-3)
    noise = np.array([np.zeros(3) if one.noise is None else one.noise for one in array.sensors])
    if noise.any():
        samples = samples + noise[:, None, :] * generator.standard_normal(samples.shape)
    for k, one in enumerate(array.sensors):
        own = samples[..., k, :, :]
        if one.resolution > 0:
            own[...] = one.resolution * np.round(own / one.resolution)
        np.clip(own, -one.saturation, one.saturation, out=own)
    return samples[..., 0, :, :] if is_one(sensors) else samples


def _shape(away: Floats, frames: Floats) -> tuple[int, ...]:
    """(..., s, n, 3) of displacements (..., s, 3) under frames (..., 1, n, 3, 3)."""
    lead = np.broadcast_shapes(away.shape[:-2], frames.shape[:-4])
    return (*lead, away.shape[-2], frames.shape[-3], 3)
