"""Bounded steps: against the pseudo-inverse, and against SciPy's bounded least squares."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from magfem.rod.bounded_step import bounded_step

RNG = np.random.default_rng(5)


def test_without_bounds_and_damping_it_is_the_pseudo_inverse():
    J, wanted = RNG.normal(size=(4, 9)), RNG.normal(size=4)
    step = bounded_step(J, wanted, np.full(9, -np.inf), np.full(9, np.inf), 0.0)
    assert np.allclose(step.change, np.linalg.pinv(J) @ wanted, rtol=0, atol=1e-12)
    assert step.rank == 4 and not step.clamped.any()
    assert step.condition == pytest.approx(np.linalg.cond(J), rel=1e-9)


def test_the_second_task_costs_nothing_of_the_first():
    J, wanted, second = RNG.normal(size=(4, 9)), RNG.normal(size=4), RNG.normal(size=9)
    step = bounded_step(J, wanted, np.full(9, -np.inf), np.full(9, np.inf), 0.0, second)
    assert np.allclose(J @ step.change, wanted, rtol=0, atol=1e-12)
    null = np.eye(9) - np.linalg.pinv(J) @ J
    assert np.allclose(null @ step.change, null @ second, rtol=0, atol=1e-12)


def test_bounds_hold_and_the_rest_makes_up_for_them():
    for _ in range(50):
        J, wanted = RNG.normal(size=(3, 8)), RNG.normal(size=3)
        high = RNG.uniform(0.05, 0.4, 8)
        step = bounded_step(J, wanted, -high, high, 0.0)
        assert np.all(np.abs(step.change) <= high + 1e-15)
        best = lsq_linear(J, wanted, (-high, high), tol=1e-12)
        if not step.clamped.all() and step.rank == 3:  # what is still free reaches the goal
            assert np.linalg.norm(J @ step.change - wanted) < 1e-12
            assert best.cost < 1e-10


def test_truncation_drops_what_no_parameter_moves():
    J = np.diag([1.0, 1e-7])
    step = bounded_step(J, np.array([1.0, 1.0]), np.full(2, -10.0), np.full(2, 10.0), 0.0, largest_condition=1e5)
    assert np.allclose(step.change, [1, 0], rtol=0, atol=1e-12) and step.rank == 1
    assert step.condition == pytest.approx(1e7, rel=1e-9)


def test_damping_is_that_of_ridge_regression():
    J, wanted, damping = RNG.normal(size=(3, 5)), RNG.normal(size=3), 0.7
    ridge = np.linalg.solve(J.T @ J + damping**2 * np.eye(5), J.T @ wanted)
    step = bounded_step(J, wanted, np.full(5, -np.inf), np.full(5, np.inf), damping)
    assert np.allclose(step.change, ridge, rtol=0, atol=1e-12)


def test_nothing_that_moves_is_no_step():
    step = bounded_step(np.zeros((2, 3)), np.ones(2), -np.ones(3), np.ones(3), 0.1)
    assert np.all(step.change == 0) and step.rank == 0 and step.condition == np.inf
