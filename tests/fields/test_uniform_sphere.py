"""The exact ball against magpylib, a stack of thin cylinders, differences, and continuity."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest

from magfem.constants import MU_0
from magfem.fields.uniform_cylinder import cylinder_jet
from magfem.fields.uniform_sphere import sphere_jet

RADIUS = 1.5e-3  # m
M = 1e6 * np.array([0.48, -0.6, 0.64])  # A/m


def scattered(count: int, reach: float = 3.0) -> np.ndarray:
    points = np.random.default_rng(1).uniform(-reach, reach, (count, 3))
    return RADIUS * points[np.abs(np.linalg.norm(points, axis=1) - 1) > 0.02]


def test_B_matches_magpylib():
    points = scattered(1000)
    (b,) = sphere_jet(points, RADIUS, M, order=0)
    peer = magpylib.magnet.Sphere(diameter=2 * RADIUS, magnetization=M).getB(points)
    np.testing.assert_allclose(b, peer, rtol=1e-12, atol=1e-14)


def test_ball_is_a_stack_of_thin_cylinders():
    """Gauss–Legendre in the height: its error outside falls as a high power of the number of slices."""
    points = scattered(300)
    points = points[np.linalg.norm(points, axis=1) > 1.5 * RADIUS]
    t, w = np.polynomial.legendre.leggauss(24)
    # Slices of thickness w R are taken thin: a sheet's field is that of a thin cylinder of the same moment.
    total = [0.0, 0.0, 0.0]
    thin = 1e-3 * RADIUS
    for height, weight in zip(t, w, strict=True):
        rim = RADIUS * np.sqrt(1 - height**2)
        part = cylinder_jet(points - [0, 0, height * RADIUS], rim, thin, M * weight * RADIUS / thin, order=2)
        total = [one + other for one, other in zip(total, part, strict=True)]
    for value, truth in zip(sphere_jet(points, RADIUS, M, order=2), total, strict=True):
        np.testing.assert_allclose(value, truth, atol=2e-6 * np.abs(truth).max())


@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_match_central_differences(order):
    points = scattered(300)
    exact = sphere_jet(points, RADIUS, M, order)[order]

    def difference(step: float) -> np.ndarray:
        ahead, behind = (
            sphere_jet(points + sign * step * np.eye(3)[:, None], RADIUS, M, order - 1)[order - 1] for sign in (1, -1)
        )
        return np.moveaxis((ahead - behind) / (2 * step), 0, -1)

    h = 0.01 * RADIUS
    coarse, fine = (np.linalg.norm(difference(step) - exact) for step in (h, h / 2))
    assert 3.9 < coarse / fine < 4.1
    extrapolated = (4 * difference(h / 2) - difference(h)) / 3
    assert np.linalg.norm(extrapolated - exact) < 1e-6 * np.linalg.norm(exact)


def test_field_is_solenoidal_and_irrotational():
    _, gradient, hessian = sphere_jet(scattered(300), RADIUS, M, order=2)
    for tensor in (gradient, np.moveaxis(hessian, -1, 0)):
        np.testing.assert_allclose(np.trace(tensor, axis1=-2, axis2=-1), 0, atol=1e-14 * np.abs(tensor).max())
        np.testing.assert_allclose(tensor, np.swapaxes(tensor, -2, -1), atol=1e-15 * np.abs(tensor).max())


def test_normal_B_and_tangential_H_are_continuous_and_the_surface_belongs_to_the_magnet():
    normal = np.random.default_rng(2).normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inner, outer = (sphere_jet(scale * RADIUS * normal, RADIUS, M, order=0)[0] for scale in (1 - 1e-13, 1 + 1e-13))
    tangential = M - normal * (normal @ M)[:, None]
    np.testing.assert_allclose(outer - inner, -MU_0 * tangential, atol=1e-11)
    pole = sphere_jet([0, 0, RADIUS], RADIUS, M, order=1)
    np.testing.assert_allclose(pole[0], 2 / 3 * MU_0 * M)
    assert np.all(pole[1] == 0)


def test_shapes_broadcast():
    for shape in ((), (0,), (1,), (2, 3)):
        b, gradient, hessian = sphere_jet(np.full((*shape, 3), 2e-3), RADIUS, M, order=2)
        assert b.shape == (*shape, 3)
        assert gradient.shape == (*shape, 3, 3)
        assert hessian.shape == (*shape, 3, 3, 3)
