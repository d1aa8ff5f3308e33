"""The fast paths of one order against mixed orders, the dipole, and diametric and axial cylinders' exact fields."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest
from references.jets import assert_harmonic, cylindrical, errors, relative, scattered
from scipy.special import eval_legendre

from magfem.constants import MU_0
from magfem.fields.packed import MIXED, TRANSVERSE_COS, TRANSVERSE_SIN, ZONAL
from magfem.fields.terms import Terms, harmonics, loops
from magfem.fields.uniform_cylinder import cylinder_jet
from magfem.typing import Floats, Points

A = 2e-3  # m, reference radius
DEGREES = [1, 2, 3, 4, 5, 6, 7, 8, 13, 20, 27, 40]


def ways(terms: Terms) -> list[int]:
    """How the sources are evaluated."""
    return terms.packed.layout[:, 0].tolist()


def both_ways(order: int, degrees: list[int], sines: list[int], values: Floats) -> tuple[Terms, Terms]:
    """A set of one order, and the same set with a harmonic of another order and no weight."""
    orders = [order] * len(degrees)
    other = 2, 2, 0, 0.0
    mixed = [[*have, more] for have, more in zip((degrees, orders, sines, values), other, strict=True)]
    return harmonics(A, degrees, orders, sines, values), harmonics(A, *mixed)


def everywhere() -> Points:
    """Points in the open, beside the axis and on it."""
    rho = np.array([0.0, 1e-12, 1e-7, 1e-3, 1e-2])
    beside = [cylindrical(rho, height) for height in (-1.3, 0.6, 4.0)]
    return A * np.concatenate([scattered(1, 60, 0.4, 8.0), *beside])


@pytest.mark.parametrize("sine", [0, 1])
@pytest.mark.parametrize("degree", DEGREES)
def test_a_transverse_harmonic_equals_the_mixed_path(degree, sine):
    fast, mixed = both_ways(1, [degree], [sine], [0.7])
    assert ways(fast) == [TRANSVERSE_SIN if sine else TRANSVERSE_COS] and ways(mixed) == [MIXED]
    points = everywhere()
    for order in range(3):
        assert errors(fast.jet(points, order), mixed.jet(points, order)).max() < 1e-12


@pytest.mark.parametrize("degree", DEGREES)
def test_a_zonal_harmonic_equals_the_mixed_path(degree):
    fast, mixed = both_ways(0, [degree], [0], [0.7])
    assert ways(fast) == [ZONAL] and ways(mixed) == [MIXED]
    points = everywhere()
    for order in range(3):
        assert errors(fast.jet(points, order), mixed.jet(points, order)).max() < 1e-12


@pytest.mark.parametrize("order", [0, 1])
def test_sums_of_one_order_equal_the_mixed_path(order):
    """Both parts at once; degrees with gaps, in any order, some twice."""
    degrees, values = [7, 1, 2, 40, 1, 12, 7], np.random.default_rng(2).normal(size=7)
    fast, mixed = both_ways(order, degrees, [0, 1, 0, 1, 1, 0, 0] if order else [0] * 7, values)
    assert sorted(ways(fast)) == ([TRANSVERSE_COS, TRANSVERSE_SIN] if order else [ZONAL])
    points = A * scattered(3, 100, 0.8, 8.0)
    assert errors(fast.jet(points, 2), mixed.jet(points, 2)).max() < 1e-12


@pytest.mark.parametrize("sine", [0, 1])
def test_degree_one_is_magpylib_dipole(sine):
    peer = magpylib.misc.Dipole(moment=4 * np.pi / MU_0 * 0.3 * A**3 * np.eye(3)[sine])
    term, points = harmonics(A, [1], [1], [sine], 0.3), A * scattered(4, 100, 0.5, 10.0)
    assert ways(term) == [TRANSVERSE_SIN if sine else TRANSVERSE_COS]
    assert relative(term.jet(points, 0)[0], peer.getB(points)).max() < 1e-9  # the two µ₀ differ by 1.6e-10


def cylinder_multipoles(remanence: Floats, radius: float, length: float, highest: int) -> Terms:
    """A cylinder's multipoles about its centre: V = −B_r·∇U, U = Σ q_l P_l(cos θ)/(4π r^{l+1}), q_l = ∫ r^l P_l dV.

    ∂_z and ∂_x of P_l/r^{l+1} are −(l + 1) P_{l+1}/r^{l+2} and −P_{l+1}^1 cos φ/r^{l+2}.
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)
    z, rho = length / 2 * nodes[:, None], radius / 2 * (1 + nodes)
    volume = 2 * np.pi * rho * radius * length / 4 * weights * weights[:, None]
    r = np.hypot(rho, z)
    even = np.arange(0, highest, 2)
    q = np.array([np.sum(volume * r**n * eval_legendre(n, z / r)) for n in even]) / (4 * np.pi * A ** (even + 3.0))
    degree, none = even + 1, 0 * even
    schmidt = np.sqrt(degree * (degree + 1) / 2)
    return (
        harmonics(A, degree, none + 1, none, remanence[0] * q * schmidt)
        + harmonics(A, degree, none + 1, none + 1, remanence[1] * q * schmidt)
        + harmonics(A, degree, none, none, remanence[2] * q * degree)
    )


REMANENCE = np.array([1.1, -0.4, 0.3])  # T


def test_first_multipoles_of_a_cylinder_in_closed_form():
    """q₀ = V and q₂ = V (L²/12 − R²/4): what the quadrature of the reference must give."""
    radius, length = A, 1.5 * A
    volume = np.pi * radius**2 * length
    dipole, octupole = cylinder_multipoles(np.array([0, 0, 1.0]), radius, length, 4).source(2).coefficient
    assert dipole == pytest.approx(volume / (4 * np.pi * A**3), rel=1e-14)
    assert octupole == pytest.approx(3 * volume * (length**2 / 12 - radius**2 / 4) / (4 * np.pi * A**5), rel=1e-13)


def test_multipoles_sum_to_the_exact_jet_of_a_cylinder_magnetised_askew():
    """At three circumscribed radii and degree 40, 3⁻⁴⁰ is left."""
    radius, length = A, 1.5 * A
    terms = cylinder_multipoles(REMANENCE, radius, length, 40)
    points = scattered(5, 80, 3.0, 10.0) * np.hypot(radius, length / 2)
    assert np.all(errors(terms.jet(points, 2), cylinder_jet(points, radius, length, REMANENCE / MU_0, 2)) < 1e-11)


@pytest.mark.parametrize("highest", [2, 4, 6])
def test_every_multipole_of_a_diametric_cylinder_adds_two_powers_of_distance(highest):
    terms = cylinder_multipoles(np.array([1.0, 0, 0]), A, 1.5 * A, highest)
    peer = magpylib.magnet.Cylinder(polarization=(1, 0, 0), dimension=(2 * A, 1.5 * A))
    directions = scattered(6, 40, 1.0, 1.0)
    near, far = (relative(terms.jet(d * A * directions, 0)[0], peer.getB(d * A * directions)).max() for d in (4, 8))
    assert highest - 0.3 < np.log2(near / far) < highest + 0.3


def test_a_loop_is_its_zonal_multipoles():
    """Inside out of its series on the axis: B_z = µ₀I R²/(2 z³) Σ binom(−3/2, k) (R/z)^{2k}."""
    radius, current, k = A, 3.0, np.arange(30)
    signs = np.cumprod(np.concatenate([[1.0], (-1.5 - k[:-1]) / (k[:-1] + 1)]))
    degree = 2 * k + 1
    series = harmonics(A, degree, 0 * k, 0 * k, MU_0 * current / (2 * A) * signs / (degree + 1))
    points = scattered(7, 80, 2.0, 20.0) * radius
    assert ways(series) == [ZONAL]
    assert np.all(errors(series.jet(points, 2), loops(np.zeros((1, 3)), radius, current).jet(points, 2)) < 1e-12)


@pytest.mark.parametrize("degree", [1, 4, 9])
def test_field_is_free_of_sources_and_curl(degree):
    term = harmonics(A, [degree, degree], [1, 1], [0, 1], [0.3, -0.8])
    assert_harmonic(lambda x: term.jet(x, 0)[0], A * scattered(8, 40, 1.0, 4.0), 0.005 * A, 1e-9)
