"""The stated accuracy of solutions, held against independent routes all over the device's region."""

from __future__ import annotations

import numpy as np
import pytest
from references import fourier_rotor, vector_potential
from references.magnet_energy import ring_field_energy

import magfem
from magfem.fem.solve import solve
from magfem.fields.norms import relative_errors
from magfem.geometry import PermanentMagnet, RingMagnet


def worst(field, points, truth):
    """Largest relative errors of B and gradient."""
    return tuple(float(relative_errors(f, t).max()) for f, t in zip(field.jet(points, 1), truth, strict=True))


def test_vector_and_scalar_potential_bracket_the_ring(ring):
    """Two dual formulations: the same dipole moment, and energies on either side of each other."""
    scalar = solve(ring, resolution=1.0)
    vector = vector_potential.solve(ring, 1.0)
    assert scalar.quantities["boundary_moment"][2] == pytest.approx(vector.moment, rel=1e-6)
    assert scalar.quantities["field_energy"] < vector.field_energy
    assert scalar.quantities["field_energy"] == pytest.approx(vector.field_energy, rel=1e-5)


def test_axisymmetric_truth_is_converged(ring, ring_layers, ring_truth):
    coarser = solve(ring, resolution=2.0)
    B, gradient = worst(coarser, ring_layers, ring_truth)
    assert B <= 1e-7 and gradient <= 5e-7


def test_fourier_truth_is_converged(rotor, rotor_layers, rotor_truth):
    points = rotor_layers[::8, ::8]
    coarser = fourier_rotor.field(rotor, 1.0, points)
    for found, truth in zip(coarser, rotor_truth, strict=True):
        assert relative_errors(found, truth[::8, ::8]).max() <= 1e-6


def test_ring_2d(ring_2d, ring_layers, ring_truth):
    B, gradient = worst(ring_2d, ring_layers, ring_truth)
    assert B <= 1e-6 and gradient <= 5e-6


def test_ring_3d(ring_3d, ring_layers, ring_truth):
    B, gradient = worst(ring_3d, ring_layers, ring_truth)
    assert B <= 2e-5 and gradient <= 5e-5


def test_rotor_3d_matches_its_azimuthal_mode(rotor_3d, rotor_layers, rotor_truth):
    B, gradient = worst(rotor_3d, rotor_layers, rotor_truth)
    assert B <= 1e-5 and gradient <= 2e-5


@pytest.mark.parametrize("name", ["rigid_ring_2d", "rigid_ring_3d", "rigid_rotor_3d"])
def test_recoil_one_matches_closed_form(name, request):
    """Mesh, shape and integration: at recoil 1 the sources do not depend on the solve (the next two tests do)."""
    solution = request.getfixturevalue(name)
    layers = solution.geometry.region.layers(np.random.default_rng(5), 64, 32)
    B, gradient = worst(solution, layers, magfem.exact(solution.geometry).jet(layers, 1))
    assert B <= 1e-4 and gradient <= 5e-4


@pytest.mark.parametrize("name", ["rigid_ring_2d", "rigid_ring_3d", "rigid_rotor_3d"])
def test_moment_seen_by_the_boundary_operator(name, request):
    """The dipole coefficient of the solved potential on the artificial boundary, against remanence·volume/µ₀."""
    solution = request.getfixturevalue(name)
    truth = solution.geometry.moment
    error = np.linalg.norm(solution.quantities["boundary_moment"] - truth) / np.linalg.norm(truth)
    assert error <= 1e-5


@pytest.mark.parametrize("name", ["rigid_ring_2d", "rigid_ring_3d"])
def test_field_energy_of_rigid_ring(name, request):
    solution = request.getfixturevalue(name)
    truth = ring_field_energy(2e-3, 0.75e-3, 1e-3, 1.35)
    assert solution.quantities["field_energy"] == pytest.approx(truth, rel=1e-3)
    assert solution.quantities["field_energy"] < truth  # a conforming potential cannot reach it


def test_moment_where_only_a_solve_can_know_it(ring_3d, rotor_3d, ring, rotor):
    """Recoil 1.05: the magnet demagnetises itself; both routes to the moment agree with the references."""
    expected = vector_potential.solve(ring, 2.0).moment
    for key in ("moment", "boundary_moment"):
        assert ring_3d.quantities[key][2] == pytest.approx(expected, rel=5e-5)
        assert rotor_3d.quantities[key][0] == pytest.approx(fourier_rotor.moment(rotor, 2.0)[0], rel=5e-5)


@pytest.mark.parametrize("name", ["rigid_ring_2d", "rigid_ring_3d", "rigid_rotor_3d"])
def test_inside_the_magnet_matches_closed_form(name, request):
    solution = request.getfixturevalue(name)
    points = inside_points(solution.geometry, np.random.default_rng(3), 1500)
    truth = magfem.exact(solution.geometry).B(points)
    assert relative_errors(solution.B(points), truth, layered=False).max() <= 1e-2


def test_inside_the_magnet_2d_equals_3d(ring, ring_2d, ring_3d):
    points = inside_points(ring, np.random.default_rng(4), 1500)
    assert relative_errors(ring_3d.B(points), ring_2d.B(points), layered=False).max() <= 1e-2


def test_gauss_law_on_closed_surfaces(ring_3d, rotor_3d, ring_2d):
    """∮B·dS over spheres around, and cutting, the magnet, against ∮|B| dS."""
    for solution in (ring_3d, rotor_3d, ring_2d):
        for centre, radius in (([0, 0, 0], 4e-3), ([0.5e-3, 0.2e-3, 0.3e-3], 3e-3), ([5e-3, 0, 0], 2e-3)):
            points, normals, weights = sphere_rule(np.array(centre, dtype=float), radius)
            B = solution.B(points)
            flux = np.sum((B * normals).sum(axis=1) * weights)
            assert abs(flux) <= 1e-6 * np.sum(np.linalg.norm(B, axis=1) * weights)


def test_gauss_law_holds_through_the_magnet(rigid_ring_3d):
    """A small sphere that cuts the ring's face: B·n has a jump in its derivatives there, the flux is still zero."""
    points, normals, weights = sphere_rule(np.array([1.4e-3, 0.0, 0.5e-3]), 0.3e-3, degree=60)
    B = rigid_ring_3d.B(points)
    flux = np.sum((B * normals).sum(axis=1) * weights)
    assert abs(flux) <= 2e-3 * np.sum(np.linalg.norm(B, axis=1) * weights)


@pytest.mark.parametrize("name", ["ring_2d", "ring_3d", "rotor_3d"])
def test_gradient_is_symmetric_trace_free_and_the_slope_of_B(name, request):
    solution = request.getfixturevalue(name)
    points = solution.geometry.region.layers(np.random.default_rng(8), 8, 6).reshape(-1, 3)
    _, gradient, hessian = solution.jet(points, 2)
    size = np.linalg.norm(gradient, axis=(1, 2))
    assert np.all(np.abs(np.trace(gradient, axis1=1, axis2=2)) <= 1e-9 * size)
    assert np.all(np.linalg.norm(gradient - np.swapaxes(gradient, 1, 2), axis=(1, 2)) <= 2e-5 * size)
    h = 2e-5
    for axis in range(3):
        step = h * np.eye(3)[axis]
        slope = (8 * (solution.B(points + step) - solution.B(points - step))) - (
            solution.B(points + 2 * step) - solution.B(points - 2 * step)
        )
        assert np.all(np.linalg.norm(slope / (12 * h) - gradient[..., axis], axis=1) <= 1e-4 * size)
        bend = (solution.gradient(points + step) - solution.gradient(points - step)) / (2 * h)
        scale = np.sqrt(np.sum(hessian**2, axis=(1, 2, 3)))
        assert np.all(np.linalg.norm(bend - hessian[..., axis], axis=(1, 2)) <= 5e-3 * scale)


@pytest.mark.parametrize(
    ("name", "dimension", "resolutions"),
    [("ring", 2, (0.25, 0.5, 1.0, 1.4)), ("ring", 3, (0.5, 0.7, 1.0)), ("rotor", 3, (0.5, 0.7, 1.0, 1.4))],
)
def test_stated_error_is_honest_on_a_ladder(name, dimension, resolutions, request):
    """The true error stays below the stated one, which is at most ten times too pessimistic."""
    geometry = request.getfixturevalue(name)
    layers, truth = request.getfixturevalue(f"{name}_layers"), request.getfixturevalue(f"{name}_truth")
    for resolution in resolutions:
        solution = solve(geometry, dimension=dimension, resolution=resolution)
        for true, key in zip(worst(solution, layers, truth), ("B", "gradient"), strict=True):
            assert true <= solution.error[key] <= 10 * true, (resolution, key)


def test_tolerance_is_reached():
    ring = RingMagnet(outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, material=PermanentMagnet(1.35, 1.05))
    coarse = solve(ring, resolution=0.25)
    tight = solve(ring, resolution=0.25, tolerance=coarse.error["B"] / 4)
    assert tight.error["B"] <= coarse.error["B"] / 4
    assert tight.settings["resolution"] > 0.25


def inside_points(geometry, rng, count):
    """Random points of a tube about z."""
    outer = getattr(geometry, "outer_diameter", None) or geometry.diameter
    inner = getattr(geometry, "inner_diameter", 0.0)
    rho = np.sqrt(rng.uniform(inner**2, outer**2, count)) / 2
    azimuth, z = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.5, 0.5, count) * geometry.length
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=1)


def sphere_rule(centre, radius, degree=40):
    """Gauss–Legendre × trapezoid on a sphere: points, outward normals, weights."""
    cosine, weight = np.polynomial.legendre.leggauss(degree)
    azimuth = 2 * np.pi * np.arange(2 * degree) / (2 * degree)
    sine = np.sqrt(1 - cosine**2)[:, None]
    normals = np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth), np.broadcast_to(cosine[:, None], (degree, 2 * degree))], -1
    ).reshape(-1, 3)
    weights = np.repeat(weight, 2 * degree) * np.pi / degree * radius**2
    return centre + radius * normals, normals, weights
