"""Straight filaments: chains of them against the circular loop, and against their own derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.constants import MU_0
from magfem.fields.filament import Filaments
from magfem.fields.terms import loops


def polygon(sides: int, radius: float = 0.01) -> Filaments:
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    corners = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    return Filaments(corners[:-1].copy(), corners[1:].copy(), np.ones(sides))


@pytest.fixture
def points() -> np.ndarray:
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.02, 0.02, (60, 3))
    return points[np.abs(np.hypot(points[:, 0], points[:, 1]) - 0.01) > 1e-3]


def test_centre_of_a_polygon():
    """µ0 I n tan(π/n)/(2π a) at the centre of a regular polygon of circumscribed radius a."""
    for sides in (3, 4, 7):
        apothem = 0.01 * np.cos(np.pi / sides)
        expected = MU_0 * sides * np.sin(np.pi / sides) / (2 * np.pi * apothem)
        assert polygon(sides).jet(np.zeros((1, 3)), 0)[0][0, 2] == pytest.approx(expected, rel=1e-12, abs=0.0)


def test_polygons_tend_to_the_loop(points):
    """With corners on the circle the error falls with the square of the number of sides."""
    circle = loops(np.zeros(3), np.array([0.01]), np.array([1.0]))
    errors = []
    for sides in (100, 200):
        differences = [a - b for a, b in zip(polygon(sides).jet(points, 2), circle.jet(points, 2), strict=True)]
        errors.append([np.abs(d).max() for d in differences])
    np.testing.assert_allclose(np.array(errors[0]) / errors[1], 4.0, rtol=0.03)


def test_derivatives(points):
    """Gradient and hessian are the differences of B and the gradient; B is the curl of A."""
    wire, step = polygon(5), 1e-6
    B, gradient, hessian = wire.jet(points, 2)
    potential = np.empty((*points.shape, 3))
    for j in range(3):
        shift = step * np.eye(3)[j]
        plus, minus = wire.jet(points + shift, 1), wire.jet(points - shift, 1)
        np.testing.assert_allclose(
            (plus[0] - minus[0]) / (2 * step), gradient[..., j], atol=1e-6 * np.abs(gradient).max()
        )
        np.testing.assert_allclose(
            (plus[1] - minus[1]) / (2 * step), hessian[..., j], atol=1e-6 * np.abs(hessian).max()
        )
        potential[..., j] = (wire.vector_potential(points + shift) - wire.vector_potential(points - shift)) / (2 * step)
    curl = np.stack([potential[:, (i + 2) % 3, (i + 1) % 3] - potential[:, (i + 1) % 3, (i + 2) % 3] for i in range(3)])
    np.testing.assert_allclose(curl.T, B, atol=1e-6 * np.abs(B).max())


def test_closed_chains_obey_maxwell(points):
    _, gradient = polygon(6).jet(points, 1)
    size = np.abs(gradient).max()
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-12 * size
    assert np.abs(gradient - np.swapaxes(gradient, 1, 2)).max() < 1e-12 * size


def test_moment_is_current_times_area():
    np.testing.assert_allclose(polygon(4).moment, [0, 0, 2 * 0.01**2], atol=1e-18)


def test_no_digits_are_lost_beside_the_wire():
    """µ0 I h/(2π d √(h² + d²)) and its derivatives beside the middle of a wire of length 2h = 2 m, d down to 1 nm."""
    wire = Filaments(np.array([[-1.0, 0, 0]]), np.array([[1.0, 0, 0]]), np.ones(1))
    d = np.logspace(-9, 1, 41)
    points = np.stack([0 * d, d, 0 * d], axis=-1)
    B, gradient, hessian = wire.jet(points, 2)
    u = 1 + d**2
    scale = MU_0 / (2 * np.pi)
    np.testing.assert_allclose(B[:, 2], scale / (d * np.sqrt(u)), rtol=1e-12)
    np.testing.assert_allclose(gradient[:, 2, 1], -scale * (1 + 2 * d**2) / (d**2 * u**1.5), rtol=1e-12)
    second = scale * (2 + 5 * d**2 + 6 * d**4) / (d**3 * u**2.5)
    np.testing.assert_allclose(hessian[:, 2, 1, 1], second, rtol=1e-11)
