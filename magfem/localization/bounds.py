"""The Cramér–Rao bound of poses: what no unbiased estimate from these samples can beat.

The samples' noise is Gaussian, rounding adds step²/12 to its variance, and the static field is not known. Position and
axis do not depend on whether the frequency is: its error turns C and S within their plane, which is the phase's. For
noise of other shapes with the same variance the true bound is lower: Gaussian noise is the least favourable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.localization.orientation import orientation
from magfem.localization.real_numbers import real_numbers
from magfem.localization.refinement import information
from magfem.localization.rotor import Model, as_rotor
from magfem.localization.sensor import SensorArray, Sensors, as_sensors
from magfem.localization.signal import quadrature_covariance
from magfem.typing import ArrayLike, Booleans, Floats, Points

LARGEST_CONDITION = 1e10
"""Of the information, scaled; beyond, some direction of a pose is not told at all."""


@dataclass(frozen=True, eq=False)
class PoseBound:
    """The least covariance of poses, as `Pose.covariance` has it.

    seen_from: (3,) m, where distance and direction are told from: the middle of the sensors.  place: (..., 3) m.
    covariance: (..., 6, 6), of position in the common frame (m) and small turns about the rotor's axes (rad), infinite
    variances where `singular` (...): one sensor in the rotation plane or on the axis, or too far from everything.
    """

    seen_from: Points
    place: Points
    covariance: Floats
    singular: Booleans

    @property
    def position(self) -> Floats:
        """(...) m, root of the least mean square distance from the true position."""
        return np.asarray(np.sqrt(np.einsum("...ii->...", self.covariance[..., :3, :3])))

    @property
    def distance(self) -> Floats:
        """(...) m, along the line to the magnet."""
        towards, _ = self._sight
        return np.asarray(np.sqrt(np.einsum("...i,...ij,...j->...", towards, self.covariance[..., :3, :3], towards)))

    @property
    def direction(self) -> Floats:
        """(...) rad, of the line to the magnet."""
        towards, r = self._sight
        across = np.eye(3) - towards[..., :, None] * towards[..., None, :]
        return np.asarray(np.sqrt(np.einsum("...ij,...ji->...", across, self.covariance[..., :3, :3])) / r)

    @property
    def axis(self) -> Floats:
        """(...) rad, root of the least mean square angle from the true axis."""
        return np.asarray(np.sqrt(self.covariance[..., 3, 3] + self.covariance[..., 4, 4]))

    @property
    def phase(self) -> Floats:
        """(...) rad, with a known frequency, at the mean time of the samples."""
        return np.asarray(np.sqrt(self.covariance[..., 5, 5]))

    @property
    def _sight(self) -> tuple[Floats, Floats]:
        away = self.place - self.seen_from
        r = np.linalg.norm(away, axis=-1)
        return away / r[..., None], r


def pose_bound(
    model: Model,
    position: ArrayLike,
    axis: ArrayLike,
    sensors: Sensors,
    *,
    times: ArrayLike,
    frequency: float = 1.0,
) -> PoseBound:
    """The bound for a rotor at `position` (..., 3) m about `axis` (..., 3), which broadcast.

    sensors: as in `localize`, their noise stated.  times: (n,) s of the samples.  frequency: Hz. Raises InputError for
    a sensor whose noise is not stated, and samples that determine nothing.
    """
    rotor, array = as_rotor(model), as_sensors(sensors)
    words = "positions in m and axes must be finite numbers (..., 3), axes not zero"
    p, a = real_numbers(position, words), real_numbers(axis, words)
    if p.shape[-1:] != (3,) or a.shape[-1:] != (3,) or not (np.isfinite(p).all() and np.isfinite(a).all()):
        raise InputError(f"{words}, got {p.shape} and {a.shape}")
    if not np.linalg.norm(a, axis=-1).all():
        raise InputError(f"{words}, got an axis of length zero")
    try:
        p, a = np.broadcast_arrays(p, a)
    except ValueError:
        raise InputError(f"as many axes as positions, or one, are needed, got {a.shape} and {p.shape}") from None
    if not np.all(np.linalg.norm(p[..., None, :] - array.positions, axis=-1) > 0):
        raise InputError("a bound needs rotors that are not where a sensor is")
    said = information(rotor, array, p, orientation(a, np.zeros(p.shape[:-1])), whitening(array, times, frequency))
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", said), np.finfo(float).tiny))
    scaled = said / (size[..., :, None] * size[..., None, :])
    values, vectors = np.linalg.eigh(scaled)
    singular = np.asarray(~(values[..., 0] * LARGEST_CONDITION > values[..., -1]))
    values = np.where(singular[..., None], 1.0, values)
    covariance = np.einsum("...ik,...k,...jk->...ij", vectors, 1 / values, vectors)
    covariance = covariance / (size[..., :, None] * size[..., None, :])
    covariance = np.where(singular[..., None, None], np.where(np.eye(6, dtype=bool), np.inf, 0.0), covariance)
    return PoseBound(array.positions.mean(axis=0), p, covariance, singular)


def whitening(array: SensorArray, times: ArrayLike, frequency: float) -> Floats:
    """(s, 6, 6) of the true field's quadratures, in the sensors' frames."""
    found = []
    for one in array.sensors:
        if one.noise is None or not np.all(np.asarray(one.noise) > 0):
            raise InputError("a bound needs sensors whose noise is stated: Sensor(noise=3e-6)")
        covariance = quadrature_covariance(times, frequency, noise=one.noise, resolution=one.resolution)
        undo = np.kron(np.eye(2), np.linalg.inv(np.asarray(one.gain)))
        found.append(np.linalg.inv(np.linalg.cholesky(undo @ covariance @ undo.T)))
    return np.array(found)
