"""Calibrations against the truth their measurements were made of, by another program of the same formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from actuation.calibration_bench import (
    BACKGROUND,
    COILS,
    GRID,
    LARGEST,
    NOISE,
    OCTOMAG,
    grid,
    octomag_samples,
    saturating,
    unit_fields,
)
from references.mpem_formula import coil_field

import magfem
from magfem.actuation import CoilSystem, calibrate
from magfem.errors import InputError
from magfem.fields.workspace_region import Ball, Box
from magfem.samples import SystemSamples


@pytest.fixture(scope="module")
def calibrated():
    return calibrate(octomag_samples(1, sigma=NOISE))


def others(seed, count=300):
    """Points of the workspace that were not measured, and currents of their own."""
    rng = np.random.default_rng(seed)
    points, currents = rng.uniform(-5e-3, 5e-3, (count, 3)), rng.uniform(-LARGEST, LARGEST, (count, 8))
    return points, currents, np.einsum("nac,nc->na", unit_fields(points), currents) + BACKGROUND


# The field


def test_field_at_other_points_and_currents_keeps_the_bound(calibrated):
    points, currents, truth = others(2)
    error = np.linalg.norm(calibrated.system.B(points, currents) - truth, axis=1)
    bound = calibrated.report["bound"]["absolute"]
    assert error.max() < bound < 20 * NOISE
    assert np.sqrt(np.mean(error**2)) < 0.5 * NOISE  # 1000 rows for 216 numbers
    assert calibrated.report["heldout"]["B"]["absolute_rms"] == pytest.approx(np.sqrt(3) * NOISE, rel=0.3)


def test_errors_are_as_large_as_the_deviations_say():
    """95 % intervals of B at random points and currents: 90 to 99 %, averaged over seeds; noise stated or estimated."""
    inside = []
    for seed in range(6):
        found = calibrate(octomag_samples(seed, per=4, sigma=NOISE if seed % 2 else None), degrees=4)
        for k in range(4):
            points, currents, _ = others(100 * seed + k, 40)
            truth = unit_fields(points) @ currents[0] + BACKGROUND
            z = (found.system.B(points, currents[0]) - truth) / found.deviation(points, currents[0])
            inside.append(np.mean(np.abs(z) < 1.96))
    assert 0.90 < np.mean(inside) < 0.99


# A system whose coefficients are known: interior axial multipoles about the origin are harmonics of order 0.

TRUTH = {
    "A": {"Source_List": ["s"], "s": {"A_Coeff": [-4e-3, 0.1, -3.0], "B_Coeff": None}},
    "B": {"Source_List": ["s"], "s": {"A_Coeff": [2e-3, 0.3, 5.0], "B_Coeff": None}},
    "C": {"Source_List": ["s"], "s": {"A_Coeff": [1e-3, -0.2, 8.0], "B_Coeff": None}},
}
for _coil in TRUTH.values():
    _coil["s"] |= {"Source_Position": [0, 0, 0], "Source_Direction": [0, 0, 1]}


def multipole_samples(seed, noise, per=4):
    rng = np.random.default_rng(seed)
    points = np.repeat(grid(count=4), per, axis=0)  # none at the origin, where the formula divides by nothing
    currents = rng.uniform(-LARGEST, LARGEST, (len(points), 3))
    B = np.einsum("nac,nc->na", unit_fields(points, TRUTH, list("ABC")), currents) + BACKGROUND
    return SystemSamples(points, currents, B + rng.normal(scale=noise, size=B.shape) if noise else B)


def coefficients(calibration):
    """Found and true (K, 4), drives A, B, C and the background."""
    terms = [*(coil.terms for coil in calibration.system.coils), calibration.system.background]
    found = np.stack([one.coefficient for one in terms], axis=1)
    first = terms[0]
    truth = np.zeros_like(found)
    axial = first.order == 0
    for k, coil in enumerate("ABC"):
        A = np.array([*TRUTH[coil]["s"]["A_Coeff"], *np.zeros(20)])
        truth[axial, k] = (A[first.degree - 1] * first.radius[0] ** (first.degree - 1.0))[axial]
    lowest = first.degree == 1  # a uniform field B is −∇(−B·x)
    for value, order, sine in zip(BACKGROUND, (1, 1, 0), (0, 1, 0), strict=True):
        truth[lowest & (first.order == order) & (first.sine == sine), 3] = -value * 1.0
    return found, truth


def test_without_noise_the_coefficients_come_back():
    found = calibrate(multipole_samples(1, 0.0))
    value, truth = coefficients(found)
    assert found.report["degree"] >= 3
    np.testing.assert_allclose(value, truth, atol=1e-6 * np.abs(truth).max())


def test_coefficients_lie_where_their_deviations_say():
    """95 % intervals of all coefficients: 90 to 99 %, over 16 seeds; the degree is found, not given."""
    inside, degrees = [], []
    for seed in range(16):
        found = calibrate(multipole_samples(seed, 100e-6))
        value, truth = coefficients(found)
        deviation = np.sqrt(np.diag(found.covariance)).reshape(value.shape)
        inside.append(np.mean(np.abs(value - truth) < 1.96 * deviation))
        degrees.append(found.report["degree"])
    assert 0.90 < np.mean(inside) < 0.99
    assert np.median(degrees) == 3


def test_noiseless_field_comes_back_as_far_as_harmonics_go():
    """OctoMag is no finite sum of harmonics: degree 10 leaves 1e-6; found are smaller ones that predict as well."""
    samples = octomag_samples(3, per=8, noise=0.0)
    points, currents, truth = others(4)
    for degrees, most in ((10, 1e-6), (None, 1e-5)):
        found = calibrate(samples, degrees=degrees)
        error = np.linalg.norm(found.system.B(points, currents) - truth, axis=1)
        assert np.sqrt(np.mean(error**2)) < most * np.linalg.norm(truth, axis=1).max()
    assert found.report["degree"] >= 7


def test_background_is_found(calibrated):
    found = calibrated.report["background"]
    deviation = np.array(found["deviation"])
    assert np.all(np.abs(np.array(found["centre"]) - BACKGROUND) < 3 * deviation)
    assert found["significant"] and deviation.max() < 5e-6
    np.testing.assert_allclose(calibrated.system.B([0, 0, 0], np.zeros(8)), found["centre"], rtol=1e-12)


def test_field_of_every_coil_at_the_centre(calibrated):
    truth = unit_fields(np.zeros((1, 3)))[0]
    assert [coil["name"] for coil in calibrated.report["coils"]] == COILS
    for k, coil in enumerate(calibrated.report["coils"]):
        error = np.array(coil["field_per_ampere"]) - truth[:, k]
        assert np.all(np.abs(error) < 4 * np.array(coil["deviation"]))
        assert max(coil["deviation"]) < 1e-6  # T/A


def test_a_workspace_with_sources_at_its_corner_is_said_to_be_beyond_the_model():
    """OctoMag's own file has sources at (−10, 9, −9) mm: in ±10 mm no degree describes it, and the report says so."""
    points = np.repeat(grid(10e-3), 4, axis=0)
    rng = np.random.default_rng(5)
    currents = rng.uniform(-LARGEST, LARGEST, (len(points), 8))
    B = np.einsum("nac,nc->na", unit_fields(points), currents) + rng.normal(scale=NOISE, size=(len(points), 3))
    found = calibrate(SystemSamples(points, currents, B, NOISE)).report
    assert found["uncertainty"]["bias_dominates"]
    assert found["uncertainty"]["model_error"] > 5 * NOISE
    assert found["uncertainty"]["noise"] == pytest.approx(NOISE)
    assert found["saturation"]["saturates"] == []


def test_noise_of_rows_measured_twice_is_known_without_a_model():
    once = octomag_samples(6, per=3)
    twice = octomag_samples(7, per=3, currents=once.currents)
    both = SystemSamples(*(np.concatenate([getattr(one, key) for one in (once, twice)]) for key in
                           ("points", "currents", "B")))  # fmt: skip
    found = calibrate(both, degrees=4).report["uncertainty"]
    assert found["noise_from"] == "rows measured more than once"
    assert found["noise"] == pytest.approx(NOISE, rel=0.1)


def test_order_of_the_rows_does_not_matter():
    samples = octomag_samples(8, per=3)
    shuffled = samples.subset(np.random.default_rng(0).permutation(samples.count))
    first, second = calibrate(samples, degrees=2), calibrate(shuffled, degrees=2)
    for one, other in zip(first.system.coils, second.system.coils, strict=True):
        scale = np.abs(one.terms.coefficient).max()
        np.testing.assert_allclose(other.terms.coefficient, one.terms.coefficient, atol=1e-10 * scale)
    assert second.report["heldout"]["B"]["absolute_rms"] == pytest.approx(first.report["heldout"]["B"]["absolute_rms"])


def test_held_out_regions_are_those_of_fits_without_them():
    """The shortcut by leverages equals fitting anew without a region."""
    from magfem.actuation.current_design import CurrentDesign, values_of
    from magfem.actuation.current_fit import fit_degrees, harmonic_units

    samples = octomag_samples(9, per=2)
    units = harmonic_units(2, 9e-3, np.zeros(3))
    place = np.repeat(np.arange(len(GRID)), 2)
    drive = np.column_stack([samples.currents, np.ones(samples.count)])
    design = CurrentDesign(values_of(units, GRID), place, drive, np.ones_like(samples.B))
    part = (GRID[:, 0] > 1e-3).astype(np.int64)[place]
    (fit,) = fit_degrees(units, design, samples.B, part, [2], "none", None)
    matrix = design.rows(np.arange(samples.count))
    for number in (0, 1):
        rows = np.repeat(part != number, 3)
        parameters = np.linalg.lstsq(matrix[rows], samples.B.ravel()[rows], rcond=None)[0]
        expected = samples.B.ravel()[~rows] - matrix[~rows] @ parameters
        np.testing.assert_allclose(fit.left_out[part == number].ravel(), expected, atol=1e-9)
    whole, _, _, _ = np.linalg.lstsq(matrix, samples.B.ravel(), rcond=None)
    np.testing.assert_allclose(fit.table.ravel(), whole, atol=1e-10)


def test_twenty_thousand_rows_are_one_fit():
    """Memory and time grow with the rows alone: benchmarks/fits.py measures them."""
    found = calibrate(octomag_samples(10, per=160))
    assert found.report["rows"] == 20000
    assert found.report["degree"] >= calibrate(octomag_samples(10, per=8)).report["degree"]  # more rows tell more


# Linearity and saturation


@pytest.mark.parametrize("per", [8, 24])
def test_saturation_is_found_and_named(per):
    """One coil of eight loses 3 % at 10 A, as tanh does."""
    found = calibrate(octomag_samples(11, per=per, response=saturating(5, 0.03))).report["saturation"]
    assert found["saturates"] == ["Coil_5"]
    coil = found["coils"][5]
    assert coil["loss"] == pytest.approx(0.03, abs=4 * coil["deviation"] + 0.002)  # the tanh has a fifth order too
    assert coil["linear_up_to"] == pytest.approx(LARGEST * np.sqrt(0.01 / 0.03), rel=0.1)


@pytest.mark.parametrize("per", [8, 24])
@pytest.mark.parametrize("seed", range(3))
def test_no_saturation_where_there_is_none(per, seed):
    found = calibrate(octomag_samples(20 + seed, per=per), degrees=(3, 4)).report["saturation"]
    assert found["saturates"] == []
    for coil in found["coils"]:
        assert abs(coil["loss"]) < 4.5 * coil["deviation"] and coil["deviation"] < 0.002


def test_saturation_cannot_be_told_from_one_size_of_current():
    signs = np.random.default_rng(12).choice([-5.0, 5.0], (8 * len(GRID), 8))
    found = calibrate(octomag_samples(12, currents=signs), degrees=(3, 4)).report["saturation"]
    assert all(coil["loss"] is None and coil["linear_up_to"] is None for coil in found["coils"])
    assert found["saturates"] == []


def test_linearity_floor_is_the_noise_of_a_linear_system():
    found = calibrate(octomag_samples(13, per=16, sigma=NOISE), degrees=4).report["linearity"]
    assert found["from"] == "positions measured more than once"
    assert found["rms"] == pytest.approx(np.sqrt(3) * NOISE, rel=0.05)
    assert not found["significant"] and found["beyond_noise"] < 0.3 * NOISE


def test_linearity_floor_shows_what_is_not_linear():
    """A field that follows |I| in one coil: what no line through I explains is √(1/12) of its largest value, RMS."""
    share = 0.02

    def response(currents):
        followed = currents.copy()
        followed[:, 2] += share * np.abs(currents[:, 2])
        return followed

    found = calibrate(octomag_samples(14, per=40, sigma=NOISE, response=response), degrees=4).report["linearity"]
    size = np.sqrt(np.mean(np.sum(unit_fields(GRID)[:, :, 2] ** 2, axis=1)))
    assert found["significant"]
    assert found["beyond_noise"] == pytest.approx(share * size * LARGEST / np.sqrt(12), rel=0.1)


def test_without_repeated_positions_the_residual_stands_in():
    rng = np.random.default_rng(15)
    points, currents, truth = others(15, 600)
    found = calibrate(SystemSamples(points, currents, truth + rng.normal(scale=NOISE, size=truth.shape)))
    assert found.report["linearity"]["from"] == "the calibration's residual"
    assert found.report["linearity"]["significant"] is None


# A model that is known beforehand


@pytest.fixture(scope="module")
def prior():
    """OctoMag as its file has it."""
    return replace(magfem.load_system("octomag"), workspace=Box((-5e-3,) * 3, (5e-3,) * 3))


GAINS = np.array([1.0, 0.97, 1.02, 1.0, 1.05, 0.99, 1.01, 0.98])


def test_gains_of_a_given_model(prior):
    found = calibrate(octomag_samples(16, per=2, response=lambda currents: currents * GAINS), prior=prior)
    assert found.report["degree"] == 0
    for one, gain in zip(found.report["gains"], GAINS, strict=True):
        assert abs(one["gain"] - gain) < 4 * one["deviation"] < 0.01
    points, currents, _ = others(17)
    truth = np.einsum("nac,nc->na", unit_fields(points), currents * GAINS) + BACKGROUND
    error = np.linalg.norm(found.system.B(points, currents) - truth, axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.4 * NOISE
    assert found.deviation([0, 0, 0], np.ones(8)).shape == (3,)


def test_a_wrong_model_is_corrected_where_that_predicts_better(prior):
    """The model lacks a source that is there: harmonics on top of it, and no larger errors than noise makes."""
    extra = {"Source_List": ["s"], "s": {"A_Coeff": None, "B_Coeff": [4e-8]}}
    extra["s"] |= {"Source_Position": [0.0, 0.0, -0.04], "Source_Direction": [0, 0, 1]}
    samples = octomag_samples(18, per=4)
    more = np.repeat(coil_field(GRID, {"X": extra}, "X"), 4, axis=0) * samples.currents[:, :1]
    samples = replace(samples, B=samples.B + more)
    plain, found = (calibrate(samples, prior=prior, correct=correct) for correct in (False, True))
    assert plain.report["degree"] == 0 and plain.report["uncertainty"]["bias_dominates"] is False
    assert found.report["degree"] >= 1
    points, currents, truth = others(19)
    truth = truth + coil_field(points, {"X": extra}, "X") * currents[:, :1]
    errors = [np.sqrt(np.mean((one.system.B(points, currents) - truth) ** 2)) for one in (plain, found)]
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < NOISE


# What cannot be told


def rows(currents, points=None):
    currents = np.asarray(currents, dtype=float)
    points = np.resize(GRID, (len(currents), 3)) if points is None else points
    return SystemSamples(points, currents, np.random.default_rng(1).normal(size=(len(currents), 3)), source="bench.csv")


def drawn(*columns):
    rng = np.random.default_rng(2)
    return np.stack([one(rng) for one in columns], axis=1)


def free(rng):
    return rng.uniform(-5, 5, 250)


def idle(rng):
    return np.zeros(250)


@pytest.mark.parametrize(
    ("currents", "complaint"),
    [
        (lambda: drawn(free, idle, free), "Coil_1 carried no current"),
        (lambda: (lambda a: a @ [[1, 0, 2], [0, 1, 0]])(drawn(free, free)), "currents of Coil_0 and Coil_2 are propor"),
        (
            lambda: (lambda a: a @ [[1, 0, 0, 1], [0, 1, 0, -1], [0, 0, 1, 0]])(drawn(free, free, free)),
            "currents of Coil_0, Coil_1 and Coil_3 depend on each other",
        ),
        (
            lambda: (lambda a: np.column_stack([a, 3 - a[:, 0]]))(drawn(free, free)),
            "currents of Coil_0 and Coil_2 add up to a constant",
        ),
        (lambda: np.full((250, 1), 2.0), "currents of Coil_0 add up to a constant"),
    ],
)
def test_currents_that_cannot_tell_the_coils(currents, complaint):
    values = currents()
    with pytest.raises(InputError, match=complaint) as caught:
        calibrate(rows(values))
    message = str(caught.value)
    assert "\n" not in message and message.endswith("[bench.csv]")


def test_one_constant_current_is_enough_without_a_background():
    points = np.repeat(GRID, 1, axis=0)
    samples = SystemSamples(points, np.full((len(points), 1), 2.0), 2.0 * unit_fields(points)[:, :, 0])
    found = calibrate(samples, background=False)
    np.testing.assert_allclose(found.system.B([0, 0, 0], [1.0]), unit_fields(np.zeros((1, 3)))[0, :, 0], rtol=1e-4)
    assert found.system.background is None and found.report["background"] is None


@pytest.mark.parametrize(
    ("points", "complaint"),
    [
        (np.resize(GRID[:6], (250, 3)), "6 positions are too few"),
        (np.linspace(0, 1e-2, 250)[:, None] * [1, 1, 0], "all positions lie on a line"),
    ],
)
def test_positions_that_cannot_tell_the_field(points, complaint):
    with pytest.raises(InputError, match=complaint):
        calibrate(rows(drawn(free, free), points))


def test_other_refusals(prior):
    samples = rows(drawn(free, free))
    with pytest.raises(InputError, match="11 rows at 11 positions are too few for 8 coils and a background"):
        calibrate(octomag_samples(1, per=1).subset(slice(0, 11)))
    with pytest.raises(InputError, match="B is zero in every row"):
        calibrate(replace(samples, B=np.zeros((250, 3))))
    with pytest.raises(InputError, match="currents of 2 coils, and 3 names"):
        calibrate(samples, coil_names=["a", "b", "c"])
    with pytest.raises(InputError, match=r"currents of 2 coils, and .* has 8"):
        calibrate(samples, prior=prior)
    with pytest.raises(InputError, match="whole numbers from 1 to 80"):
        calibrate(samples, degrees=0)
    with pytest.raises(InputError, match="names of their own"):
        calibrate(samples, coil_names=["a", "a"])


def test_workspace_is_what_the_samples_fill(calibrated):
    assert calibrated.system.workspace == Box((-5e-3,) * 3, (5e-3,) * 3)
    rng = np.random.default_rng(22)
    direction = rng.normal(size=(400, 3))
    sphere = 5e-3 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    currents = rng.uniform(-5, 5, (400, 8))
    samples = SystemSamples(sphere, currents, np.einsum("nac,nc->na", unit_fields(sphere), currents))
    ball = calibrate(samples, degrees=3).system.workspace
    assert isinstance(ball, Ball) and ball.radius == pytest.approx(5e-3, rel=0.02)
    given = calibrate(samples, degrees=3, workspace=Ball((0.0, 0.0, 0.0), 4e-3), name="mine").system
    assert given.workspace.radius == 4e-3 and given.name == "mine"
    assert isinstance(given, CoilSystem)
    assert OCTOMAG["Coil_List"][:8] == COILS
