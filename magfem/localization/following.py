"""Following a magnet live: one window of samples after another, each judged by all before it.

What is believed after a window is a few hypotheses, each a state of `motion` with its weight. A new window is explained
from every hypothesis' prediction, beginning both at the prediction and at each branch that the window offers by itself,
by Gauss–Newton on prior and samples together (an iterated Kalman filter). What ends at the same pose is merged, what is
hopeless dropped. So a first window that is ambiguous is decided by later ones, and a faulty window moves nothing by
more than its inflated covariance allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from magfem.errors import InputError
from magfem.localization.localize import localize, whitened
from magfem.localization.motion import DIFFUSE, ProcessNoise, dynamics, update
from magfem.localization.orientation import orientation
from magfem.localization.pose import Pose
from magfem.localization.real_numbers import TIMES, real_numbers
from magfem.localization.refinement import Measured
from magfem.localization.rotor import Model, as_rotor
from magfem.localization.sensor import Sensors, as_sensors
from magfem.localization.window_likelihood import Windows, likelihoods, misfit, moved
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Floats, Points, Vectors

MOST_HYPOTHESES = 4
MOST_ITERATIONS = 30
SMALL_CHANGE = 1e-5  # of the distance, and rad
HOPELESS = 12.0  # log weight behind the best below which a hypothesis is dropped
SETTLED = 3  # steps before a misfit may be the window's fault
FAULTY = 1e-4  # probability of a window's misfit below which its covariance is inflated
SAME = 4.0
"""Squared deviations of position and axis, of two hypotheses together, within which they are one: they then tell of the
same branch, only by other ways."""


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of a magnet at `time` (s); h hypotheses, likeliest first.

    state: (h, 12), see `motion`.  state_covariance: (h, 12, 12).  frame: (h, 3, 3), orientation at time zero of the
    window.  log_weight: (h,), zero for the first.  faulty: whether the last window did not fit what was predicted.
    pose: what that window says alone.
    """

    time: float
    state: Floats
    state_covariance: Floats
    frame: Floats
    log_weight: Floats
    faulty: bool
    pose: Pose

    @property
    def position(self) -> Points:
        """(3,) m."""
        return np.asarray(self.state[0, :3])

    @property
    def axis(self) -> Vectors:
        """(3,) unit vector."""
        return np.asarray(self.state[0, 3:6] / np.linalg.norm(self.state[0, 3:6]))

    @property
    def velocity(self) -> Vectors:
        """(3,) m/s."""
        return np.asarray(self.state[0, 6:9])

    def moment_direction(self, time: float = 0.0) -> Vectors:
        """(3,) unit vector of the moment across the axis, at `time` (s) of the last window's clock."""
        angle = float(self.pose.turning.angle(np.asarray(time)))
        return np.asarray(np.cos(angle) * self.frame[0, :, 0] + np.sin(angle) * self.frame[0, :, 1])

    @property
    def covariance(self) -> Floats:
        """(6, 6) of position and axis."""
        return np.asarray(self.covariances[0])

    @property
    def covariances(self) -> Floats:
        """(h, 6, 6) of position and axis, of every hypothesis."""
        axis = self.state[:, 3:6] / np.linalg.norm(self.state[:, 3:6], axis=-1, keepdims=True)
        across = np.tile(np.eye(6), (len(axis), 1, 1))
        across[:, 3:, 3:] -= axis[:, :, None] * axis[:, None, :]
        return np.asarray(across @ self.state_covariance[:, :6, :6] @ across)

    @property
    def position_deviation(self) -> float:
        """m, root of the mean square distance from the true position that the covariance states."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    @property
    def axis_deviation(self) -> float:
        """rad, root of the mean square angle from the true axis that the covariance states."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))

    @property
    def ambiguous(self) -> bool:
        """Whether another hypothesis is about as likely."""
        return bool(np.any(self.log_weight[1:] > self.log_weight[0] - 3.0))


def follow(
    belief: Belief | None,
    samples: ArrayLike,
    times: ArrayLike,
    model: Model,
    frequency: float | None = None,
    sensors: Sensors = None,
    *,
    start: float = 0.0,
    noise: ProcessNoise,
    near: ArrayLike | None = None,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
) -> Belief:
    """What is believed after one more window; `belief` is None for the first.

    samples: (n, 3) T of one sensor, (s, n, 3) of several.  times: (n,) s, after the window's `start` (s).  noise: the
    process noise, such as `track` found on a record.  near: (3,) m, where the magnet is about in the first window; a
    `Rotor` as `model` saves building it anew. Otherwise as `localize`. Raises InputError for a window that is not after
    the last.
    """
    rotor = as_rotor(model, rotation_axis)
    pose = localize(samples, times, rotor, frequency, sensors, strict=False)
    time = start + float(np.mean(real_numbers(times, TIMES)))
    return follow_pose(belief, pose, time, rotor, sensors, noise=noise, near=near)


def follow_pose(
    belief: Belief | None,
    pose: Pose,
    time: float,
    model: Model,
    sensors: Sensors = None,
    *,
    noise: ProcessNoise,
    near: ArrayLike | None = None,
    rotation_axis: ArrayLike = (0.0, 0.0, 1.0),
) -> Belief:
    """As `follow`, after a window whose samples, about `time` (s), gave `pose` alone, with the same model and sensors.

    Not every window needs the same sensors, as long as they share a frame.
    """
    rotor, array = as_rotor(model, rotation_axis), as_sensors(sensors)
    if not isinstance(noise, ProcessNoise):
        raise InputError("follow needs the process noise, such as track finds: ProcessNoise(1e-8, 1e-5)")
    if pose.position.ndim != 1:
        raise InputError("follow takes one window at a time; a whole record is for track")
    if belief is not None and not time > belief.time:
        raise InputError(f"windows must follow each other in time: {time:g} s is not after {belief.time:g} s")
    with one_thread_for_algebra():
        measured = whitened(pose.fields, array)
        prior = _first(pose, near) if belief is None else _predicted(belief, pose, time, noise)
        many = len(prior.state)
        seen = Windows(
            rotor,
            array,
            Measured(
                np.repeat(measured.quadratures[None], many, axis=0), np.repeat(measured.whitening[None], many, axis=0)
            ),
        )
        return _explained(seen, prior, pose, time)


@dataclass(frozen=True, eq=False)
class _Prior:
    """What is expected (n, 12), (n, 12, 12), how likely that was (n,), and where to begin (n, 3), (n, 3, 3)."""

    state: Floats
    covariance: Floats
    log_weight: Floats
    position: Points
    frame: Floats


def _offered(pose: Pose) -> tuple[Points, Floats]:
    """Positions (k, 3) and frames (k, 3, 3) of a window's branches."""
    branches = [one for one in pose.branches if np.isfinite(one.log_likelihood)]
    axes, phases = np.array([one.axis for one in branches]), np.array([one.phase for one in branches])
    return np.array([one.position for one in branches]), orientation(axes, phases)


def _first(pose: Pose, near: ArrayLike | None) -> _Prior:
    """Nothing is known but, with `near`, about where the magnet is."""
    position, frame = _offered(pose)
    count = len(position)
    weight: Floats = np.zeros(count)
    if near is not None:
        where = real_numbers(near, "near must be a position (3,) in m")
        weight -= HOPELESS * np.linalg.norm(position - where, axis=-1) / pose.distance
    state = np.concatenate([position, frame[:, :, 2], np.zeros((count, 6))], axis=-1)
    return _Prior(state, np.tile(np.diag(DIFFUSE), (count, 1, 1)), weight, position, frame)


def _predicted(belief: Belief, pose: Pose, time: float, noise: ProcessNoise) -> _Prior:
    """Every hypothesis at the new time, to be met from where it is expected and from each branch of the window."""
    turning = belief.state[:, 3:6] / np.linalg.norm(belief.state[:, 3:6], axis=-1, keepdims=True)
    motion = dynamics(np.full(len(turning), time - belief.time), turning, belief.state[:, 9:])
    state = np.einsum("hij,hj->hi", motion.F, belief.state) + motion.c
    covariance = motion.F @ belief.state_covariance @ np.swapaxes(motion.F, -1, -2)
    covariance += float(noise.position) * motion.position + float(noise.axis) * motion.axis
    offered_position, offered_frame = _offered(pose)
    hypotheses, starts = len(state), 1 + len(offered_position)
    axis = state[:, 3:6] / np.linalg.norm(state[:, 3:6], axis=-1, keepdims=True)
    expected = orientation(axis, np.full(hypotheses, pose.phase))
    position = np.concatenate(
        [state[:, None, :3], np.broadcast_to(offered_position, (hypotheses, starts - 1, 3))], axis=1
    )
    frame = np.concatenate([expected[:, None], np.broadcast_to(offered_frame, (hypotheses, starts - 1, 3, 3))], axis=1)
    return _Prior(
        np.repeat(state, starts, axis=0),
        np.repeat(covariance, starts, axis=0),
        np.repeat(belief.log_weight, starts),
        position.reshape(-1, 3),
        frame.reshape(-1, 3, 3),
    )


def _explained(seen: Windows, prior: _Prior, pose: Pose, time: float) -> Belief:
    p, R = prior.position, prior.frame
    limit = float(chi2.isf(FAULTY, 6 * len(seen.array.sensors) - 1))
    inverse = np.linalg.inv(prior.covariance[:, :6, :6])
    weight, share = np.ones(len(p)), np.ones(len(p))
    cost = np.full(len(p), np.inf)
    last_p, last_R = p, R
    for iteration in range(MOST_ITERATIONS):
        # A step that made it worse, samples and prior together, is taken back, and half of it tried.
        off = np.concatenate([p, R[:, :, 2]], axis=-1) - prior.state[:, :6]
        now = weight * misfit(seen, p, R) + np.einsum("ni,nij,nj->n", off, inverse, off)
        worse = now > cost + 1e-9 * np.abs(now)
        p, R = np.where(worse[:, None], last_p, p), np.where(worse[:, None, None], last_R, R)
        cost, share = np.where(worse, cost, now), np.where(worse, 0.5 * share, 1.0)
        last_p, last_R = p, R
        said, phase = likelihoods(seen, p, R, weight)
        state, covariance, evidence = update(
            prior.state, prior.covariance, said.place, said.gradient, said.information, said.misfit
        )
        towards = said.place + share[:, None] * (state[:, :6] - said.place)
        p, R, changes = moved(seen, p, R, towards, phase)
        if changes.max() < SMALL_CHANGE and iteration > SETTLED:
            break
        if iteration == SETTLED:
            weight = np.minimum(1.0, limit / np.maximum(misfit(seen, last_p, last_R), 1e-12))
            cost = np.full(len(p), np.inf)
    # A window that is believed less has a covariance that is larger, and so a density that is lower.
    evidence = evidence + 0.5 * 6 * len(seen.array.sensors) * np.log(weight)
    score = prior.log_weight + evidence
    order = np.argsort(-score, kind="stable")
    kept: list[int] = []
    for one in order[score[order] > score.max() - HOPELESS]:
        off = state[kept, :6] - state[one, :6]
        both = covariance[kept, :6, :6] + covariance[one, :6, :6]
        if np.all(np.einsum("ki,ki->k", off, np.linalg.solve(both, off[..., None])[..., 0]) > SAME):
            kept.append(int(one))
    kept = kept[:MOST_HYPOTHESES]
    return Belief(
        time=time,
        state=state[kept],
        state_covariance=covariance[kept],
        frame=R[kept],
        log_weight=score[kept] - score.max(),
        faulty=bool(weight[kept[0]] < 1.0),
        pose=pose,
    )
