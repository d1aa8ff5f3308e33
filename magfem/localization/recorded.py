"""Poses from recordings: which sensors took part, and one pose for every motor that turns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from magfem.errors import ConvergenceError, InputError
from magfem.localization.frequency import find_frequency, spectrum
from magfem.localization.localize import localize, localize_several, locate_field
from magfem.localization.pose import Pose
from magfem.localization.rotor import Rotor
from magfem.localization.sensor import Sensor
from magfem.localization.signal import demodulate
from magfem.localization.tracking import Track, track, windows
from magfem.samples.recording import Recording
from magfem.typing import ArrayLike, Floats
from magfem.units import quoted

FEWEST = 4  # times of samples, one more than the unknowns of an axis

_ALL = 0.9  # share of the times at which a sensor must have read for its samples to be taken together with others'


@dataclass(frozen=True, eq=False)
class Setup:
    """What turns and what sees it.

    rotor: the motors' model.  frequencies: Hz, one for each motor; empty for one motor whose frequency is to be found.
    sensors: by their names, in the frame that they share; a single one, seen from which poses are told, by the empty
    name.  drift, swing: whether the frequency of a single motor changes steadily, and whether it turns unevenly.
    """

    rotor: Rotor
    frequencies: tuple[float, ...]
    sensors: Mapping[str, Sensor]
    drift: bool = False
    swing: bool = False

    @property
    def motors(self) -> int:
        """How many turn."""
        return max(1, len(self.frequencies))

    def sensor(self, name: str) -> Sensor:
        """The sensor of this name; InputError when there is none. One alone need not be named by its samples."""
        if name in self.sensors:
            return self.sensors[name]
        if not name and len(self.sensors) == 1:
            return next(iter(self.sensors.values()))
        known = ", ".join(quoted(one) for one in self.sensors)
        if not name:
            raise InputError(f"the samples do not say which sensor took them: a column sensor is needed, of {known}")
        if known == '""':
            raise InputError(f"the samples are of a sensor {quoted(name)}: where it stands must be stated")
        raise InputError(f"there is no sensor {quoted(name)}: known are {known}")

    def check_track(self) -> None:
        """Raise InputError where what turns cannot be followed as a track."""
        if self.motors > 1 or self.drift or self.swing:
            raise InputError("a track is that of a single magnet, whose frequency does not drift and that turns evenly")

    def check_rate(self, recording: Recording) -> None:
        """Raise InputError when a frequency is half the rate of the samples or more: it would seem to be another."""
        interval = recording.interval
        for frequency in self.frequencies:
            if interval and 2 * frequency * interval >= 1:
                raise InputError(
                    f"{frequency:g} Hz is not below half the rate of the samples ({1 / interval:.6g} Hz): such a "
                    "rotation seems to be a slower one"
                )


def localize_recording(
    recording: Recording, setup: Setup, near: Sequence[ArrayLike | Pose | None] | None = None
) -> tuple[tuple[Pose, ...], tuple[str, ...]]:
    """The poses of all motors, in the order of their frequencies, and the names of the sensors that took part.

    near: for every motor where it is about, as in `localize`, or None. Sensors may read at times of their own. Raises
    InputError and ConvergenceError as `localize` does, and for sensors that `setup` does not know.
    """
    times, samples, names = recording.side_by_side()
    sensors = [setup.sensor(name) for name in names]
    if not names:
        raise InputError(f"all {len(recording.times)} samples are missing")
    if len(times) < FEWEST:
        few = f"{len(times)} samples do" if len(times) > 1 else "1 sample does"
        raise InputError(f"{few} not determine the static field, cosine and sine: {FEWEST} times are the least")
    prior = [None] * setup.motors if near is None else list(near)
    if len(setup.frequencies) > 1:
        several = localize_several(samples, times, setup.rotor, setup.frequencies, sensors, near=prior, strict=False)
        return tuple(_converged(pose) for pose in several), names
    frequency = setup.frequencies[0] if setup.frequencies else None
    if frequency is None and not _together(samples):
        return (_converged(_of_separate_times(samples, times, setup, sensors, prior[0])),), names
    turning = {"drift": setup.drift, "swing": setup.swing}
    pose = localize(samples, times, setup.rotor, frequency, sensors, near=prior[0], strict=False, **turning)
    return (_converged(pose),), names


def track_recording(
    recording: Recording, setup: Setup, length: float, step: float, near: ArrayLike | None = None
) -> tuple[Track, Floats, Floats, tuple[str, ...]]:
    """The track of one magnet through windows of `length` s, one every `step` s.

    The recording must be evenly sampled but for gaps, by all sensors at once. Returns the track, the starts (w,) s of
    its windows, those of windows with too few samples, and the sensors' names. Raises InputError and ConvergenceError
    as `track` does.
    """
    setup.check_track()
    times, samples, names = recording.evenly()
    sensors = [setup.sensor(name) for name in names]
    cut, within, starts = windows(samples, times, length, step)
    frequency = setup.frequencies[0] if setup.frequencies else None
    found = track(cut, within, setup.rotor, frequency, sensors, starts=starts, near=near)
    kept = found.times - float(within.mean())
    left_out = starts[np.abs(starts[:, None] - kept).min(axis=1) > 0.25 * step]
    return found, kept, left_out, names


def _converged(pose: Pose) -> Pose:
    """The pose; ConvergenceError where the branch chosen did not converge. That others did not is no harm."""
    if not pose.converged:
        raise ConvergenceError(f"the refinement did not converge in {int(pose.iterations)} steps")
    return pose


def _together(samples: Floats) -> bool:
    """Whether sensors (s, n, 3) read at the same times, all in all."""
    return bool((~np.isnan(samples).all(axis=2)).mean() > _ALL) or len(samples) == 1


def _of_separate_times(
    samples: Floats, times: Floats, setup: Setup, sensors: Sequence[Sensor], near: ArrayLike | Pose | None
) -> Pose:
    """As `localize` of an unknown frequency. All times together look like a rate that no sensor had, and in a spectrum
    up to half of that a rotation stands as high at its mirrored frequency: so the spectrum is of the strongest sensor.
    """
    strongest = int(np.argmax(np.nanmax(np.nanstd(samples, axis=1), axis=-1)))
    own = ~np.isnan(samples[strongest]).all(axis=-1)
    start = spectrum(samples[strongest][own], times[own]).peak
    columns = np.moveaxis(samples, 0, 1).reshape(len(times), -1)
    turning = find_frequency(columns, times, start, drift=setup.drift, swing=setup.swing)
    fields = [
        demodulate(one, times, turning, noise=s.noise, resolution=s.resolution, saturation=s.saturation)
        for one, s in zip(samples, sensors, strict=True)
    ]
    return locate_field(fields, setup.rotor, sensors, near=near, strict=False)
