"""Oblate harmonics against complex arithmetic, dipole layers, dipoles, axis formulas, mirror symmetry and laws."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest
from numpy.polynomial import legendre
from references.jets import assert_harmonic, cylindrical, differences, errors, relative, scattered, sphere
from scipy.spatial.transform import Rotation

from magfem.fields.term_kinds import HARMONIC, OBLATE
from magfem.fields.terms import Terms, harmonics
from magfem.typing import Floats, Points

A = 2e-3  # m, radius of the disc
PARTS = [(degree, part) for degree in (0, 1, 2, 3, 4, 5, 8, 13, 30) for part in (0, 1) if degree or part]
LOW = [one for one in PARTS if one[0] < 6]


def single(degree: int, imaginary: int, **where: Floats) -> Terms:
    return harmonics(A, [degree], [0], [imaginary], 1.0, kind=OBLATE, **where)


def off_the_disc(seed: int, count: int, clear: float = 0.3, farthest: float = 5.0) -> Points:
    """Random points (count, 3) m, `clear` radii from the disc at least."""
    points = scattered(seed, 20 * count, 0.1, farthest)
    beyond = np.maximum(np.hypot(points[:, 0], points[:, 1]) - 1, 0)
    return A * points[np.hypot(beyond, points[:, 2]) > clear][:count]


def complex_field(points: Points, degree: int, imaginary: int) -> Floats:
    """−∇ of a Re or Im (a/R)^{l+1} P_l(Z/R), R² = ρ² + Z² and Z = z − ia, by the chain rule in complex numbers.

    With t = Z/R and X = (x, y, Z): ∇R = X/R, ∇t = (ẑ − tX/R)/R.
    """
    X = points / A - np.array([0, 0, 1j])
    R = np.sqrt((X**2).sum(axis=1))  # numpy's root has a positive real part
    t, unit = X[:, 2] / R, X / R[:, None]
    series = np.eye(degree + 1)[degree]
    P, slope = legendre.legval(t, series), legendre.legval(t, legendre.legder(series))
    field = ((degree + 1) * P / R ** (degree + 2))[:, None] * unit
    field = field - (slope / R ** (degree + 2))[:, None] * (np.array([0, 0, 1]) - t[:, None] * unit)
    return field.imag if imaginary else field.real


@pytest.mark.parametrize(("degree", "imaginary"), PARTS)
def test_field_and_gradient_match_complex_arithmetic(degree, imaginary):
    points = off_the_disc(degree, 60)
    jet = single(degree, imaginary).jet(points, 2)
    assert relative(jet[0], complex_field(points, degree, imaginary)).max() < 1e-11
    step = 0.02 * A / (degree + 4)
    slopes = differences(lambda x: complex_field(x, degree, imaginary), points, step)
    assert np.median(relative(jet[1], slopes)) < 1e-10
    curves = differences(lambda x: single(degree, imaginary).jet(x, 1)[1], points, step)
    assert np.median(relative(jet[2], curves)) < 1e-10


@pytest.mark.parametrize("where", [(0.5, 1e-4), (0.5, -1e-4), (0.99, 1e-3), (1.01, -1e-3), (2.0, 1e-9), (0.0, 1e-6)])
@pytest.mark.parametrize(("degree", "imaginary"), LOW)
def test_nothing_is_lost_near_the_disc(degree, imaginary, where):
    points = A * cylindrical(*where)
    ours, truth = single(degree, imaginary).jet(points, 0)[0], complex_field(points, degree, imaginary)
    whole = np.hypot(*(np.linalg.norm(complex_field(points, degree, part)) for part in (0, 1)))
    assert np.linalg.norm(ours - truth) < 1e-12 * whole  # one part alone vanishes in the plane


@pytest.mark.parametrize(("degree", "imaginary"), PARTS)
def test_on_the_axis_it_is_a_power_of_a_complex_number(degree, imaginary):
    """B_z = ±(l + 1) Re or Im (a/(|z| ∓ ia))^{l+2}: R is z − ia above the disc, and ia − z below it."""
    height = np.array([0.05, 0.5, 1.0, 3.0, 30.0])
    for side in (1, -1):
        power = (1 / (height - side * 1j)) ** (degree + 2) * (degree + 1) * (1 if side > 0 else (-1) ** (degree + 1))
        B = single(degree, imaginary).jet(A * cylindrical(0.0, side * height), 0)[0]
        assert not B[:, :2].any()
        truth = power.imag if imaginary else power.real
        assert np.all(np.abs(B[:, 2] - truth) < 1e-13 * (degree + 1) * np.abs(power))


@pytest.mark.parametrize(("degree", "imaginary"), PARTS)
def test_mirror_symmetry_is_that_of_degree_and_part(degree, imaginary):
    """V is even in z where degree and part are both even or both odd, and odd elsewhere."""
    points = off_the_disc(20, 60)
    parity = (-1) ** (degree + imaginary)
    B, gradient, hessian = single(degree, imaginary).jet(points, 2)
    mirrored = single(degree, imaginary).jet(points * [1, 1, -1], 2)
    flip = np.array([1, 1, -1])
    turned = (
        B * flip,
        gradient * flip * flip[:, None],
        hessian * flip * flip[:, None] * flip[:, None, None],
    )
    assert np.all(errors(mirrored, tuple(parity * part for part in turned)) < 1e-13)


def test_degree_zero_is_a_layer_of_dipoles():
    """Im 1/R jumps by 2/√(1 − ρ²/a²) across the disc: V = ∫ τ n·(x − y)/(4π|x − y|³) dS with this τ.

    With u = √(1 − ρ²/a²), τ dS = 2a³ du dφ: Gauss's rule in u and the trapezoidal one in φ converge exponentially.
    """
    points = off_the_disc(21, 30, clear=0.5)

    def layer(nodes: int) -> Floats:
        u, weight = legendre.leggauss(nodes)
        rho = np.sqrt(1 - (0.5 + 0.5 * u) ** 2)
        phi = np.arange(2 * nodes) * np.pi / nodes
        disc = A * np.stack(np.broadcast_arrays(rho[:, None] * np.cos(phi), rho[:, None] * np.sin(phi), 0.0), axis=-1)
        dipoles = (
            np.broadcast_to((0.5 * weight * np.pi / nodes)[:, None], disc.shape[:2]).ravel() * 2 * A**3 / 4 / np.pi
        )
        d = points[:, None] - disc.reshape(-1, 3)
        r = np.linalg.norm(d, axis=-1, keepdims=True)
        fields = 3 * d[..., 2:] * d / r**5 - np.array([0, 0, 1]) / r**3
        return (dipoles[:, None] * fields).sum(axis=1)

    coarse, fine = layer(40), layer(80)
    assert relative(coarse, fine).max() < 1e-11  # the reference has converged
    assert relative(single(0, 1).jet(points, 0)[0], fine).max() < 1e-11


@pytest.mark.parametrize(("degree", "imaginary"), [(0, 1), (1, 0)])
def test_lowest_degrees_are_dipoles_of_the_stated_moment_far_away(degree, imaginary):
    """What is left over falls with the square of the distance: B itself like its cube."""
    turn, coefficient = Rotation.from_rotvec([0.3, 1.1, -0.5]).as_matrix(), 0.3
    term = single(degree, imaginary, frame=turn).scaled(coefficient)
    np.testing.assert_allclose(np.linalg.norm(term.moment), coefficient * A**3 * 1e7, rtol=1e-9)  # 4π/µ₀
    dipole, directions = magpylib.misc.Dipole(moment=term.moment), A * scattered(22, 40, 1.0, 1.0)
    near, far = (relative(term.jet(d * directions, 0)[0], dipole.getB(d * directions)).max() for d in (30, 300))
    assert far < 1e-4 and 1.95 < np.log10(near / far) < 2.05
    near, far = (np.linalg.norm(term.jet(d * directions, 0)[0], axis=1) for d in (300, 3000))
    np.testing.assert_allclose(near / far, 1e3, rtol=1e-3)


@pytest.mark.parametrize(("degree", "imaginary"), [(1, 1), (2, 0), (2, 1), (5, 0)])
def test_higher_degrees_have_no_moment_and_fall_faster(degree, imaginary):
    """Re of degree l decays as r^{−l−2}; Im, whose lead is that of degree l + 1, by one power more."""
    term, directions = single(degree, imaginary), A * scattered(23, 40, 1.0, 1.0)
    assert not term.moment.any()
    near, far = (np.linalg.norm(term.jet(d * directions, 0)[0], axis=1) for d in (100, 1000))
    np.testing.assert_allclose(np.log10(near / far), degree + 2 + imaginary, atol=0.05)


@pytest.mark.parametrize("degree", [1, 2, 3, 6])
def test_far_away_real_parts_are_ordinary_harmonics(degree):
    term, ordinary = single(degree, 0), harmonics(A, [degree], [0], [0], 1.0, kind=HARMONIC)
    points = A * scattered(24, 40, 1.0, 1.0)
    near, far = (errors(term.jet(d * points, 2), ordinary.jet(d * points, 2)) for d in (100, 1000))
    assert np.all(np.abs(np.log10(near / far) - 2) < 0.1)


@pytest.mark.parametrize(("degree", "imaginary"), LOW)
def test_field_is_free_of_sources_and_curl(degree, imaginary):
    assert_harmonic(lambda x: single(degree, imaginary).jet(x, 0)[0], off_the_disc(25, 40, 0.5), 0.005 * A, 1e-9)


@pytest.mark.parametrize(("degree", "imaginary"), LOW)
def test_flux_through_a_sphere_around_the_disc_vanishes(degree, imaginary):
    points, weights = sphere(80)
    outward = np.einsum("ij,ij->i", single(degree, imaginary).jet(1.7 * A * points, 0)[0], points)
    assert abs(outward @ weights) < 1e-12 * (np.abs(outward) @ weights)


@pytest.mark.parametrize(("degree", "imaginary"), LOW)
def test_the_field_jumps_across_the_disc_and_nowhere_else(degree, imaginary):
    """In the plane: through the disc one component jumps, the normal one where V is even; outside it all is smooth."""
    term, above = single(degree, imaginary), 1e-10
    outside = cylindrical(np.array([1.05, 1.5, 4.0]), above)
    scale = [np.abs(part).max() for part in term.jet(A * cylindrical(1.05, 0.05), 2)]
    for up, down, size in zip(term.jet(A * outside, 2), term.jet(A * outside * [1, 1, -1], 2), scale, strict=True):
        assert np.abs(up - down).max() < 1e-6 * size
    inside = A * cylindrical(np.array([0.1, 0.5, 0.8]), above)
    jump = term.jet(inside, 0)[0] - term.jet(inside * [1, 1, -1], 0)[0]
    across, along = np.abs(jump[:, 2]), np.linalg.norm(jump[:, :2], axis=1)
    even = (degree + imaginary) % 2 == 0
    assert np.all((across if even else along) > 1e-2) and np.all((along if even else across) < 1e-6)


@pytest.mark.parametrize(("degree", "imaginary"), LOW)
@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_the_disc_itself_counts_as_its_upper_side(degree, imaginary, zero):
    term, rho = single(degree, imaginary), np.array([0.0, 0.3, 0.9])
    on, limit = term.jet(A * cylindrical(rho, zero), 2), term.jet(A * cylindrical(rho, 1e-13), 2)
    for ours, truth in zip(on, limit, strict=True):
        np.testing.assert_allclose(ours, truth, rtol=1e-9, atol=1e-9 * np.abs(truth).max())


def test_the_rim_is_infinite():
    assert not np.isfinite(single(2, 0).jet(A * np.array([[1.0, 0, 0]]), 0)[0]).all()


def test_degrees_and_parts_add_in_one_source():
    """One source of many harmonics, moved and turned, is the sum of single ones in complex arithmetic."""
    turn, centre = Rotation.from_rotvec([0.4, -1.2, 0.7]).as_matrix(), A * np.array([0.5, -0.3, 0.9])
    degrees, parts = [3, 0, 1, 3, 8, 1], [1, 1, 0, 0, 1, 0]
    values = np.random.default_rng(26).normal(size=6)
    source = harmonics(A, degrees, [0] * 6, parts, values, centre, turn, OBLATE)
    points = off_the_disc(27, 60)
    truth = sum(v * complex_field(points, n, part) for v, n, part in zip(values, degrees, parts, strict=True))
    assert relative(source.jet(points @ turn.T + centre, 0)[0], truth @ turn.T).max() < 1e-11
