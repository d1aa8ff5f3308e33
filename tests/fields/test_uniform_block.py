"""The exact block against magpylib, quadrature over its volume, a current bar, differences, and conservation laws."""

from __future__ import annotations

import itertools

import magpylib
import numpy as np
import pytest

from magfem.constants import MU_0
from magfem.fields import uniform_block
from magfem.fields.uniform_block import block_jet, newton_derivatives, rectangle_derivatives
from magfem.typing import Floats, Points

UNIT = 1e-3  # m
M = 1e6 * np.array([0.48, -0.6, 0.64])  # A/m
SIZES = {"cube": (1.0, 1.0, 1.0), "brick": (1.0, 2.0, 3.0), "plate": (4.0, 3.0, 0.05), "bar": (0.1, 8.0, 0.2)}

sizes = pytest.mark.parametrize("size", [UNIT * np.array(size) for size in SIZES.values()], ids=SIZES)


def scattered(size: Floats, count: int, clear: float, rng: np.random.Generator) -> Points:
    """Half inside, half about; `clear` shortest edges off the surface."""
    points = rng.uniform(-0.5, 0.5, (4 * count, 3)) * size
    points[::2] *= 4
    excess = np.abs(points) - size / 2
    gap = np.where((excess < 0).all(axis=1), -excess.max(axis=1), np.linalg.norm(np.maximum(excess, 0), axis=1))
    return points[gap > clear * size.min()][:count]


def relative(value: Floats, truth: Floats) -> Floats:
    flat, norm = (value - truth).reshape(len(truth), -1), truth.reshape(len(truth), -1)
    return np.linalg.norm(flat, axis=1) / np.linalg.norm(norm, axis=1)


def by_volume(points: Points, size: Floats, counts: tuple[int, int, int]) -> list[Floats]:
    """Derivatives of U, orders 1 to 4, with 1/r derived by Maxwell's poles, by Gauss–Legendre over the block."""
    rules = [np.polynomial.legendre.leggauss(n) for n in counts]
    grid = np.meshgrid(*(edge / 2 * t for edge, (t, _) in zip(size, rules, strict=True)), indexing="ij")
    weights = np.einsum("i,j,k", *(w for _, w in rules)).ravel() * np.prod(size) / (32 * np.pi)
    d = points[:, None] - np.stack(grid, axis=-1).reshape(-1, 3)
    r = np.linalg.norm(d, axis=-1)
    n, unit = d / r[..., None], np.eye(3)

    def total(power: int, letters: str) -> Floats:
        """∫ n n … / r^power."""
        names = ",".join(f"pq{letter}" for letter in letters)
        return np.einsum(f"pq{',' + names if names else ''}->p{letters}", weights / r**power, *[n] * len(letters))

    second = 3 * total(3, "ij") - np.einsum("p,ij->pij", total(3, ""), unit)
    third = -15 * total(4, "ijk")
    fourth = 105 * total(5, "ijkl")
    one, two, none = total(4, "a"), total(5, "ab"), total(5, "")
    for a, rest in (("i", "jk"), ("j", "ik"), ("k", "ij")):
        third += 3 * np.einsum(f"p{a},{rest}->pijk", one, unit)
    for a, rest in (("ij", "kl"), ("ik", "jl"), ("il", "jk"), ("jk", "il"), ("jl", "ik"), ("kl", "ij")):
        fourth -= 15 * np.einsum(f"p{a},{rest}->pijkl", two, unit)
    for a, rest in (("ij", "kl"), ("ik", "jl"), ("il", "jk")):
        fourth += 3 * np.einsum(f"p,{a},{rest}->pijkl", none, unit, unit)
    return [-total(2, "i"), second, third, fourth]


@sizes
def test_B_matches_magpylib(size):
    points = scattered(size, 1000, 0.01, np.random.default_rng(1))
    (b,) = block_jet(points, size, M, order=0)
    peer = magpylib.magnet.Cuboid(dimension=size, magnetization=M).getB(points)
    error = relative(b, peer)
    assert np.max(error) < 1e-9
    assert np.median(error) < 1e-12


@sizes
def test_derivatives_outside_match_quadrature_over_the_volume(size):
    """Half to one longest edge away, all orders; further out the same with fewer nodes."""
    rng = np.random.default_rng(2)
    rays = rng.normal(size=(6, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    for reach, tolerance in ((1.1, 1e-10), (3.0, 1e-11), (20.0, 1e-11), (100.0, 1e-12), (1e6, 1e-12)):
        points = reach * np.linalg.norm(size) * rays
        truth = by_volume(points, size, (30, 30, 30) if reach < 2 else (14, 14, 14))
        for value, exact in zip(newton_derivatives(points, size, 1, 4), truth, strict=True):
            assert np.max(relative(value, exact)) < tolerance


@sizes
def test_both_routes_agree_where_they_meet(size, monkeypatch):
    """Corner sums and Gauss rules, evaluated uncompiled at the same points."""
    half = size / 2
    for kernel in ("_by_gauss", "_add_corner", "add_pole", "_at", "_unit", "_unfold"):
        monkeypatch.setattr(uniform_block, kernel, getattr(uniform_block, kernel).py_func)
    block = uniform_block._block.py_func
    points = np.random.default_rng(3).normal(size=(2, 3))
    points *= 1.2 * np.linalg.norm(size) / np.linalg.norm(points, axis=1, keepdims=True)
    found = []
    for switch in (0.0, np.inf):
        monkeypatch.setattr(uniform_block, "CANCELLATION", switch)
        out = np.empty((2, 34))
        block(points, half, 4, out)
        found.append(out)
    for first, last in ((0, 3), (3, 9), (9, 19), (19, 34)):
        assert np.max(relative(found[0][:, first:last], found[1][:, first:last])) < 1e-10


@sizes
@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_match_central_differences(size, order):
    points = scattered(size, 200, 0.1, np.random.default_rng(4))
    exact = block_jet(points, size, M, order)[order]

    def difference(step: float) -> Floats:
        ahead, behind = (
            block_jet(points + sign * step * np.eye(3)[:, None], size, M, order - 1)[order - 1] for sign in (1, -1)
        )
        return np.moveaxis((ahead - behind) / (2 * step), 0, -1)

    h = 0.01 * size.min()
    coarse, fine = (np.linalg.norm(difference(step) - exact) for step in (h, h / 2))
    assert 3.8 < coarse / fine < 4.2
    extrapolated = (4 * difference(h / 2) - difference(h)) / 3
    assert np.linalg.norm(extrapolated - exact) < 3e-6 * np.linalg.norm(exact)


@sizes
def test_gradient_of_the_potential_gives_the_second_derivatives(size):
    points = scattered(size, 100, 0.1, np.random.default_rng(5))
    h = 0.005 * size.min()

    def slope(step: float) -> Floats:
        ahead, behind = (newton_derivatives(points + s * step * np.eye(3)[:, None], size, 1, 1)[0] for s in (1, -1))
        return np.moveaxis((ahead - behind) / (2 * step), 0, -1)

    (second,) = newton_derivatives(points, size, 2, 2)
    assert np.max(relative((4 * slope(h / 2) - slope(h)) / 3, second)) < 1e-6


@sizes
def test_potential_obeys_poissons_equation(size):
    points = scattered(size, 400, 0.0, np.random.default_rng(6))
    inside = (np.abs(points) <= size / 2).all(axis=1)
    second, third, fourth = newton_derivatives(points, size, 2, 4)
    np.testing.assert_allclose(np.trace(second, axis1=1, axis2=2), -1.0 * inside, atol=1e-13)
    for tensor in (third, fourth):
        np.testing.assert_allclose(np.trace(tensor, axis1=-2, axis2=-1), 0, atol=1e-12 * np.abs(tensor).max())


def test_long_bar_of_current_has_the_field_of_a_wire():
    """B = µ0 ∇U × J: µ0 I/(2π d) far from the axis of a bar that is longer still."""
    size, density = np.array([0.1, 0.2, 2000.0]) * UNIT, 1e6
    distance = np.array([3.0, 5.0]) * UNIT
    (slope,) = newton_derivatives(np.stack([distance, 0 * distance, 0 * distance], axis=-1), size, 1, 1)
    b = MU_0 * np.cross(slope, [0, 0, density])
    truth = MU_0 * density * size[0] * size[1] / (2 * np.pi * distance)
    # The bar's cross-section adds (w² − h²)/(12 d²) here, its ends take away d²/(2 (L/2)²).
    truth *= 1 + (size[0] ** 2 - size[1] ** 2) / (12 * distance**2) - 2 * distance**2 / size[2] ** 2
    np.testing.assert_allclose(b[:, 1], truth, rtol=1e-6)
    assert np.all(np.abs(b[:, [0, 2]]) < 1e-12 * truth[:, None])


@sizes
def test_rectangle_is_a_face_of_the_block(size):
    """Two charged faces make a block magnetised along y: −∇S of both is H."""
    points = scattered(size, 200, 0.01, np.random.default_rng(7))
    shift = np.array([0, size[1] / 2, 0])
    upper, lower = (rectangle_derivatives(points + sign * shift, size[0], size[2], 3) for sign in (-1, 1))
    tensors = newton_derivatives(points, size, 2, 4)
    for one, other, tensor in zip(upper, lower, tensors, strict=True):
        scale = np.linalg.norm(tensor[..., 1].reshape(len(points), -1), axis=1)
        error = np.linalg.norm((other - one - tensor[..., 1]).reshape(len(points), -1), axis=1)
        assert np.max(error / scale) < 1e-9


@sizes
def test_normal_B_and_tangential_H_are_continuous_and_the_surface_belongs_to_the_magnet(size):
    rng = np.random.default_rng(8)
    for axis, sign in itertools.product(range(3), (-1, 1)):
        normal = sign * np.eye(3)[axis]
        on = rng.uniform(-0.45, 0.45, (20, 3)) * size
        on[:, axis] = sign * size[axis] / 2
        step = 1e-10 * size.min() * normal
        inner, outer, face = (block_jet(on + shift, size, M, 0)[0] for shift in (-step, step, 0 * step))
        np.testing.assert_allclose((outer - inner) / MU_0, -(M - normal * (normal @ M)) + 0 * inner, atol=1e-2)
        np.testing.assert_allclose(face, inner, atol=1e-8)


@sizes
def test_extensions_of_faces_and_edges_are_ordinary(size):
    """The formulas are singular there term by term; the field is not."""
    half = size / 2
    on = half * np.array(
        [[1, 1, 1.7], [1, -1, -3], [1, 0.2, 2.5], [-1.4, 1, 1], [1, 3, 0], [5, 1, -1], [0, 0, 4], [1, 9, 9]]
    )
    step = 1e-9 * size.min() * np.random.default_rng(9).normal(size=on.shape)
    for value, beside in zip(block_jet(on, size, M, 2), block_jet(on + step, size, M, 2), strict=True):
        assert np.max(relative(value, beside)) < 1e-6
    middle = newton_derivatives(on, size, 1, 4)
    turned = newton_derivatives(on[:, [1, 2, 0]], size[[1, 2, 0]], 1, 4)
    for rank, (one, other) in enumerate(zip(middle, turned, strict=True), start=1):
        index = np.ix_(range(len(on)), *[[1, 2, 0]] * rank)
        assert np.max(relative(other, one[index])) < 1e-10


@sizes
def test_edges_and_corners_are_large_and_finite(size):
    half = size / 2
    on = half * np.array([[1, 1, 1], [1, -1, 0.3], [-1, 0.2, 1], [0, 1, -1]])
    close = on * (1 - 1e-3 * size.min() / size)
    for value, near in zip(block_jet(on, size, M, 2), block_jet(close, size, M, 2), strict=True):
        assert np.all(np.isfinite(value))
        flat, other = (np.linalg.norm(tensor.reshape(4, -1), axis=1) for tensor in (value, near))
        assert np.all(flat > 0.99 * other)  # B itself may fall a little where its finite part is against the rest


def test_shapes_broadcast():
    for shape in ((), (0,), (1,), (2, 3)):
        jet = block_jet(np.full((*shape, 3), 1e-3), UNIT * np.ones(3), M, order=2)
        assert [value.shape for value in jet] == [(*shape, *(3,) * n) for n in (1, 2, 3)]
        slopes = newton_derivatives(np.full((*shape, 3), 1e-3), UNIT * np.ones(3), 1, 3)
        assert [value.shape for value in slopes] == [(*shape, *(3,) * n) for n in (1, 2, 3)]
