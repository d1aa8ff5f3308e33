"""Calibration of sensors: samples of a textbook's dipole read by sensors of known faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import ConvergenceError, InputError
from magfem.fields import DipoleField
from magfem.localization import Sensor, as_rotor, calibrate, calibration_bound, localize
from magfem.localization.sensors_card import read_sensors, write_sensors
from tests.localization import calibration_bench as bench

MOMENT = 1.2e-3
MODEL = as_rotor(DipoleField([MOMENT, 0.0, 0.0]))
KNOWN = {"frequency": bench.FREQUENCY}
PLACES = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]]
AT_REST = {"gain", "rotation", "position"}  # offsets are not told by sensors at rest in an unknown field
ROTOR = np.array([1e-3, 2e-3, -1e-3]), np.array([0.1, -0.2, 1.0])


def moved_rotor(count, seed=1):
    """Positions, axes and phases of a rotor on a robot, and two faulty sensors at rest."""
    rng = np.random.default_rng(seed)
    position, axis, phase = bench.around(rng, count), bench.units(rng, count), rng.uniform(-3, 3, count)
    return position, axis, phase, [bench.faulty(rng, place) for place in PLACES]


def carriers(count, seed=2):
    rng = np.random.default_rng(seed)
    places = bench.around(rng, count)
    return [RigidTransform.from_components(one, Rotation.random(random_state=rng)) for one in places]


def assert_same(found, true, relative=1e-11):
    for one, other in zip(found, true, strict=True):
        gain, turn, place, offset = bench.off_by(one, other)
        assert gain < relative and turn < relative and place < 0.02 * relative and offset < 1e-4 * relative


@pytest.mark.parametrize("phases_known", [True, False])
def test_a_moved_rotor_calibrates_sensors_at_rest(phases_known) -> None:
    position, axis, phase, sensors = moved_rotor(12)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors)
    found = calibrate(
        read,
        bench.TIMES,
        MODEL,
        position,
        axis,
        [bench.nominal(place) for place in PLACES],
        phase=phase if phases_known else None,
        static=bench.EARTH,
        **KNOWN,
    )
    assert_same(found.sensors, sensors)
    assert np.abs(np.exp(1j * found.phase) - np.exp(1j * phase)).max() < 1e-11
    assert found.converged and not found.warnings
    assert np.nanmax(found.held_out) < 1e-15


@pytest.mark.parametrize("along", [0.0, 4e-4])
@pytest.mark.parametrize("phase", [None, 0.0])
def test_sensors_carried_about_a_rotor_at_rest_find_it_as_well(along, phase) -> None:
    """Also the Earth's field, and, when that is stated, the rotor's moment."""
    rng = np.random.default_rng(3)
    sensors, moved = [bench.faulty(rng, place) for place in ([0, 0, 0], [2e-3, 0, 0])], carriers(14)
    position, axis = ROTOR
    read = bench.samples((MOMENT, along), position, axis, 0.6, sensors, moved)
    model = as_rotor(DipoleField([MOMENT, 0.0, along]))
    nominal = [bench.nominal(place) for place in ([0, 0, 0], [2e-3, 0, 0])]
    find = {*AT_REST, "offset", "rotor", *({"phase"} if phase is not None else set())}
    same = {"phase": phase, "sensor_poses": moved, **KNOWN}
    found = calibrate(read, bench.TIMES, model, [0, 0, 0], [0, 0, 1], nominal, find=find, **same)
    assert_same(found.sensors, sensors)
    assert found.position[0] == pytest.approx(position, abs=1e-13)
    assert found.axis[0] == pytest.approx(axis / np.linalg.norm(axis), abs=1e-11)
    assert found.static == pytest.approx(bench.EARTH, abs=1e-16)
    heavier = as_rotor(DipoleField([1.25 * MOMENT, 0.0, 1.25 * along]))
    found = calibrate(
        read, bench.TIMES, heavier, [0, 0, 0], [0, 0, 1], nominal, find=find | {"moment"}, static=bench.EARTH, **same
    )
    assert_same(found.sensors, sensors)
    assert found.moment == pytest.approx(MOMENT, rel=1e-12)


def test_gains_take_the_moment_of_the_model_for_the_truth() -> None:
    """A model a fourth too strong makes gains a fourth too small: only the product is in the samples."""
    position, axis, phase, sensors = moved_rotor(8)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors)
    nominal = [bench.nominal(place) for place in PLACES]
    heavier = as_rotor(DipoleField([1.25 * MOMENT, 0.0, 0.0]))
    found = calibrate(read, bench.TIMES, heavier, position, axis, nominal, phase=phase, find=AT_REST, **KNOWN)
    for one, true in zip(found.sensors, sensors, strict=True):
        assert one.gain == pytest.approx(np.asarray(true.gain) / 1.25, rel=1e-11, abs=1e-12)
    # With gains that are known the moment is told.
    known = [
        Sensor(pose=RigidTransform.from_translation(p), gain=one.gain) for p, one in zip(PLACES, sensors, strict=True)
    ]
    found = calibrate(
        read, bench.TIMES, heavier, position, axis, known, phase=phase, find={"rotation", "position", "moment"}, **KNOWN
    )
    assert found.moment == pytest.approx(MOMENT, rel=1e-12)
    for one, true in zip(found.sensors, sensors, strict=True):
        assert (one.pose.rotation.inv() * true.pose.rotation).magnitude() < 1e-11
        assert np.array_equal(one.gain, true.gain)


def test_a_trusted_mounting_leaves_all_of_the_matrix_to_the_gain() -> None:
    position, axis, phase, sensors = moved_rotor(8)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors)
    nominal = [bench.nominal(place) for place in PLACES]
    found = calibrate(
        read, bench.TIMES, MODEL, position, axis, nominal, phase=phase, find={"gain", "position"}, **KNOWN
    )
    for one, true in zip(found.sensors, sensors, strict=True):
        expected = np.asarray(true.gain) @ true.pose.rotation.as_matrix().T
        assert one.gain == pytest.approx(expected, abs=1e-11)
        assert one.pose.rotation.magnitude() == 0.0


@pytest.mark.parametrize("turn", [[90, 0, 0], [170, 40, 85], [0, 120, -60]])
@pytest.mark.parametrize("phases_known", [True, False])
def test_mountings_are_found_from_far_off(turn, phases_known) -> None:
    position, axis, phase, _ = moved_rotor(10)
    pose = RigidTransform.from_components([1e-3, -1e-3, 2e-3], Rotation.from_euler("xyz", turn, degrees=True))
    sensor = Sensor(pose=pose, gain=np.diag([1.1, 0.95, 1.02]))
    read = bench.samples((MOMENT, 0.0), position, axis, phase, [sensor])[:, 0]
    stated = phase if phases_known else None
    found = calibrate(read, bench.TIMES, MODEL, position, axis, phase=stated, find=AT_REST, **KNOWN)
    assert_same(found.sensors, [sensor])


def test_localization_is_right_only_with_sensors_that_were_calibrated(tmp_path: Path) -> None:
    """Faults of 5 % and 1 mm put a rotor off by far more than noise does; calibrated, only noise is left, as stated."""
    position, axis, phase, sensors = moved_rotor(30, seed=8)
    rng = np.random.default_rng(9)
    long = np.arange(4000) / 20
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors, noise=3e-6, rng=rng, times=long)
    nominal = [bench.nominal(place) for place in PLACES]
    found = calibrate(read, long, MODEL, position, axis, nominal, static=bench.EARTH, **KNOWN)
    write_sensors(tmp_path / "sensors.toml", {"a": found.sensors[0], "b": found.sensors[1]}, source="bench")
    calibrated = list(read_sensors(tmp_path / "sensors.toml", "sensors.toml").values())
    place, upright = np.array([5e-3, 6e-3, 20e-3]), np.array([0.6, 0.0, 0.8])
    seen = bench.samples((MOMENT, 0.0), np.tile(place, (200, 1)), upright, 0.3, sensors, noise=3e-6, rng=rng)
    before, after = (localize(seen, bench.TIMES, MODEL, bench.FREQUENCY, used) for used in (nominal, calibrated))
    bias = [np.linalg.norm(one.position.mean(axis=0) - place) for one in (before, after)]
    scatter = np.linalg.norm(after.position.std(axis=0))
    assert bias[0] > 5 * scatter and bias[1] < 0.3 * scatter
    turned = [np.linalg.norm(one.axis.mean(axis=0) - upright) for one in (before, after)]
    assert turned[0] > 5 * turned[1]
    off = np.concatenate([after.position - place], axis=-1)
    share = np.einsum("ni,nij,nj->n", off, np.linalg.inv(after.covariance[:, :3, :3]), off) / 3
    assert 0.85 < share.mean() < 1.15


@pytest.mark.parametrize("noise", [2e-6, None])
def test_covariances_are_those_of_repeated_calibrations(noise) -> None:
    """150 calibrations with 15 unknowns: the mean of χ² per degree of freedom is one, ± 0.03 by chance."""
    rng = np.random.default_rng(11)
    moved, (position, axis) = carriers(9), ROTOR
    sensor = bench.faulty(rng, [0, 0, 0])
    clean = bench.samples((MOMENT, 0.0), position, axis, 0.4, [sensor], moved)[:, 0]
    where = np.concatenate([[0, 1, 2, 4, 5, 8], np.arange(9, 18)])  # the upper triangle of a symmetric gain
    squares, residuals, errors = [], [], []
    for _ in range(150):
        read = clean + 2e-6 * rng.standard_normal(clean.shape)
        found = calibrate(
            read, bench.TIMES, MODEL, position, axis, bench.nominal([0, 0, 0], noise), sensor_poses=moved, **KNOWN
        )
        one = found.sensors[0]
        turn = (sensor.pose.rotation.inv() * one.pose.rotation).as_rotvec()
        gain, place = np.asarray(one.gain) - sensor.gain, one.pose.translation - sensor.pose.translation
        error = np.concatenate([gain.ravel(), turn, place, one.offset - sensor.offset])[where]
        squares.append(error @ np.linalg.solve(found.covariance[np.ix_(where, where)], error) / 15)
        residuals.append(found.residual**2)
        deviation = found.deviations[0]
        stated = [deviation.gain.ravel(), deviation.rotation, deviation.position, deviation.offset]
        errors.append(error / np.concatenate(stated)[where])
    assert 0.9 < np.mean(squares) < 1.1
    assert 0.95 < np.mean(residuals) < 1.05
    assert np.all((np.std(errors, axis=0) > 0.8) & (np.std(errors, axis=0) < 1.2))


def test_a_bound_tells_beforehand_what_a_calibration_reaches() -> None:
    """Of faultless sensors it is a calibration's covariance; of more poses it falls with the root of their number."""
    moved, (position, axis) = carriers(16), ROTOR
    sensor = bench.nominal([0, 0, 0], 2e-6)
    rng = np.random.default_rng(5)
    read = bench.samples((MOMENT, 0.0), position, axis, 0.4, [sensor], moved, noise=2e-6, rng=rng)[:, 0]
    same = {"sensor_poses": moved, "phase": 0.4, "static": bench.EARTH, **KNOWN}
    found = calibrate(read, bench.TIMES, MODEL, position, axis, sensor, **same)
    bound = calibration_bound(MODEL, position, axis, sensor, times=bench.TIMES, **same)
    assert not bound.untold and bound.condition == pytest.approx(found.condition, rel=0.02)
    for part in ("gain", "rotation", "position", "offset"):
        assert getattr(bound.deviations[0], part) == pytest.approx(getattr(found.deviations[0], part), rel=0.03)
    thrice = calibration_bound(MODEL, position, axis, sensor, times=bench.TIMES, **{**same, "sensor_poses": moved * 3})
    assert thrice.deviations[0].position * np.sqrt(3) == pytest.approx(bound.deviations[0].position, rel=1e-9)


def test_poses_left_out_are_predicted_as_a_fit_without_them_does() -> None:
    position, axis, phase, sensors = moved_rotor(7)
    rng = np.random.default_rng(6)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors[:1], noise=1e-6, rng=rng)[:, 0]
    sensor = bench.nominal(PLACES[0], 1e-6)
    found = calibrate(read, bench.TIMES, MODEL, position, axis, sensor, phase=phase, find=AT_REST, **KNOWN)
    turning = np.column_stack([np.ones(200), *(f(2 * np.pi * bench.FREQUENCY * bench.TIMES) for f in (np.cos, np.sin))])
    for out in range(7):
        rest = np.arange(7) != out
        less = calibrate(
            read[rest], bench.TIMES, MODEL, position[rest], axis[rest], sensor, phase=phase[rest], find=AT_REST, **KNOWN
        )
        predicted = bench.samples((MOMENT, 0.0), position[out], axis[out], phase[out], less.sensors)[0, 0]
        error = np.linalg.lstsq(turning, predicted - read[out], rcond=None)[0][1:]
        assert found.held_out[out, 0] == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.05)


def test_a_robust_calibration_leaves_wrong_poses_aside() -> None:
    """At two of fourteen poses the rotor was not where the robot said: more than five deviations off."""
    position, axis, phase, sensors = moved_rotor(14)
    rng = np.random.default_rng(12)
    truly = position.copy()
    truly[3] += [4e-3, 0, 0]
    truly[9] += [0, -5e-3, 1e-3]
    read = bench.samples((MOMENT, 0.0), truly, axis, phase, sensors, noise=1e-6, rng=rng)
    nominal = [bench.nominal(place) for place in PLACES]
    same = {"phase": phase, "find": AT_REST, **KNOWN}
    plain, robust = (
        calibrate(read, bench.TIMES, MODEL, position, axis, nominal, robust=robust, **same) for robust in (False, True)
    )
    assert np.all(robust.weight[[3, 9]] < 0.3) and np.all(np.delete(robust.weight, [3, 9], axis=0) > 0.6)
    off = np.array(
        [[bench.off_by(a, b)[:3] for a, b in zip(one.sensors, sensors, strict=True)] for one in (plain, robust)]
    )
    deviation = np.array([[one.gain.max(), one.rotation.max(), one.position.max()] for one in robust.deviations])
    assert np.all(off[1] < 4 * deviation) and np.all(off[0].max(axis=0) > 3 * off[1].max(axis=0))
    assert plain.residual > 5 and "known poses" in plain.warnings[0]
    assert np.nanmax(robust.misfit[[3, 9]]) > 5 > np.nanmax(np.delete(robust.misfit, [3, 9], axis=0))


def test_samples_that_are_missing_or_saturated_are_done_without() -> None:
    position, axis, phase, sensors = moved_rotor(10)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors)
    read[2, 1, ::7, 0] = np.nan
    read[4, 0] = np.nan
    read[5, 1, :, 2] = 1.0
    nominal = [Sensor(pose=RigidTransform.from_translation(place), saturation=0.1) for place in PLACES]
    found = calibrate(read, bench.TIMES, MODEL, position, axis, nominal, phase=phase, find=AT_REST, **KNOWN)
    for one, true in zip(found.sensors, sensors, strict=True):
        assert max(bench.off_by(one, true)[:3]) < 1e-11
    assert np.argwhere(np.isnan(found.misfit)).tolist() == [[4, 0], [5, 1]]
    assert found.warnings == ("2 of 20 sets of samples were too few or saturated, and left out",)
    assert np.isnan(found.static).all()


def test_poses_may_have_clocks_of_their_own() -> None:
    """One clock for all poses: the same as phases that go on from pose to pose."""
    position, axis, _, sensors = moved_rotor(8)
    begin = 12.3 * np.arange(8)
    phase = 0.2 + 2 * np.pi * bench.FREQUENCY * begin
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors)
    nominal = [bench.nominal(place) for place in PLACES]
    clock = begin[:, None] + bench.TIMES
    found = calibrate(read, clock, MODEL, position, axis, nominal, phase=0.2, find=AT_REST, **KNOWN)
    for one, true in zip(found.sensors, sensors, strict=True):
        assert max(bench.off_by(one, true)[:3]) < 1e-10


@pytest.mark.parametrize(
    ("poses", "find", "stated", "message"),
    [
        (8, {*AT_REST, "offset"}, {}, "the offset of the sensor and the static field: turn the sensors"),
        (8, {*AT_REST, "moment"}, {}, "do not determine the gain of the sensor and the rotor's moment: moment and"),
        (1, AT_REST, {}, "the readings of 1 poses do not determine the gain of the sensor"),
        (0, {*AT_REST, "rotor"}, {}, "the position of the sensor and the rotor's position: turn the carrier"),
    ],
)
def test_what_the_readings_do_not_determine_is_named(poses, find, stated, message) -> None:
    position, axis, phase, sensors = moved_rotor(max(poses, 1))
    moved = None
    if not poses:  # carried along, never turned
        moved = [RigidTransform.from_translation(place) for place in bench.around(np.random.default_rng(2), 10)]
        position, axis, phase = *ROTOR, 0.5
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors[:1], moved)[:, 0]
    same = {"phase": phase, "find": find, "sensor_poses": moved, **stated, **KNOWN}
    with pytest.raises(InputError, match=message):
        calibrate(read, bench.TIMES, MODEL, position, axis, **same)
    bound = calibration_bound(MODEL, position, axis, bench.nominal([0, 0, 0], 1e-6), times=bench.TIMES, **same)
    assert bound.untold and bound.condition == np.inf
    assert any(np.isinf(getattr(bound.deviations[0], part)).all() for part in find & {"gain", "position", "offset"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions": np.zeros((3, 3))}, r"positions must be numbers \(8, 3\) m, got \(3, 3\)"),
        ({"axes": np.zeros(3)}, "axes must not be zero"),
        ({"phase": np.zeros(3)}, r"phase must be numbers \(8,\) rad"),
        ({"static": [np.nan, 0, 0]}, "static must be finite numbers"),
        ({"find": {"pose"}}, "find has 'pose'; it can have gain, rotation"),
        ({"find": ()}, "find is empty"),
        ({"find": {"phase"}, "phase": None}, "a number added to stated phases"),
        ({"find": {"rotor"}}, "for one at rest"),
        ({"sensor_poses": [RigidTransform.identity()] * 3}, "sensor_poses must be 8 RigidTransforms"),
        ({"samples": np.zeros((8, 1, 1, 200, 3))}, r"samples of a calibration must be \(poses, n, 3\)"),
        ({"times": np.zeros(5)}, r"times must be \(200,\) or \(8, 200\) s"),
        ({"samples": np.full((8, 200, 3), np.nan)}, "no pose has samples enough"),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(change, message) -> None:
    position, axis, phase, sensors = moved_rotor(8)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors[:1])[:, 0]
    given = {"samples": read, "times": bench.TIMES, "positions": position, "axes": axis, "phase": phase, **change}
    with pytest.raises(InputError, match=message):
        calibrate(model=MODEL, find=given.pop("find", AT_REST), **given, **KNOWN)


def test_a_bound_needs_to_know_the_noise() -> None:
    with pytest.raises(InputError, match="whose noise is stated"):
        calibration_bound(MODEL, [0, 0, 0.02], [0, 0, 1], Sensor(), times=bench.TIMES, **KNOWN)


def test_a_calibration_that_does_not_converge_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    position, axis, phase, sensors = moved_rotor(8)
    read = bench.samples((MOMENT, 0.0), position, axis, phase, sensors[:1])[:, 0]
    monkeypatch.setattr("magfem.localization.calibration_fit.MOST_ITERATIONS", 2)
    same = {"phase": phase, "find": AT_REST, **KNOWN}
    with pytest.raises(ConvergenceError, match="did not converge in 2 steps: begin nearer to the truth"):
        calibrate(read, bench.TIMES, MODEL, position, axis, **same)
    found = calibrate(read, bench.TIMES, MODEL, position, axis, strict=False, **same)
    assert not found.converged and "the calibration did not converge" in found.warnings
