"""Charged discs against Coulomb's law, rigid cylinder magnets (ours and magpylib's), axis formulas and Gauss's law."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest
from references.jets import assert_harmonic, cylindrical, errors, relative, scattered, sphere
from scipy.spatial.transform import Rotation

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.terms import Terms, charge_discs, concatenate, loops
from magfem.fields.uniform_cylinder import cylinder_jet
from magfem.typing import Floats, Jet, Points

A, CHARGE = 2e-3, 1.3  # radius, m; density, T
DISC = charge_discs(np.zeros((1, 3)), A, CHARGE)
HALF = 0.6 * A  # half the length of the magnet that two discs make
PAIR = charge_discs(np.array([[0, 0, HALF], [0, 0, -HALF]]), A, [CHARGE, -CHARGE])


def off_the_disc(seed: int, count: int, clear: float = 0.3, farthest: float = 5.0) -> Points:
    """Random points (count, 3) m, `clear` radii from the disc at least."""
    points = scattered(seed, 20 * count, 0.1, farthest)
    beyond = np.maximum(np.hypot(points[:, 0], points[:, 1]) - 1, 0)
    return A * points[np.hypot(beyond, points[:, 2]) > clear][:count]


def coulomb(points: Points, nodes: int) -> Jet:
    """σ/4π ∫ R/R³ dS and its derivatives under the integral: Gauss's rule in ρ², the trapezoidal one in φ."""
    u, weight = np.polynomial.legendre.leggauss(nodes)
    phi = np.arange(4 * nodes) * np.pi / (2 * nodes)
    rho = A * np.sqrt(0.5 + 0.5 * u)[:, None]
    disc = np.stack(np.broadcast_arrays(rho * np.cos(phi), rho * np.sin(phi), 0.0), axis=-1).reshape(-1, 3)
    charge = CHARGE * A**2 / 4 * np.repeat(weight, phi.size) * np.pi / (2 * nodes) / (4 * np.pi)
    R = points[:, None] - disc
    r = np.linalg.norm(R, axis=-1)
    one, w3, w5, w7 = np.eye(3), charge * r**-3, charge * r**-5, charge * r**-7
    first = np.einsum("nq,nqi->ni", w5, R)
    symmetric = sum(np.einsum(how, one, first) for how in ("ij,nk->nijk", "ik,nj->nijk", "jk,ni->nijk"))
    return (
        np.einsum("nq,nqi->ni", w3, R),
        w3.sum(axis=1)[:, None, None] * one - 3 * np.einsum("nq,nqi,nqj->nij", w5, R, R),
        15 * np.einsum("nq,nqi,nqj,nqk->nijk", w7, R, R, R, optimize=True) - 3 * symmetric,
    )


def test_disc_matches_coulomb_s_law():
    points = off_the_disc(1, 40, clear=0.5)
    coarse, fine = coulomb(points, 30), coulomb(points, 45)
    assert errors(coarse, fine).max() < 1e-11  # the reference has converged
    assert errors(DISC.jet(points, 2), fine).max() < 1e-11


def test_axis_matches_the_closed_form():
    """B_z = ±σ/2 (1 − |z|/√(z² + a²)), written without its cancellation as σ/2 a²/(r (r + |z|))."""
    z = np.geomspace(1e-6, 10, 50) * A
    r = np.hypot(z, A)
    for side in (1, -1):
        B, gradient, hessian = DISC.jet(cylindrical(0.0, side * z), 2)
        np.testing.assert_allclose(B[:, 2], side * CHARGE / 2 * A**2 / (r * (r + z)), rtol=1e-13, atol=0)
        assert not B[:, :2].any()
        slope = -CHARGE / 2 * A**2 / r**3
        np.testing.assert_allclose(gradient, slope[:, None, None] * np.diag([-0.5, -0.5, 1.0]), rtol=1e-13, atol=0)
        np.testing.assert_allclose(hessian[:, 2, 2, 2], side * 1.5 * CHARGE * A**2 * z / r**5, rtol=1e-12, atol=0)


@pytest.mark.parametrize("distance", [10.0, 100.0, 1000.0])
def test_far_on_the_axis_digits_are_lost_as_stated(distance):
    """Like (a/z)², and there alone: not where ρ > a, nor in the derivatives."""
    z, r = distance * A, np.hypot(distance, 1) * A
    truth = CHARGE / 2 * A**2 / (r * (r + z))
    assert abs(DISC.jet(cylindrical(0.0, z), 0)[0][0, 2] / truth - 1) < 1e-15 * distance**2
    points = A * scattered(2, 60, distance, distance)
    jet = DISC.jet(points[np.hypot(points[:, 0], points[:, 1]) > 2 * A], 2)
    far = coulomb(points[np.hypot(points[:, 0], points[:, 1]) > 2 * A], 12)
    assert errors(jet, far).max() < 2e-12


def test_far_field_is_that_of_a_point_charge():
    """σ π a² x/(4π r³), up to a²/r²: the charge that `net_charge` counts."""
    points = A * scattered(3, 60, 300.0, 300.0)
    r = np.linalg.norm(points, axis=1, keepdims=True)
    assert relative(DISC.jet(points, 0)[0], CHARGE * A**2 / 4 * points / r**3).max() < 1e-5


def test_two_opposite_discs_are_a_magnet_outside():
    points = scattered(4, 400, 0.05, 8.0) * A
    points = points[(np.abs(points[:, 2]) > 1.1 * HALF) | (np.hypot(points[:, 0], points[:, 1]) > 1.05 * A)]
    truth = cylinder_jet(points, A, 2 * HALF, [0, 0, CHARGE / MU_0], 2)
    assert errors(PAIR.jet(points, 2), truth).max() < 2e-12
    peer = magpylib.magnet.Cylinder(polarization=(0, 0, CHARGE), dimension=(2 * A, 2 * HALF))
    assert relative(PAIR.jet(points, 0)[0], peer.getB(points)).max() < 1e-12


def test_two_opposite_discs_are_a_magnet_s_µ0H_inside():
    points = A * cylindrical(*np.random.default_rng(5).uniform([[0], [-0.5]], [[0.9], [0.5]], (2, 60)))
    B, gradient, hessian = cylinder_jet(points, A, 2 * HALF, [0, 0, CHARGE / MU_0], 2)
    assert errors(PAIR.jet(points, 2), (B - [0, 0, CHARGE], gradient, hessian)).max() < 1e-11


@pytest.mark.parametrize(("distance", "tolerances"), [(0.1, (1e-12, 1e-12, 1e-11)), (1e-2, (1e-12, 1e-12, 1e-10))])
def test_rim_of_a_magnet_all_round_it(distance, tolerances):
    angle = np.arange(0.1, 2 * np.pi, 0.3)
    points = A * cylindrical(1 + distance * np.cos(angle), distance * np.sin(angle)) + [0, 0, HALF]
    outside = points[(points[:, 2] > HALF) | (np.hypot(points[:, 0], points[:, 1]) > A)]
    truth = cylinder_jet(outside, A, 2 * HALF, [0, 0, CHARGE / MU_0], 2)
    assert np.all(errors(PAIR.jet(outside, 2), truth) < tolerances)


@pytest.mark.parametrize("height", [1e-3, 1e-2, 0.5, 5.0])
def test_above_the_rim_nothing_is_lost(height):
    """ρ = a to within rounding: the third elliptic integral's characteristic is 1 there, and its factor 0."""
    beside = np.array([0.0, 1e-16, -1e-15, 1e-12, -1e-10, 1e-9, -1e-8, 1e-6, -1e-4])
    points = A * cylindrical(1 + beside, height, np.linspace(0, 3, 9)) + [0, 0, HALF]
    truth = cylinder_jet(points, A, 2 * HALF, [0, 0, CHARGE / MU_0], 1)
    assert errors(PAIR.jet(points, 1), truth).max() < 2e-12


def test_field_across_the_disc_jumps_by_its_density():
    """B_z = ±σ/2 beside the disc from its own charge, zero in the plane outside; the disc counts as its upper side."""
    rho = np.array([0.0, 0.4, 0.9, 0.999])
    up, down = (DISC.jet(A * cylindrical(rho, side * 1e-12), 0)[0] for side in (1, -1))
    np.testing.assert_allclose(up[:, 2], CHARGE / 2, rtol=1e-8)
    np.testing.assert_allclose(up * [1, 1, -1], down, rtol=1e-12, atol=1e-12)
    for zero in (0.0, -0.0):
        on = DISC.jet(A * cylindrical(rho, zero), 0)[0]
        np.testing.assert_allclose(on[:, 2], CHARGE / 2, rtol=1e-15)
    assert not DISC.jet(A * cylindrical(np.array([1.001, 2.0, 50.0]), 0.0), 0)[0][:, 2].any()
    assert not np.isfinite(DISC.jet(np.array([[A, 0, 0]]), 0)[0]).all()  # the rim itself


def flux_through_a_box(terms: Terms, centre: Points, half: Floats) -> float:
    """∮ B·dS over the six faces, 60 Gauss points a side."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    total = 0.0
    for axis in range(3):
        u, v = np.meshgrid(half[(axis + 1) % 3] * nodes, half[(axis + 2) % 3] * nodes, indexing="ij")
        area = np.outer(weights, weights) * half[(axis + 1) % 3] * half[(axis + 2) % 3]
        for side in (1, -1):
            face = np.empty((*u.shape, 3))
            face[..., axis], face[..., (axis + 1) % 3], face[..., (axis + 2) % 3] = side * half[axis], u, v
            B = terms.jet(face.reshape(-1, 3) + centre, 0)[0]
            total += side * float(np.sum(B[:, axis] * area.ravel()))
    return total


def test_flux_through_a_box_is_the_charge_in_it():
    charge, half = CHARGE * np.pi * A**2, A * np.array([1.5, 1.6, 0.5])
    assert flux_through_a_box(DISC, np.array([1e-4, 2e-4, 1e-4]), half) == pytest.approx(charge, rel=1e-10, abs=0)
    assert abs(flux_through_a_box(DISC, np.array([0, 0, 1.0 * A]), half)) < 1e-10 * charge
    assert abs(flux_through_a_box(PAIR, np.zeros(3), A * np.array([1.5, 1.5, 1.5]))) < 1e-10 * charge


def test_flux_through_a_sphere_around_a_magnet_vanishes():
    points, weights = sphere(80)
    outward = np.einsum("ij,ij->i", PAIR.jet(2 * A * points, 0)[0], points)
    assert abs(outward @ weights) < 1e-12 * (np.abs(outward) @ weights)


def test_field_is_free_of_sources_and_curl():
    assert_harmonic(lambda x: DISC.jet(x, 0)[0], off_the_disc(6, 60, 0.5), 0.01 * A, 1e-9)


def test_moved_and_turned_magnet_matches_magpylib():
    turn, centre = Rotation.from_rotvec([0.3, 1.1, -0.5]), A * np.array([1.0, -2.0, 0.5])
    axis = turn.as_matrix()[:, 2]
    pair = charge_discs(centre + np.outer([HALF, -HALF], axis), A, [CHARGE, -CHARGE], turn.as_matrix())
    peer = magpylib.magnet.Cylinder(
        polarization=(0, 0, CHARGE), dimension=(2 * A, 2 * HALF), position=centre, orientation=turn
    )
    points = A * scattered(7, 100, 2.0, 8.0) + centre
    assert relative(pair.jet(points, 0)[0], peer.getB(points)).max() < 1e-12
    np.testing.assert_allclose(pair.moment, CHARGE / MU_0 * 2 * HALF * np.pi * A**2 * axis, rtol=1e-12)


def test_what_charge_is_left_is_counted():
    """By the discs' areas, over the sum of their sizes."""
    assert DISC.net_charge == 1.0 and PAIR.net_charge == 0.0
    assert charge_discs(np.zeros((2, 3)), [1.0, 2.0], [4.0, -1.0]).net_charge == 0.0
    assert charge_discs(np.zeros((2, 3)), [1.0, 1.0], [1.0, -0.5]).net_charge == pytest.approx(1 / 3, rel=1e-15)
    assert loops(np.zeros((1, 3)), A, 1.0).net_charge == 0.0


@pytest.mark.parametrize(
    ("terms", "left"),
    [
        (DISC, "100.0%"),
        (concatenate([PAIR, DISC.scaled(-1.0)]), "-33.3%"),
        (charge_discs(np.zeros((2, 3)), A, [1.0, -1.0 + 1e-6]), "0.0%"),
    ],
)
def test_monopoles_are_refused(terms, left):
    with pytest.raises(InputError, match="a monopole does not exist") as caught:
        terms.check_sources()
    assert left in str(caught.value) and "\n" not in str(caught.value)


def test_neutral_sets_are_taken():
    PAIR.check_sources()
    concatenate([PAIR, PAIR.scaled(0.3), loops(np.zeros((1, 3)), A, 1.0)]).check_sources()
