"""The current loop against magpylib, the Biot–Savart integral, differences, elementary formulas and laws."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magfem.constants import MU_0
from magfem.fields.terms import frame_about, loops
from magfem.typing import Floats, Points

RADIUS = 2e-3  # m
CURRENT = 3.0  # A
LOOP = loops(np.zeros((1, 3)), np.array([RADIUS]), np.array([CURRENT]))
PEER = magpylib.current.Circle(diameter=2 * RADIUS, current=CURRENT)
CENTRAL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])  # weights of the eighth-order first difference


def jet(points: Points, order: int = 2) -> tuple[Floats, ...]:
    return LOOP.jet(points, order)


def at(rho: Floats | float, z: Floats | float, azimuth: Floats | float = 0.7) -> Points:
    """Points (n, 3) m from cylindrical coordinates in units of the radius."""
    rho, z, azimuth = np.broadcast_arrays(rho, z, azimuth)
    return RADIUS * np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=-1).reshape(-1, 3)


def around_wire(distance: float) -> Points:
    """Points (24, 3) at `distance` radii from the wire, all round it."""
    angle = np.arange(24) * 2 * np.pi / 24
    return at(1 + distance * np.cos(angle), distance * np.sin(angle), 3 * angle)


def scattered(count: int, seed: int, reach: float = 3.0, clear: float = 0.05) -> Points:
    """Random points (count, 3), up to `reach` radii away and `clear` radii from the wire at least."""
    points = np.random.default_rng(seed).uniform(-reach, reach, (20 * count, 3))
    distance = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2])
    return RADIUS * points[distance > clear][:count]


def relative(value: Floats, truth: Floats) -> Floats:
    """|value − truth| over |truth| at every point."""
    axes = tuple(range(1, truth.ndim))
    return np.sqrt(((value - truth) ** 2).sum(axes) / (truth**2).sum(axes))


def biot_savart(points: Points, nodes: int) -> tuple[Floats, Floats, Floats]:
    """B, gradient and hessian: µ₀I/4π ∮ dl × R/R³ differentiated under the integral, by the trapezoidal rule.

    The integrand is periodic and analytic: the rule converges exponentially in the number of nodes.
    """
    phi = np.arange(nodes) * 2 * np.pi / nodes
    wire = RADIUS * np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    step = 2 * np.pi / nodes * RADIUS * np.stack([-np.sin(phi), np.cos(phi), 0 * phi], axis=-1)
    R = points[:, None, :] - wire
    r = np.linalg.norm(R, axis=-1)
    one = np.eye(3)
    first = np.einsum("bj,nq->nqbj", one, r**-3) - 3 * np.einsum("nqb,nqj,nq->nqbj", R, R, r**-5)
    mixed = np.einsum("bj,nqk->nqbjk", one, R)
    mixed = mixed + np.einsum("bk,nqj->nqbjk", one, R) + np.einsum("jk,nqb->nqbjk", one, R)
    second = 15 * np.einsum("nqb,nqj,nqk,nq->nqbjk", R, R, R, r**-7) - 3 * mixed * r[..., None, None, None] ** -5
    cross = np.zeros((3, 3, 3))
    for i, a, b in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[i, a, b], cross[i, b, a] = 1.0, -1.0
    c = MU_0 * CURRENT / (4 * np.pi)
    return (
        c * np.einsum("iab,qa,nqb,nq->ni", cross, step, R, r**-3),
        c * np.einsum("iab,qa,nqbj->nij", cross, step, first),
        c * np.einsum("iab,qa,nqbjk->nijk", cross, step, second),
    )


def differences(points: Points, order: int, step: float) -> Floats:
    """Derivatives of the order-th part of the jet by eighth-order central differences, new index last."""
    columns = []
    for axis in np.eye(3):
        moved = [jet(points + sign * (k + 1) * step * axis, order)[order] for k in range(4) for sign in (1, -1)]
        columns.append(sum(w * (moved[2 * k] - moved[2 * k + 1]) for k, w in enumerate(CENTRAL)) / step)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(
    ("points", "tolerance"),
    [
        pytest.param(at(0.0, np.linspace(-20, 20, 41)), 1e-13, id="axis"),
        pytest.param(scattered(500, 1), 1e-13, id="off axis"),
        pytest.param(around_wire(0.05), 1e-13, id="near the wire"),
        pytest.param(around_wire(1e-4), 1e-11, id="at the wire"),
        pytest.param(scattered(500, 2, reach=1000.0), 1e-12, id="far"),
        pytest.param(at(np.geomspace(1e-9, 1e-2, 50), np.linspace(-3, 3, 50)), 1e-13, id="near the axis"),
    ],
)
def test_field_matches_magpylib_circle(points, tolerance):
    assert relative(jet(points, 0)[0], PEER.getB(points)).max() < tolerance


def test_jet_matches_biot_savart_integral():
    points = scattered(150, 3, clear=0.2)
    for ours, coarse, fine in zip(jet(points), biot_savart(points, 250), biot_savart(points, 500), strict=True):
        assert relative(coarse, fine).max() < 1e-12  # the reference has converged
        assert relative(ours, fine).max() < 2e-12


def test_jet_matches_biot_savart_integral_where_the_evaluation_changes_over():
    """Lines from the axis outwards: series and elliptic integrals hand over at a value of 4a²s/(a² + s + z²)²."""
    rho = np.linspace(0.05, 0.6, 300)
    points = np.concatenate([at(rho, z) for z in (0.02, 0.3, 1.0)])
    s, z2 = (points[:, 0] ** 2 + points[:, 1] ** 2) / RADIUS**2, (points[:, 2] / RADIUS) ** 2
    ratio = 4 * s / (1 + s + z2) ** 2
    assert ratio.min() < 0.01 and ratio.max() > 0.5
    for ours, truth in zip(jet(points), biot_savart(points, 120), strict=True):
        assert relative(ours, truth).max() < 1e-12


@pytest.mark.parametrize("order", [0, 1])
def test_orders_of_the_jet_agree(order):
    """B asked for alone, or with derivatives, is the same field: they may be computed in different ways."""
    points = np.concatenate([scattered(300, 4), at(np.linspace(0, 0.6, 300), 0.3)])
    for few, all_three in zip(jet(points, order), jet(points, 2), strict=False):
        assert relative(few, all_three).max() < 1e-12


def test_gradient_and_hessian_are_differences_of_eighth_order():
    """Step study: halving the step divides the error by 2⁸, until rounding."""
    points = scattered(60, 5, clear=0.5)
    for order in (0, 1):
        truth = jet(points)[order + 1]
        wide, narrow, fine = (
            np.median(relative(differences(points, order, h * RADIUS), truth)) for h in (0.08, 0.04, 0.01)
        )
        assert 7.0 < np.log2(wide / narrow) < 9.0
        assert fine < 1e-11


def test_axis_matches_elementary_formula():
    """B_z = µ₀I a²/(2(a² + z²)^{3/2}) and its derivatives; off the axis, one step of Taylor's series."""
    z = np.linspace(-8, 8, 33) * RADIUS
    w = RADIUS**2 + z**2
    c = MU_0 * CURRENT * RADIUS**2 / 2
    B, slope, curvature = c * w**-1.5, -3 * c * z * w**-2.5, 3 * c * (4 * z**2 - RADIUS**2) * w**-3.5
    ours = jet(np.stack([0 * z, 0 * z, z], axis=-1))
    np.testing.assert_allclose(ours[0], B[:, None] * [0, 0, 1], rtol=1e-14, atol=0)
    scale = np.abs(slope).max()
    np.testing.assert_allclose(
        ours[1], slope[:, None, None] * np.diag([-0.5, -0.5, 1.0]), rtol=1e-13, atol=1e-15 * scale
    )
    np.testing.assert_allclose(ours[2][:, 2, 2, 2], curvature, rtol=1e-12, atol=1e-14 * np.abs(curvature).max())
    beside = jet(np.stack([0 * z + 1e-9 * RADIUS, 0 * z, z], axis=-1), 0)[0]
    np.testing.assert_allclose(beside[:, 0], -slope / 2 * 1e-9 * RADIUS, rtol=1e-12, atol=1e-30)


def test_derivatives_near_the_axis_lose_no_digits():
    """G = B_x/x tends to −B_z'/2, linearly in s = x²: no division by a small radius anywhere."""
    x = np.geomspace(1e-12, 1e-3, 20) * RADIUS
    points = np.stack([x, 0 * x, 0 * x + 0.6 * RADIUS], axis=-1)
    B, gradient, hessian = jet(points)
    on_axis = jet(np.array([[0, 0, 0.6 * RADIUS]]))
    expected = (x / RADIUS) ** 2 + 1e-15
    assert np.all(np.abs(B[:, 0] / x / on_axis[1][0, 0, 0] - 1) < 5 * expected)
    assert relative(gradient[:3], np.broadcast_to(on_axis[1], (3, 3, 3))).max() < 1e-10
    np.testing.assert_allclose(hessian[:, 0, 0, 2], on_axis[2][0, 0, 0, 2], rtol=1e-4)


def test_far_field_is_the_dipole_of_its_moment():
    """The relative difference falls with the square of the distance."""
    dipole = magpylib.misc.Dipole(moment=LOOP.moment)
    directions = scattered(40, 6, reach=1.0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    near, far = (
        relative(jet(d * RADIUS * directions, 0)[0], dipole.getB(d * RADIUS * directions)).max() for d in (50, 500)
    )
    assert 1.95 < np.log10(near / far) < 2.05
    assert far < 1e-5


def test_field_near_the_wire_is_that_of_a_straight_wire():
    """µ₀I/(2πd), up to terms of order (d/a) log(d/a)."""
    for d in (1e-2, 1e-4, 1e-6):
        B = np.linalg.norm(jet(around_wire(d), 0)[0], axis=1)
        straight = MU_0 * CURRENT / (2 * np.pi * d * RADIUS)
        assert np.abs(B / straight - 1).max() < d * (1 + np.log(8 / d))


def test_mirror_and_rotation_symmetry():
    points = scattered(200, 7)
    B = jet(points, 0)[0]
    mirrored = jet(points * [1, 1, -1], 0)[0]
    np.testing.assert_allclose(mirrored, B * [-1, -1, 1], rtol=1e-13, atol=1e-16)
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(jet(points @ quarter.T, 0)[0], B @ quarter.T, rtol=1e-12, atol=1e-17)


def test_field_itself_is_free_of_sources_and_curl():
    """By differences of B, not by how the gradient is stored."""
    slopes = differences(scattered(100, 8, clear=0.5), 0, 0.01 * RADIUS)
    size = np.linalg.norm(slopes, axis=(1, 2))
    assert np.all(np.abs(np.trace(slopes, axis1=1, axis2=2)) < 1e-10 * size)
    assert np.all(np.linalg.norm(slopes - np.swapaxes(slopes, 1, 2), axis=(1, 2)) < 1e-10 * size)


def test_derivatives_are_symmetric_and_without_trace():
    _, gradient, hessian = jet(scattered(100, 9))
    assert np.array_equal(gradient, np.swapaxes(gradient, 1, 2))
    for axes in ((0, 2, 1, 3), (0, 1, 3, 2), (0, 3, 2, 1)):
        assert np.array_equal(hessian, np.transpose(hessian, axes))
    size = np.abs(hessian).max(axis=(1, 2, 3))
    assert np.all(np.abs(np.trace(gradient, axis1=1, axis2=2)) < 1e-14 * np.abs(gradient).max(axis=(1, 2)))
    assert np.all(np.abs(np.trace(hessian, axis1=1, axis2=2)) < 1e-14 * size[:, None])


def test_circulation_around_the_wire_is_ampere_s_law():
    """∮ B·dl = µ₀I on a circle around the wire: the trapezoidal rule converges exponentially."""
    angle = np.arange(400) * 2 * np.pi / 400
    points = at(1 + 0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0)
    along = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    circulation = np.sum(jet(points, 0)[0] * along) * 0.5 * RADIUS * 2 * np.pi / 400
    # A current that turns right-handed about +z crosses the half plane x > 0 along +y: B circles it the other way.
    assert circulation == pytest.approx(-MU_0 * CURRENT, rel=1e-13, abs=0)


def test_displaced_and_tilted_loops_match_magpylib():
    direction = np.array([1.0, -2.0, 0.5])
    centre = np.array([[1e-3, 0, -2e-3], [0, 3e-3, 0]])
    ours = loops(centre, np.array([RADIUS, RADIUS / 2]), np.array([CURRENT, -CURRENT]), frame_about(direction))
    rotation, _ = Rotation.align_vectors(direction, [0, 0, 1])
    peers = magpylib.Collection(
        magpylib.current.Circle(diameter=2 * RADIUS, current=CURRENT, position=centre[0], orientation=rotation),
        magpylib.current.Circle(diameter=RADIUS, current=-CURRENT, position=centre[1], orientation=rotation),
    )
    points = scattered(300, 10, reach=5.0)
    np.testing.assert_allclose(ours.jet(points, 0)[0], peers.getB(points), rtol=1e-9, atol=1e-14)


def test_field_on_the_wire_is_not_finite():
    """No large but wrong number where the field does not exist."""
    assert not np.isfinite(jet(at(1.0, 0.0, 0.0), 0)[0]).all()
