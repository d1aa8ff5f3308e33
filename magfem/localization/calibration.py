"""Sensors' gains, axes, offsets and mountings from motions that are known.

Either a robot moves the rotor to known poses before sensors at rest, or it carries the sensors to known poses about a
rotor at rest, whose own pose may be unknown. What the readings can tell:

- Of one sensor they tell the matrix that takes the field on its nominal axes to its reading, nine numbers. Gain and
  mounting rotation are one product in it. It is split so that the gain is symmetric (see `gain_split`): the sensor's
  axes are then as near as a rotation can come to those it reads along. Only the product matters for localization.
- The rotor's moment and the scale of all gains are one product. The moment is that of the model, unless the gains'
  scale is known: because they are not to be found, or because the static field is stated, offsets are found, and the
  sensors are turned in it.
- An offset is told from the static field only where its sensor is turned in that field, or where the field is stated.
- The pose of a rotor at rest and the places of sensors are told apart only where the carrier is turned.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import ConvergenceError, InputError
from magfem.localization.calibration_fit import (
    CalibrationFit,
    Determined,
    Readings,
    determined,
    fit_unknowns,
    held_out,
    whitened_jacobian,
)
from magfem.localization.calibration_readings import Layout, Motion, Unknowns
from magfem.localization.calibration_setting import carried, checked_samples, measured_readings, setting
from magfem.localization.calibration_start import first_guess
from magfem.localization.gain_split import split_derivatives, split_gain
from magfem.localization.rotor import Model, Rotor, as_rotor
from magfem.localization.sensor import Sensor, SensorArray, Sensors, as_sensors
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Floats, Points, Vectors

FIND = ("gain", "rotation", "position", "offset")
WORSE = 1.5
"""Residuals of this many deviations are not noise alone: known poses or the rotor's model are less good than that."""


@dataclass(frozen=True, eq=False)
class SensorDeviation:
    """Standard deviations of what was found of one sensor; zero where it was not to be found.

    gain: (3, 3).  rotation: (3,) rad, small turns about the sensor's own axes.  position: (3,) m, in the frame that its
    pose is stated in.  offset: (3,) T.
    """

    gain: Floats
    rotation: Vectors
    position: Vectors
    offset: Vectors


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibrated sensors, and how far to trust them.

    sensors: with gain, offset and pose as found; poses are in the frame of those that were given.  deviations: one for
    each sensor.  names (p,), covariance (p, p): of all that was found, the sensors' gains (nine, row by row), rotations
    (rad), positions (m) and offsets (T) first.  static: (3,) T, the static field of everything but the rotor, in the
    common frame; NaN where no offsets were found.  moment: A·m², across the rotor's axis.  position (k, 3) m, axis
    (k, 3), phase (k,) rad: of the rotor, as known or as found.  noise: (s, 3) T of a sample.

    residual: root of the sum of squared residuals, each over its deviation, over the degrees of freedom: about one;
    residuals that a robust calibration trusts less count with their weight.
    misfit: (k, s), the root mean square at each pose, NaN where samples were too few to count.  weight: (k, s), below
    one where a robust calibration trusted a pose less.  held_out: (k, s) T, root mean square error with which a fit to
    all other poses predicts the quadratures of a pose.  condition: of the scaled problem.  freedom: degrees of freedom.
    """

    sensors: tuple[Sensor, ...]
    deviations: tuple[SensorDeviation, ...]
    names: tuple[str, ...]
    covariance: Floats
    static: Vectors
    moment: float
    position: Points
    axis: Vectors
    phase: Floats
    noise: Floats
    residual: float
    misfit: Floats
    weight: Floats
    held_out: Floats
    condition: float
    freedom: int
    converged: bool
    iterations: int

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to beware of, in words; empty when all is well."""
        said = []
        if not self.converged:
            said.append("the calibration did not converge")
        if self.residual > WORSE:
            said.append(
                f"residuals are {self.residual:.3g} times what the samples' noise explains: the known poses or the "
                "rotor's model are not that good, and deviations are at least as much larger"
            )
        if (left_out := int(np.isnan(self.misfit).sum())) > 0:
            said.append(f"{left_out} of {self.misfit.size} sets of samples were too few or saturated, and left out")
        return tuple(said)


@dataclass(frozen=True, eq=False)
class CalibrationBound:
    """What a calibration with these motions can reach, before it is made.

    untold: what it cannot determine, in words; empty for a good plan.  condition: of the scaled problem, infinite where
    something is untold.  deviations: the least standard deviations, for each sensor, of what is determined; infinite
    for what is not.
    """

    untold: tuple[str, ...]
    condition: float
    deviations: tuple[SensorDeviation, ...]


def calibrate(
    samples: ArrayLike,
    times: ArrayLike,
    model: Model,
    positions: ArrayLike,
    axes: ArrayLike,
    sensors: Sensors = None,
    *,
    frequency: float,
    phase: ArrayLike | None = None,
    static: ArrayLike | None = None,
    sensor_poses: RigidTransform | Sequence[RigidTransform] | None = None,
    find: Collection[str] = FIND,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
    robust: bool = False,
    strict: bool = True,
) -> Calibration:
    """Gains, mountings and offsets of sensors from samples at k known poses.

    samples: (k, n, 3) T of one sensor, (k, s, n, 3) of a sequence of s; NaN are missing.  times: (n,) s, from the same
    instant of each pose, or (k, n).  model: of the rotor.  positions: (k, 3) m, axes: (k, 3), of the rotor in the
    common frame; (3,) for one at rest.  sensors: as they are meant to be, where the search begins: places within about
    a third of the distance to the rotor.  frequency: Hz.
    phase: rad, at time zero, as in `Pose`; (k,) or one number; None where each pose has one of its own, unknown.
    static: (3,) T, the field of everything but the rotor, in the common frame; None to find it.
    sensor_poses: k poses of the carrier that the sensors are mounted on, in the common frame; the poses of `sensors`
    are then in the carrier's frame.
    find: what is not known, out of "gain", "rotation", "position", "offset" (of every sensor), "moment" (of the rotor),
    "rotor" (position and axis of one at rest; where it is about must be given) and "phase" (a number to be added to all
    stated phases). Static readings are used where offsets are found, and only there.
    robust: weigh poses less whose residuals are out of proportion (Huber).  strict: raise ConvergenceError instead of
    telling by `converged`.

    Raises InputError for arrays that do not belong together, and for what the readings do not determine, by its name.
    """
    rotor, array = as_rotor(model, rotation_axis), as_sensors(sensors)
    b = checked_samples(samples, sensors, array)
    layout, motion, start = setting(array, len(b), positions, axes, phase, static, sensor_poses, frozenset(find))
    with one_thread_for_algebra():
        measured, noise = measured_readings(b, times, frequency, array, layout)
        if not measured.used.any():
            raise InputError("no pose has samples enough: look at gaps and saturation")
        guess = first_guess(rotor, motion, start, layout, measured)
        fit = fit_unknowns(rotor, motion, guess, layout, measured, robust)
        told = determined(fit.jacobian, layout.names)
        if told.untold:
            raise InputError(_untold(told.untold, layout))
        if strict and not fit.converged:
            raise ConvergenceError(
                f"the calibration did not converge in {fit.iterations} steps: begin nearer to the truth, pass "
                "robust=True where some poses are wrong, or strict=False to see it all the same"
            )
        return _calibration(rotor, array, layout, motion, measured, noise, fit, told)


def calibration_bound(
    model: Model,
    positions: ArrayLike,
    axes: ArrayLike,
    sensors: Sensors,
    *,
    times: ArrayLike,
    frequency: float,
    phase: ArrayLike | None = None,
    static: ArrayLike | None = None,
    sensor_poses: RigidTransform | Sequence[RigidTransform] | None = None,
    find: Collection[str] = FIND,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
) -> CalibrationBound:
    """What motions that are planned will determine, and how well (Cramér–Rao); arguments as in `calibrate`.

    The sensors' noise must be stated. Raises InputError where it is not, and for arrays that do not belong together.
    """
    rotor, array = as_rotor(model, rotation_axis), as_sensors(sensors)
    for one in array.sensors:
        if one.noise is None or not np.all(np.asarray(one.noise) > 0):
            raise InputError("a bound needs sensors whose noise is stated: Sensor(noise=3e-6)")
    shapes = (
        np.shape(positions)[:-1],
        np.shape(axes)[:-1],
        () if phase is None else np.shape(phase),
        carried(sensor_poses),
    )
    poses = max((shape[0] for shape in shapes if shape), default=1)
    layout, motion, at = setting(array, poses, positions, axes, phase, static, sensor_poses, frozenset(find))
    with one_thread_for_algebra():
        nothing = np.zeros((poses, len(array.sensors), np.shape(times)[-1], 3))
        measured, _ = measured_readings(nothing, times, frequency, array, layout)
        _, J = whitened_jacobian(rotor, motion, at, layout, measured)
        told = determined(J, layout.names)
    _, covariance = _reported(layout, at, told.covariance)
    deviations = _deviations(layout, np.sqrt(np.diag(covariance)))
    unbounded = tuple(
        replace(
            one,
            **{
                name: np.full(np.shape(getattr(one, name)), np.inf)
                for name in {"gain", "rotation", "position", "offset"} & set(layout.find)
                if _name("gain" if name == "rotation" and "gain" in layout.find else name, j, layout) in told.untold
            },
        )
        for j, one in enumerate(deviations)
    )
    return CalibrationBound(told.untold, told.condition, unbounded)


def _calibration(
    rotor: Rotor,
    array: SensorArray,
    layout: Layout,
    motion: Motion,
    measured: Readings,
    noise: Floats,
    fit: CalibrationFit,
    told: Determined,
) -> Calibration:
    at, used = fit.unknowns, measured.used
    gain, mounting = _gain_and_mounting(layout, at)
    names, covariance = _reported(layout, at, told.covariance)
    sensors = tuple(
        replace(
            one,
            pose=RigidTransform.from_components(at.place[j], Rotation.from_matrix(motion.nominal[j] @ mounting[j].T)),
            gain=gain[j],
            offset=at.offset[j],
        )
        for j, one in enumerate(array.sensors)
    )
    square = np.einsum("ksa,ksa->ks", fit.residual, fit.residual)
    freedom = int(used.sum()) * fit.residual.shape[-1] - len(layout.names)
    plain = np.sqrt(square / fit.weight / fit.residual.shape[-1])  # as if it had not been trusted less
    return Calibration(
        sensors=sensors,
        deviations=_deviations(layout, np.sqrt(np.diag(covariance))),
        names=names,
        covariance=covariance,
        static=at.static if layout.static_used else np.full(3, np.nan),
        moment=at.moment * rotor.moment,
        position=at.rotor,
        axis=at.upright[..., 2],
        phase=np.asarray(np.angle(np.exp(1j * at.phase))),
        noise=noise,
        residual=float(np.sqrt((fit.weight * square).sum() / max(freedom, 1))),
        misfit=np.where(used, plain, np.nan),
        weight=fit.weight,
        held_out=held_out(fit, told.covariance, measured.whitening),
        condition=told.condition,
        freedom=freedom,
        converged=fit.converged,
        iterations=fit.iterations,
    )


def _gain_and_mounting(layout: Layout, at: Unknowns) -> tuple[Floats, Floats]:
    """Gains (s, 3, 3) and rotations U (s, 3, 3) from nominal axes to the sensor's own."""
    if {"gain", "rotation"} <= layout.find:
        return split_gain(at.matrix)
    if "rotation" in layout.find:
        return at.gain, np.linalg.inv(at.gain) @ at.matrix
    return at.matrix, np.broadcast_to(np.eye(3), at.matrix.shape)


def _reported(layout: Layout, at: Unknowns, covariance: Floats) -> tuple[tuple[str, ...], Floats]:
    """Names and covariance with gains and rotations apart, from that of the unknowns."""
    width, rest = len(layout.own), len(layout.common)
    split = {"gain", "rotation"} <= layout.find
    blocks = []
    for gain, turn in zip(*_gain_and_mounting(layout, at), strict=True):
        block = np.eye(width)
        if split:
            block = np.vstack([np.zeros((3, width)), block])
            block[:9, :9], block[9:12, :9] = split_derivatives(gain, turn)
            block[9:12, 9:] = 0.0
            block[12:, 9:] = np.eye(width - 9)
            block[12:, :9] = 0.0
        blocks.append(block)
    rows = sum(len(block) for block in blocks) + rest
    change = np.zeros((rows, covariance.shape[0]))
    row = 0
    for j, block in enumerate(blocks):
        change[row : row + len(block), j * width : (j + 1) * width] = block
        row += len(block)
    change[row:, layout.sensors * width :] = np.eye(rest)
    own = _own_parts(layout)
    names = [_name(part, j, layout) for j in range(layout.sensors) for part, size in own for _ in range(size)]
    return (*names, *layout.common), change @ covariance @ change.T


def _own_parts(layout: Layout) -> list[tuple[str, int]]:
    sizes = {"gain": 9, "rotation": 3, "position": 3, "offset": 3}
    return [(part, size) for part, size in sizes.items() if part in layout.find]


def _name(part: str, sensor: int, layout: Layout) -> str:
    return f"the {part} of " + (f"sensor {sensor}" if layout.sensors > 1 else "the sensor")


def _deviations(layout: Layout, deviation: Floats) -> tuple[SensorDeviation, ...]:
    found, column = [], 0
    for _ in range(layout.sensors):
        own: dict[str, Floats] = {
            "gain": np.zeros(9),
            **{one: np.zeros(3) for one in ("rotation", "position", "offset")},
        }
        for part, size in _own_parts(layout):
            own[part] = deviation[column : column + size]
            column += size
        found.append(SensorDeviation(own["gain"].reshape(3, 3), own["rotation"], own["position"], own["offset"]))
    return tuple(found)


def _untold(names: tuple[str, ...], layout: Layout) -> str:
    """What to say, and to do, about what the readings do not determine."""
    has = {part for part in (*FIND, "static", "moment", "rotor") if any(part in name for name in names)}
    if "moment" in has:
        mend = 'moment and gains are one product: leave "moment" or "gain" out of find'
    elif {"offset", "static"} <= has and "gain" not in has:
        mend = 'turn the sensors in the static field, state static, or leave "offset" out of find'
    elif "rotor" in has and "position" in has:
        mend = 'turn the carrier of the sensors, or leave "rotor" or "position" out of find'
    else:
        mend = "add poses in other directions and of other orientations, or leave some of it out of find"
    listed = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    return f"the readings of {layout.poses} poses do not determine {listed}: {mend}"
