"""Poses as plain data, and the JSON file that holds them.

    {"format": "magfem-poses", "version": 1, "model", "samples", "sensors", "poses": [...], "left_out": [...]}

Lengths are in m, angles in rad, times in s, fields in T. A pose is in the frame of the sensor, or of several sensors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from magfem.localization.pose import Branch, Pose
from magfem.localization.sensor import Sensor

FORMAT, VERSION = "magfem-poses", 1


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
