"""Separable fits of measurements: degenerate parameters, outliers, single components, bounds, weights, places."""

from __future__ import annotations

import logging
from dataclasses import replace
from itertools import pairwise

import magpylib
import numpy as np
import pytest
from fitting.sensed_magnet import DISC, GRID, deviations_away, read_by_sensor, solved

import magfem
from magfem.fitting import Recipe
from magfem.fitting.alignment import alignment_of
from magfem.fitting.families import axial_multipole, charged_faces, displaced_multipoles, wall_and_face_loops
from magfem.fitting.measurement import Measurement, solve_measurement
from magfem.samples import Samples

NOISE = 2e-5
CENTRE = {"centre_x": 0.6e-3, "centre_y": -0.4e-3, "centre_z": 0.3e-3}
FREE = {"centre": (-3e-3, 3e-3)}


def disturbed(B, seed=0, noise=NOISE):
    return B + noise * np.random.default_rng(seed).normal(size=B.shape)


# Degenerate parameters


@pytest.fixture(scope="module")
def shifted_ring(ring, ring_peer) -> Samples:
    """The ring 0.1 mm above its place, seen all round from 1 to 6 mm with 0.1 mT of noise."""
    points = replace(ring.region, clearance=1e-3).layers(np.random.default_rng(0), 40, 20).reshape(-1, 3)
    return Samples(points, disturbed(ring_peer.getB(points - (0, 0, 1e-4)), noise=1e-4), 1e-4)


def along_the_axis(samples, member, free="centre_z"):
    alignment = alignment_of({free: (-1e-3, 1e-3) if free == "centre_z" else None}, 16e-3)
    return solve_measurement(Measurement(samples, member, alignment, False, "sigma", "evidence", "squares"))


def test_gain_beside_free_coefficients_is_degenerate(ring, shifted_ring) -> None:
    fit = along_the_axis(shifted_ring, next(wall_and_face_loops(ring, ring.region)), "gain")
    assert fit.degenerate == ("gain",) and np.isnan(fit.covariance[-1, -1])
    assert np.isfinite(fit.covariance[:-1, :-1]).all()


@pytest.mark.parametrize("number", [0, 1, 2])
def test_axial_offset_of_loops_with_free_currents_is_degenerate(ring, shifted_ring, number) -> None:
    """Their currents follow it to half a per cent or better."""
    candidates = wall_and_face_loops(ring, ring.region)
    member = [next(candidates) for _ in range(number + 1)][-1]
    assert along_the_axis(shifted_ring, member).degenerate == ("centre_z",)


@pytest.mark.parametrize("poles", [2, 4, 6, 9])
def test_axial_offset_of_a_free_multipole_is_degenerate(ring, shifted_ring, poles) -> None:
    """Poles up to P + 1 stand in for it exactly; that there are none but P is nothing that was measured.

    With six poles the least squares lie 0.28 mm from the truth.
    """
    fit = along_the_axis(shifted_ring, next(axial_multipole(ring, ring.region, poles)))
    assert fit.degenerate == ("centre_z",)


def test_axial_offset_of_known_faces_is_found(ring, shifted_ring) -> None:
    """Geometry fixed, strength free: to 0.2 µm."""
    fit = along_the_axis(shifted_ring, next(charged_faces(ring, ring.region)))
    assert fit.degenerate == ()
    assert abs(fit.theta[0] - 1e-4) < 0.3e-6
    assert abs(deviations_away(fit, {"centre_z": 1e-4})[0]) < 3


def test_a_dipole_has_a_centre() -> None:
    """One pole alone cannot stand in for its own offset."""
    points = GRID + np.array([0, 0, 10e-3])
    dipole = magpylib.misc.Dipole(moment=(0, 0, 0.1), position=(0, 0, 0.5e-3))
    samples = Samples(points, disturbed(dipole.getB(points), noise=1e-6), 1e-6)
    fit = along_the_axis(samples, next(axial_multipole(DISC, DISC.region, 1)))
    assert fit.degenerate == ()
    assert abs(deviations_away(fit, {"centre_z": 0.5e-3})[0]) < 3


def test_parameters_that_the_noise_hides_are_degenerate() -> None:
    """Offsets of elements within 20 µm, where the noise is worth 0.3 mm."""
    samples = Samples(GRID, disturbed(read_by_sensor({}), noise=2e-3), 2e-3)
    hidden = solved(samples, {"offset_xz": (-2e-5, 2e-5), "centre_z": (-3e-3, 3e-3)})
    assert hidden.degenerate == ("offset_xz",)
    assert solved(samples, {"offset_xz": (-3e-3, 3e-3)}).degenerate == ()


def test_the_report_names_degenerate_parameters_and_states_no_deviation(ring, shifted_ring, caplog) -> None:
    recipe = Recipe(
        geometry=ring, family="axial_multipole", free={"centre_z": (-1e-3, 1e-3), "centre_x": (-1e-3, 1e-3)}
    )
    with caplog.at_level(logging.WARNING, "magfem"):
        found = magfem.fit(shifted_ring, recipe).report["measurement"]
    assert found["degenerate"] == ["centre_z"]
    assert found["free"]["centre_z"]["deviation"] is None and found["free"]["centre_x"]["deviation"] > 0
    assert "these data do not decide centre_z" in caplog.text


# Outliers


def test_huber_survives_gross_outliers_where_squares_do_not() -> None:
    """One reading in twenty is off by up to 50 deviations."""
    rng = np.random.default_rng(4)
    B = disturbed(read_by_sensor(CENTRE))
    wrong = rng.random(B.shape) < 0.05
    samples = Samples(GRID, np.where(wrong, B + 50 * NOISE * rng.uniform(0.5, 1, B.shape), B), NOISE)
    robust, plain = (solved(samples, FREE, loss=loss) for loss in ("huber", "squares"))
    assert np.abs(deviations_away(robust, CENTRE)).max() < 3
    assert np.abs(deviations_away(plain, CENTRE)).max() > 6
    assert np.all(robust.weight[wrong.ravel()] < 0.5)
    assert np.mean(robust.weight[~wrong.ravel()] > 0.9) > 0.85


def test_huber_finds_the_noise_by_itself() -> None:
    rng = np.random.default_rng(5)
    B = disturbed(read_by_sensor(CENTRE), 6)
    B[rng.random(B.shape) < 0.05] += 1e-3
    fit = solved(Samples(GRID, B), FREE, weighting="absolute", loss="huber")
    assert fit.theta == pytest.approx(list(CENTRE.values()), abs=3e-6)
    assert 0.03 < np.mean(fit.weight < 0.3) < 0.08


# Sensors of one axis


@pytest.mark.parametrize("axis", [0, 2])
def test_a_probe_of_one_axis_finds_the_magnet(axis) -> None:
    B = np.full(GRID.shape, np.nan)
    B[:, axis] = disturbed(read_by_sensor(CENTRE))[:, axis]
    fit = solved(Samples(GRID, B, NOISE), FREE)
    assert fit.residual.size == len(GRID) and fit.degenerate == ()
    assert np.abs(deviations_away(fit, CENTRE)).max() < 3


def test_single_components_and_whole_vectors_together_are_left_out_as_they_were_measured() -> None:
    """Held-out residuals of a sample: fits without all its components, however many there are."""
    B = disturbed(read_by_sensor({}))
    B[::2, :2] = np.nan
    fit = solved(Samples(GRID, B, NOISE), {}, background=True)
    point = fit.measurement.point_of_row
    for sample in (0, 1, 50, 77):
        others = np.delete(np.arange(len(GRID)), sample)
        without = solved(Samples(GRID[others], B[others], NOISE), {}, background=True)
        matrix, target = fit.measurement.matrix(np.empty(0)), fit.measurement.target
        own = point == sample
        missed = target[own] - matrix[own] @ without.solved.parameters
        np.testing.assert_allclose(fit.left_out[own], missed, rtol=1e-6)


# Bounds


def test_a_bound_that_was_reached_is_reported() -> None:
    B = disturbed(read_by_sensor(CENTRE))
    recipe = Recipe(
        geometry=DISC, family="charged_faces", free={"centre_x": (-2e-3, 0.5e-3), "centre_y": None, "centre_z": None}
    )
    free = magfem.fit(Samples(GRID, B, NOISE), recipe).report["measurement"]["free"]
    assert free["centre_x"]["at_bound"] and free["centre_x"]["value"] == pytest.approx(0.5e-3, rel=1e-3)
    assert not free["centre_y"]["at_bound"] and not free["centre_z"]["at_bound"]


# Weights


def test_relative_weights_minimise_the_relative_error() -> None:
    """(5.3): Σ|ΔB|²/|B|², computed by magpylib for the strength and the height, is smallest where the fit is."""
    clean = read_by_sensor(CENTRE)
    B = clean * (1 + 0.02 * np.random.default_rng(7).normal(size=clean.shape))
    fit = solved(Samples(GRID, B), FREE, weighting="relative")
    size = np.linalg.norm(B, axis=1)
    assert size.min() > 0.01 * size.max()

    def cost(strength, places) -> float:
        away = B - strength * read_by_sensor(dict(zip(CENTRE, places, strict=True)))
        return float(np.sum(np.sum(away**2, axis=1) / size**2))

    strength, least = fit.solved.parameters[0] / 1.2, fit.theta
    best = cost(strength, least)
    assert best == pytest.approx(float(np.sum(fit.residual**2)), rel=1e-9)
    for step in (-1e-3, 1e-3):
        assert cost(strength * (1 + step), least) > best
        for k in range(3):
            assert cost(strength, least + step * 1e-2 * np.eye(3)[k]) > best


# Places of sources


def of_poles(points, places, coefficients):
    """B of Σ_m Σ_k a_mk ∂ᵏ/∂zᵏ(1/|r − d_m ẑ|), k = 1, 2 (5.2): minus the potential's gradient, by complex steps."""

    def potential(x, y, z):
        total = 0.0
        for place, (first, second) in zip(places, coefficients, strict=True):
            height = z - place
            r2 = x**2 + y**2 + height**2
            total = total - first * height * r2**-1.5 + second * (3 * height**2 - r2) * r2**-2.5
        return total

    step = 1e-30
    moved = points[:, None, :] + 1j * step * np.eye(3)
    return -potential(*np.moveaxis(moved, -1, 0)).imag / step


def test_displacements_of_two_sources_are_found() -> None:
    """M = 2, N = 2 with coefficients of their own, noise 2 µT: places and their deviations."""
    places, coefficients = (0.2e-3, -1.2e-3), ((-4e-9, 3e-12), (-6e-9, -5e-12))
    points = DISC.region.layers(np.random.default_rng(1), 20, 20).reshape(-1, 3)
    B = of_poles(points, places, coefficients)
    away = []
    for seed in range(10):
        samples = Samples(points, disturbed(B, seed, 2e-6), 2e-6)
        member = next(displaced_multipoles(DISC, DISC.region, sources=2, orders=2))
        fit = solve_measurement(Measurement(samples, member, alignment_of({}, 1.0), False, "sigma", "none", "squares"))
        top = DISC.length / 2 - 0.25 * DISC.clearance
        # Places are the depth of the first source and the gap to the second.
        true = dict(zip(fit.measurement.free, (top - places[0], places[0] - places[1]), strict=True))
        away.append(deviations_away(fit, true))
        assert fit.degenerate == ()
    assert np.abs(away).max() < 4 and 0.6 < np.sqrt(np.mean(np.square(away))) < 1.4


def test_displacements_are_found_by_magfem_fit() -> None:
    """Two dipoles of magpylib on the axis, 1.5 mm apart."""
    points = DISC.region.layers(np.random.default_rng(2), 20, 15).reshape(-1, 3)
    dipoles = [magpylib.misc.Dipole(moment=(0, 0, m), position=(0, 0, z)) for m, z in ((0.04, 0.2e-3), (0.06, -1.3e-3))]
    samples = Samples(points, disturbed(magpylib.getB(dipoles, points, sumup=True), noise=1e-6), 1e-6)
    recipe = Recipe(geometry=DISC, family="displaced_multipoles", options={"sources": 2, "orders": 1})
    model = magfem.fit(samples, recipe)
    heights = [source["centre"][2] for source in model.terms]
    assert sorted(heights) == pytest.approx([-1.3e-3, 0.2e-3], abs=5e-6)
    assert model.moment == pytest.approx([0, 0, 0.1], abs=1e-4)
    assert all(high > low for high, low in pairwise(heights))
