"""What localization refuses, and that it says what was expected: one sentence, never a traceback of numpy's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from magfem.errors import InputError, OutsideRegionError
from magfem.localization import (
    ProcessNoise,
    Sensor,
    as_rotor,
    demodulate,
    dipole_poses,
    find_frequency,
    follow,
    localize,
    place_sensors,
    pose_bound,
    simulated_samples,
    spectrum,
    synchrony,
    track,
    windows,
    workspace,
)
from magfem.localization.published import field_ellipse

TIMES = np.arange(40) / 20
PLACE, AXIS = np.array([8e-3, -6e-3, 20e-3]), np.array([0.6, 0.0, 0.8])
SENSOR = Sensor(noise=1e-7)
ROTOR = as_rotor("rotor_1x3")
SAMPLES = simulated_samples(ROTOR, PLACE, AXIS, TIMES, 1.0, SENSOR)
WORDS = [["a"] * 3] * 40
TRACK = np.stack([SAMPLES] * 4)
NOISE = ProcessNoise(1e-8, 1e-5)
BOX = ([-0.02, -0.02, 0.0], [0.02, 0.02, 0.0])


def _simulated(**other: object) -> object:
    given = {"position": PLACE, "axis": AXIS, "times": TIMES, "frequency": 1.0, **other}
    return simulated_samples(ROTOR, **given)


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "samples of words": (lambda: localize(WORDS, TIMES, ROTOR, 1.0), "samples must be real numbers"),
    "complex samples": (lambda: localize(SAMPLES * 1j, TIMES, ROTOR, 1.0), "samples must be real numbers"),
    "times of words": (lambda: localize(SAMPLES, ["now"] * 40, ROTOR, 1.0), "times must be real numbers"),
    "ragged samples": (lambda: demodulate([[1, 2, 3], [1, 2]], TIMES, 1.0), "samples must be real numbers"),
    "noise of words": (lambda: demodulate(SAMPLES, TIMES, 1.0, noise="quiet"), "noise must be one or three"),
    "noise in µT": (lambda: demodulate(SAMPLES, TIMES, 1.0, noise=300), "noise must be one or three"),
    "negative step": (lambda: demodulate(SAMPLES, TIMES, 1.0, noise=1e-6, resolution=-1e-7), "resolution must be a"),
    "frequency of words": (lambda: localize(SAMPLES, TIMES, ROTOR, "fast"), "positive number in Hz"),
    "complex frequency": (lambda: demodulate(SAMPLES, TIMES, 1j), "positive number in Hz"),
    "near of two": (lambda: localize(SAMPLES, TIMES, ROTOR, 1.0, near=[0, 0]), "near must be positions"),
    "near at infinity": (lambda: localize(SAMPLES, TIMES, ROTOR, 1.0, near=[0, 0, np.inf]), "near must be positions"),
    "near for more poses": (lambda: localize(SAMPLES, TIMES, ROTOR, 1.0, near=np.ones((4, 3))), "does not fit poses"),
    "axis of words": (lambda: as_rotor("rotor_1x3", "up"), "rotation_axis must be three numbers"),
    "spectrum of words": (lambda: spectrum(WORDS, TIMES), "samples must be real numbers"),
    "found from words": (lambda: find_frequency(WORDS, TIMES), "samples must be real numbers"),
    "synchrony of words": (lambda: synchrony(WORDS, TIMES, 1.0), "samples must be real numbers"),
    "ellipse of words": (lambda: field_ellipse(WORDS, TIMES), "samples must be real numbers"),
    "windows of words": (lambda: windows(WORDS, TIMES, 1.0), "samples must be real numbers"),
    "starts of words": (lambda: track(TRACK, TIMES, ROTOR, 1.0, starts="abcd"), "starts must be real numbers"),
    "too few starts": (lambda: track(TRACK, TIMES, ROTOR, 1.0, starts=[0, 2, 4]), "3 windows need samples"),
    "overlapping windows": (
        lambda: track(TRACK, TIMES, ROTOR, 1.0, starts=[0, 1, 2, 3]),
        "windows of a track must not overlap",
    ),
    "follow from words": (
        lambda: follow(None, SAMPLES, TIMES, ROTOR, 1.0, noise=NOISE, near="here"),
        "near must be a position",
    ),
    "quadratures of words": (lambda: dipole_poses("abc", "abc", 1.0), "quadratures of a field must be finite"),
    "quadratures that do not fit": (lambda: dipole_poses(np.ones((2, 3)), np.eye(3), 1.0), "as many cosine as sine"),
    "moment of nothing": (lambda: dipole_poses([1, 0, 0], [0, 1, 0], 0.0), "a moment must be a positive number"),
    "simulated seed": (lambda: _simulated(seed="x"), "seed must be a whole number"),
    "simulated places that do not fit": (
        lambda: _simulated(position=np.ones((2, 3)), axis=np.ones((5, 3))),
        "do not fit each other",
    ),
    "simulated axis of zero": (lambda: _simulated(axis=np.zeros(3)), "an axis must have a direction"),
    "simulated at no time": (lambda: _simulated(times=[np.nan]), "need finite numbers"),
    "bound without axis": (lambda: pose_bound(ROTOR, PLACE, np.zeros(3), SENSOR, times=TIMES), "of length zero"),
    "bounds that do not fit": (
        lambda: pose_bound(ROTOR, np.ones((2, 3)), np.ones((5, 3)), SENSOR, times=TIMES),
        "as many axes as positions",
    ),
    "workspace of words": (lambda: workspace(ROTOR, "here", SENSOR, times=TIMES), "points must be finite numbers"),
    "workspace without axes": (
        lambda: workspace(ROTOR, PLACE, SENSOR, times=TIMES, axes=np.empty((0, 3))),
        "axes must be directions",
    ),
    "box of words": (
        lambda: place_sensors(ROTOR, [PLACE], 2, "low", BOX[1], noise=1e-6, times=TIMES),
        "low and high must be corners",
    ),
    "sensor's noise": (lambda: Sensor(noise="quiet"), "sensor: noise must be one or three"),
    "sensor's limit": (lambda: Sensor(saturation=[1, 2]), "sensor: saturation must be a positive field"),
    "sensor's step": (lambda: Sensor(resolution=np.nan), "sensor: resolution must be a step"),
    "sensor's gain": (lambda: Sensor(gain=[["a"] * 3] * 3), "sensor: gain must be"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_one_sentence(name: str) -> None:
    call, words = REFUSED[name]
    with pytest.raises(InputError, match=words) as refusal:
        call()
    assert "\n" not in str(refusal.value)


def test_a_sensor_within_the_magnet_is_not_simulated_unless_asked() -> None:
    with pytest.raises(OutsideRegionError):
        _simulated(position=[0.0, 0.0, 1e-3])
    assert np.isfinite(_simulated(position=[0.0, 0.0, 1e-3], outside="extrapolate")).all()


def test_masked_samples_are_missing() -> None:
    masked = np.ma.masked_array(SAMPLES, np.zeros(SAMPLES.shape, dtype=bool))
    masked[3] = np.ma.masked
    missing = SAMPLES.copy()
    missing[3] = np.nan
    assert np.array_equal(
        localize(masked, TIMES, ROTOR, 1.0, SENSOR).position, localize(missing, TIMES, ROTOR, 1.0, SENSOR).position
    )
