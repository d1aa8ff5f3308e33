"""Where magnet and sensor are, how they are turned: found in what magpylib says a sensor would read."""

from __future__ import annotations

import numpy as np
import pytest
from fitting.sensed_magnet import GRID, deviations_away, read_by_sensor, solved

from magfem.errors import InputError
from magfem.fitting.alignment import ALIASES, GROUPS, NAMES, Alignment, alignment_of
from magfem.samples import Samples

NOISE = 2e-5
BACKGROUND = (30e-6, -10e-6, 45e-6)
TRUE = {
    "centre_x": 0.6e-3,
    "centre_y": -0.4e-3,
    "centre_z": 0.3e-3,
    "tilt_x": 0.05,
    "tilt_y": -0.03,
    "turn_x": 0.02,
    "turn_y": 0.04,
    "turn_z": -0.1,
}
FREE = {"centre": (-3e-3, 3e-3), "tilt_x": None, "tilt_y": None, "turn": None}
ELEMENTS = {"offset_xx": 0.1e-3, "offset_xy": -0.2e-3, "offset_xz": 0.3e-3, "offset_yx": 0.15e-3, "offset_yz": -0.25e-3}


def noisy(seed: int, true=TRUE, background=BACKGROUND) -> Samples:
    B = read_by_sensor(true, background=background)
    return Samples(GRID, B + NOISE * np.random.default_rng(seed).normal(size=B.shape), NOISE)


# Found


def test_without_noise_everything_is_found() -> None:
    fit = solved(
        Samples(GRID, read_by_sensor(TRUE, background=BACKGROUND)), FREE, background=True, weighting="absolute"
    )
    np.testing.assert_allclose(fit.theta, [TRUE[name] for name in fit.measurement.free], atol=1e-8)
    np.testing.assert_allclose(fit.solved.parameters[-3:], BACKGROUND, atol=1e-10)
    assert fit.degenerate == ()


def test_stated_deviations_are_the_scatter_over_twenty_seeds() -> None:
    """Pose, turn of the sensor and background together: each within 3 deviations nearly always, RMS about one."""
    away = []
    for seed in range(20):
        fit = solved(noisy(seed), FREE, background=True)
        own = np.sqrt(np.diag(fit.covariance))[1:4]
        away.append([*deviations_away(fit, TRUE), *(fit.solved.parameters[1:] - BACKGROUND) / own])
    size = np.abs(away)
    assert size.shape == (20, 11)
    assert np.mean(size < 3) > 0.98
    assert 0.8 < np.sqrt(np.mean(size**2)) < 1.2


def test_elements_of_the_sensor_are_found_one_by_one() -> None:
    """Places of the x and the y element against the z element's, as well as the magnet's own."""
    true = {"centre_z": 0.3e-3} | ELEMENTS
    away = []
    for seed in range(20):
        fit = solved(noisy(seed, true), {"centre": (-3e-3, 3e-3), "offsets": (-1e-3, 1e-3)}, background=True)
        away.append(deviations_away(fit, true))
        assert fit.degenerate == ()
    assert np.abs(away).max() < 4.5
    assert 0.8 < np.sqrt(np.mean(np.square(away))) < 1.2


def test_gain_beside_a_free_strength_is_named_and_their_product_found() -> None:
    fit = solved(noisy(1, {"gain": 1.1}), {"gain": None}, background=True)
    assert fit.degenerate == ("gain",)
    strength = solved(noisy(1, {}), {}, background=True).solved.parameters[0]
    assert fit.theta[0] * fit.solved.parameters[0] == pytest.approx(1.1 * strength, rel=1e-3)


# What a scan cannot tell


def test_rolling_about_a_straight_scan_is_named() -> None:
    """On one line along x, magnet and sensor may turn about that line together, and nothing is read differently."""
    line = np.column_stack([np.linspace(-15e-3, 15e-3, 61), np.zeros(61), np.full(61, 7e-3)])
    rolled = {"centre_y": 7e-3 * np.sin(0.2), "centre_z": 7e-3 * (1 - np.cos(0.2)), "tilt_x": 0.2, "turn_x": 0.2}
    rng = np.random.default_rng(3)
    B = read_by_sensor({}, line)
    np.testing.assert_allclose(read_by_sensor(rolled, line), B, atol=1e-12)
    fit = solved(Samples(line, B + NOISE * rng.normal(size=B.shape), NOISE), FREE)
    assert set(fit.degenerate) == {"centre_y", "tilt_x", "turn_x"}
    linear = len(fit.solved.parameters)
    for k, name in enumerate(fit.measurement.free):
        assert np.isnan(fit.covariance[linear + k, linear + k]) == (name in fit.degenerate)


def test_spin_about_its_own_axis_is_named() -> None:
    fit = solved(noisy(2), FREE | {"tilt_z": None}, background=True)
    assert fit.degenerate == ("tilt_z",)


# Names and bounds


def test_groups_are_their_parameters_and_height_is_a_coordinate() -> None:
    assert alignment_of(["centre"], 0.1).names == GROUPS["centre"]
    assert alignment_of({"height": (0.0, 1e-3)}, 0.1).bounds == {"centre_z": (0.0, 1e-3)}
    assert alignment_of([*GROUPS, "gain"], 0.1).names == NAMES
    assert ALIASES == {"height": "centre_z"}


def test_default_bounds_go_with_the_extent() -> None:
    bounds = alignment_of(["centre_x", "offset_xz", "turn_y", "gain"], 0.2).bounds
    assert bounds["centre_x"] == (-0.2, 0.2) and bounds["offset_xz"] == (-0.01, 0.01)
    assert bounds["turn_y"] == pytest.approx((-np.pi / 6, np.pi / 6)) and bounds["gain"] == (0.5, 2.0)


def test_values_of_fixed_parameters_are_neutral() -> None:
    values = Alignment({"turn_x": (-1.0, 1.0)}).values(np.array([0.25]))
    assert values.pop("turn_x") == 0.25 and values.pop("gain") == 1.0
    assert set(values.values()) == {0.0} and len(values) == len(NAMES) - 2


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ({"roll": None}, "unknown free parameter 'roll'; known: centre"),
        ({"gain": (2.0, 0.5)}, "the lower bound must be smaller than the upper one, got 2 and 0.5"),
        ({"centre_x": (1e-3, 1e-3)}, "the lower bound must be smaller"),
    ],
)
def test_names_and_bounds_are_checked(free, words) -> None:
    with pytest.raises(InputError, match=words):
        alignment_of(free, 0.1)
