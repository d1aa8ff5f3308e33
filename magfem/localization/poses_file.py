"""Poses as plain data, and the JSON file that holds them.

    {"format": "magfem-poses", "version": 1, "model", "samples", "sensors", "poses": [...], "left_out": [...]}

Lengths are in m, angles in rad, times in s, fields in T. A pose is in the frame of the sensor, or of several sensors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from magfem.localization.following import Belief
from magfem.localization.orientation import orientation, phase_of
from magfem.localization.pose import Branch, Pose
from magfem.localization.sensor import Sensor
from magfem.localization.tracking import Track
from magfem.typing import Floats, Points, Vectors

FORMAT, VERSION = "magfem-poses", 1
FAULTY = "the samples of this window do not fit the track"
AMBIGUOUS = "another track is as likely: state where the rotor is about, or use a second sensor"


def poses_to_dict(
    poses: Sequence[dict[str, Any]],
    model: str,
    samples: str,
    sensors: Mapping[str, Sensor],
    left_out: Sequence[dict[str, Any]] = (),
) -> dict[str, Any]:
    """All that the file holds; `poses` as `pose_to_dict` makes them, `left_out` windows with `time` and `reason`."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "model": model,
        "samples": samples,
        "sensors": [_sensor(name, one) for name, one in sensors.items()],
        "poses": list(poses),
        "left_out": list(left_out),
    }


def pose_to_dict(pose: Pose, time: float, window: tuple[float, float], sensors: Sequence[str]) -> dict[str, Any]:
    """A single pose as plain data.

    time: s, the middle of the `window` of samples it is of. The frequency and the phase are those at time zero of the
    samples' clock, as in `Pose`; `moment_direction` is at `time`.  sensors: names of those that took part.
    """
    strongest = max(pose.fields, key=lambda field: float(field.strength))
    return {
        "time": float(time),
        "window": [float(one) for one in window],
        "frequency": float(pose.frequency),
        "frequency_deviation": float(pose.turning.deviation),
        "drift": float(pose.turning.drift),
        "swing": None if pose.turning.swing is None else float(np.linalg.norm(pose.turning.swing)),
        **_branch(pose),
        "moment_direction": pose.moment_direction(time).tolist(),
        "position_deviation": _finite(pose.position_deviation),
        "axis_deviation": _finite(pose.axis_deviation),
        "strength": float(strongest.strength),
        "signal_to_noise": _finite(strongest.signal_to_noise),
        "sensors": list(sensors),
        "ambiguous": bool(pose.ambiguous),
        "warnings": list(pose.warnings),
        "branches": [_branch(one) for one in pose.branches],
    }


def track_to_dicts(track: Track, starts: Floats, length: float, sensors: Sequence[str]) -> list[dict[str, Any]]:
    """A track as plain data, a pose for every window of `length` s that begins at one of `starts` (w,) s.

    `branches` are the tracks that were followed, at that time; their log_likelihood is that of the whole track. Phases
    and their deviations are those of the window alone, of the branch that is nearest to the track.
    """
    tracks = (track, *track.alternatives)
    every = [[_tracked(one, w, float(starts[w])) for one in tracks] for w in range(len(starts))]
    turning = track.poses.turning
    frequency = np.broadcast_to(track.poses.frequency, starts.shape)
    deviation = np.broadcast_to(turning.deviation, starts.shape)
    found = []
    for w, branches in enumerate(every):
        best = branches[0]
        angle = best["phase"] + 2 * np.pi * frequency[w] * track.times[w]
        strongest = max(track.poses.fields, key=lambda field: float(field.strength[w]))
        said = ((track.faulty[w], FAULTY), (track.ambiguous, AMBIGUOUS))
        found.append(
            {
                "time": float(track.times[w]),
                "window": [float(starts[w]), float(starts[w]) + length],
                "frequency": float(frequency[w]),
                "frequency_deviation": float(deviation[w]),
                "drift": 0.0,
                **best,
                "velocity": track.velocity[w].tolist(),
                "moment_direction": orientation(track.axis[w], angle)[:, 0].tolist(),
                "position_deviation": _finite(track.position_deviation[w]),
                "axis_deviation": _finite(track.axis_deviation[w]),
                "strength": float(strongest.strength[w]),
                "signal_to_noise": _finite(strongest.signal_to_noise[w]),
                "sensors": list(sensors),
                "faulty": bool(track.faulty[w]),
                "ambiguous": bool(track.ambiguous),
                "warnings": [words for flag, words in said if flag],
                "branches": branches,
            }
        )
    return found


def belief_to_dict(belief: Belief, window: tuple[float, float], sensors: Sequence[str]) -> dict[str, Any]:
    """What is believed after a window, as plain data; its pose must be of the clock that `window` (s) is of.

    `branches` are the hypotheses, their log_likelihood that of all windows so far, less that of the likeliest. The
    deviation of a phase is that of the window alone.
    """
    pose = belief.pose
    middle = sum(window) / 2
    variances = np.array([one.covariance[5, 5] for one in pose.branches])
    branches = []
    for h, state in enumerate(belief.state):
        position, axis = state[:3], belief.frame[h, :, 2]
        own = variances[_nearest(position, axis, pose.branches)]
        covariance = _about_own_axes(belief.covariances[h], belief.frame[h], float(own))
        phase = phase_of(belief.frame[h])
        branches.append(_branch(Branch(position, axis, phase, covariance, belief.log_weight[h])))
    said = ((belief.faulty, FAULTY), (belief.ambiguous, AMBIGUOUS))
    return {
        **pose_to_dict(pose, middle, window, sensors),
        **branches[0],
        "velocity": belief.velocity.tolist(),
        "moment_direction": belief.moment_direction(middle).tolist(),
        "position_deviation": _finite(belief.position_deviation),
        "axis_deviation": _finite(belief.axis_deviation),
        "faulty": belief.faulty,
        "ambiguous": belief.ambiguous,
        "warnings": [words for flag, words in said if flag],
        "branches": branches,
    }


def _tracked(track: Track, w: int, start: float) -> dict[str, Any]:
    """Window w of a track, its covariance that of a `Branch`: of turns about the rotor's axes at time zero."""
    position, axis = track.position[w], track.axis[w]
    candidates = [
        Branch(one.position[w], one.axis[w], one.phase[w], one.covariance[w], one.log_likelihood[w])
        for one in track.poses.branches
        if np.isfinite(one.log_likelihood[w])
    ]
    own = candidates[_nearest(position, axis, candidates)]
    frequency = float(np.broadcast_to(track.poses.frequency, track.times.shape)[w])
    phase = float(np.angle(np.exp(1j * (float(own.phase) - 2 * np.pi * frequency * start))))
    deviation = float(np.broadcast_to(track.poses.turning.deviation, track.times.shape)[w])
    middle = track.times[w]  # from where an uncertain frequency carries the phase to time zero, not to the start alone
    variance = own.covariance[5, 5] + (2 * np.pi * deviation) ** 2 * (middle**2 - (middle - start) ** 2)
    covariance = _about_own_axes(track.covariance[w], orientation(axis, phase), float(variance))
    return _branch(Branch(position, axis, np.asarray(phase), covariance, np.asarray(track.log_evidence)))


def _nearest(position: Points, axis: Vectors, branches: Sequence[Branch]) -> int:
    """Which of a window's branches is the nearest to a pose."""
    size = np.linalg.norm(position)
    apart = [np.linalg.norm(one.position - position) / size + np.linalg.norm(one.axis - axis) for one in branches]
    return int(np.argmin(apart))


def _about_own_axes(covariance: Floats, frame: Floats, phase_variance: float) -> Floats:
    """(6, 6) of position and turns about the rotor's axes, the columns of `frame`, from that of position and axis."""
    # A small change da of the axis is the turn −ŷ·da about x̂ and x̂·da about ŷ.
    turns = np.zeros((6, 6))
    turns[:3, :3] = np.eye(3)
    turns[3, 3:], turns[4, 3:] = -frame[:, 1], frame[:, 0]
    found: Floats = turns @ covariance @ turns.T
    found[5, 5] = phase_variance
    return found


def _branch(one: Branch) -> dict[str, Any]:
    covariance = np.asarray(one.covariance)
    return {
        "position": one.position.tolist(),
        "axis": one.axis.tolist(),
        "phase": float(one.phase),
        "covariance": covariance.tolist() if np.isfinite(covariance).all() else None,
        "log_likelihood": _finite(one.log_likelihood),
    }


def _sensor(name: str, one: Sensor) -> dict[str, Any]:
    return {
        "name": name,
        "position": np.asarray(one.pose.translation).tolist(),
        "quaternion": one.pose.rotation.as_quat().tolist(),
        "noise": None if one.noise is None else np.asarray(one.noise).tolist(),
        "resolution": float(one.resolution),
        "saturation": _finite(one.saturation),
    }


def _finite(value: Any) -> float | None:
    """A number as JSON can hold it: None for one that is not finite."""
    return float(value) if np.isfinite(value) else None
