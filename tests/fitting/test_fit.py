"""Fits of closed forms and solutions: errors on fresh points, moments, choice of order, noise, any sensible magnet."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

import magfem
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.field import Evaluated
from magfem.fields.norms import relative_errors
from magfem.fields.region import Everywhere
from magfem.fields.terms import harmonics
from magfem.fitting import Recipe, validate
from magfem.fitting.families import wall_and_face_loops
from magfem.fitting.least_squares import solve_least_squares
from magfem.geometry import CylinderMagnet
from magfem.typing import Floats

CENTRAL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])  # weights of the eighth-order first difference
devices = pytest.mark.parametrize("name", ["ring", "rotor", "skew"])


class Source(Evaluated):
    """A field of our making that belongs to a device."""

    region = Everywhere()

    def __init__(self, jet, geometry=None, unit="T") -> None:
        self.make, self.geometry, self.unit, self.asked = jet, geometry, unit, []

    def evaluate(self, points, order):
        return self.make(points, order)

    def jet(self, points, order=1, outside="raise"):
        """As it is asked, with the layers of the points: what a fit sees."""
        self.asked.append(np.array(points))
        shaped = super().jet(points, order, outside)
        return self.disturb(shaped, len(self.asked) - 1)

    def disturb(self, jet, call):
        return jet


def largest(found: Floats, truth: Floats) -> float:
    return float(relative_errors(found, truth).max())


def same_bits(a, b) -> bool:
    return all(np.array_equal(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))


# The accuracy that is asked of every model


@devices
def test_model_of_closed_form_matches_magpylib_and_its_gradient(name, request):
    model, field, peer, points = (
        request.getfixturevalue(f"{name}_{what}") for what in ("model", "field", "peer", "points")
    )
    B, gradient = model.jet(points)
    assert largest(B, peer.getB(points.reshape(-1, 3)).reshape(points.shape)) <= 5e-5
    assert largest(gradient, field.gradient(points)) <= 5e-4
    assert model.report["condition"] <= 1e7


@pytest.mark.parametrize("name", ["ring", "rotor"])
def test_model_of_solution_matches_the_solution(name, request):
    model, solution, points = (
        request.getfixturevalue(f"{name}_{what}") for what in ("solution_model", "solution", "points")
    )
    for ours, truth, target in zip(model.jet(points), solution.jet(points), (5e-5, 5e-4), strict=True):
        assert largest(ours, truth) <= target
    assert model.report["condition"] <= 1e7
    for key, safety in (("B", 1.5), ("gradient", 1.5)):
        share = solution.error[key]
        assert model.report["fem"][key] == share
        assert model.report["bound"][key] >= model.report["heldout"][key]["max"] + share
        assert model.report["bound"][key] <= safety * model.report["heldout"][key]["max"] + 1.001 * share


@devices
def test_moment_is_remanence_times_volume(name, request):
    device, model = (request.getfixturevalue(key) for key in (name, f"{name}_model"))
    expected = device.material.remanence_vector * device.volume / MU_0
    assert np.linalg.norm(model.moment - expected) <= 1e-5 * np.linalg.norm(expected)


def test_moment_of_solution_model_is_the_solution_s(
    ring_solution, ring_solution_model, rotor_solution, rotor_solution_model
):
    for solution, model in ((ring_solution, ring_solution_model), (rotor_solution, rotor_solution_model)):
        assert np.linalg.norm(model.moment - solution.moment) <= 1e-5 * np.linalg.norm(solution.moment)


def test_degree_one_is_the_dipole(rotor, rotor_model):
    """g_11 = µ₀ m/(4π a³) in Schmidt's normalisation: nothing of the dipole hides in other terms."""
    (term,) = rotor_model.terms
    (index,) = [i for i, kind in enumerate(zip(term["degrees"], term["orders"], strict=True)) if kind == (1, 1)]
    dipole = rotor.material.remanence * rotor.volume / (4 * np.pi * rotor.hull.radius**3)
    assert term["parts"][index] == "cos" and term["radius"] == rotor.hull.radius
    assert term["coefficients"][index] == pytest.approx(dipole, rel=1e-5)


@devices
def test_field_of_model_is_free_of_sources_and_curl(name, request):
    """Divergence and curl by differences of B: the gradient is stored so that it could not show them."""
    model = request.getfixturevalue(f"{name}_model")
    h = 0.02 * model.region.clearance
    points = request.getfixturevalue(f"{name}_points")[:20].reshape(-1, 3)
    columns = []
    for axis in np.eye(3):
        moved = [model.B(points + s * (k + 1) * h * axis, "extrapolate") for k in range(4) for s in (1, -1)]
        columns.append(sum(w * (moved[2 * k] - moved[2 * k + 1]) for k, w in enumerate(CENTRAL)) / h)
    slopes = np.stack(columns, axis=-1)
    size = np.linalg.norm(slopes, axis=(1, 2))
    assert np.abs(np.trace(slopes, axis1=1, axis2=2) / size).max() < 1e-9
    assert (np.linalg.norm(slopes - np.swapaxes(slopes, 1, 2), axis=(1, 2)) / size).max() < 1e-9
    gradient = model.gradient(points)
    assert (np.linalg.norm(gradient - slopes, axis=(1, 2)) / size).max() < 1e-9


# Terms recovered, whatever they are


def test_field_of_known_harmonics_is_recovered(rotor):
    truth = harmonics(rotor.hull.radius, [1, 3, 5], [1, 1, 1], [0, 0, 0], np.array([0.1, -0.02, 0.004]))
    model = magfem.fit(Source(truth.jet), Recipe(geometry=rotor))
    (term,) = model.terms
    assert model.report["label"] == "odd degrees up to 5"
    np.testing.assert_allclose(term["coefficients"], truth.coefficient, rtol=1e-10)


def test_field_of_known_loops_is_recovered(ring):
    """Currents in the family's own places are found to the digits that their condition leaves."""
    candidate = next(wall_and_face_loops(ring, ring.region))
    currents = np.random.default_rng(5).normal(size=candidate.parameters)
    model = magfem.fit(Source(candidate.with_parameters(currents).jet, ring))
    assert model.report["label"] == candidate.label
    np.testing.assert_allclose(model.lowered.coefficient, currents, rtol=0, atol=1e-14 * model.report["condition"])


def test_field_per_ampere_gives_a_model_per_ampere(rotor):
    truth = harmonics(rotor.hull.radius, [1], [1], [0], np.array([0.1]))
    model = magfem.fit(Source(truth.jet, rotor, unit="T/A"))
    assert model.unit == "T/A" and (2.0 * model).unit == "T"


# The choice of the order


def test_order_is_the_smallest_that_halves_the_targets(ring_model, rotor_model):
    for model in (ring_model, rotor_model):
        *refused, accepted = model.report["candidates"]
        assert accepted["label"] == model.report["label"]

        def score(one):
            return max(one["selection"]["B"]["max"] / 5e-5, one["selection"]["gradient"]["max"] / 5e-4)

        assert score(accepted) <= 0.5 and all(score(one) > 0.5 for one in refused) and refused


def test_tighter_targets_take_more_terms_and_err_less(rotor_field, rotor_model, rotor_points):
    loose = magfem.fit(rotor_field, Recipe(target_B=5e-4, target_gradient=5e-3))
    assert loose.report["parameters"] < rotor_model.report["parameters"]
    for model, bound in ((loose, 5e-4), (rotor_model, 5e-5)):
        assert largest(model.B(rotor_points), rotor_field.B(rotor_points)) <= bound


class Disturbed(Source):
    """Adds noise to what one of the calls returns."""

    def __init__(self, field, call: int, amount: float) -> None:
        super().__init__(field.evaluate, field.geometry)
        self.call, self.amount = call, amount

    def disturb(self, jet, call):
        if call != self.call:
            return jet
        rng = np.random.default_rng(call)
        return tuple(part * (1 + self.amount * rng.normal(size=part.shape)) for part in jet)


def test_held_out_data_choose_and_fit_nothing(rotor_field, rotor_model):
    """Spoilt held-out data, asked for last, spoil the stated errors and nothing else."""
    source = Disturbed(rotor_field, 2, 0.1)
    model = magfem.fit(source)
    assert len(source.asked) == 3
    assert same_bits(model.lowered, rotor_model.lowered)
    assert model.report["heldout"]["B"]["max"] > 0.05 > rotor_model.report["heldout"]["B"]["max"]
    assert model.report["heldout"]["points"] == source.asked[2][..., 0].size >= 2000
    for key in ("training", "candidates"):
        assert model.report[key] == rotor_model.report[key]
    assert not same_bits(magfem.fit(Disturbed(rotor_field, 0, 0.1)).lowered, rotor_model.lowered)


def test_sample_sets_share_no_point(rotor_field, rotor_model):
    source = Source(rotor_field.evaluate, rotor_field.geometry)
    magfem.fit(source)
    validate(rotor_model, source)
    sets = [{point.tobytes() for point in points.reshape(-1, 3)} for points in source.asked]
    assert len(sets) == 4 and all(len(points) > 100 for points in sets)
    assert len(set.union(*sets)) == sum(map(len, sets))


# Repeatability


@pytest.mark.parametrize("name", ["ring", "rotor"])
def test_same_seed_same_bits(name, request):
    field, model = (request.getfixturevalue(f"{name}_{what}") for what in ("field", "model"))
    again = magfem.fit(field)
    assert same_bits(again.lowered, model.lowered)
    assert np.array_equal(again.covariance, model.covariance)
    assert again.report == model.report


def test_another_seed_gives_another_model_within_the_bounds(rotor_field, rotor_model, rotor_points):
    other = magfem.fit(rotor_field, Recipe(seed=7))
    assert not same_bits(other.lowered, rotor_model.lowered)
    bound = other.report["bound"]["B"] + rotor_model.report["bound"]["B"]
    assert 0 < largest(other.B(rotor_points), rotor_model.B(rotor_points)) <= bound


# Covariance


class Noisy(Source):
    """Known harmonics and Gaussian noise in proportion to each layer's root mean square, tenfold in the gradient.

    This is noise of one deviation in every row of the fit, so its covariance is exact.
    """

    def __init__(self, terms, geometry, amount: float, seed: int) -> None:
        super().__init__(terms.jet, geometry)
        self.amount, self.rng = amount, np.random.default_rng(seed)

    def disturb(self, jet, call):
        noisy = []
        for part, factor in zip(jet, (1.0, 10.0), strict=True):
            axes = tuple(range(1, part.ndim))
            rms = np.sqrt((part**2).sum(axis=axes[1:]).mean(axis=1)).reshape(-1, *[1] * len(axes))
            noisy.append(part + self.amount * factor * rms * self.rng.normal(size=part.shape))
        return tuple(noisy)


KNOWN = np.array([0.1, -0.02])


def noisy_fit(rotor: CylinderMagnet, amount: float, seed: int):
    truth = harmonics(rotor.hull.radius, [1, 3], [1, 1], [0, 0], KNOWN)
    recipe = Recipe(geometry=rotor, target_B=0.9, target_gradient=0.9)
    return magfem.fit(Noisy(truth, rotor, amount, seed), recipe)


def test_coefficients_scatter_as_the_covariance_says(rotor):
    """Over 12 fits the mean of dᵀC⁻¹d is the number of coefficients, within four of its own deviations."""
    squares = []
    for seed in range(12):
        model = noisy_fit(rotor, 1e-3, seed)
        away = model.lowered.coefficient - KNOWN
        squares.append(away @ np.linalg.solve(model.covariance, away))
    p = model.lowered.coefficient.size
    assert abs(np.mean(squares) - p) < 4 * np.sqrt(2 * p / 12)


def test_covariance_goes_with_the_square_of_the_noise(rotor):
    weak, strong = noisy_fit(rotor, 1e-4, 1), noisy_fit(rotor, 1e-3, 1)
    np.testing.assert_allclose(strong.covariance, 100 * weak.covariance, rtol=5e-3, atol=1e-6 * strong.covariance.max())


def test_least_squares_matches_the_normal_equations():
    rng = np.random.default_rng(3)
    matrix, target = rng.normal(size=(50, 4)) * [1, 1e-3, 1e3, 1], rng.normal(size=50)
    solved = solve_least_squares(matrix, target)
    inverse = np.linalg.inv(matrix.T @ matrix)
    residual = target - matrix @ solved.parameters
    np.testing.assert_allclose(solved.parameters, inverse @ matrix.T @ target, rtol=1e-9)
    np.testing.assert_allclose(solved.covariance, residual @ residual / 46 * inverse, rtol=1e-9)
    scaled = matrix / np.linalg.norm(matrix, axis=0)
    assert solved.condition == pytest.approx(np.linalg.cond(scaled), rel=1e-9)


def test_scaling_a_column_scales_its_parameter_and_leaves_the_condition():
    rng = np.random.default_rng(4)
    matrix, target = rng.normal(size=(30, 3)), rng.normal(size=30)
    plain, scaled = solve_least_squares(matrix, target), solve_least_squares(matrix * [1, 1e9, 1], target)
    np.testing.assert_allclose(scaled.parameters * [1, 1e9, 1], plain.parameters, rtol=1e-12)
    assert scaled.condition == pytest.approx(plain.condition, rel=1e-9)


# Refusals


def test_field_without_a_device_is_refused(rotor):
    dipole = Source(harmonics(1e-3, [1], [1], [0], np.array([0.1])).jet)
    with pytest.raises(InputError, match="which device"):
        magfem.fit(dipole)
    with pytest.raises(InputError, match="which device"):
        magfem.fit(magfem.exact(rotor).at(RigidTransform.identity()))


def test_loops_for_a_transverse_magnet_are_refused(rotor_field):
    with pytest.raises(InputError, match="need axial magnetisation"):
        magfem.fit(rotor_field, Recipe(family="wall_and_face_loops"))


@pytest.mark.parametrize(
    ("value", "message"), [(np.nan, "not finite"), (np.inf, "not finite"), (0.0, "vanishes"), (1.0, "does not change")]
)
def test_fields_that_nothing_fits_are_refused(rotor, value, message):
    def uniform(points, order):
        return tuple(np.full((len(points), *(3,) * rank), value * (rank == 1 or value != 1)) for rank in (1, 2))

    with pytest.raises(InputError, match=message):
        magfem.fit(Source(uniform, rotor))
