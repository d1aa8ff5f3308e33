"""Interior solid harmonics against SciPy's, the textbook's quadrupoles, a loop's series about its centre, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from references import scipy_harmonics
from references.jets import assert_harmonic, differences, errors, relative, scattered
from scipy.spatial.transform import Rotation
from scipy.special import binom

from magfem.constants import MU_0
from magfem.fields.term_kinds import INTERIOR
from magfem.fields.terms import Terms, harmonics, loops, uniform
from magfem.typing import Floats, Points

A = 2e-3  # m, reference radius
SINGLE = [(n, m, sine) for n in range(1, 9) for m in range(n + 1) for sine in (False, True) if m or not sine]
HIGH = [(40, m, sine) for m, sine in ((0, False), (1, True), (2, False), (23, True), (40, False))]


def single(degree: int, order: int, sine: bool, **where: Floats) -> Terms:
    return harmonics(A, [degree], [order], [sine], 1.0, kind=INTERIOR, **where)


@pytest.mark.parametrize(("degree", "order", "sine"), SINGLE)
def test_single_harmonic_and_its_derivatives_match_scipy(degree, order, sine):
    """B is a polynomial of degree seven at most: eighth-order differences of it, and of them, are exact."""
    points = A * scattered(degree + 20 * order, 40, 0.3, 3.0)

    def B(x: Points) -> Floats:
        return scipy_harmonics.field(x, degree, order, sine, A, interior=True)

    def gradient(x: Points) -> Floats:
        return differences(B, x, 0.2 * A)

    jet = single(degree, order, sine).jet(points, 2)
    assert relative(jet[0], B(points)).max() < 1e-12
    for ours, truth in ((jet[1], gradient(points)), (jet[2], differences(gradient, points, 0.2 * A))):
        size = np.abs(truth).max(axis=tuple(range(1, truth.ndim)), keepdims=True)
        scale = np.linalg.norm(jet[0], axis=1).max() / A ** (ours.ndim - 2)  # where the truth itself is zero
        assert np.all(np.abs(ours - truth) < 1e-9 * size + 1e-11 * scale)


@pytest.mark.parametrize(("degree", "order", "sine"), HIGH)
def test_degree_forty_matches_scipy(degree, order, sine):
    points, term = A * scattered(order, 40, 0.5, 2.0), single(degree, order, sine)
    _, gradient, hessian = term.jet(points, 2)
    assert (
        relative(term.jet(points, 0)[0], scipy_harmonics.field(points, degree, order, sine, A, interior=True)).max()
        < 1e-12
    )
    near = 1e-3 * A
    slopes = differences(lambda x: scipy_harmonics.field(x, degree, order, sine, A, interior=True), points, near)
    assert np.median(relative(gradient, slopes)) < 1e-10
    assert np.median(relative(hessian, differences(lambda x: term.jet(x, 1)[1], points, near))) < 1e-10


def test_uniform_is_uniform():
    value = np.array([0.1, -0.2, 0.3])
    points = scattered(1, 70, 1e-3, 1e2)
    for radius in (1.0, 0.02):
        B, gradient, hessian = uniform(value, radius).jet(points, 2)
        np.testing.assert_allclose(B, np.broadcast_to(value, B.shape), rtol=1e-15, atol=0)
        assert not gradient.any() and not hessian.any()


@pytest.mark.parametrize(
    ("order", "sine", "slope"),
    [
        (0, False, [[1, 0, 0], [0, 1, 0], [0, 0, -2]]),
        (1, False, -np.sqrt(3) * np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0]])),
        (1, True, -np.sqrt(3) * np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0]])),
        (2, False, -np.sqrt(3) * np.array([[1, 0, 0], [0, -1, 0], [0, 0, 0]])),
        (2, True, -np.sqrt(3) * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])),
    ],
)
def test_degree_two_is_the_quadrupole_of_textbooks(order, sine, slope):
    """V a = z² − ρ²/2, √3 xz, √3 yz, √3/2 (x² − y²), √3 xy: B = −∇V is linear."""
    points = A * scattered(2, 40, 0.1, 10.0)
    B, gradient, hessian = single(2, order, sine).jet(points, 2)
    slope = np.array(slope) / A
    np.testing.assert_allclose(B, points @ slope, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(gradient, np.broadcast_to(slope, gradient.shape), rtol=1e-14, atol=0)
    assert not hessian.any()


def test_all_degrees_together_are_a_loop_seen_from_its_centre():
    """On the axis B_z = B₀ (1 + z²/R²)^{−3/2}, a binomial series; its terms are −l g_l (z/a)^{l−1}."""
    radius, current = 2.5 * A, 3.0
    k = np.arange(32)
    on_axis = MU_0 * current / (2 * radius) * binom(-1.5, k) * (A / radius) ** (2 * k)
    degree = 2 * k + 1
    series = harmonics(A, degree, 0 * k, 0 * k, -on_axis / degree, kind=INTERIOR)
    loop = loops(np.zeros((1, 3)), radius, current)
    points = scattered(3, 80, 0.05 * radius, 0.5 * radius)
    assert np.all(errors(series.jet(points, 2), loop.jet(points, 2)) < 1e-12)


@pytest.mark.parametrize(("degree", "order", "sine"), [(3, 0, False), (5, 2, True), (8, 8, False)])
def test_field_is_free_of_sources_and_curl(degree, order, sine):
    assert_harmonic(lambda x: single(degree, order, sine).jet(x, 0)[0], A * scattered(4, 40, 0.5, 3.0), 0.2 * A, 1e-9)


@pytest.mark.parametrize(("degree", "order", "sine"), [(1, 1, True), (4, 0, False), (6, 3, True), (8, 8, False)])
def test_a_frame_turns_the_field_and_a_centre_moves_it(degree, order, sine):
    turn, centre = Rotation.from_rotvec([0.4, -1.2, 0.7]).as_matrix(), A * np.array([0.5, -0.3, 0.9])
    points = A * scattered(5, 40, 0.3, 3.0)
    placed = single(degree, order, sine, centre=centre, frame=turn)
    truth = scipy_harmonics.field(points, degree, order, sine, A, interior=True) @ turn.T
    assert relative(placed.jet(points @ turn.T + centre, 0)[0], truth).max() < 1e-11


def test_sources_far_away_have_no_moment():
    assert not single(1, 0, False).moment.any()
