"""A model's strength from single readings: the rotor's, as the dissertation has them (6.1.2), and synthetic ones."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import magfem
from magfem.errors import InputError, OutsideRegionError
from magfem.fitting.readings import Reading
from magfem.fitting.scaling import scale_to, scaled
from magfem.geometry import CylinderMagnet

ALONG = np.array([1.0, 0.0, 0.0])
DISTANCES = (10e-3, 20e-3, 30e-3, 40e-3)
READINGS = (411e-6, 55e-6, 18e-6, 7e-6)  # T, dissertation 6.1.2, along the magnetisation
UNCERTAINTY = 0.5e-6
IMPLIED = (1.14, 1.21, 1.33, 1.22)  # T, the remanence that each asks for


def reading(x: float, value: float, uncertainty: float | None = UNCERTAINTY, direction=ALONG) -> Reading:
    return Reading(np.array([x, 0.0, 0.0]), np.asarray(direction, dtype=float), value, uncertainty, "a test")


def test_each_reading_of_the_rotor_implies_a_remanence() -> None:
    """With the card's recoil permeability, 1.05."""
    model, card = magfem.load_model("rotor_1x3"), magfem.load_geometry("rotor_1x3")
    scale = scale_to(model, [reading(x, B) for x, B in zip(DISTANCES, READINGS, strict=True)])
    assert isinstance(card, CylinderMagnet)
    np.testing.assert_allclose(card.material.remanence * scale.implied, IMPLIED, rtol=0, atol=0.02)


def test_readings_along_a_finite_cylinder_imply_it_by_magpylib_too(rotor_model, rotor, rotor_peer) -> None:
    scale = scale_to(rotor_model, [reading(x, B) for x, B in zip(DISTANCES, READINGS, strict=True)])
    there = rotor_peer.getB([(x, 0, 0) for x in DISTANCES])[:, 0]
    np.testing.assert_allclose(scale.implied, np.array(READINGS) / there, rtol=1e-4)


def test_deviation_covers_the_scatter_of_the_readings(rotor, rotor_model) -> None:
    """The readings disagree by far more than 0.5 µT: a common scatter makes their squares what chance makes them."""
    measurements = [reading(x, B) for x, B in zip(DISTANCES, READINGS, strict=True)]
    scale = scale_to(rotor_model, measurements)
    alone = scale.implied * 0.5e-6 / np.array(READINGS)
    variance = alone**2 + scale.scatter**2
    assert np.sum((scale.implied - scale.factor) ** 2 / variance) == pytest.approx(len(READINGS) - 1, rel=1e-9)
    assert scale.factor == pytest.approx(np.average(scale.implied, weights=1 / variance), rel=1e-12)
    assert scale.deviation == pytest.approx(np.sum(1 / variance) ** -0.5, rel=1e-12)
    assert scale.chi is not None and scale.chi > 3


def test_deviation_is_that_of_many_draws(rotor_model) -> None:
    """A true factor 0.9, distances off by a random 2 %: the stated deviation is the factors' own scatter."""
    rng, found = np.random.default_rng(4), []
    for _ in range(60):
        values = [
            0.9 * float(rotor_model.B([x, 0.0, 0.0])[0]) * (1 + 0.06 * rng.normal()) + 0.5e-6 * rng.normal()
            for x in DISTANCES
        ]
        found.append(scale_to(rotor_model, [reading(x, B) for x, B in zip(DISTANCES, values, strict=True)]))
    factors = np.array([one.factor for one in found])
    stated = np.sqrt(np.mean([one.deviation**2 for one in found]))
    assert abs(factors.mean() - 0.9) < 3 * factors.std() / np.sqrt(60)
    assert stated == pytest.approx(factors.std(), rel=0.35)  # three degrees of freedom each


def test_readings_that_agree_have_the_deviation_of_their_uncertainty(rotor_model, rotor_peer) -> None:
    true = 0.85 * rotor_peer.getB([(x, 0, 0) for x in DISTANCES])[:, 0]
    scale = scale_to(rotor_model, [reading(x, B) for x, B in zip(DISTANCES, true, strict=True)])
    assert scale.factor == pytest.approx(0.85, rel=1e-4)
    assert scale.deviation == pytest.approx(UNCERTAINTY / np.linalg.norm(true / 0.85), rel=1e-3)


def test_exact_readings_give_the_exact_factor(rotor_model) -> None:
    rng = np.random.default_rng(1)
    points = rotor_model.region.layers(rng, 2, 5).reshape(-1, 3)
    directions = rng.normal(size=points.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = 1.07 * np.sum(rotor_model.B(points) * directions, axis=1)
    scale = scale_to(
        rotor_model, [Reading(*one, 1e-6, "") for one in zip(points, directions, values.tolist(), strict=True)]
    )
    assert scale.factor == pytest.approx(1.07, rel=1e-12)
    np.testing.assert_allclose(scale.implied, 1.07, rtol=1e-10)


def test_readings_without_uncertainty_count_by_their_size(rotor_model) -> None:
    """The mean of the implied factors for readings whose implied factors differ little; chi is not known."""
    there = rotor_model.B([(x, 0.0, 0.0) for x in DISTANCES])[:, 0]
    factors = 1 + 1e-4 * np.array([1.0, -2.0, 0.5, 0.5])
    scale = scale_to(
        rotor_model, [reading(x, B, None) for x, B in zip(DISTANCES, (there * factors).tolist(), strict=True)]
    )
    assert scale.chi is None and scale.factor == pytest.approx(1.0, abs=1e-7)
    assert scale.deviation == pytest.approx(1e-4 * np.sqrt(5.5 / 3 / 4), rel=1e-3)


def test_signs_of_readings_count(rotor_model) -> None:
    """A sensor that looks the other way reads the negative."""
    B = float(rotor_model.B((10e-3, 0, 0))[0])
    both = [reading(10e-3, B), reading(10e-3, -B, direction=-ALONG)]
    assert scale_to(rotor_model, both).factor == pytest.approx(1.0, rel=1e-12)


def test_a_scaled_model_is_the_factor_times_the_model(rotor_model, rotor_points) -> None:
    scale = scale_to(rotor_model, [reading(x, B) for x, B in zip(DISTANCES, READINGS, strict=True)])
    model = scaled(rotor_model, scale)
    np.testing.assert_allclose(model.B(rotor_points), scale.factor * rotor_model.B(rotor_points), rtol=1e-12)
    share = scale.deviation / scale.factor
    for key in ("B", "gradient"):
        assert model.report["bound"][key] == pytest.approx(rotor_model.report["bound"][key] + 2 * share)
    assert model.report["scale"] == scale.to_dict()
    # The factor's deviation is the same share of the field everywhere: it dwarfs the fit's own.
    point = rotor_points[30, :4]
    own = np.abs(share * model.B(point))
    np.testing.assert_allclose(model.deviation(point)[0], own, rtol=1e-3, atol=1e-6 * own.max())


def test_a_single_reading_has_the_deviation_of_its_uncertainty(rotor_model) -> None:
    scales = [scale_to(rotor_model, [reading(20e-3, 55e-6, sigma)]) for sigma in (0.5e-6, 1e-6, 2e-6)]
    assert all(two.deviation == pytest.approx(2 * one.deviation, rel=1e-12) for one, two in pairwise(scales))


def test_readings_that_say_nothing_are_refused(rotor_model) -> None:
    with pytest.raises(InputError, match="one measurement or more"):
        scale_to(rotor_model, [])
    across = reading(10e-3, 1e-6, direction=(0.0, 0.0, 1.0))
    with pytest.raises(InputError, match="vanishes in the model"):
        scale_to(rotor_model, [reading(10e-3, 411e-6), across])
    with pytest.raises(OutsideRegionError):
        scale_to(rotor_model, [reading(0.6e-3, 0.2)])


def test_readings_that_nothing_weighs_are_refused(rotor_model) -> None:
    with pytest.raises(InputError, match="a single measurement needs its uncertainty"):
        scale_to(rotor_model, [reading(10e-3, 411e-6, None)])
    with pytest.raises(InputError, match="of zero needs an uncertainty"):
        scale_to(rotor_model, [reading(10e-3, 411e-6, None), reading(20e-3, 0.0, None)])


def test_readings_that_cannot_be_weighed_are_refused(rotor_model) -> None:
    known, unknown = reading(10e-3, 411e-6), Reading(np.array([0.02, 0, 0]), np.array([1.0, 0, 0]), 55e-6, None, "")
    with pytest.raises(InputError, match="either all measurements have an uncertainty or none"):
        scale_to(rotor_model, [known, unknown])
    exact = [
        Reading(np.array([x, 0, 0]), np.array([1.0, 0, 0]), float(rotor_model.B([x, 0, 0])[0]), None, "")
        for x in DISTANCES
    ]
    with pytest.raises(InputError, match="agree exactly"):
        scale_to(rotor_model, exact)


def test_a_model_per_ampere_is_not_scaled_by_readings_in_T() -> None:
    with pytest.raises(InputError, match="per ampere"):
        scale_to(magfem.load_model("bigmag_air"), [reading(50e-3, 1e-3)])
