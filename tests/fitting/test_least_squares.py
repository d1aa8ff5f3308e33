"""Least squares against brute force: refits without rows, the evidence itself, and the scatter of the estimates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from magfem.fitting.least_squares import LeastSquares, solve_least_squares
from magfem.typing import Floats


def problem(seed: int = 0, rows: int = 40, decay: float = 3.0, noise: float = 0.1) -> tuple[Floats, Floats, Floats]:
    """Columns (n, 6) of unequal size that resemble each other, the truth, and data with noise."""
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(rows, 6)) @ np.diag(10.0 ** -np.linspace(0, decay, 6)) @ rng.normal(size=(6, 6))
    truth = rng.normal(size=6)
    return matrix, truth, matrix @ truth + noise * rng.normal(size=rows)


def scaled_columns(matrix: Floats) -> Floats:
    return matrix / np.linalg.norm(matrix, axis=0)


def refit(matrix: Floats, target: Floats, ridge: float, scale: Floats) -> Floats:
    """Parameters by the normal equations with the ridge on the parameters times `scale`."""
    found: Floats = np.linalg.lstsq(
        np.vstack([matrix, np.sqrt(ridge) * np.diag(scale)]), np.concatenate([target, 0 * scale]), rcond=None
    )[0]
    return found


RIDGES = pytest.mark.parametrize("ridge", ["none", "evidence", "leave-one-out"])


# Rows left out


@RIDGES
def test_leave_one_out_is_what_refits_without_each_row_miss_it_by(ridge) -> None:
    matrix, _, target = problem()
    solved = solve_least_squares(matrix, target, ridge)
    scale = np.linalg.norm(matrix, axis=0)
    for row in range(len(target)):
        others = np.arange(len(target)) != row
        parameters = refit(matrix[others], target[others], solved.ridge, scale)
        assert solved.leave_one_out[row] == pytest.approx(target[row] - matrix[row] @ parameters, rel=1e-6)


@RIDGES
def test_regions_left_out_are_what_refits_without_them_miss_them_by(ridge) -> None:
    matrix, _, target = problem()
    solved = solve_least_squares(matrix, target, ridge)
    scale = np.linalg.norm(matrix, axis=0)
    for fold in range(4):
        out = np.arange(len(target)) % 4 == fold
        parameters = refit(matrix[~out], target[~out], solved.ridge, scale)
        np.testing.assert_allclose(solved.without(target, out), target[out] - matrix[out] @ parameters, rtol=1e-6)


# The ridge


def log_evidence(matrix: Floats, target: Floats, ridge: float, variance: float) -> float:
    """Of data (n,) whose scaled parameters have a normal prior of variance σ²/λ: a normal density of n dimensions."""
    scaled = scaled_columns(matrix)
    covariance = variance * (np.eye(len(target)) + scaled @ scaled.T / ridge)
    return float(multivariate_normal(cov=covariance).logpdf(target))


def best_evidence(matrix: Floats, target: Floats, ridge: float) -> float:
    """The largest evidence over the variance, which is known in closed form."""
    scaled = scaled_columns(matrix)
    shape = np.eye(len(target)) + scaled @ scaled.T / ridge
    variance = float(target @ np.linalg.solve(shape, target)) / len(target)
    return log_evidence(matrix, target, ridge, variance)


@pytest.mark.parametrize("seed", range(4))
def test_evidence_ridge_has_the_largest_evidence_when_the_noise_is_known(seed) -> None:
    matrix, _, target = problem(seed)
    solved = solve_least_squares(matrix, target, "evidence", variance=0.01)
    top = log_evidence(matrix, target, solved.ridge, 0.01)
    grid = solved.ridge * 10.0 ** np.linspace(-3, 3, 121)
    assert top >= max(log_evidence(matrix, target, one, 0.01) for one in grid) - 1e-6
    assert top > log_evidence(matrix, target, 1.3 * solved.ridge, 0.01)
    assert top > log_evidence(matrix, target, solved.ridge / 1.3, 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_evidence_ridge_has_the_largest_evidence_when_the_noise_is_not_known(seed) -> None:
    matrix, _, target = problem(seed)
    solved = solve_least_squares(matrix, target, "evidence")
    top = best_evidence(matrix, target, solved.ridge)
    assert (
        top >= max(best_evidence(matrix, target, one) for one in solved.ridge * 10.0 ** np.linspace(-3, 3, 121)) - 1e-6
    )


def test_evidence_finds_the_variance_of_the_noise() -> None:
    """Over 200 sets of 40 rows the mean of σ² is 0.01 within three of its own deviations."""
    found = []
    for seed in range(200):
        matrix, _, target = problem(seed)
        found.append(solve_least_squares(matrix, target, "evidence").variance)
    assert abs(np.mean(found) - 0.01) < 3 * np.std(found) / np.sqrt(len(found))


def test_leave_one_out_ridge_predicts_best() -> None:
    """No ridge of a finer grid predicts left-out rows noticeably better, by refits without each."""
    matrix, _, target = problem(3, noise=1.0)
    solved = solve_least_squares(matrix, target, "leave-one-out")
    scale = np.linalg.norm(matrix, axis=0)

    def missed(ridge: float) -> float:
        total = 0.0
        for row in range(len(target)):
            others = np.arange(len(target)) != row
            total += float(target[row] - matrix[row] @ refit(matrix[others], target[others], ridge, scale)) ** 2
        return total

    assert solved.ridge > 0
    assert missed(solved.ridge) == pytest.approx(float(np.sum(solved.leave_one_out**2)), rel=1e-6)
    assert missed(solved.ridge) <= 1.01 * min(missed(one) for one in solved.ridge * 10.0 ** np.linspace(-4, 4, 33))


def test_a_ridge_shortens_the_parameters_and_the_evidence_needs_none_without_data() -> None:
    matrix, _, target = problem(noise=1.0)
    plain, ridged = solve_least_squares(matrix, target), solve_least_squares(matrix, target, "evidence")
    scale = np.linalg.norm(matrix, axis=0)
    assert np.linalg.norm(scale * ridged.parameters) < np.linalg.norm(scale * plain.parameters)
    assert ridged.effective < plain.effective == pytest.approx(6)
    nothing = solve_least_squares(matrix, 0 * target, "evidence")
    assert nothing.parameters == pytest.approx(0) and np.isfinite(nothing.covariance).all()


# Condition


def test_condition_is_that_of_the_scaled_columns() -> None:
    matrix, _, target = problem()
    assert solve_least_squares(matrix, target).condition == pytest.approx(np.linalg.cond(scaled_columns(matrix)))


def test_condition_is_kept_below_its_limit() -> None:
    """With the ridge: that of the scaled columns over √λ times the unit matrix."""
    matrix, _, target = problem(decay=9)
    limit = 1e4
    assert solve_least_squares(matrix, target).condition > 10 * limit
    solved = solve_least_squares(matrix, target, most_condition=limit)
    whole = np.vstack([scaled_columns(matrix), np.sqrt(solved.ridge) * np.eye(6)])
    assert solved.condition == pytest.approx(np.linalg.cond(whole), rel=1e-6)
    assert solved.condition == pytest.approx(limit, rel=1e-6)
    easy, _, data = problem(decay=1)
    assert solve_least_squares(easy, data, most_condition=limit).ridge == 0


# Columns without any effect


@RIDGES
@pytest.mark.parametrize("most", [1e7, np.inf])
def test_columns_of_zeros_get_no_parameter_and_disturb_no_other(ridge, most) -> None:
    matrix, _, target = problem()
    with_zero = np.insert(matrix, 2, 0.0, axis=1)
    whole = solve_least_squares(with_zero, target, ridge, most_condition=most)
    plain = solve_least_squares(matrix, target, ridge)
    assert whole.parameters[2] == 0
    np.testing.assert_allclose(np.delete(whole.parameters, 2), plain.parameters, rtol=1e-9)
    assert np.isfinite(whole.covariance).all()
    np.testing.assert_allclose(whole.leave_one_out, plain.leave_one_out, rtol=1e-9)
    out = np.arange(len(target)) < 10
    np.testing.assert_allclose(whole.without(target, out), plain.without(target, out), rtol=1e-9)
    assert whole.condition == np.inf


# Scatter


def scatter(ridge: str, variance: float | None) -> tuple[Floats, Floats, list[LeastSquares]]:
    """Estimates less the truth (k, 6) of 4000 sets of data on the same columns, and their mean covariance."""
    matrix, truth, _ = problem(1, decay=1)
    rng = np.random.default_rng(2)
    solved = [
        solve_least_squares(matrix, matrix @ truth + 0.1 * rng.normal(size=len(matrix)), ridge, variance)
        for _ in range(4000)
    ]
    away = np.array([one.parameters - truth for one in solved])
    return away, np.mean([one.covariance for one in solved], axis=0), solved


@pytest.mark.parametrize("variance", [None, 0.01])
def test_covariance_is_the_scatter_of_the_estimates(variance) -> None:
    """The scatter of 4000 estimates, whitened by the covariance, is the unit matrix to 10 %, four deviations."""
    away, covariance, solved = scatter("none", variance)
    white = np.linalg.solve(np.linalg.cholesky(covariance), away.T)
    assert np.abs(white @ white.T / len(away) - np.eye(6)).max() < 0.1
    assert np.mean([one.variance for one in solved]) == pytest.approx(0.01, rel=0.02)
