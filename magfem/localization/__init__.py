"""Localization: where a magnet is that turns about an axis, from the field that it makes at one sensor or more."""

from magfem.localization.bounds import PoseBound, pose_bound
from magfem.localization.calibration import (
    Calibration,
    CalibrationBound,
    SensorDeviation,
    calibrate,
    calibration_bound,
)
from magfem.localization.design import Placement, Workspace, needed_noise, place_sensors, reach, workspace
from magfem.localization.dipole_pose import DipolePoses, dipole_poses
from magfem.localization.following import Belief, follow, follow_pose
from magfem.localization.frequency import Frequency, Spectrum, find_frequency, spectrum
from magfem.localization.localize import localize, localize_several, locate_field
from magfem.localization.motion import ProcessNoise
from magfem.localization.pose import Branch, Pose
from magfem.localization.rotor import Rotor, as_rotor
from magfem.localization.sensor import Sensor
from magfem.localization.signal import RotatingField, demodulate, demodulate_several
from magfem.localization.simulated import simulated_samples
from magfem.localization.synchrony import Synchrony, synchrony
from magfem.localization.tracking import Track, track, windows

__all__ = [
    "Belief",
    "Branch",
    "Calibration",
    "CalibrationBound",
    "DipolePoses",
    "Frequency",
    "Placement",
    "Pose",
    "PoseBound",
    "ProcessNoise",
    "RotatingField",
    "Rotor",
    "Sensor",
    "SensorDeviation",
    "Spectrum",
    "Synchrony",
    "Track",
    "Workspace",
    "as_rotor",
    "calibrate",
    "calibration_bound",
    "demodulate",
    "demodulate_several",
    "dipole_poses",
    "find_frequency",
    "follow",
    "follow_pose",
    "localize",
    "localize_several",
    "locate_field",
    "needed_noise",
    "place_sensors",
    "pose_bound",
    "reach",
    "simulated_samples",
    "spectrum",
    "synchrony",
    "track",
    "windows",
    "workspace",
]
