"""What follows from the bound: where sensors see well, how quiet they must be, and where to put them.

The bound is proportional to the noise and to one over the root of the number of samples. A dipole's field falls with
the cube of the distance, so that directions, axes and the relative distance are told worse with its cube, and positions
with its fourth power.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import RigidTransform
from scipy.special import erfc

from magfem.errors import ConvergenceError, InputError
from magfem.localization.bounds import pose_bound, whitening
from magfem.localization.dipole_pose import dipole_poses
from magfem.localization.orientation import orientation
from magfem.localization.real_numbers import real_numbers
from magfem.localization.refinement import Measured, quadratures_at, refine
from magfem.localization.rotor import Model, Rotor, as_rotor
from magfem.localization.sensor import Sensor, SensorArray, Sensors, as_sensors
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Booleans, Floats, Points, Vectors

LEAST_GAIN = 1e-9  # of the objective, relative, at which placement ends
IMPROVED = 3  # starts
WELL_TOLD = (float(np.radians(25.0)), float(np.radians(75.0)))
"""rad: the β that one sensor tells well (6.1.3)."""


@dataclass(frozen=True, eq=False)
class Workspace:
    """How well a rotor is told at points (..., 3) m, over axes (k, 3).

    position, axis: (...) m and rad, medians over the axes of the bounds: with one sensor some axes are not told at all.
    worst_position, worst_axis: (...).  wrong_branch: (...) probability, the largest over the axes, that another branch
    fits the samples better; one half with a single sensor, for a branch that nothing tells apart.
    """

    points: Points
    axes: Vectors
    position: Floats
    axis: Floats
    worst_position: Floats
    worst_axis: Floats
    wrong_branch: Floats

    def within(self, position: float, axis: float, wrong_branch: float = 0.005) -> Booleans:
        """(...) whether these bounds (m, rad, probability) are kept in the median: the workspace."""
        return np.asarray((self.position <= position) & (self.axis <= axis) & (self.wrong_branch <= wrong_branch))


def workspace(
    model: Model,
    points: ArrayLike,
    sensors: Sensors,
    *,
    times: ArrayLike,
    frequency: float = 1.0,
    axes: ArrayLike | None = None,
) -> Workspace:
    """The workspace of sensors, whose noise must be stated, at `points` (..., 3) m.

    axes: (k, 3), directions that the rotor's axis may have; unless stated, twenty-four evenly over all directions.
    Raises InputError as `pose_bound` does.
    """
    rotor, array = as_rotor(model), as_sensors(sensors)
    place = real_numbers(points, "points must be finite numbers (..., 3) in m")
    along = _stated_axes(axes)
    with one_thread_for_algebra():
        bound = pose_bound(rotor, place[..., None, :], along, sensors, times=times, frequency=frequency)
        wrong = _wrong_branch(rotor, array, place, along, whitening(array, times, frequency))
    return Workspace(
        points=place,
        axes=along,
        position=np.median(bound.position, axis=-1),
        axis=np.median(bound.axis, axis=-1),
        worst_position=bound.position.max(axis=-1),
        worst_axis=bound.axis.max(axis=-1),
        wrong_branch=wrong,
    )


def _stated_axes(axes: ArrayLike | None) -> Vectors:
    """(k, 3): those stated, or twenty-four over all directions."""
    along = real_numbers(_AXES if axes is None else axes, "axes must be directions (k, 3)")
    if along.ndim != 2 or along.shape[1] != 3 or not len(along):
        raise InputError(f"axes must be directions (k, 3), got {along.shape}")
    return along


def _mean(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))


def _wrong_branch(rotor: Rotor, array: SensorArray, place: Points, axes: Vectors, white: Floats) -> Floats:
    """(...) the probability that noise makes another minimum of the misfit deeper than the true one, the worst axis'.

    Two poses whose quadratures lie d deviations apart are confused with probability ½ erfc(d/√8).
    """
    lead = place.shape[:-1]
    p = np.broadcast_to(place[..., None, :], (*lead, len(axes), 3)).reshape(-1, 3)
    a = np.broadcast_to(axes / np.linalg.norm(axes, axis=1, keepdims=True), (*lead, len(axes), 3)).reshape(-1, 3)
    frame = orientation(a, np.zeros(len(a)))
    seen = quadratures_at(rotor, array, p, frame)  # (n, s, 6)
    poses = dipole_poses(seen[..., :3], seen[..., 3:], rotor.moment)
    starts = (array.positions[:, None] + np.einsum("sij,nsbj->nsbi", array.axes, poses.position)).reshape(len(p), -1, 3)
    frames = (array.axes[:, None] @ poses.frame).reshape(len(p), -1, 3, 3)
    measured = Measured(seen[:, None], np.broadcast_to(white, (len(p), 1, *white.shape)))
    other = refine(rotor, array, measured, starts, frames)
    r = np.linalg.norm(p, axis=-1)[:, None]
    apart = np.linalg.norm(other.position - p[:, None], axis=-1) > 0.05 * r
    apart |= np.linalg.norm(other.frame[..., 2] - a[:, None], axis=-1) > 0.1
    separation = np.where(apart, other.misfit, np.inf).min(axis=-1)
    wrong = 0.5 * erfc(np.sqrt(separation / 8))
    return np.asarray(wrong.reshape(*lead, len(axes)).max(axis=-1))


def _all_directions() -> Floats:
    """(24, 3) unit vectors evenly over half of all directions, the other half their opposites.

    The corners of a truncated cuboctahedron, which a mirror or a quarter turn leaves as they are: maps about sensors
    that are arranged alike on both sides come out alike on both sides. None lies along or across a coordinate axis,
    where a sensor straight below would be blind.
    """
    corner = np.array([1.0, 1.0 + np.sqrt(2.0), 1.0 + 2.0 * np.sqrt(2.0)])
    signs = np.array([(1.0, y, z) for y in (1.0, -1.0) for z in (1.0, -1.0)])
    orders = np.array(list(permutations(range(3))))
    return np.asarray((signs[:, None] * corner[orders]).reshape(-1, 3) / np.linalg.norm(corner))


_AXES = _all_directions()
"""Axes of all directions: one and its opposite turn the same way round."""


def needed_noise(
    model: Model,
    distance: float,
    *,
    count: int,
    position: float = np.inf,
    axis: float = np.inf,
    beta: tuple[float, float] = WELL_TOLD,
) -> float:
    """T: the standard deviation of a sample of one sensor that errors at `distance` (m) ask for.

    position: m.  axis: rad.  Both are root mean squares over β (from, to, rad), of `count` evenly taken samples. Raises
    InputError where nothing is asked.
    """
    if not (np.isfinite(position) or np.isfinite(axis)):
        raise InputError("needed_noise: state the position error (m), the axis error (rad) or both")
    bound = _at_distance(model, distance, count, beta)
    return float(min(position / bound[0], axis / bound[1]))


def reach(
    model: Model,
    noise: float,
    *,
    count: int,
    position: float = np.inf,
    axis: float = np.inf,
    beta: tuple[float, float] = WELL_TOLD,
) -> float:
    """m: how far one sensor of `noise` (T) keeps `position` (m) and `axis` (rad); the inverse of `needed_noise`."""
    if not noise > 0:
        raise InputError(f"reach: noise must be a positive standard deviation in T, got {noise!r}")
    low, high = 5e-3, 10.0
    for _ in range(60):
        middle = np.sqrt(low * high)
        enough = needed_noise(model, middle, count=count, position=position, axis=axis, beta=beta) >= noise
        low, high = (middle, high) if enough else (low, middle)
    return float(low)


def _at_distance(model: Model, distance: float, count: int, beta: tuple[float, float]) -> tuple[float, float]:
    """Root-mean-square bounds of position (m) and axis (rad) for a noise of 1 T."""
    if not (distance > 0 and count > 3):
        raise InputError(f"a distance in m and more than three samples are needed, got {distance!r} and {count!r}")
    angles = np.linspace(beta[0], beta[1], 41)
    away = np.stack([np.cos(angles), np.zeros(angles.shape), np.sin(angles)], axis=-1)
    times = np.arange(count) / count  # one turn, evenly: what counts is their number
    bound = pose_bound(model, -distance * away, [0.0, 0.0, 1.0], Sensor(noise=1.0), times=times)
    return float(_mean(bound.position)), float(_mean(bound.axis))


@dataclass(frozen=True, eq=False)
class Placement:
    """Where sensors are best put.

    sensors: at their places.  objective: the root-mean-square (or worst) bound of the position there, m.  start: that
    of the best random start.  converged, iterations: of the search that ended there.
    """

    sensors: tuple[Sensor, ...]
    objective: float
    start: float
    converged: bool
    iterations: int


def place_sensors(
    model: Model,
    region: ArrayLike,
    count: int,
    low: ArrayLike,
    high: ArrayLike,
    *,
    noise: float,
    times: ArrayLike,
    frequency: float = 1.0,
    axes: ArrayLike | None = None,
    worst: bool = False,
    starts: int = 8,
    seed: int = 0,
    strict: bool = True,
) -> Placement:
    """Places of `count` sensors in the box from `low` to `high` (3,) m with the least bound of a rotor's position.

    region: (n, 3) m, where the rotor may be, about any of `axes` (k, 3).  noise: T, of every axis of every sensor
    alike, so that how a sensor is turned does not matter: turning it turns the noise, which looks the same.  worst:
    least of the largest bound instead of the root mean square.  starts: random ones; from the best three of them places
    are improved. A box without extent in a direction holds the sensors in a plane.

    Raises InputError for boxes and counts that are none, ConvergenceError unless `strict` is false.
    """
    rotor = as_rotor(model)
    points = real_numbers(region, "region must be points (n, 3) in m")
    lower, upper = (real_numbers(one, "low and high must be corners (3,) in m of a box") for one in (low, high))
    along = _stated_axes(axes)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(f"region must be points (n, 3) in m, got {points.shape}")
    if lower.shape != (3,) or upper.shape != (3,) or not np.all(lower <= upper):
        raise InputError("low and high must be corners (3,) in m of a box, low not above high")
    if count < 1 or starts < 1:
        raise InputError("place_sensors needs at least one sensor and one start")
    free = np.flatnonzero(upper > lower)
    if not free.size:
        raise InputError("the box has no extent: there is nothing to place")

    def places(unit: Floats) -> Floats:
        """(count, 3) m of coordinates (count · free,) from 0 to 1."""
        found = np.tile(lower, (count, 1))
        found[:, free] += (upper - lower)[free] * np.clip(unit.reshape(count, free.size), 0.0, 1.0)
        return found

    def objective(unit: Floats) -> float:
        sensors = _at(places(unit), noise)
        bound = pose_bound(rotor, points[:, None, :], along, sensors, times=times, frequency=frequency)
        # A rotor that is not told at all must not make the search blind.
        position = np.minimum(bound.position, 1e3)
        return float(np.log(position.max() if worst else np.sqrt(np.mean(position**2))))

    generator = np.random.default_rng(seed)
    with one_thread_for_algebra():
        tried = [generator.uniform(size=count * free.size) for _ in range(starts)]
        begun = [objective(one) for one in tried]
        ended = [
            minimize(
                objective,
                tried[k],
                method="Nelder-Mead" if worst else "L-BFGS-B",  # the largest of many has corners
                bounds=[(0.0, 1.0)] * (count * free.size),
                options={"maxiter": 400 * count} if worst else {"maxiter": 200, "ftol": LEAST_GAIN},
            )
            for k in np.argsort(begun)[:IMPROVED]
        ]
    found = min(ended, key=lambda one: float(one.fun))
    if strict and not found.success:
        raise ConvergenceError(f"placing sensors did not converge in {found.nit} steps: {found.message}")
    return Placement(
        sensors=_at(places(found.x), noise),
        objective=float(np.exp(found.fun)),
        start=float(np.exp(min(begun))),
        converged=bool(found.success),
        iterations=int(found.nit),
    )


def _at(places: Floats, noise: float) -> tuple[Sensor, ...]:
    return tuple(Sensor(pose=RigidTransform.from_translation(one), noise=noise) for one in places)
