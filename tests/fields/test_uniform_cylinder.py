"""The exact cylinder against magpylib, elementary formulas, differences, and the laws of magnetostatics."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest

from magfem.constants import MU_0
from magfem.fields import uniform_cylinder
from magfem.fields.uniform_cylinder import cylinder_jet, newton_derivatives, ring_jet
from magfem.typing import Floats, Points

RADIUS = 2e-3  # m
M = 1e6  # A/m
DIRECTIONS = {"axial": (0, 0, 1), "diametric": (1, 0, 0), "skew": (0.48, -0.6, 0.64)}
ASPECTS = [0.05, 0.5, 2, 10, 50]  # length / radius

directions = pytest.mark.parametrize("direction", DIRECTIONS.values(), ids=DIRECTIONS)
aspects = pytest.mark.parametrize("aspect", ASPECTS)


def from_cylindrical(rho: Floats, phi: Floats, z: Floats) -> Points:
    return np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=-1)


def scattered(aspect: float, count: int, rng: np.random.Generator) -> Points:
    """Half inside, half outside within two circumscribed radii; 5 % of the radius clear of axis and rims."""
    half = aspect / 2
    reach = 2 * np.hypot(1, half)
    points = rng.uniform(-reach, reach, (200 * count, 3))
    points[::2] = rng.uniform(-1, 1, points[::2].shape) * [1, 1, half]
    rho, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    points = points[(rho > 0.05) & (np.hypot(rho - 1, np.abs(z) - half) > 0.05)]
    inside = (np.hypot(points[:, 0], points[:, 1]) < 1) & (np.abs(points[:, 2]) < half)
    return RADIUS * np.concatenate([points[inside][:count], points[~inside][:count]])


def relative(value: Floats, truth: Floats, rank: int) -> Floats:
    axes = tuple(range(-rank, 0))
    return np.sqrt(((value - truth) ** 2).sum(axes) / (truth**2).sum(axes))


@aspects
@directions
def test_B_matches_magpylib(aspect, direction):
    points = scattered(aspect, 500, np.random.default_rng(1))
    m = M * np.array(direction)
    peer = magpylib.magnet.Cylinder(dimension=(2 * RADIUS, aspect * RADIUS), magnetization=m)
    (b,) = cylinder_jet(points, RADIUS, aspect * RADIUS, m, order=0)
    # magpylib loses digits towards the axis and far from flat or long magnets; its median does not.
    error = relative(b, peer.getB(points), 1)
    assert np.max(error) < 1e-8
    assert np.median(error) < 1e-12


@aspects
def test_potential_matches_its_classical_integrals(aspect):
    """The unsplit solenoid and charged-face integrals over the polar angle, by a fine trapezoidal rule."""
    points = scattered(aspect, 60, np.random.default_rng(8)) / RADIUS
    rho, z, half = np.hypot(points[:, 0], points[:, 1])[:, None], points[:, 2:], aspect / 2
    clear = np.abs(rho[:, 0] - 1) > 0.02  # the integrals nearly diverge at the wall
    points, rho, z = points[clear], rho[clear], z[clear]
    psi = np.arange(4000) * 2 * np.pi / 4000
    c2 = 1 + rho**2 - 2 * rho * np.cos(psi)
    sines = [zeta / np.sqrt(c2 + zeta**2) / c2 for zeta in (z + half, z - half)]
    solenoid = sines[0] - sines[1]
    inside = (rho[:, 0] < 1) & (np.abs(z[:, 0]) < half)
    u_s = -(np.sin(psi) ** 2 * solenoid).mean(axis=-1) / 4
    u_zz = ((1 - rho * np.cos(psi)) * solenoid).mean(axis=-1) / 2 - inside
    (tensor,) = newton_derivatives(RADIUS * points, RADIUS, aspect * RADIUS, 2)
    size = np.linalg.norm(tensor, axis=(1, 2))
    assert np.all(np.abs(tensor[:, 2, 2] - u_zz) < 2e-13 * size)
    # The field across a radius is 2 ∂U/∂s.
    x, y = points[:, 0] / rho[:, 0], points[:, 1] / rho[:, 0]
    across = y**2 * tensor[:, 0, 0] - 2 * x * y * tensor[:, 0, 1] + x**2 * tensor[:, 1, 1]
    assert np.all(np.abs(across - 2 * u_s) < 2e-13 * size)


def test_ring_matches_magpylib():
    m = M * np.array(DIRECTIONS["skew"])
    points = 1.5 * scattered(0.7, 50, np.random.default_rng(2))
    peer = magpylib.magnet.CylinderSegment(dimension=(0.75e-3, RADIUS, 1e-3, 0, 360), magnetization=m)
    (b,) = ring_jet(points, 0.75e-3, RADIUS, 1e-3, m, order=0)
    assert np.max(relative(b, peer.getB(points), 1)) < 1e-9


@aspects
def test_axis_matches_elementary_formula(aspect):
    half = aspect * RADIUS / 2
    z = np.concatenate([np.linspace(-0.99, 0.99, 21), np.geomspace(1.01, 1000, 40)]) * half
    b, gradient = cylinder_jet(from_cylindrical(0 * z, 0 * z, z), RADIUS, 2 * half, (0, 0, M), order=1)
    upper, lower = np.longdouble(z) + half, np.longdouble(z) - half

    def cosine(x):
        return x / np.hypot(x, np.longdouble(RADIUS))

    truth = MU_0 * M / 2 * (cosine(upper) - cosine(lower))
    slope = MU_0 * M / 2 * RADIUS**2 * (np.hypot(upper, RADIUS) ** -3 - np.hypot(lower, RADIUS) ** -3)
    # The formulas, differences themselves, hold their last digits only in extended precision.
    tolerance = 1e-13 + 10 * np.finfo(np.longdouble).eps * M * MU_0 / np.abs(truth)
    assert np.all(np.abs(b[:, 2] / truth - 1) < tolerance)
    np.testing.assert_allclose(gradient[:, 2, 2], slope.astype(float), rtol=1e-9, atol=1e-16 * M * MU_0 / RADIUS)
    assert np.all(b[:, :2] == 0)


@directions
@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_match_central_differences(direction, order):
    """Each order against differences of the one before: the error falls as step², to almost nothing."""
    points = scattered(1.2, 40, np.random.default_rng(3))
    m = M * np.array(direction)
    exact = cylinder_jet(points, RADIUS, 1.2 * RADIUS, m, order)[order]

    def difference(step: float) -> Floats:
        shifts = step * np.eye(3)[:, None]
        ahead, behind = (
            cylinder_jet(points + sign * shifts, RADIUS, 1.2 * RADIUS, m, order - 1)[order - 1] for sign in (1, -1)
        )
        return np.moveaxis((ahead - behind) / (2 * step), 0, -1)

    # Points closer to a face or the wall than the step would difference across the jump.
    rho, z = np.hypot(points[:, 0], points[:, 1]), np.abs(points[:, 2])
    clear = np.minimum(np.abs(rho - RADIUS), np.abs(z - 0.6 * RADIUS)) > 0.05 * RADIUS
    h = 0.008 * RADIUS
    coarse, middle, fine = (np.linalg.norm((difference(step) - exact)[clear]) for step in (h, h / 2, h / 4))
    assert 3.8 < coarse / middle < 4.2 and 3.8 < middle / fine < 4.2
    # Two Richardson steps leave the sixth order of the step.
    first, second = (4 * difference(step / 2) - difference(step) for step in (h, h / 2))
    extrapolated = (16 * second / 3 - first / 3) / 15
    assert np.max(relative(extrapolated[clear], exact[clear], order + 1)) < 2e-7


@aspects
def test_field_is_solenoidal_and_irrotational(aspect):
    points = scattered(aspect, 200, np.random.default_rng(4))
    second, third, fourth = newton_derivatives(points, RADIUS, aspect * RADIUS, 4)
    inside = (np.hypot(points[:, 0], points[:, 1]) < RADIUS) & (np.abs(points[:, 2]) < aspect * RADIUS / 2)
    np.testing.assert_allclose(np.trace(second, axis1=-2, axis2=-1), -1.0 * inside, atol=1e-14)
    for tensor in (third, fourth):
        size = np.abs(tensor).max()
        np.testing.assert_allclose(np.trace(tensor, axis1=-2, axis2=-1), 0, atol=1e-13 * size)
        np.testing.assert_array_equal(tensor, np.swapaxes(tensor, 1, -1))


@directions
def test_no_flux_leaves_a_surface_that_cuts_the_magnet(direction):
    """∮ B·dS over a can off the axis, through the upper face; B is smooth on each side of the face."""
    m = M * np.array(direction)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    phi = np.arange(48) * 2 * np.pi / 48
    r, centre = 0.5 * RADIUS, np.array([0.3, 0.1, 0]) * RADIUS
    low, face, high = -0.2 * RADIUS, 0.5 * RADIUS, 1.1 * RADIUS

    def field(rho: Floats, z: Floats) -> Floats:
        points = centre + from_cylindrical(*np.broadcast_arrays(rho, phi, z))
        return cylinder_jet(points, RADIUS, 2 * face, m, order=0)[0]

    fluxes = []
    for start, end in ((low, face), (face, high)):
        z = ((start + end) / 2 + (end - start) / 2 * nodes)[:, None]
        b = field(np.array(r), z)
        radial = (b[..., 0] * np.cos(phi) + b[..., 1] * np.sin(phi)).mean(axis=-1)
        fluxes.append(2 * np.pi * r * (end - start) / 2 * (weights @ radial))
    rho = (r * (1 + nodes) / 2)[:, None]
    for z, sign in ((low, -1), (high, 1)):
        normal = field(rho, np.array(z))[..., 2].mean(axis=-1)
        fluxes.append(sign * np.pi * r * (weights @ (normal * rho[:, 0])))
    assert np.abs(fluxes).max() > 1e-3 * MU_0 * M * RADIUS**2
    assert abs(sum(fluxes)) < 1e-12 * np.abs(fluxes).max()


@aspects
def test_far_field_is_the_dipole(aspect):
    """The next term is the octupole: the deviation falls as distance⁻²."""
    length = aspect * RADIUS
    m = M * np.array(DIRECTIONS["skew"])
    moment = m * np.pi * RADIUS**2 * length
    rays = np.random.default_rng(5).normal(size=(200, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    scale = np.hypot(RADIUS, length / 2)

    def deviation(distance: float) -> float:
        dipole = MU_0 / (4 * np.pi * distance**3) * (3 * rays * (rays @ moment)[:, None] - moment)
        (b,) = cylinder_jet(distance * rays, RADIUS, length, m, order=0)
        return float(np.max(relative(b, dipole, 1)))

    near, far = deviation(100 * scale), deviation(1000 * scale)
    assert near < 3e-4
    assert 98 < near / far < 102
    assert deviation(1e8 * scale) < 1e-14


@directions
def test_normal_B_and_tangential_H_are_continuous(direction):
    m, length, step = M * np.array(direction), 1.4 * RADIUS, 1e-10
    rng = np.random.default_rng(6)
    count = 50
    phi = rng.uniform(0, 2 * np.pi, count)
    wall = from_cylindrical(RADIUS * np.ones(count), phi, rng.uniform(-0.6, 0.6, count) * RADIUS)
    face = from_cylindrical(rng.uniform(0, 0.9, count) * RADIUS, phi, np.full(count, length / 2))
    outward = from_cylindrical(np.ones(count), phi, np.zeros(count))
    for points, normal in ((wall, outward), (face, np.tile([0.0, 0, 1], (count, 1)))):
        inner, outer = (
            cylinder_jet(points + side * step * RADIUS * normal, RADIUS, length, m, order=0)[0] for side in (-1, 1)
        )
        jump = (outer - inner) / MU_0
        # B_n does not jump, H_t neither: B jumps by the tangential part of the magnetisation that ends.
        tangential = m - normal * (normal @ m)[:, None]
        np.testing.assert_allclose(jump, -tangential, atol=1e-8 * M)


def test_surface_belongs_to_the_magnet():
    m, length = M * np.array(DIRECTIONS["skew"]), RADIUS
    surface = np.array([[RADIUS, 0, 0], [0, -RADIUS, 0.2 * length], [0.3e-3, 0, length / 2], [0, 0, -length / 2]])
    for on, within in zip(
        cylinder_jet(surface, RADIUS, length, m, order=2),
        cylinder_jet(surface * (1 - 1e-12), RADIUS, length, m, order=2),
        strict=True,
    ):
        np.testing.assert_allclose(on, within, atol=1e-9 * np.abs(on).max())


def test_plane_of_a_face_beside_the_magnet_is_ordinary():
    """Between the planes of the faces the formula has another elementary part; nothing may show outside."""
    at = np.array([[1.01, 0, 0.5], [1.3, 0.2, 0.5], [0, 1.9, -0.5]]) * RADIUS
    m = M * np.array(DIRECTIONS["skew"])
    exact = cylinder_jet(at, RADIUS, RADIUS, m, order=2)
    for sign in (-1, 1):
        beside = cylinder_jet(at + sign * np.array([0, 0, 1e-15]), RADIUS, RADIUS, m, order=2)
        for value, truth in zip(beside, exact, strict=True):
            np.testing.assert_allclose(value, truth, atol=1e-9 * np.abs(truth).max())


@aspects
@pytest.mark.parametrize(("switch", "values"), [("NEAR_AXIS", (0.003, 0.03)), ("FAR", (1.8, 2.5))], ids=["axis", "far"])
def test_both_routes_agree_where_they_meet(aspect, switch, values, monkeypatch):
    rng = np.random.default_rng(7)
    half, count = aspect / 2, 200
    ball = np.hypot(1, half)
    if switch == "FAR":
        points = rng.normal(size=(count, 3))
        points *= 2 * ball / np.linalg.norm(points, axis=-1, keepdims=True)
    else:
        z = rng.uniform(-1.9, 1.9, count) * ball
        rho = 0.1 * np.hypot(1, np.abs(z) - half)
        points = from_cylindrical(rho, rng.uniform(0, 2 * np.pi, count), z)
    m = M * np.array(DIRECTIONS["skew"])
    jets = []
    for value in values:
        monkeypatch.setattr(uniform_cylinder, switch, value)
        jets.append(cylinder_jet(RADIUS * points, RADIUS, aspect * RADIUS, m, order=2))
    for rank, (one, other, tolerance) in enumerate(zip(*jets, (1e-12, 1e-11, 1e-9), strict=True), start=1):
        # Inside a long magnet the derivatives all but vanish: there 1 % of the largest is the measure.
        size = np.sqrt((one**2).sum(axis=tuple(range(1, rank + 1))))
        difference = np.sqrt(((one - other) ** 2).sum(axis=tuple(range(1, rank + 1))))
        assert np.max(difference / np.maximum(size, 0.01 * size.max())) < tolerance


def test_rim_is_large_and_finite():
    rim = RADIUS * np.array([[1, 0, 0.5], [0, 1, -0.5], [0.6, 0.8, 0.5]])
    close = rim * (1 - 1e-3)
    m = M * np.array(DIRECTIONS["skew"])
    for on, near in zip(
        cylinder_jet(rim, RADIUS, RADIUS, m, 2), cylinder_jet(close, RADIUS, RADIUS, m, 2), strict=True
    ):
        assert np.all(np.isfinite(on))
        assert np.all(np.linalg.norm(on.reshape(3, -1), axis=1) > np.linalg.norm(near.reshape(3, -1), axis=1))


def test_shapes_broadcast():
    m = (0, 0, M)
    for shape in ((), (0,), (1,), (2, 3)):
        b, gradient, hessian = cylinder_jet(np.full((*shape, 3), 1e-3), RADIUS, RADIUS, m, order=2)
        assert b.shape == (*shape, 3)
        assert gradient.shape == (*shape, 3, 3)
        assert hessian.shape == (*shape, 3, 3, 3)


def test_vacuum_permeability_is_that_of_the_devices():
    """Across the wall of an axially magnetised cylinder B jumps by µ₀ M."""
    inside, outside = cylinder_jet([[1 - 1e-12, 0, 0], [1 + 1e-12, 0, 0]], 1.0, 2.0, [0, 0, 1 / MU_0], 0)[0]
    assert inside[2] - outside[2] == pytest.approx(1, abs=1e-10)
