"""`localize` as a user meets it: against fields written out, closed forms of magnets, and what cannot work."""

from __future__ import annotations

import numpy as np
import pytest
from localization.dipole_field import dipole_samples, pose_at
from localization.paths import degrees_between
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.errors import InputError
from magfem.fields import DipoleField
from magfem.localization import Sensor, as_rotor, demodulate, localize, localize_several, locate_field
from magfem.localization.orientation import orientation, phase_of, upright_frame
from magfem.localization.refinement import linearised, quadratures_at
from magfem.localization.sensor import as_sensors

TIMES = np.arange(60) / 20
MOMENT = 2.6e-3
DIPOLE = DipoleField([MOMENT, 0, 0])
POSITION, AXIS = np.array([12e-3, -5e-3, 22e-3]), np.array([0.48, 0.6, 0.64])


@pytest.mark.parametrize("degrees", [5.0, 30.0, 60.0, 85.0])
def test_noiseless_round_trip(degrees: float) -> None:
    """To ten digits in position and axis; phase and moment at any time; the sense of rotation too."""
    position, axis = pose_at(np.radians(degrees), 0.025, np.random.default_rng(int(degrees)))
    samples = dipole_samples(position, axis, TIMES, 1.0, MOMENT, phase=0.9) + np.array([2e-5, 0.0, -4e-5])
    pose = localize(samples, TIMES, model=DIPOLE, frequency=1.0)
    best = min(pose.branches, key=lambda one: np.linalg.norm(one.position - position) + np.linalg.norm(one.axis - axis))
    assert np.linalg.norm(best.position - position) < 1e-10 * 0.025
    assert np.linalg.norm(best.axis - axis) < 1e-10
    assert best.phase == pytest.approx(0.9, abs=1e-9)
    assert len(pose.branches) == 4 and pose.ambiguous


def test_moment_direction_is_where_the_moment_points() -> None:
    """At any time, the direction whose dipole makes the field of that time: what a locked rotor is steered by."""
    samples = dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT, phase=-0.4)
    pose = localize(samples, TIMES, DIPOLE, 1.0, near=POSITION)
    for time in (0.0, 0.37, 2.2):
        m = MOMENT * pose.moment_direction(time)
        r = -pose.position
        d = np.linalg.norm(r)
        B = 1e-7 * (3 * r * (m @ r) / d**5 - m / d**3)
        expected = dipole_samples(POSITION, AXIS, np.array([time]), 1.0, MOMENT, phase=-0.4)[0]
        np.testing.assert_allclose(B, expected, atol=1e-6 * np.abs(expected).max())
    assert pose.moment_direction(0.1) @ pose.axis == pytest.approx(0.0, abs=1e-12)


def test_a_tilted_moment() -> None:
    """70° from the axis: m sin(tilt) turns, m cos(tilt) is static and taken for the Earth's."""
    tilt = np.radians(70)
    samples = dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT, tilt=tilt)
    model = DipoleField(MOMENT * np.array([np.sin(tilt), 0.0, np.cos(tilt)]))
    pose = localize(samples, TIMES, model, 1.0, near=POSITION)
    np.testing.assert_allclose(pose.position, POSITION, atol=1e-11)
    np.testing.assert_allclose(pose.axis, AXIS, atol=1e-9)


@pytest.mark.parametrize("distance", [5e-3, 8e-3, 15e-3, 40e-3])
def test_a_finite_rotor_of_closed_form(distance: float) -> None:
    """A rigid cylinder's field turned sample by sample, localized with a model fitted to it: 1 µm and 0.02°."""
    rotor = as_rotor(_fitted())
    exact = _exact()
    rng = np.random.default_rng(int(1e3 * distance))
    for beta in (0.2, 0.8, 1.3):
        position, axis = pose_at(beta, distance, rng)
        frames = orientation(axis, 2 * np.pi * TIMES + 0.3)
        inside = np.einsum("nij,i->nj", frames, -position)
        samples = np.einsum("nij,nj->ni", frames, exact.B(inside))
        pose = localize(samples, TIMES, rotor, 1.0, near=position)
        best = min(
            pose.branches, key=lambda one: np.linalg.norm(one.position - position) + np.linalg.norm(one.axis - axis)
        )
        assert np.linalg.norm(best.position - position) < 1e-6
        assert degrees_between(best.axis, axis) < 0.02


_CACHE: dict[str, object] = {}


def _exact() -> magfem.Field:
    if "exact" not in _CACHE:
        card = magfem.load_geometry("rotor_1x3")
        from dataclasses import replace

        rigid = replace(card, material=replace(card.material, recoil_permeability=1.0))
        _CACHE["exact"] = magfem.exact(rigid)
        _CACHE["fitted"] = magfem.fit(_CACHE["exact"])
    return _CACHE["exact"]  # type: ignore[return-value]


def _fitted() -> magfem.Field:
    _exact()
    return _CACHE["fitted"]  # type: ignore[return-value]


def test_jacobian_against_differences() -> None:
    """Of the whitened residuals, for motions and turns in the rotor's own frame, near a finite rotor."""
    rotor = as_rotor("rotor_1x3")
    array = as_sensors(
        [RigidTransform.from_components([0.01, 0, 0], Rotation.from_rotvec([0.3, 0.1, 0])), RigidTransform.identity()]
    )
    rng = np.random.default_rng(0)
    p = np.array([[4e-3, 3e-3, 9e-3], [-6e-3, 2e-3, 12e-3]])
    R = Rotation.from_rotvec(rng.normal(size=(2, 3))).as_matrix()
    white = np.tile(np.eye(6) / 1e-6, (2, 2, 1, 1))
    target = np.zeros((2, 2, 6))
    J, _ = linearised(rotor, array, p, R, target, white)
    for k in range(6):
        h = 1e-8 if k < 3 else 1e-6
        sides = []
        for sign in (1, -1):
            place, frame = p.copy(), R.copy()
            if k < 3:
                place = place + sign * h * R[:, :, k]
            else:
                frame = R @ Rotation.from_rotvec(sign * h * np.eye(3)[k - 3]).as_matrix()
            sides.append(linearised(rotor, array, place, frame, target, white)[1])
        numeric = (sides[0] - sides[1]) / (2 * h)
        np.testing.assert_allclose(J[:, :, k], numeric, rtol=1e-5, atol=1e-6 * np.abs(J[:, :, k]).max())


def test_several_sensors_turned_and_apart_need_no_prior() -> None:
    sensors = [
        Sensor(pose=RigidTransform.from_components([x, 2e-3, -x], Rotation.from_rotvec([x * 40, 0.5, -0.2])))
        for x in (-0.01, 0.012, 0.02)
    ]
    seen = np.stack(
        [
            dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT, sensor=one.pose.translation)
            @ one.pose.rotation.as_matrix()
            for one in sensors
        ]
    )
    pose = localize(seen, TIMES, DIPOLE, 1.0, sensors)
    np.testing.assert_allclose(pose.position, POSITION, atol=1e-10)
    np.testing.assert_allclose(pose.axis, AXIS, atol=1e-8)
    assert not pose.ambiguous and not pose.singular


def test_places_stand_for_sensors() -> None:
    """(s, 3) m, or one (3,), as lists or arrays: sensors turned as the common frame."""
    places = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]]
    seen = np.stack([dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT, sensor=at) for at in places])
    for given in (places, np.array(places), [RigidTransform.from_translation(at) for at in places]):
        np.testing.assert_allclose(localize(seen, TIMES, DIPOLE, 1.0, given).position, POSITION, atol=1e-10)
    one = localize(seen[1], TIMES, DIPOLE, 1.0, places[1], near=POSITION)
    np.testing.assert_allclose(one.position, POSITION, atol=1e-10)


def test_gain_and_offset_are_undone() -> None:
    gain = np.array([[1.1, 0.02, 0.0], [-0.03, 0.95, 0.01], [0.0, 0.04, 1.05]])
    sensor = Sensor(gain=gain, offset=[1e-5, 2e-5, -3e-5])
    samples = sensor.readings(dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT))
    pose = localize(samples, TIMES, DIPOLE, 1.0, sensor, near=POSITION)
    np.testing.assert_allclose(pose.position, POSITION, atol=1e-10)


def test_one_sensor_moved_from_place_to_place() -> None:
    """Times of their own at each place, the magnet turning on: as good as as many sensors."""
    places = np.array([[0, 0, 0], [0.02, 0, 0], [0.0, 0.015, 0.005]])
    times = np.stack([TIMES, TIMES + 7.3, TIMES + 15.1])
    seen = np.stack(
        [dipole_samples(POSITION, AXIS, t, 1.0, MOMENT, 0.2, sensor=at) for t, at in zip(times, places, strict=True)]
    )
    pose = localize(seen, times, DIPOLE, 1.0, [RigidTransform.from_translation(at) for at in places])
    np.testing.assert_allclose(pose.position, POSITION, atol=1e-10)
    assert pose.phase == pytest.approx(0.2, abs=1e-7)


def test_batches_are_each_alone() -> None:
    rng = np.random.default_rng(3)
    poses = [pose_at(0.7, r, rng) for r in (0.015, 0.02, 0.03)]
    samples = np.stack([dipole_samples(p, a, TIMES, 1.0, MOMENT) for p, a in poses])
    samples = samples + 1e-6 * rng.normal(size=samples.shape)
    near = np.stack([p for p, _ in poses])
    together = localize(samples, TIMES, DIPOLE, 1.0, near=near)
    for k in range(3):
        alone = localize(samples[k], TIMES, DIPOLE, 1.0, near=near[k])
        np.testing.assert_allclose(together.position[k], alone.position, rtol=1e-9)
        np.testing.assert_allclose(together.covariance[k], alone.covariance, rtol=1e-6)
    assert together.position.shape == (3, 3) and together.covariance.shape == (3, 6, 6)


def test_near_chooses_the_branch() -> None:
    samples = dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT)
    assert localize(samples, TIMES, DIPOLE, 1.0).position[2] > 0
    for sign in (1, -1):
        pose = localize(samples, TIMES, DIPOLE, 1.0, near=sign * POSITION)
        np.testing.assert_allclose(pose.position, sign * POSITION, atol=1e-10)
        again = localize(samples, TIMES, DIPOLE, 1.0, near=pose)
        np.testing.assert_allclose(again.position, pose.position)


def test_an_unknown_frequency_costs_only_the_phase() -> None:
    """10 mHz off over 30 s doubles the position's error and more; found from the samples it is as good as known."""
    times = np.arange(600) / 20
    rng = np.random.default_rng(5)
    position, axis = pose_at(0.8, 0.025, rng)
    samples = dipole_samples(position, axis, times, 1.0, MOMENT) + 3e-6 * rng.normal(size=(200, 600, 3))
    sensor = Sensor(noise=3e-6)
    errors = [
        np.sqrt(
            np.mean(np.sum((localize(samples, times, DIPOLE, f, sensor, near=position).position - position) ** 2, -1))
        )
        for f in (1.0, None, 1.01)
    ]
    assert errors[1] == pytest.approx(errors[0], rel=0.05)
    assert errors[2] > 1.9 * errors[0]


def test_two_motors_at_once() -> None:
    other, across = np.array([-10e-3, 12e-3, 20e-3]), np.array([0.0, 0.8, 0.6])
    times = np.arange(200) / 20
    samples = dipole_samples(POSITION, AXIS, times, 1.0, MOMENT) + dipole_samples(other, across, times, 1.7, MOMENT)
    first, second = localize_several(samples, times, DIPOLE, [1.0, 1.7], near=[POSITION, other])
    np.testing.assert_allclose(first.position, POSITION, atol=1e-10)
    np.testing.assert_allclose(second.position, other, atol=1e-10)
    with pytest.raises(InputError, match="cannot tell the frequencies"):
        localize_several(samples, times, DIPOLE, [1.0, 1.01])
    with pytest.raises(InputError, match="as many models"):
        localize_several(samples, times, [DIPOLE], [1.0, 1.7])


def test_from_a_demodulated_field() -> None:
    field = demodulate(dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT), TIMES, 1.0)
    np.testing.assert_allclose(locate_field([field], DIPOLE, near=POSITION).position, POSITION, atol=1e-10)
    with pytest.raises(InputError, match="as many fields"):
        locate_field([field, field], DIPOLE)


def test_singular_and_outside_are_told() -> None:
    """β = 0 and 90° with one sensor; a sensor beyond the region of the rotor's model."""
    rng = np.random.default_rng(8)
    for beta in (0.01, np.pi / 2 - 0.01):
        position, axis = pose_at(beta, 0.03, rng)
        samples = dipole_samples(position, axis, TIMES, 1.0, MOMENT) + 1e-6 * rng.normal(size=(60, 3))
        pose = localize(samples, TIMES, DIPOLE, 1.0, near=position)
        assert pose.singular
        assert any("blind to beta" in words for words in pose.warnings)
        assert np.isfinite(pose.covariance).all()
    far = localize(dipole_samples([0.05, 0.02, 0.06], AXIS, TIMES, 1.0), TIMES, "rotor_1x3", 1.0)
    assert not far.inside and any("region" in words for words in far.warnings)


def test_orientation_and_phase_are_inverse() -> None:
    rng = np.random.default_rng(9)
    axis = rng.normal(size=(50, 3))
    axis = np.concatenate([axis, [[0, 0, 1], [0, 0, -1], [1e-9, 0, -1]]])
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    phase = rng.uniform(-3.1, 3.1, len(axis))
    frame = orientation(axis, phase)
    np.testing.assert_allclose(np.swapaxes(frame, -1, -2) @ frame, np.tile(np.eye(3), (len(axis), 1, 1)), atol=1e-8)
    np.testing.assert_allclose(frame[..., 2], axis, atol=1e-12)
    np.testing.assert_allclose(phase_of(frame), phase, atol=1e-6)
    # The shortest turn leaves the direction across both +z and the axis where it is.
    still = np.cross([0, 0, 1.0], axis[:50])
    np.testing.assert_allclose(np.einsum("nij,nj->ni", upright_frame(axis[:50]), still), still, atol=1e-12)


def test_simulated_quadratures_are_the_dipole_far_away() -> None:
    seen = quadratures_at(as_rotor(DIPOLE), as_sensors(None), POSITION[None], orientation(AXIS, np.asarray(0.0))[None])
    B = dipole_samples(POSITION, AXIS, np.array([0.0, 0.25]), 1.0, MOMENT)
    np.testing.assert_allclose(seen[0, 0], B.ravel(), rtol=1e-7, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"samples": np.zeros((60, 2))}, r"\(\.\.\., n, 3\)"),
        ({"samples": np.zeros((60, 3))}, "all zero|does not turn"),
        ({"samples": np.ones((60, 3))}, "does not turn|all zero"),
        ({"samples": "no"}, "real numbers"),
        ({"frequency": 0.0}, "positive number in Hz"),
        ({"frequency": "1 Hz"}, "positive number in Hz"),
        ({"frequency": np.nan}, "positive number in Hz"),
        ({"sensors": []}, "sensors must be"),
        ({"sensors": "here"}, "sensors must be"),
        ({"sensors": [Sensor(), Sensor()]}, "samples of 2 sensors"),
        ({"near": [1.0, 2.0]}, "near must be"),
        ({"near": [np.nan, 0, 0]}, "near must be"),
        ({"model": 5}, "field model or its name"),
        ({"times": np.stack([TIMES, TIMES])}, "times must be"),
    ],
)
def test_errors_for_people(change: dict[str, object], words: str) -> None:
    given: dict[str, object] = {
        "samples": dipole_samples(POSITION, AXIS, TIMES, 1.0, MOMENT),
        "times": TIMES,
        "model": DIPOLE,
        "frequency": 1.0,
    }
    with pytest.raises(InputError, match=words):
        localize(**(given | change))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"noise": -1.0}, "noise must be"),
        ({"noise": [1e-6, 1e-6]}, "noise must be"),
        ({"resolution": -1.0}, "resolution must be"),
        ({"saturation": 0.0}, "saturation must be"),
        ({"gain": np.zeros((3, 3))}, "gain cannot be undone"),
        ({"gain": np.eye(2)}, "gain must be"),
        ({"offset": [1.0, np.nan, 0.0]}, "offset must be"),
        ({"pose": [0, 0, 0]}, "pose must be"),
    ],
)
def test_sensors_that_cannot_be(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Sensor(**change)  # type: ignore[arg-type]


def test_samples_that_their_noise_does_not_explain_are_told() -> None:
    """Clipped ones whose limit nobody stated, and sensors of a card that says them to be elsewhere; noise alone never:
    one false alarm in a million is stated.
    """
    quiet = Sensor(noise=1e-7)
    seen = dipole_samples(POSITION, AXIS, TIMES) + 1e-7 * np.random.default_rng(1).normal(size=(60, 3))
    clean = localize(seen, TIMES, DIPOLE, 1.0, quiet, near=POSITION)
    assert not clean.warnings and not clean.scattered and not clean.contradicted
    clipped = localize(np.clip(seen, -6e-6, 6e-6), TIMES, DIPOLE, 1.0, quiet, near=POSITION)
    assert clipped.scattered and any("scatter more than their noise" in words for words in clipped.warnings)

    stated = [Sensor(noise=3e-6, pose=RigidTransform.from_translation([x, 0.0, 0.0])) for x in (-0.01, 0.01)]
    truly = [dipole_samples(POSITION, AXIS, TIMES, sensor=np.array([x, 0.0, 0.0])) for x in (-0.01, 0.015)]
    noise = 3e-6 * np.random.default_rng(2).normal(size=(2000, 2, 60, 3))
    moved = localize(np.array(truly) + noise[0], TIMES, DIPOLE, 1.0, stated)
    assert moved.contradicted and any("contradict" in words for words in moved.warnings)
    right = [dipole_samples(POSITION, AXIS, TIMES, sensor=one.pose.translation) for one in stated]
    many = localize(np.array(right) + noise, TIMES, DIPOLE, 1.0, stated, strict=False)
    assert many.scattered.shape == many.contradicted.shape == (2000,)
    assert not many.scattered.any() and not many.contradicted.any()
