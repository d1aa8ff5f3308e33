"""Models of samples: intervals that cover, orders that do not overfit, bias that is named, and two measurements."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import magpylib
import numpy as np
import pytest

import magfem
from magfem.errors import ConvergenceError, InputError
from magfem.fields.workspace_region import Ball, Box
from magfem.fitting import FieldModel, Recipe
from magfem.fitting.found_parameters import found_parameters
from magfem.fitting.held_out import regions
from magfem.geometry import AXIAL, CylinderMagnet, PermanentMagnet
from magfem.samples import Samples, read_samples
from magfem.typing import Floats, Points

REFERENCES = Path(__file__).parents[1] / "references"
SEEDS = range(20)


class Judged(NamedTuple):
    """Per seed: the shares of components that ±1.96 deviations cover, and the RMS error over the RMS field."""

    models: list[FieldModel]
    B: list[float]
    gradient: list[float]
    rms: list[float]


def judged(points: Points, B: Floats, noise: float, unit: str, recipe: Recipe, test: Points, truth: Any) -> Judged:
    """Fits for all seeds, compared with the true B and gradient at points that were not measured."""
    result = Judged([], [], [], [])
    for seed in SEEDS:
        noisy = B + noise * np.random.default_rng(seed).normal(size=B.shape)
        model = magfem.fit(Samples(points, noisy, noise, unit=unit), recipe)
        found, deviation = model.jet(test), model.deviation(test)
        covered = [
            float(np.mean(np.abs(one - true) <= 1.96 * by))
            for one, true, by in zip(found, truth, deviation, strict=True)
        ]
        error = np.sqrt(np.sum((found[0] - truth[0]) ** 2) / np.sum(truth[0] ** 2))
        for values, value in zip(result, (model, *covered, float(error)), strict=True):
            values.append(value)
    return result


# Devices


@pytest.fixture(scope="module")
def noisy_ring(ring_solution) -> Judged:
    """1500 points all round the solved ring, 0.1 mT."""
    region = ring_solution.geometry.region
    points, test = (region.layers(np.random.default_rng(seed), 50, 30).reshape(-1, 3) for seed in (1, 2))
    recipe = Recipe(geometry=ring_solution.geometry)
    return judged(points, ring_solution.B(points), 1e-4, "T", recipe, test, ring_solution.jet(test))


def test_intervals_of_the_ring_cover(noisy_ring) -> None:
    assert 0.90 < np.mean(noisy_ring.B) < 0.99
    assert 0.90 < np.mean(noisy_ring.gradient) < 0.99


def test_noisy_ring_is_found_to_half_a_thousandth(noisy_ring) -> None:
    assert max(noisy_ring.rms) <= 5e-4


def test_ring_s_own_error_is_below_the_noise(noisy_ring) -> None:
    for model in noisy_ring.models:
        stated = model.report["uncertainty"]
        assert not stated["bias_dominates"] and stated["noise"] == pytest.approx(1e-4)
        assert stated["standardised_residual"] == pytest.approx(1.0, abs=0.05)
        assert model.report["condition"] <= 1e7
        assert model.provenance["source"] == "measured samples"


def test_bias_of_six_poles_is_named(ring_solution, caplog) -> None:
    """An axial multipole on the ring's samples: its residual is tens of times the noise, and it says so."""
    points = replace(ring_solution.geometry.region, clearance=1e-3).layers(np.random.default_rng(1), 50, 30)
    B = ring_solution.B(points.reshape(-1, 3))
    noisy = B + 1e-4 * np.random.default_rng(0).normal(size=B.shape)
    samples = Samples(points.reshape(-1, 3), noisy, 1e-4)
    with caplog.at_level(logging.WARNING, "magfem"):
        model = magfem.fit(samples, Recipe(geometry=ring_solution.geometry, family="axial_multipole"))
    stated = model.report["uncertainty"]
    assert stated["bias_dominates"] and stated["standardised_residual"] > 10
    left = np.sqrt(np.mean((model.B(samples.points) - B) ** 2))
    assert stated["model_error"] == pytest.approx(left, rel=0.05)
    assert "own error is larger than the noise" in caplog.text


def test_noisy_solenoid_is_found_to_half_a_per_cent() -> None:
    """At 4 A, 0.1 mT in each of 1500 points; samples are per ampere."""
    solution = magfem.solve(magfem.load_geometry("solenoid_24x48x60"))
    region = solution.geometry.region
    points, test = (region.layers(np.random.default_rng(seed), 50, 30).reshape(-1, 3) for seed in (1, 2))
    noise, B, truth = 1e-4 / 4, solution.B(points), solution.B(test)
    noisy = B + noise * np.random.default_rng(0).normal(size=B.shape)
    model = magfem.fit(Samples(points, noisy, noise, unit="T/A"), Recipe(geometry=solution.geometry))
    assert model.unit == "T/A"
    assert np.sqrt(np.sum((model.B(test) - truth) ** 2) / np.sum(truth**2)) <= 5e-3


# Workspaces


def cubic(points: Points) -> tuple[Floats, Floats]:
    """B and gradient of minus the gradient of a potential of degrees 1 to 3, written out by hand; m and T."""
    x, y, z = np.moveaxis(points / 0.02, -1, 0)
    one, zero = np.ones_like(x), np.zeros_like(x)
    # V/a = -(x + z/2) - xz - yz/2 - (x² - y²)/4 - (z³ - 3/2 z (x² + y²))/5 - xyz/3, B₀ = 10 mT
    B = [
        one + z + x / 2 - 3 / 5 * x * z + y * z / 3,
        z / 2 - y / 2 - 3 / 5 * y * z + x * z / 3,
        one / 2 + x + y / 2 + 3 / 5 * z**2 - 3 / 10 * (x**2 + y**2) + x * y / 3,
    ]
    slopes = [
        [1 / 2 - 3 / 5 * z, z / 3, one - 3 / 5 * x + y / 3],
        [z / 3, -1 / 2 - 3 / 5 * z, one / 2 - 3 / 5 * y + x / 3],
        [one - 3 / 5 * x + y / 3, one / 2 - 3 / 5 * y + x / 3, 6 / 5 * z + zero],
    ]
    gradient = np.stack([np.stack(row, axis=-1) for row in slopes], axis=-2)
    return 0.01 * np.stack(B, axis=-1), 0.01 / 0.02 * gradient


@pytest.fixture(scope="module")
def grid() -> Points:
    axis = np.linspace(-20e-3, 20e-3, 5)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def test_the_cubic_field_is_maxwell_s() -> None:
    points = np.random.default_rng(0).uniform(-20e-3, 20e-3, (50, 3))
    step = 1e-6
    _, gradient = cubic(points)
    slopes = [(cubic(points + step * axis)[0] - cubic(points - step * axis)[0]) / (2 * step) for axis in np.eye(3)]
    np.testing.assert_allclose(gradient, np.stack(slopes, axis=-1), atol=1e-9)
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-12
    assert np.array_equal(gradient, np.swapaxes(gradient, 1, 2))


@pytest.fixture(scope="module")
def noisy_grid(grid) -> Judged:
    """125 points, 50 µT; judged within the ball about them."""
    rng = np.random.default_rng(3)
    test = Ball((0.0, 0.0, 0.0), 20e-3).random_points(rng, 1000)
    recipe = Recipe(heldout="regions")
    return judged(grid, cubic(grid)[0], 5e-5, "T", recipe, test, cubic(test))


def test_intervals_of_interior_harmonics_cover(noisy_grid) -> None:
    assert 0.90 < np.mean(noisy_grid.B) < 0.99
    assert 0.90 < np.mean(noisy_grid.gradient) < 0.99


def test_grids_do_not_overfit(noisy_grid) -> None:
    """Degree 3 in truth: held-out regions choose 3, or 4 at most, though higher degrees leave smaller residuals."""
    chosen = [model.report["label"] for model in noisy_grid.models]
    assert set(chosen) <= {"interior harmonics up to degree 3", "interior harmonics up to degree 4"}
    assert chosen.count("interior harmonics up to degree 3") >= 15
    for model in noisy_grid.models:
        tried = model.report["candidates"]
        assert tried[-1]["training_rms"] < tried[2]["training_rms"]
        assert tried[-1]["parameters"] > model.report["parameters"]


def test_regions_are_eight_parts_of_space(grid) -> None:
    """Nearly equal, and each a box of its own: no point of one lies among those of another."""
    number = regions(grid)
    counts = np.bincount(number)
    assert len(counts) == 8 and counts.min() >= 10
    boxes = [(grid[number == one].min(axis=0), grid[number == one].max(axis=0)) for one in range(8)]
    volumes = [np.prod(high - low) for low, high in boxes]
    assert sum(volumes) < 1.1 * np.prod(np.ptp(grid, axis=0))


def test_held_out_regions_are_refits_without_them(grid) -> None:
    """What is said of the chosen order, by ordinary least squares on the other seven regions."""
    B = cubic(grid)[0] + 5e-5 * np.random.default_rng(5).normal(size=grid.shape)
    options = {"degrees": 3}
    recipe = Recipe(family="interior_harmonics", options=options, ridge="none", heldout="regions")
    stated = magfem.fit(Samples(grid, B, 5e-5), recipe).report["heldout"]["B"]["absolute_rms"]
    number = regions(grid)
    missed = np.zeros(len(grid))
    for one in range(8):
        others = number != one
        centre = {"centre": (0.0, 0.0, 0.0)}
        model = magfem.fit(Samples(grid[others], B[others], 5e-5), replace(recipe, options=options | centre))
        missed[~others] = np.linalg.norm(model.B(grid[~others], "extrapolate") - B[~others], axis=1)
    assert stated == pytest.approx(np.sqrt(np.mean(missed**2)), rel=1e-6)


def test_a_background_is_no_source(noisy_ring, ring_solution) -> None:
    """A static field in the samples is found as such and is no part of the model."""
    region = ring_solution.geometry.region
    points = region.layers(np.random.default_rng(1), 30, 20).reshape(-1, 3)
    B = ring_solution.B(points) + np.array([2e-4, -1e-4, 5e-4])
    noisy = B + 2e-5 * np.random.default_rng(0).normal(size=B.shape)
    model = magfem.fit(Samples(points, noisy, 2e-5), Recipe(geometry=ring_solution.geometry, background=True))
    found = model.report["measurement"]["background"]
    away = (np.array(found["value"]) - (2e-4, -1e-4, 5e-4)) / found["deviation"]
    assert np.abs(away).max() < 4
    assert np.sqrt(np.mean((model.B(points) - ring_solution.B(points)) ** 2)) < 2e-5


# Regions of models


def test_without_a_device_the_model_holds_where_the_samples_are(grid) -> None:
    B, _ = cubic(grid)
    model = magfem.fit(Samples(grid, B))
    assert isinstance(model.region, Ball) and model.region.contains(grid).all()
    above = grid + np.array([0, 0, 0.1])
    outside = magfem.fit(Samples(above, B, 1e-5), Recipe(family="exterior_harmonics"))
    assert isinstance(outside.region, Box) and outside.region.contains(above).all()


def test_models_of_samples_come_back_from_their_file(noisy_grid, tmp_path) -> None:
    model = noisy_grid.models[0]
    model.save(tmp_path / "workspace.json")
    back = magfem.load_model(tmp_path / "workspace.json")
    points = model.region.layers(np.random.default_rng(1), 2, 20)
    assert np.array_equal(back.B(points), model.B(points))
    assert back.report == model.report and back.region == model.region


# Two published measurements


@pytest.fixture(scope="module")
def gradient_field() -> Samples:
    field = read_samples(REFERENCES / "ibi_gradient_2Tpm_tdesign36.csv")
    assert isinstance(field, Samples)
    return field


@pytest.fixture(scope="module")
def gradient_model(gradient_field) -> FieldModel:
    return magfem.fit(gradient_field)


def test_measured_gradient_is_two_tesla_per_metre(gradient_model) -> None:
    """As its source says: 2 T/m along one axis, half of it against the other two."""
    along = np.sort(np.linalg.eigvalsh(gradient_model.gradient(gradient_model.region.centre)))
    assert along == pytest.approx([-1.0, -1.0, 2.0], rel=0.03)
    assert gradient_model.region.radius == pytest.approx(42e-3, rel=1e-3)


def test_measured_gradient_takes_four_degrees_and_no_more(gradient_model) -> None:
    """Degrees 5 and 6 fit closer and predict worse: the tool stops lower by itself, and says what it tried."""
    tried = {one["label"].split()[-1]: one for one in gradient_model.report["candidates"]}
    assert gradient_model.report["label"] == "interior harmonics up to degree 4"
    assert tried["4"]["heldout_rms"] < tried["5"]["heldout_rms"] < tried["6"]["heldout_rms"]
    assert tried["4"]["training_rms"] > tried["5"]["training_rms"] > tried["6"]["training_rms"]
    assert gradient_model.report["heldout"]["B"]["rms"] < 0.01


def test_measured_gradient_s_deviations_are_too_small_for_its_residual(gradient_model) -> None:
    stated = gradient_model.report["uncertainty"]
    assert stated["bias_dominates"] and 4 < stated["standardised_residual"] < 7


def test_elements_of_the_gradient_s_sensor_sit_apart(gradient_field, gradient_model) -> None:
    """With a place for each element of the sensor the residual falls, held out as well."""
    offset = magfem.fit(
        gradient_field, Recipe(options={"degrees": 4}, family="interior_harmonics", free={"offsets": None})
    )
    for key in ("training", "heldout"):
        assert offset.report[key]["B"]["absolute_rms"] < 0.8 * gradient_model.report[key]["B"]["absolute_rms"]
    found = offset.report["measurement"]
    assert found["degenerate"] == []
    for name in ("offset_xz", "offset_yy"):
        assert abs(found["free"][name]["value"]) > 4 * found["free"][name]["deviation"]
        assert 2e-3 < abs(found["free"][name]["value"]) < 4e-3


@pytest.fixture(scope="module")
def scanned() -> FieldModel:
    """The scan of a magnet of 8 × 2 mm, 7 mm above a sensor whose pose is known to some tenths of a millimetre."""
    disc = CylinderMagnet(
        diameter=8e-3, length=2e-3, material=PermanentMagnet(1.2, 1.0, AXIAL), clearance=1e-3, extent=20e-3
    )
    scan = read_samples(REFERENCES / "bomatec_D8H2_scan.csv", {"x": "-magnet_x_mm", "y": "=0 mm", "z": "=-7 mm"})
    assert isinstance(scan, Samples)
    free = {"centre": (-3e-3, 3e-3), "tilt_x": None, "tilt_y": None, "turn": None}
    return magfem.fit(scan, Recipe(geometry=disc, family="device", free=free))


def test_scanned_magnet_has_its_remanence(scanned) -> None:
    """1126 mT, with 0.064 mT left: what magpylib's documentation finds in the same scan."""
    found = scanned.report["measurement"]["remanence"]
    assert found["value"] == pytest.approx(1.126, abs=2e-3) and 0 < found["deviation"] < 2e-3
    assert scanned.report["training"]["B"]["absolute_rms"] == pytest.approx(0.064e-3, abs=0.003e-3)
    assert scanned.moment[2] == pytest.approx(found["value"] * np.pi * (4e-3) ** 2 * 2e-3 / (4e-7 * np.pi), rel=1e-3)


def test_scanned_magnet_may_roll_about_its_line(scanned) -> None:
    """Magnet and sensor turned together about the line of the scan read the same: that roll is not decided."""
    found = scanned.report["measurement"]
    assert found["degenerate"] == ["centre_y", "tilt_x", "turn_x"]
    assert found["free"]["centre_x"]["deviation"] < 10e-6 and found["free"]["centre_z"]["deviation"] < 10e-6
    assert not any(one["at_bound"] for one in found["free"].values())


def test_one_candidate_without_deviations_does_not_tell_noise_from_bias(scanned) -> None:
    stated = scanned.report["uncertainty"]
    assert not stated["told_apart"] and not stated["bias_dominates"] and stated["model_error"] == 0.0
    # What is left may all be the model's own: the bound leaves nothing out as noise.
    assert scanned.report["bound"]["B"] >= scanned.report["training"]["B"]["max"]


def test_found_parameters_end_at_the_second_digit_of_their_deviation():
    """By hand: 0.02139 deg of deviation leave 1.079 deg."""
    degree = np.pi / 180
    free = {
        "turn_y": {"value": 1.07912 * degree, "deviation": 0.0213948 * degree, "at_bound": False},
        "centre_x": {"value": -7.2087e-4, "deviation": 1.76179e-6, "at_bound": True},
        "tilt_x": {"value": 0.5 * degree, "deviation": None, "at_bound": False},
        "gain": {"value": 1.0234567, "deviation": 0.0123, "at_bound": False},
    }
    found = found_parameters({"free": free, "remanence": {"value": 1.12564, "deviation": 9.34e-4}})
    assert [tuple(one) for one in found] == [
        ("turn y", "1.079 deg ± 0.021 deg", ""),
        ("centre x", "-720.9 µm ± 1.8 µm", "at the limit of its bounds"),
        ("tilt x", "0.5 deg", "cannot be told from the coefficients"),
        ("gain", "1.023 ± 0.012", ""),
        ("remanence", "1.12564 T ± 930 µT", ""),
    ]


# Refusals


def test_weights_by_deviations_need_deviations(grid) -> None:
    with pytest.raises(InputError, match="state no standard deviations"):
        magfem.fit(Samples(grid, cubic(grid)[0]), Recipe(weighting="sigma"))


def test_families_of_devices_need_one(grid) -> None:
    for family in ("axial_multipole", "device"):
        with pytest.raises(InputError, match=f"the family {family} needs a device"):
            magfem.fit(Samples(grid, cubic(grid)[0]), Recipe(family=family))


def test_too_few_samples_are_refused(grid) -> None:
    with pytest.raises(ConvergenceError, match="3 measured components are too few"):
        B = np.where(np.arange(3) < [[2], [1]], cubic(grid[:2])[0], np.nan)
        magfem.fit(Samples(grid[:2], B))
    with pytest.raises(InputError, match="lie all at one place"):
        magfem.fit(Samples(grid[:1], cubic(grid[:1])[0]))
    with pytest.raises(InputError, match="zero throughout"):
        magfem.fit(Samples(grid, np.zeros_like(grid)))


def test_samples_that_say_nothing_of_most_terms_ask_for_a_symmetry() -> None:
    """The axial component along the axis alone: whatever is not axial does not show at all."""
    line = np.column_stack([np.zeros((40, 2)), np.linspace(-20e-3, 20e-3, 40)])
    B = np.full((40, 3), np.nan)
    B[:, 2] = cubic(line)[0][:, 2] + 1e-6 * np.random.default_rng(1).normal(size=40)
    with pytest.raises(ConvergenceError, match=r"a symmetry .* leaves fewer parameters"):
        magfem.fit(Samples(line, B, 1e-6))
    axial = magfem.fit(Samples(line, B, 1e-6), Recipe(family="interior_harmonics", options={"symmetry": "axial"}))
    np.testing.assert_allclose(axial.B(line)[:, 2], cubic(line)[0][:, 2], atol=5e-6)


def test_two_unknown_magnets_take_two_centres() -> None:
    """Expansions about both magnets describe what none about the middle between them does."""
    places = np.array([[-6e-3, 0, 0], [6e-3, 2e-3, 0]])
    magnets = [
        magpylib.magnet.Cuboid(dimension=(3e-3, 3e-3, 2e-3), polarization=turn, position=place)
        for turn, place in zip([(0.3, 0, 1.0), (0, 1.1, 0)], places, strict=True)
    ]
    rng = np.random.default_rng(3)
    points = rng.uniform(-20e-3, 20e-3, (700, 3))
    points = points[np.linalg.norm(points[:, None] - places, axis=2).min(axis=1) > 7e-3]
    B = magpylib.getB(magnets, points, sumup=True)
    samples = Samples(points, B + 1e-6 * rng.normal(size=B.shape), 1e-6)
    options = {"centres": places.tolist(), "radius": 3e-3}
    both = magfem.fit(samples, Recipe(family="exterior_harmonics", options=options))
    assert both.report["heldout"]["B"]["absolute_rms"] < 4e-6
    with pytest.raises(ConvergenceError, match="describes these samples"):
        magfem.fit(samples, Recipe(family="exterior_harmonics", options={"radius": 8e-3, "degrees": (1, 2, 3, 4, 5)}))
