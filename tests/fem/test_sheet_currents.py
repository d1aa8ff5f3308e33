"""Current sheets against magnetised bodies, sums of loops, and the laws of magnetostatics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from magfem.constants import MU_0
from magfem.fem.sheet_currents import SheetCurrents
from magfem.fields.terms import loops
from magfem.fields.uniform_block import block_jet
from magfem.fields.uniform_cylinder import cylinder_jet
from magfem.mesh.lattice import patches
from magfem.typing import Floats, Points

RADIUS, LENGTH, M = 2e-3, 3e-3, 1e6  # m, m, A/m
SIZE = np.array([2e-3, 3e-3, 1.5e-3])


def relative(found: Floats, truth: Floats) -> float:
    """Largest error at a point over the value there."""
    axes = tuple(range(1, truth.ndim))
    return float((np.sqrt(((found - truth) ** 2).sum(axes)) / np.sqrt((truth**2).sum(axes))).max())


def sheet(points: Floats, stream: Floats) -> SheetCurrents:
    """Of a lattice (2n+1, 2m+1, 3) m and its stream function (2n+1, 2m+1) A."""
    return SheetCurrents(patches(points), patches(np.ascontiguousarray(stream)))


def tube(around: int, along: int = 4) -> SheetCurrents:
    """The wall of a cylinder magnetised along its axis: K = M turns about z."""
    angle, z = np.meshgrid(
        np.linspace(0, 2 * np.pi, 2 * around + 1), np.linspace(-0.5, 0.5, 2 * along + 1) * LENGTH, indexing="ij"
    )
    return sheet(np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), z], axis=-1), M * z)


def box(split: tuple[int, int] = (1, 1)) -> SheetCurrents:
    """The four walls of a block magnetised along z, exactly; each divided as `split` says."""
    corners = 0.5 * SIZE[:2] * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]])
    walls = []
    for start, end in pairwise(corners):
        u = np.linspace(0, 1, 2 * split[0] + 1)[:, None, None]
        z = np.linspace(-0.5, 0.5, 2 * split[1] + 1)[None, :, None] * SIZE[2]
        plan = np.broadcast_to(start + u * (end - start), (u.size, z.size, 2))
        height = np.broadcast_to(z, (u.size, z.size, 1))
        walls.append(sheet(np.concatenate([plan, height], axis=-1), M * height[..., 0]))
    return SheetCurrents.joined(walls)


def wavy_ribbon(elements: int = 40) -> SheetCurrents:
    """A closed ribbon that waves and twists, 1 A flowing unevenly across it; it links the y axis's x = 3 mm."""
    t = np.linspace(0, 2 * np.pi, 2 * elements + 1)
    t[-1] = 0.0
    centre = np.stack([(3 + 0.5 * np.cos(3 * t)) * np.cos(t), 3 * np.sin(t), 0.8 * np.sin(2 * t)], axis=-1)
    lean = 2 * t + 0.5 * np.sin(t)
    half = 0.3 * np.stack([np.cos(lean) * np.cos(t), np.cos(lean) * np.sin(t), np.sin(lean)], axis=-1)
    across = np.linspace(-1, 1, 7)
    points = 1e-3 * (centre[:, None] + across[:, None] * half[:, None])
    stream = 0.5 * (1 + across) + 0.2 * (1 - across**2) * np.sin(4 * t)[:, None]
    return sheet(points, stream)


def around(size: Floats, clear: float, count: int = 120) -> Points:
    """Points inside and about a box of half `size`, none nearer than `clear` to its surface."""
    points = np.random.default_rng(3).uniform(-2, 2, (40 * count, 3)) * size
    points[::2] /= 2
    excess = np.abs(points) - size
    gap = np.where((excess < 0).all(axis=1), -excess.max(axis=1), np.linalg.norm(np.maximum(excess, 0), axis=1))
    return points[gap > clear][:count]


def off_the_tube(clear: float, count: int = 100) -> Points:
    """Points about the tube and in it, none nearer than `clear` to its wall."""
    points = np.random.default_rng(4).uniform(-2, 2, (60 * count, 3)) * np.array([RADIUS, RADIUS, LENGTH / 2])
    rho, z = np.hypot(points[:, 0], points[:, 1]), np.abs(points[:, 2])
    return points[np.hypot(rho - RADIUS, np.maximum(z - LENGTH / 2, 0)) > clear][:count]


def test_tube_is_a_magnetised_cylinder():
    points = off_the_tube(0.4e-3)
    truth = cylinder_jet(points, RADIUS, LENGTH, [0, 0, M], 2)
    found = tube(48, 8).jet(points, 2)
    for part, exact, bound in zip(found, truth, (2e-6, 5e-6, 3e-5), strict=True):
        assert relative(part, exact) < bound


def test_tube_converges_with_order_four():
    points = off_the_tube(0.8e-3)
    truth = cylinder_jet(points, RADIUS, LENGTH, [0, 0, M], 2)
    errors = [
        [relative(part, exact) for part, exact in zip(tube(n).jet(points, 2), truth, strict=True)] for n in (8, 16)
    ]
    slopes = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert (slopes > 3.6).all()
    assert (slopes < 4.6).all()


def test_box_is_a_magnetised_block():
    """Flat patches with a linear stream function are exact: what is left is the error of the integration."""
    points = around(SIZE / 2, 0.2e-3)
    truth = block_jet(points, SIZE, [0, 0, M], 2)
    for part, exact, bound in zip(box().jet(points, 2), truth, (1e-6, 5e-6, 5e-5), strict=True):
        assert relative(part, exact) < bound


@pytest.mark.parametrize("distance", [1e-4, 1e-5, 1e-6, 1e-8])
def test_next_to_a_wall_errors_are_small_beside_what_each_part_of_it_adds(distance):
    """µ0 K over the distance to the power of the derivative: what the rule's error of 1e-6 refers to."""
    rng = np.random.default_rng(6)
    points = rng.uniform(-0.4, 0.4, (60, 3)) * SIZE
    points[:, 0] = 0.5 * SIZE[0] + distance * rng.choice([-1, 1], 60)
    truth = block_jet(points, SIZE, [0, 0, M], 2)
    for order, (part, exact) in enumerate(zip(box().jet(points, 2), truth, strict=True)):
        worst = np.sqrt(((part - exact) ** 2).sum(tuple(range(1, exact.ndim)))).max()
        assert worst * distance**order / (MU_0 * M) < (1e-6, 1e-6, 1e-5)[order]


def on_a_wall() -> tuple[Points, Floats]:
    """Points on the wall at +x of the box, and the mean of the block's field at both of its sides."""
    on = np.random.default_rng(7).uniform(-0.4, 0.4, (30, 3)) * SIZE
    on[:, 0] = 0.5 * SIZE[0]
    step = np.array([1e-10, 0, 0])
    inside, outside = (block_jet(on + sign * step, SIZE, [0, 0, M], 0)[0] for sign in (-1, 1))
    return on, 0.5 * (inside + outside)


def test_on_the_sheet_tangential_b_is_the_mean_of_both_sides():
    on, mean = on_a_wall()
    np.testing.assert_allclose(
        box().jet(on, 0)[0][:, 1:], mean[:, 1:], rtol=0, atol=4e-6 * MU_0 * M
    )  # a millionth of each wall


def test_on_the_sheet_normal_b_is_the_mean_of_both_sides():
    on, mean = on_a_wall()
    np.testing.assert_allclose(box().jet(on, 0)[0][:, 0], mean[:, 0], rtol=0, atol=1e-6 * MU_0 * M)


def test_disc_is_a_sum_of_loops():
    inner, outer = 1e-3, 3e-3
    angle, rho = np.meshgrid(np.linspace(0, 2 * np.pi, 97), np.linspace(inner, outer, 17), indexing="ij")
    points = np.stack([rho * np.cos(angle), rho * np.sin(angle), 0 * rho], axis=-1)
    disc = sheet(points, (rho - inner) * (2 * outer - inner - rho) * 1e6)  # K turns about z, u × v points down
    nodes, weights = np.polynomial.legendre.leggauss(40)
    radii = inner + 0.5 * (outer - inner) * (1 + nodes)
    currents = 0.5 * (outer - inner) * weights * 2e6 * (outer - radii)
    places = around(np.array([3e-3, 3e-3, 1e-4]), 0.5e-3, 40)
    truth = loops(np.zeros((40, 3)), radii, currents).jet(places, 2)
    for part, exact, bound in zip(disc.jet(places, 2), truth, (5e-6, 1e-5, 1e-4), strict=True):
        assert relative(part, exact) < bound
    assert disc.moment[2] == pytest.approx(np.pi * (currents * radii**2).sum(), rel=1e-6)
    np.testing.assert_allclose(disc.moment[:2], 0, atol=1e-9 * disc.moment[2])


def test_moments_of_tube_and_box():
    np.testing.assert_allclose(tube(48).moment, [0, 0, M * np.pi * RADIUS**2 * LENGTH], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(box().moment, [0, 0, M * SIZE.prod()], rtol=1e-12, atol=1e-15)


def test_far_field_is_that_of_the_moment():
    ribbon = wavy_ribbon()
    points = 2.0 * np.array([[0.6, 0.0, 0.8], [0.0, -1.0, 0.0], [0.48, 0.64, -0.6]])  # 2 m away
    n = points / 2.0
    dipole = MU_0 / (4 * np.pi) * (3 * n * (n @ ribbon.moment)[:, None] - ribbon.moment) / 2.0**3
    both = 0.5 * (ribbon.jet(points, 0)[0] + ribbon.jet(-points, 0)[0])  # the quadrupole's field is odd
    assert relative(both, dipole) < 5e-5  # (4 mm/2 m)², times ten for the octupole


@pytest.mark.parametrize("clear", [0.4e-3, 5e-6])
def test_curl_of_the_vector_potential_is_b(clear):
    ribbon = wavy_ribbon()
    points = around(np.array([4e-3, 3.5e-3, 1.2e-3]), 0.0)
    if clear < 1e-5:
        points = ribbon.nodes[::7, 4] + clear * np.array([0.6, 0.0, 0.8])
    A, slope = ribbon.layer_jet(points, 1)
    B = ribbon.jet(points, 0)[0]
    curl = np.stack([slope[:, k, j] - slope[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=-1)
    assert relative(curl, B) < 1e-5
    np.testing.assert_array_equal(ribbon.vector_potential(points).shape, A.shape)
    assert relative(ribbon.vector_potential(points), A) < 1e-6
    trace = np.abs(np.trace(slope, axis1=1, axis2=2)) / np.linalg.norm(slope, axis=(1, 2))
    assert trace.max() < 1e-5  # the Coulomb gauge: no charge piles up


def test_field_of_a_closed_ribbon_has_neither_sources_nor_curl():
    ribbon = wavy_ribbon()
    points = around(np.array([4e-3, 3.5e-3, 1.2e-3]), 0.3e-3)
    _, gradient, hessian = ribbon.jet(points, 2)
    size = np.linalg.norm(gradient, axis=(1, 2))
    assert (np.abs(np.trace(gradient, axis1=1, axis2=2)) / size).max() < 1e-5
    assert (np.linalg.norm(gradient - gradient.transpose(0, 2, 1), axis=(1, 2)) / size).max() < 1e-5
    bulk = np.sqrt((hessian**2).sum((1, 2, 3)))
    assert (np.linalg.norm(np.einsum("nijj->ni", hessian), axis=1) / bulk).max() < 1e-4  # Laplace's equation


@pytest.mark.parametrize(("at", "amperes"), [(3.5e-3, 1.0), (9e-3, 0.0)])
def test_amperes_law_round_a_ribbon(at, amperes):
    """The circle lies in the plane y = 0, where the ribbon crosses it upwards at x = 3.5 mm, and downwards at −2.5."""
    ribbon = wavy_ribbon()
    t = 2 * np.pi * np.arange(96) / 96
    circle = np.array([at, 0, 0]) + 1.5e-3 * np.stack([np.cos(t), 0 * t, np.sin(t)], axis=-1)
    steps = 1.5e-3 * np.stack([-np.sin(t), 0 * t, np.cos(t)], axis=-1) * 2 * np.pi / 96
    integral = float((ribbon.jet(circle, 0)[0] * steps).sum())
    assert integral / MU_0 == pytest.approx(-amperes, abs=2e-6)


def test_patches_may_be_turned_and_split():
    ribbon = wavy_ribbon()
    nodes, stream = ribbon.nodes.reshape(-1, 3, 3, 3), ribbon.stream.reshape(-1, 3, 3)
    turned = SheetCurrents(nodes[:, ::-1, ::-1].reshape(-1, 9, 3), stream[:, ::-1, ::-1].reshape(-1, 9))
    # With u and v exchanged, or one of them backwards, the normal is reversed, and so is the stream function.
    swapped = SheetCurrents(
        np.ascontiguousarray(nodes.transpose(0, 2, 1, 3)).reshape(-1, 9, 3),
        -np.ascontiguousarray(stream.transpose(0, 2, 1)).reshape(-1, 9),
    )
    u = np.linspace(0, 1, 5)
    shapes = np.stack([(1 - u) * (1 - 2 * u), 4 * u * (1 - u), u * (2 * u - 1)], axis=1)
    fine = np.einsum("ua,vb,pabi->puvi", shapes, shapes, nodes), np.einsum("ua,vb,pab->puv", shapes, shapes, stream)
    split = SheetCurrents.joined([sheet(points, psi) for points, psi in zip(*fine, strict=True)])
    far, near = around(np.array([4e-3, 3.5e-3, 1.2e-3]), 0.0, 60), ribbon.nodes[::4, 4] + 1e-5
    for other in (turned, swapped, split):
        # Far patches partly cancel, whose errors do not.
        for bound, part, truth in zip((2e-5, 5e-5), other.jet(far, 1), ribbon.jet(far, 1), strict=True):
            assert relative(part, truth) < bound
        assert relative(other.jet(near, 0)[0], ribbon.jet(near, 0)[0]) < 2e-6
        assert relative(other.vector_potential(near), ribbon.vector_potential(near)) < 2e-6
    assert relative(split.jet(far, 0)[0], ribbon.jet(far, 0)[0]) < 1e-5


def test_orders_agree_and_empty_input_is_welcome():
    ribbon = wavy_ribbon(12)
    points = around(np.array([4e-3, 3.5e-3, 1.2e-3]), 0.1e-3, 40)
    alone, pair, triple = (ribbon.jet(points, order) for order in (0, 1, 2))
    assert relative(pair[0], alone[0]) < 1e-12
    assert relative(triple[0], alone[0]) < 1e-12
    assert relative(triple[1], pair[1]) < 1e-12
    assert ribbon.jet(np.empty((0, 3)), 2)[2].shape == (0, 3, 3, 3)
    assert SheetCurrents.joined([]).count == 0


def test_derivatives_are_differences():
    ribbon = wavy_ribbon()
    points = around(np.array([4e-3, 3.5e-3, 1.2e-3]), 1.5e-3, 20)
    _, gradient, hessian = ribbon.jet(points, 2)
    step = 1e-4
    for axis, move in enumerate(step * np.eye(3)):
        jets = {k: ribbon.jet(points + k * move, 1) for k in (-2, -1, 1, 2)}
        for rank, found in enumerate((gradient[..., axis], hessian[..., axis])):
            slope = (8 * (jets[1][rank] - jets[-1][rank]) - (jets[2][rank] - jets[-2][rank])) / (12 * step)
            whole = (gradient, hessian)[rank]
            size = np.sqrt((whole**2).sum(tuple(range(1, whole.ndim))))
            off = np.sqrt(((slope - found) ** 2).sum(tuple(range(1, found.ndim))))
            assert (off / size).max() < 1e-3  # 24 (step/distance)⁴, and rounding of the rules over the step
