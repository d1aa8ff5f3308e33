"""Solid harmonics against SciPy's, magpylib's dipole, contour integrals, differences, rotations and laws."""

from __future__ import annotations

from math import factorial

import magpylib
import numpy as np
import pytest
from references import scipy_harmonics
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.constants import MU_0
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics, loops
from magfem.fitting.families import axial_multipole
from magfem.geometry import AXIAL, PermanentMagnet, RingMagnet
from magfem.typing import Floats, Points

A = 2e-3  # m, reference radius
CENTRAL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])  # weights of the eighth-order first difference
SINGLE = [(n, m, sine) for n in range(1, 9) for m in range(n + 1) for sine in (False, True) if m or not sine]
SELECTED = [(1, 0, False), (1, 1, True), (2, 1, False), (3, 3, True), (5, 2, False), (9, 9, True), (13, 1, False)]


def single(degree: int, order: int, sine: bool, coefficient: float = 1.0) -> Terms:
    return harmonics(A, [degree], [order], [sine], np.array([coefficient]))


def scattered(count: int, seed: int, nearest: float = 0.5, farthest: float = 4.0) -> Points:
    """Random points (count, 3) m, `nearest` to `farthest` reference radii from the origin."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return A * directions * rng.uniform(nearest, farthest, (count, 1))


def clear_of_axis(points: Points) -> Points:
    """Those farther from the z axis than half their distance to the origin."""
    return points[np.hypot(points[:, 0], points[:, 1]) > 0.5 * np.linalg.norm(points, axis=1)]


def relative(value: Floats, truth: Floats) -> Floats:
    """|value − truth| over |truth| at every point."""
    axes = tuple(range(1, truth.ndim))
    return np.sqrt(((value - truth) ** 2).sum(axes) / (truth**2).sum(axes))


def differences(terms: Terms, points: Points, order: int, step: float) -> Floats:
    """Derivatives of the order-th part of the jet by eighth-order central differences, new index last."""
    columns = []
    for axis in np.eye(3):
        moved = [terms.jet(points + sign * (k + 1) * step * axis, order)[order] for k in range(4) for sign in (1, -1)]
        columns.append(sum(w * (moved[2 * k] - moved[2 * k + 1]) for k, w in enumerate(CENTRAL)) / step)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(("degree", "order", "sine"), [*SINGLE, *SELECTED[-2:]])
def test_single_harmonic_matches_scipy(degree, order, sine):
    points = scattered(50, degree + 20 * order)
    truth = scipy_harmonics.field(points, degree, order, sine, A)
    assert relative(single(degree, order, sine).jet(points, 0)[0], truth).max() < 1e-12


@pytest.mark.parametrize("part", range(3))
def test_degree_one_is_magpylib_dipole(part):
    term = single(1, *[(1, False), (1, True), (0, False)][part], coefficient=0.3)
    points = scattered(100, 1)
    peer = magpylib.misc.Dipole(moment=4 * np.pi / MU_0 * 0.3 * A**3 * np.eye(3)[part])
    assert relative(term.jet(points, 0)[0], peer.getB(points)).max() < 1e-9  # the two µ₀ differ by 1.6e-10
    assert np.allclose(term.moment, peer.moment, rtol=1e-14, atol=0)


def test_moment_of_several_sources_is_that_of_their_far_field():
    """Loops and harmonics, displaced and turned: only degree one counts, and the centre does not matter."""
    direction = np.array([2.0, -1.0, 3.0])
    terms = concatenate(
        [
            harmonics(A, [1, 1, 2, 3], [0, 1, 1, 0], [0, 1, 0, 0], np.array([0.1, 0.2, 5.0, 7.0]), [1e-3, 0, 0]),
            harmonics(A / 2, [1], [1], [0], np.array([0.4]), [0, 1e-3, 2e-3], frame_about(direction)),
            loops(np.array([[0, 0, 1e-3]]), np.array([A]), np.array([50.0]), frame_about(direction)),
        ]
    )
    peer = magpylib.misc.Dipole(moment=terms.moment)
    ratios = []
    for distance in (1e3, 1e4):
        points = scattered(100, 2, distance, distance)
        ratios.append(relative(terms.jet(points, 0)[0], peer.getB(points)).max())
    assert ratios[1] < 1e-2 and 0.9 < np.log10(ratios[0] / ratios[1]) < 1.1  # the rest is of degree two


@pytest.mark.parametrize("k", range(1, 9))
def test_axial_multipole_is_the_derivative_of_one_over_r(k):
    """(2.7): ∂ᵏ/∂zᵏ(1/r) = (−1)ᵏ k! P_k(cos θ)/r^{k+1}; here −∇ of it, the derivative by Cauchy's integral.

    −∇(1/r) = x/r³ is analytic in z within the distance to the axis.
    """
    points = clear_of_axis(scattered(60, 3))
    ring = RingMagnet(
        outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, material=PermanentMagnet(1.0, 1.0, AXIAL)
    )
    candidate = next(axial_multipole(ring, ring.region, poles=8))
    B, _ = candidate.columns(points)
    contour = np.exp(2j * np.pi * np.arange(200) / 200)
    size = 0.8 * np.hypot(points[:, 0], points[:, 1])[:, None]
    x, y, z = (points[:, i, None] for i in range(3))
    z = z + size * contour
    r3 = np.sqrt(x**2 + y**2 + z**2) ** 3
    derivative = [np.mean(c / r3 * contour**-k, axis=1) * factorial(k) / size[:, 0] ** k for c in (x, y, z)]
    truth = np.real(np.stack(derivative, axis=-1)) * (-1) ** k / factorial(k) * ring.hull.radius ** (k + 2)
    assert relative(B[k - 1], truth).max() < 1e-10


@pytest.mark.parametrize(("degree", "order", "sine"), SELECTED)
def test_derivatives_are_differences_of_eighth_order(degree, order, sine):
    """Step study: halving the step divides the error by 2⁸, until rounding."""
    points, term = scattered(40, 4, nearest=1.5), single(degree, order, sine)
    for rank in (0, 1):
        truth = term.jet(points, 2)[rank + 1]
        wide, narrow, fine = (
            np.median(relative(differences(term, points, rank, h * A), truth)) for h in (0.1, 0.05, 0.01)
        )
        assert 7.0 < np.log2(wide / narrow) < 9.0
        assert fine < 1e-10


@pytest.mark.parametrize(("degree", "order", "sine"), SELECTED)
def test_field_satisfies_laplace(degree, order, sine):
    """Divergence and curl of B by differences; the derivatives are symmetric and without trace."""
    points, term = clear_of_axis(scattered(60, 5, nearest=1.5)), single(degree, order, sine)
    slopes = differences(term, points, 0, 0.01 * A)
    size = np.linalg.norm(slopes, axis=(1, 2))
    assert np.all(np.abs(np.trace(slopes, axis1=1, axis2=2)) < 1e-9 * size)
    assert np.all(np.linalg.norm(slopes - np.swapaxes(slopes, 1, 2), axis=(1, 2)) < 1e-9 * size)
    _, gradient, hessian = term.jet(points, 2)
    assert np.array_equal(gradient, np.swapaxes(gradient, 1, 2))
    assert np.array_equal(hessian, np.transpose(hessian, (0, 3, 2, 1)))
    assert np.array_equal(hessian, np.transpose(hessian, (0, 2, 1, 3)))
    largest = np.abs(hessian).max(axis=(1, 2, 3))[:, None]
    assert np.all(np.abs(np.trace(hessian, axis1=1, axis2=2)) < 1e-14 * largest)


def test_flux_through_a_sphere_vanishes():
    """Gauss's law around all sources, by a product rule that is exact to degree 24."""
    terms = harmonics(A, [n for n, *_ in SINGLE], [m for _, m, _ in SINGLE], [s for *_, s in SINGLE], 1.0, [1e-4, 0, 0])
    height, weight = np.polynomial.legendre.leggauss(60)
    phi = np.arange(60) * 2 * np.pi / 60
    rho = np.sqrt(1 - height**2)[:, None]
    sphere = np.stack(np.broadcast_arrays(rho * np.cos(phi), rho * np.sin(phi), height[:, None]), axis=-1)
    outward = np.einsum("ijk,ijk->ij", terms.jet(2 * A * sphere.reshape(-1, 3), 0)[0].reshape(sphere.shape), sphere)
    assert abs(np.sum(outward * weight[:, None])) < 1e-13 * np.sum(np.abs(outward) * weight[:, None])


def several() -> Terms:
    """Loops and harmonics in different frames, some next to each other in one frame."""
    rng = np.random.default_rng(6)
    tilted = frame_about(rng.normal(size=3), rng.normal(size=3))
    kinds = [SINGLE[i] for i in (0, 2, 5, 11, 17)]
    listed = [[kind[i] for kind in kinds] for i in range(3)]
    return concatenate(
        [
            harmonics(A, *listed, rng.normal(size=5), [1e-4, 2e-4, 0], tilted),
            harmonics(A, *listed, rng.normal(size=5), [0, 0, -3e-4], tilted),
            loops(rng.normal(size=(3, 3)) * 1e-4, np.array([1e-3, 2e-3, 1e-4]), rng.normal(size=3) * 100),
            harmonics(A, *listed, rng.normal(size=5)),
        ]
    )


def test_a_rotated_source_equals_rotated_points_and_fields():
    """Wigner's rotation without its matrices: R·B(R⁻¹(x − t)), and one more R for every derivative."""
    terms = several()
    pose = RigidTransform.from_components([1e-3, -2e-3, 3e-3], Rotation.from_rotvec([0.3, -1.1, 0.6]))
    points = scattered(100, 7, nearest=1.5)
    R = pose.rotation.as_matrix()
    B, gradient, hessian = terms.jet(points, 2)
    placed = terms.placed(pose)
    moved = placed.jet(pose.apply(points), 2)
    assert relative(moved[0], B @ R.T).max() < 1e-12
    assert relative(moved[1], R @ gradient @ R.T).max() < 1e-12
    assert relative(moved[2], np.einsum("ia,jb,kc,nabc->nijk", R, R, R, hessian)).max() < 1e-12
    assert np.allclose(placed.moment, R @ terms.moment, rtol=1e-12, atol=0)


def test_derivatives_of_several_tilted_sources_are_differences():
    terms, points = several(), scattered(60, 8, nearest=2.0)
    for rank in (0, 1):
        found = differences(terms, points, rank, 0.01 * A)
        assert np.median(relative(found, terms.jet(points, 2)[rank + 1])) < 1e-10


def test_terms_add_and_scale_like_fields():
    terms, points = several(), scattered(50, 9, nearest=1.5)
    parts = [single(1, 0, False, 0.2), terms.scaled(-3.0), terms]
    for rank in range(3):
        total = sum(part.jet(points, 2)[rank] for part in parts)
        assert relative((parts[0] + parts[1] + parts[2]).jet(points, 2)[rank], total).max() < 1e-12


@pytest.mark.parametrize("order", [0, 1, 2])
def test_orders_of_the_jet_agree(order):
    points = scattered(100, 10)
    for few, three in zip(several().jet(points, order), several().jet(points, 2), strict=False):
        assert relative(few, three).max() < 1e-12


def test_on_the_polar_axis_nothing_is_lost():
    """Where spherical coordinates break down: B of (l, 0) is (l + 1)(a/z)^{l+2} along z, (l, 1) points across."""
    z = np.array([0.7, 1.0, 5.0]) * A
    points = np.stack([0 * z, 0 * z, z], axis=-1)
    for n in (1, 4, 9):
        along, across = single(n, 0, False).jet(points, 0)[0], single(n, 1, True).jet(points, 0)[0]
        decay = (A / z) ** (n + 2)
        np.testing.assert_allclose(along, ((n + 1) * decay)[:, None] * [0, 0, 1], rtol=1e-13, atol=0)
        # Schmidt's P_l^1 = √(2/(l(l+1))) sin θ dP_l/d cos θ, and dP_l/d cos θ = l(l+1)/2 at the pole.
        np.testing.assert_allclose(across, -(np.sqrt(n * (n + 1) / 2) * decay)[:, None] * [0, 1, 0], rtol=1e-13, atol=0)
