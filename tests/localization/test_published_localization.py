"""The dissertation's localization: a dipole's geometry, all four branches, its flaw with and without."""

from __future__ import annotations

import numpy as np
import pytest
from localization.turning_rotor import degrees_between, placed, seen
from references import localization_dissertation as published
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.fields.dipole_field import DipoleField
from magfem.localization.isolines import FITTED_AT, isoline_functions, isoline_radii
from magfem.localization.published import (
    BRANCHES,
    branches,
    field_ellipse,
    localize_as_published,
    track_as_published,
)

DIPOLE = DipoleField([2.6e-3, 0, 0])
TIMES = np.arange(published.SAMPLES) / published.SAMPLING_RATE
EARTH = np.array([2e-5, -1e-5, 4.2e-5])
SOURCES = {"dipole": DIPOLE, "rotor_1x3": "rotor_1x3", "rotor_1x3_dissertation": "rotor_1x3_dissertation"}


@pytest.fixture(scope="module", params=SOURCES)
def both(request):
    source = SOURCES[request.param]
    return {name: isoline_functions(source, name) for name in ("eccentric", "polar")}


@pytest.fixture(scope="module")
def rotor():
    return isoline_functions("rotor_1x3")


def scene(field, thetas, distance=0.02, seed=1, strength=None):
    """Poses with the sensor at polar angles `thetas`, and their noiseless samples: samples, positions, axes."""
    rng = np.random.default_rng(seed)
    found = []
    for theta in thetas:
        away = distance if strength is None else isoline_radii(field, strength, theta)
        position, orientation = placed(rng, away, theta)
        found.append((EARTH + seen(field, position, orientation, TIMES), position, orientation.apply([0, 0, 1])))
    return [np.array(part) for part in zip(*found, strict=True)]


@pytest.mark.parametrize("theta", np.radians([4.0, 30.0, 54.7, 61.0, 86.0, -12.0, -45.0, -80.0]))
def test_four_branches_hold_the_truth_and_all_make_one_field(theta):
    """6.11 to 6.13 with a dipole's closed forms: one branch is the pose, and a rotor in each gives the same ellipse."""
    position, orientation = placed(np.random.default_rng(7), 0.03, theta)
    ellipse = field_ellipse(seen(DIPOLE, position, orientation, TIMES), TIMES)
    high = abs(theta)
    alpha = np.arctan2(2 * np.cos(high), np.sin(high))
    positions, axes = branches(ellipse.axis, ellipse.least, 0.03, alpha, high)
    off = np.linalg.norm(positions - position, axis=1) / 0.03 + np.linalg.norm(
        axes - orientation.apply([0, 0, 1]), axis=1
    )
    assert off.min() < 1e-6
    for place, axis in zip(positions, axes, strict=True):
        turned = Rotation.align_vectors([axis], [[0, 0, 1]])[0]
        again = field_ellipse(seen(DIPOLE, place, turned, TIMES), TIMES)
        np.testing.assert_allclose(again.axis, ellipse.axis, atol=1e-7)
        for one, other in ((again.greatest, ellipse.greatest), (again.least, ellipse.least)):
            np.testing.assert_allclose(one * np.sign(one @ other), other, atol=1e-6 * ellipse.strength)


def test_all_four_quadrants_and_both_sides_are_reached(both):
    """Noiseless, with the consistent parametrisation: the pose comes back but for what the fits leave.

    At 100 µT, the isoline that b_ratio(β) and α(β) are fitted on.
    """
    functions = both["polar"]
    thetas = np.radians(np.concatenate([np.arange(10, 86, 5), -np.arange(10, 86, 5)]))
    samples, positions, axes = scene(functions.field, thetas, strength=FITTED_AT)
    found = localize_as_published(samples, TIMES, functions, positions)
    assert found.found.all()
    assert degrees_between(found.position, positions).max() < 0.35
    assert degrees_between(found.axis, axes).max() < 0.35
    distances = np.linalg.norm(positions, axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(found.position, axis=1), distances, rtol=0.035
    )  # no isoline is an ellipse
    np.testing.assert_allclose(np.degrees(found.beta), np.degrees(np.abs(thetas)), atol=0.2)
    assert len(np.unique(found.signs, axis=0)) == 4


def test_the_eccentric_angle_turns_the_axis_away(both):
    """As published: position as good as above, axis off by β − θ, tan θ = (c_z / c_x) tan β, six degrees at 45°."""
    functions = both["eccentric"]
    thetas = np.radians(np.arange(10, 86, 5.0))
    samples, positions, axes = scene(functions.field, thetas, strength=FITTED_AT)
    found = localize_as_published(samples, TIMES, functions, positions)
    assert degrees_between(found.position, positions).max() < 0.5
    off = degrees_between(found.axis, axes)
    ratio = functions.along_moment(1e-4) / functions.along_axis(1e-4)
    expected = np.degrees(np.arctan(ratio * np.tan(thetas)) - thetas)
    np.testing.assert_allclose(off, expected, atol=0.6)
    assert 5.5 < off.max() < 6.6
    assert thetas[off.argmax()] == pytest.approx(np.radians(42), abs=np.radians(6))


def test_near_the_rotor_its_isolines_are_others():
    """A cylinder is no dipole at 5 mm, and b_ratio(β) is that of 100 µT: a limit of the algorithm, not of the data."""
    functions = isoline_functions("rotor_1x3", "polar")
    thetas = np.radians([30.0, 50.0, 70.0])
    off = {}
    for distance in (5e-3, 40e-3):
        samples, positions, axes = scene(functions.field, thetas, distance)
        off[distance] = degrees_between(localize_as_published(samples, TIMES, functions, positions).axis, axes).max()
    assert off[40e-3] < 1.0 and off[5e-3] > 5.0


def test_the_prior_chooses_the_branch(rotor):
    samples, positions, _ = scene(rotor.field, np.radians([20.0, 50.0, -70.0]))
    for k in range(4):
        first = localize_as_published(samples, TIMES, rotor, positions)
        chosen = localize_as_published(samples, TIMES, rotor, 3.0 * first.positions[:, k])  # directions alone count
        np.testing.assert_array_equal(chosen.signs, np.broadcast_to(BRANCHES[k], (3, 2)))
        np.testing.assert_array_equal(chosen.position, first.positions[:, k])
        np.testing.assert_array_equal(chosen.axis, first.axes[:, k])


def test_one_branch_s_axis_by_6_13_as_it_is_printed(rotor):
    """Rotation vectors of SciPy, the signs where they are printed."""
    samples, positions, _ = scene(rotor.field, [0.6])
    found = localize_as_published(samples, TIMES, rotor, positions)
    omega, least = found.ellipse.axis[0], found.ellipse.least[0] / np.linalg.norm(found.ellipse.least[0])
    alpha, beta = found.alpha[0], found.beta[0]
    for k, (c_1, c_2) in enumerate(BRANCHES):
        position = c_1 * Rotation.from_rotvec(c_2 * alpha * least).apply(omega)
        axis = c_2 * Rotation.from_rotvec(c_2 * (alpha - beta + c_2 * np.pi / 2) * least).apply(omega)
        distance = np.linalg.norm(rotor.position(found.strength[0], beta))
        np.testing.assert_allclose(found.positions[0, k], distance * position, atol=1e-12)
        np.testing.assert_allclose(found.axes[0, k], axis, atol=1e-12)


def test_the_ellipse_is_the_field_s(rotor):
    """Its greatest and least values over a turn, by looking at every tenth of a degree."""
    position, orientation = placed(np.random.default_rng(3), 0.025, 0.5)
    ellipse = field_ellipse(EARTH + seen(rotor.field, position, orientation, TIMES), TIMES)
    turn = np.linalg.norm(seen(rotor.field, position, orientation, np.arange(3600) / 3600), axis=1)
    assert ellipse.strength == pytest.approx(turn.max(), rel=1e-5)
    assert ellipse.ratio == pytest.approx(turn.max() / turn.min(), rel=1e-5)
    np.testing.assert_allclose(ellipse.static, EARTH, atol=1e-10)


def test_ratios_are_limited():
    """In the plane of rotation the slightest noise drives the ratio above 2, on the axis it cannot go below 1."""
    rng, functions = np.random.default_rng(5), isoline_functions(DIPOLE)
    samples, positions, _ = scene(DIPOLE, np.radians([0.0] * 20 + [90.0] * 20), strength=1e-5)
    found = localize_as_published(samples + rng.normal(0, 1e-9, samples.shape), TIMES, functions, positions)
    assert (found.ellipse.ratio[:20] > 2).any()
    assert found.ratio.max() == 2.0 and found.ratio.min() >= 1.0
    assert found.found.all() and found.beta.min() >= 0 and found.beta.max() <= np.pi / 2


def test_missing_samples_and_any_order(rotor):
    rng = np.random.default_rng(6)
    samples, positions, _ = scene(rotor.field, [0.7], strength=5e-5)
    noisy = samples[0] + rng.normal(0, 3e-6, samples[0].shape)
    gaps = noisy.copy()
    gaps[[5, 50, 51], [0, 1, 2]] = np.nan
    kept = np.isfinite(gaps).all(axis=1)
    found = localize_as_published(gaps, TIMES, rotor, positions[0])
    without = localize_as_published(noisy[kept], TIMES[kept], rotor, positions[0])
    np.testing.assert_allclose(found.position, without.position, rtol=1e-9)
    np.testing.assert_allclose(found.axis, without.axis, atol=1e-9)
    order = rng.permutation(TIMES.size)
    shuffled = localize_as_published(gaps[order], TIMES[order], rotor, positions[0])
    np.testing.assert_allclose(shuffled.axis, found.axis, atol=1e-9)


def test_errors_under_noise_are_those_of_an_independent_trial():
    """At 20 µT, 3 µT of noise, 0.1 µT steps: a trial before this code had 4.6 mm, 9.7° and 27° RMS.

    Ten degrees of the axis are not the flaw's: the mended parametrisation is hardly better here.
    """
    functions = isoline_functions("rotor_1x3")
    rng = np.random.default_rng(8)
    samples, positions, axes = scene(functions.field, np.radians(rng.uniform(25, 75, 120)), strength=20e-6)
    samples = np.round((samples + rng.normal(0, 3e-6, samples.shape)) / 1e-7) * 1e-7
    found = localize_as_published(samples, TIMES, functions, positions)
    rms = [
        np.sqrt(np.mean(np.square(part)))
        for part in (
            1e3 * np.linalg.norm(found.position - positions, axis=1),
            degrees_between(found.position, positions),
            degrees_between(found.axis, axes),
        )
    ]
    np.testing.assert_allclose(rms, [4.6, 9.7, 27.0], rtol=0.35)


def test_published_bounds_hold_at_strong_fields():
    """7 mm, 11° and 23° of Fig. 6.6c, from 50 µT up and β of 25° to 75°; it is noisier than measured below."""
    functions = isoline_functions("rotor_1x3_measured")
    rng = np.random.default_rng(9)
    samples, positions, axes = scene(functions.field, np.radians(rng.uniform(25, 75, 40)), strength=100e-6)
    uniform = rng.uniform(-published.SENSOR_PEAK_NOISE, published.SENSOR_PEAK_NOISE, samples.shape)
    found = localize_as_published(samples + uniform, TIMES, functions, positions)
    assert np.linalg.norm(found.position - positions, axis=1).max() < published.POSITION_ERROR
    assert degrees_between(found.position, positions).max() < published.DIRECTION_ERROR
    assert degrees_between(found.axis, axes).max() < published.AXIS_ERROR


def test_a_wrong_branch_is_handed_on(rotor):
    """What the dissertation sees in Fig. 6.7: a track begun on the mirror branch stays there."""
    orientation = Rotation.from_rotvec([0.4, 0.2, 0.0])
    path = np.array([0.012, 0.004, 0.018]) + np.linspace(0, 0.01, 12)[:, None] * [0.3, 1.0, -0.2]
    samples = np.array([seen(rotor.field, place, orientation, TIMES[:40]) for place in path])
    right = track_as_published(samples, TIMES[:40], rotor, path[0])
    assert degrees_between(right.position, path).max() < 1.0
    wrong = track_as_published(samples, TIMES[:40], rotor, -path[0])
    np.testing.assert_allclose(wrong.position, -right.position, rtol=1e-12)
    one = localize_as_published(samples[1], TIMES[:40], rotor, right.position[0])
    np.testing.assert_array_equal(one.position, right.position[1])


def test_what_cannot_be_used_is_refused(rotor):
    good = np.ones((10, 3))
    for samples, times, near, words in (
        (good[:, :2], TIMES[:10], [0, 0, 1], "shape"),
        (good, TIMES[:9], [0, 0, 1], "times"),
        (good[:5], TIMES[:5], [0, 0, 1], "at least 6"),
        (np.where(np.arange(10)[:, None] < 5, np.nan, good), TIMES[:10], [0, 0, 1], "at least 6"),
        ("field", TIMES[:10], [0, 0, 1], "numbers"),
        (good, TIMES[:10], [0, 0, 0], "own place"),
        (np.ones((4, 10, 3)), TIMES[:10], np.ones((3, 3)), "near"),
    ):
        with pytest.raises(InputError, match=words):
            localize_as_published(samples, times, rotor, near)
    with pytest.raises(InputError, match="track"):
        track_as_published(good, TIMES[:10], rotor, [0, 0, 1])


def test_no_ellipse_no_pose(rotor):
    """A field at rest traces nothing: NaN, and `found` says so."""
    found = localize_as_published(np.tile(EARTH, (2, 10, 1)), TIMES[:10], rotor, [0, 0, 1])
    assert not found.found.any()
    assert np.isnan(found.position).all() and np.isnan(found.axis).all()
