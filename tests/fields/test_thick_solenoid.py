"""Windings of rectangular section against magnetised cylinders, magpylib, closed forms, differences and laws."""

from __future__ import annotations

from itertools import pairwise

import magpylib
import numpy as np
import pytest
from references.coils import AXIS

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields import thick_solenoid
from magfem.fields.loop import loop_vector_potential
from magfem.fields.terms import loops
from magfem.fields.thick_solenoid import thick_solenoid_jet, thick_solenoid_vector_potential
from magfem.fields.uniform_cylinder import cylinder_jet
from magfem.typing import Floats, Jet, Points

NI = 1000.0  # A
Section = tuple[float, float, float]  # inner radius, outer radius, length, m
SECTIONS = {
    "usual": (10e-3, 15e-3, 30e-3),
    "long": (10e-3, 11e-3, 300e-3),
    "disc": (1e-3, 15e-3, 0.1e-3),
    "layer": (10e-3, 10.001e-3, 30e-3),
    "sheet": (10e-3, 10e-3, 30e-3),
    "narrow ring": (100e-3, 100.5e-3, 0.5e-3),
}
sections = pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
thick = pytest.mark.parametrize("section", [SECTIONS[n] for n in ("usual", "long", "narrow ring")])
NODES, WEIGHTS = np.polynomial.legendre.leggauss(14)


def size(tensor: Floats) -> Floats:
    """Frobenius norm at every point."""
    norm: Floats = np.sqrt((tensor**2).reshape(tensor.shape[0], -1).sum(axis=1))
    return norm


def of_cylinders(points: Points, section: Section, order: int) -> Jet:
    """The winding as coaxial magnetised cylinders, M = J da, of all its radii; the points share one ρ.

    Where the cylinder's wall crosses the points its field jumps: the rule is split there, and the moving end of
    the integral of M adds −µ0 J ρ to B_z.
    """
    inner, outer, length = section
    if inner == outer:
        return cylinder_jet(points, outer, length, (0, 0, NI / length), order)
    x, y, z = points.T
    rho = float(np.hypot(x[0], y[0]))
    J = NI / (length * (outer - inner))
    cut = min(max(rho, inner), outer)
    finest = 0.01 * min(max(outer - inner, length), 2 * length)  # of the heights over the ends
    levels = max(2, int(np.log((outer - inner) / finest) / 1.2) + 2)
    steps = (outer - inner) * 0.3 ** np.arange(levels)
    cuts = np.unique(np.clip([inner, outer, cut, *(cut + steps), *(cut - steps)], inner, outer))
    total = [np.zeros((len(points), *(3,) * rank)) for rank in range(1, order + 2)]
    for a, b in pairwise(cuts):
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            part = cylinder_jet(points, (a + b + (b - a) * node) / 2, length, (0, 0, J * weight * (b - a) / 2), order)
            for one, other in zip(total, part, strict=True):
                one += other
    inside = (inner <= rho <= outer) & (np.abs(z) <= length / 2)
    unit = np.stack([x, y], axis=-1) / rho
    total[1][:, 2, :2] -= MU_0 * J * unit * inside[:, None]
    if order > 1:
        across = np.eye(2) - unit[:, :, None] * unit[:, None, :]
        total[2][:, 2, :2, :2] -= MU_0 * J / rho * across * inside[:, None, None]
    return tuple(total)


def on_cylinder(rho: float, z: Floats) -> Points:
    phi = np.arange(z.size) * 1.0
    return np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=-1)


def outside(section: Section, count: int, seed: int, clear: float, reach: float) -> Points:
    """Random points between `clear` and `reach` longer sides from the section."""
    inner, outer, length = section
    side = max(outer - inner, length)
    points = np.random.default_rng(seed).uniform(-1, 1, (40 * count, 3)) * (
        np.array([outer, outer, length / 2]) + reach * side
    )
    rho = np.hypot(points[:, 0], points[:, 1])
    gap = np.hypot(
        np.maximum(np.maximum(inner - rho, rho - outer), 0), np.maximum(np.abs(points[:, 2]) - length / 2, 0)
    )
    return points[(gap > clear * side) & (gap < reach * side)][:count]


@sections
def test_matches_magnetised_cylinders(section):
    inner, outer, length = section
    side = max(outer - inner, length)
    for rho in (0.01 * inner + 1e-5, (inner + outer) / 2, outer + 0.01 * side, outer + 0.5 * side):
        if inner == outer == rho:
            continue
        z = length * np.array([0.01, -0.2, 0.45, -0.48, 0.52, 0.8]) + side * np.array([0, 0, 0, 0, 0.01, 0.3])
        points = on_cylinder(rho, z)
        truth = of_cylinders(points, section, 2)
        for value, exact, tolerance in zip(
            thick_solenoid_jet(points, *section, NI, 2), truth, (1e-9, 5e-9, 1e-6), strict=True
        ):
            assert np.max(size(value - exact) / size(exact)) < tolerance


@sections
def test_both_routes_agree(section, monkeypatch):
    points = outside(section, 60, 1, 0.05, 1.5)
    jets = []
    for near in (0.0, 1e9):
        monkeypatch.setattr(thick_solenoid, "NEAR", near)
        jets.append(thick_solenoid_jet(points, *section, NI, 1))
    for cells, ends, tolerance in zip(*jets, (1e-9, 1e-7), strict=True):
        assert np.max(size(cells - ends) / size(ends)) < tolerance


def test_axis_matches_published_numbers_and_closed_form():
    inner, outer, length = section = SECTIONS["usual"]
    z = np.array([*AXIS, 0.1, 2.0])
    axis = z[:, None] * np.array([0.0, 0.0, 1.0])
    b = thick_solenoid_jet(axis, *section, NI, 0)[0]
    np.testing.assert_allclose(b[:3, 2], list(AXIS.values()), rtol=0, atol=6e-11)

    def end(zeta: Floats) -> Floats:
        return zeta * np.log((outer + np.hypot(outer, zeta)) / (inner + np.hypot(inner, zeta)))

    J = NI / (length * (outer - inner))
    exact = MU_0 * J / 2 * (end(z + length / 2) - end(z - length / 2))
    np.testing.assert_allclose(b[:4, 2], exact[:4], rtol=1e-11)
    np.testing.assert_allclose(b[:, :2], 0, atol=1e-18)


def test_matches_loops_of_magpylib():
    """A fine lattice of loops, seen from afar: a midpoint rule, whose error is of second order."""
    inner, outer, length = section = SECTIONS["usual"]
    points = np.random.default_rng(2).normal(size=(5, 3)) * 0.02 + np.array([0, 0, 0.06])
    exact = thick_solenoid_jet(points, *section, NI, 0)[0]
    errors = []
    for n in (4, 8):
        radii = inner + (outer - inner) * (np.arange(n) + 0.5) / n
        heights = length * ((np.arange(4 * n) + 0.5) / (4 * n) - 0.5)
        b = sum(
            magpylib.current.Circle(diameter=2 * a, current=NI / (4 * n * n), position=(0, 0, h)).getB(points)
            for a in radii
            for h in heights
        )
        errors.append(np.max(size(b - exact) / size(exact)))
    assert errors[1] < 1e-3
    assert 3.9 < errors[0] / errors[1] < 4.1


@thick
def test_curl_is_current_and_divergence_vanishes_in_the_winding(section):
    inner, outer, length = section
    rng = np.random.default_rng(3)
    n = 50
    rho, phi = rng.uniform(inner, outer, n), rng.uniform(0, 7, n)
    points = np.stack([rho * np.cos(phi), rho * np.sin(phi), length * rng.uniform(-0.5, 0.5, n)], axis=-1)
    _, g, h = thick_solenoid_jet(points, *section, NI, 2)
    curl = np.stack([g[:, 2, 1] - g[:, 1, 2], g[:, 0, 2] - g[:, 2, 0], g[:, 1, 0] - g[:, 0, 1]], axis=-1)
    J = NI / (length * (outer - inner)) * np.stack([-np.sin(phi), np.cos(phi), 0 * phi], axis=-1)
    np.testing.assert_allclose(curl, MU_0 * J, atol=1e-12 * MU_0 * np.abs(J).max())
    np.testing.assert_allclose(np.trace(g, axis1=1, axis2=2), 0, atol=1e-12 * np.abs(g).max())
    np.testing.assert_array_equal(h, np.swapaxes(h, 2, 3))


@pytest.mark.parametrize("section", [SECTIONS["usual"], SECTIONS["disc"]])
def test_derivatives_are_those_of_the_field_inside(section):
    """Eighth-order differences, away from the surface by many steps."""
    inner, outer, length = section
    rng = np.random.default_rng(4)
    rho = inner + (outer - inner) * rng.uniform(0.3, 0.7, 20)
    points = np.stack([rho * 0.6, rho * 0.8, length * rng.uniform(-0.2, 0.2, 20)], axis=-1)
    step = 0.01 * min(outer - inner, length)
    exact = thick_solenoid_jet(points, *section, NI, 2)
    for order, tolerance in ((0, 1e-9), (1, 1e-6)):
        for axis in range(3):
            shift = step * np.eye(3)[axis]
            total = np.zeros_like(exact[order])
            for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), start=1):
                ahead, behind = (thick_solenoid_jet(points + s * k * shift, *section, NI, 2)[order] for s in (1, -1))
                total += weight * (ahead - behind) / step
            error = size(total - exact[order + 1][..., axis])
            assert np.max(error) < tolerance * np.max(size(exact[order + 1]))


def test_circulation_is_the_current_enclosed():
    """Round a rectangle whose corner lies in the winding; its sides are cut where they enter it."""
    inner, outer, length = section = SECTIONS["usual"]
    r0, r1, z0, z1 = 0.004, 0.5 * (inner + outer), -0.03, 0.2 * length
    corners = [(r0, z0), (r1, z0), (r1, -length / 2), (r1, z1), (inner, z1), (r0, z1), (r0, z0)]
    nodes, weights = np.polynomial.legendre.leggauss(60)
    total = 0.0
    for a, b in pairwise(corners):
        start, side = np.array([a[0], 0, a[1]]), np.array([b[0] - a[0], 0, b[1] - a[1]])
        field = thick_solenoid_jet(start + (nodes[:, None] + 1) / 2 * side, *section, NI, 0)[0]
        total += weights @ field @ side / 2
    # Along +ρ below and −ρ above: clockwise about +φ.
    enclosed = NI * (r1 - inner) / (outer - inner) * (z1 + length / 2) / length
    assert -total == pytest.approx(MU_0 * enclosed, rel=1e-6)


@sections
def test_far_field_is_the_dipole(section):
    inner, outer, length = section
    moment = NI * np.pi * (inner**2 + inner * outer + outer**2) / 3 * np.array([0, 0, 1.0])
    rays = np.random.default_rng(5).normal(size=(50, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    for ratio, tolerance in ((1e3, 1e-5), (1e5, 1e-9)):
        r = ratio * max(outer, length)
        dipole = MU_0 / (4 * np.pi * r**3) * (3 * rays * (rays @ moment)[:, None] - moment)
        b = thick_solenoid_jet(r * rays, *section, NI, 0)[0]
        assert np.max(size(b - dipole) / size(dipole)) < tolerance


def test_surface_belongs_to_the_winding():
    inner, outer, length = section = SECTIONS["usual"]
    surface = np.array([[inner, 0, 1e-3], [0, outer, 2e-3], [12e-3, 0, length / 2], [0, 13e-3, -length / 2]])
    within = surface + 1e-12 * np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1], [0, 0, 1]])
    for on, near in zip(
        thick_solenoid_jet(surface, *section, NI, 1), thick_solenoid_jet(within, *section, NI, 1), strict=True
    ):
        np.testing.assert_allclose(on, near, atol=1e-6 * np.abs(near).max())


def test_sheet_has_the_mean_of_both_sides():
    section = SECTIONS["sheet"]
    radii = section[1] + np.array([0, 1e-9, -1e-9])
    on, out, within = thick_solenoid_jet(radii[:, None] * np.array([1.0, 0, 0]) + [0, 0, 1e-3], *section, NI, 0)[0]
    np.testing.assert_allclose(on, (out + within) / 2, atol=1e-7 * abs(within[2]))
    assert within[2] - out[2] == pytest.approx(MU_0 * NI / section[2], rel=1e-6)


def test_corners_are_finite():
    for part in thick_solenoid_jet([[10e-3, 0, 15e-3], [0, 15e-3, -15e-3]], *SECTIONS["usual"], NI, 2):
        assert np.all(np.isfinite(part))


@sections
def test_flux_is_the_circulation_of_the_potential(section):
    """2πρ A_φ = ∫ B_z 2πρ dρ, discs in the bore, through the winding and beyond."""
    inner, outer, length = section
    side = max(outer - inner, length)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    for z in (0.1 * length, 0.5 * length + 0.3 * side):
        flux = last = 0.0
        grading = [*(inner * np.array([0.5, 0.9, 0.99, 0.999])), inner]
        if outer > inner:
            grading += [*(inner + (outer - inner) * np.array([0.05, 0.5, 0.95])), outer]
        grading += [*(outer * np.array([1.001, 1.01, 1.1])), outer + side]
        for radius in grading:
            rho = last + (radius - last) * (nodes + 1) / 2
            b = thick_solenoid_jet(on_cylinder(1.0, rho)[:, [2, 2, 2]] * [1, 0, 0] + [0, 0, z], *section, NI, 0)[0]
            flux += np.pi * (radius - last) * (weights @ (b[:, 2] * rho))
            last = radius
            a = thick_solenoid_vector_potential([radius, 0, z], *section, NI)
            assert 2 * np.pi * radius * a[1] == pytest.approx(flux, rel=1e-8, abs=0)
            assert a[0] == a[2] == 0


def test_potential_has_the_curl_of_the_field_in_the_winding():
    section = SECTIONS["usual"]
    point, step = np.array([12.1e-3, 0, 4.3e-3]), 1e-4
    gradient = np.empty((3, 3))
    for axis in range(3):
        total = np.zeros(3)
        for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), start=1):
            shift = k * step * np.eye(3)[axis]
            ahead, behind = (thick_solenoid_vector_potential(point + s * shift, *section, NI) for s in (1, -1))
            total += weight * (ahead - behind) / step
        gradient[:, axis] = total
    curl = [gradient[2, 1] - gradient[1, 2], gradient[0, 2] - gradient[2, 0], gradient[1, 0] - gradient[0, 1]]
    np.testing.assert_allclose(curl, thick_solenoid_jet(point, *section, NI, 0)[0], atol=1e-9 * np.abs(curl).max())


def test_loop_potential_has_the_flux_of_the_loop():
    nodes, weights = np.polynomial.legendre.leggauss(60)
    loop = loops(np.zeros((1, 3)), np.array([2e-3]), np.array([1.0]))
    for radius in (1e-5, 1e-3, 5e-3):
        rho = radius * (nodes + 1) / 2
        flux = np.pi * radius * weights @ (loop.jet(on_cylinder(0, rho)[:, [2, 1, 1]] + [0, 0, 1e-3], 0)[0][:, 2] * rho)
        a = loop_vector_potential([0, radius, 1e-3], 2e-3)
        assert -2 * np.pi * radius * a[0] == pytest.approx(flux, rel=1e-11, abs=0)


def test_shapes_broadcast_and_bad_windings_are_refused():
    for shape in ((), (0,), (2, 3)):
        points = np.full((*shape, 3), 1e-3)
        for rank, part in enumerate(thick_solenoid_jet(points, *SECTIONS["usual"], NI, 2), start=1):
            assert part.shape == (*shape, *(3,) * rank)
        assert thick_solenoid_vector_potential(points, *SECTIONS["usual"], NI).shape == (*shape, 3)
    for bad in ((2.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 2.0, -1.0)):
        with pytest.raises(InputError, match="expected 0 ≤ inner_radius"):
            thick_solenoid_jet([0, 0, 0], *bad, NI)
