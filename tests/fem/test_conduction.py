"""Conduction in foils and thick tracks against closed forms, bounds, and windings of the same current."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from references import coil_corners

from magfem.constants import MU_0
from magfem.fem.conduction import evenly_spread, solve_sheet, solve_solid
from magfem.fem.sheet_currents import SheetCurrents
from magfem.fem.solve_coil import _solve_track
from magfem.fields.coaxial_inductance import CoaxialWinding, self_inductance
from magfem.fields.thick_solenoid import thick_solenoid_jet
from magfem.geometry.circuit import FoilTrack, Stations
from magfem.geometry.foil_ribbon import Ribbon, Straight
from magfem.typing import Floats, Jet, Points

RHO = 1.7e-8  # Ω·m


def ring(inner: float, outer: float, thickness: float, around: int = 48) -> FoilTrack:
    """A flat ring about z, its current right-handed; `around` elements at resolution 1."""

    def stations(resolution: float) -> Stations:
        elements = round(around * resolution)
        angle = np.linspace(0, 2 * np.pi, 2 * elements + 1)
        way = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        up = np.tile([0.0, 0.0, 1.0], (angle.size, 1))
        return Stations(inner * way, outer * way, up, np.zeros(elements, dtype=bool))

    return FoilTrack(
        stations, outer - inner, thickness, np.pi * (inner + outer), np.pi * (outer**2 - inner**2), lead_length=0.0
    )


def square(inside: float, width: float, thickness: float, turn: float = 1.0) -> FoilTrack:
    """A square ring with mitred corners, `inside` its inner sides, right-handed about z."""
    half = 0.5 * (inside + width)
    corners = half * np.array([[1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]])
    pieces = []
    for n, start in enumerate(corners):
        end = corners[(n + 1) % 4]
        along = (end - start) / np.linalg.norm(end - start)
        pieces.append(Straight(start, end, np.array([-along[1], along[0], 0.0]), (width, width)))
    length = 4 * (inside + width)
    return FoilTrack(Ribbon(tuple(pieces)), width, thickness, length, length * width, lead_length=0.0)


def ring_resistance(inner: float, outer: float, thickness: float) -> float:
    """Of a ring of rectangular section, J ∝ 1/ρ."""
    return float(RHO * 2 * np.pi / (thickness * np.log(outer / inner)))


def ring_jet(inner: float, outer: float, thickness: float, points: Points, order: int) -> Jet:
    """Field of 1 A in it: a sum of solenoids without build, K = t J(ρ) dρ."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    radii = inner + 0.5 * (outer - inner) * (1 + nodes)
    currents = 0.5 * (outer - inner) * weights / (radii * np.log(outer / inner))
    jets = [
        thick_solenoid_jet(points, r, r, thickness, current, order) for r, current in zip(radii, currents, strict=True)
    ]
    return tuple(sum(parts) for parts in zip(*jets, strict=True))


def off_the_ring(inner: float, outer: float, thickness: float, distance: float) -> Points:
    """Points all at one distance from the ring's section."""
    angle = 2 * np.pi * np.arange(48) / 48
    out = distance * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    corner = 0.5 * np.sign(np.round(out / distance, 9)) * [outer - inner, thickness]
    rho, z = (np.array([0.5 * (inner + outer), 0.0]) + corner + out).T
    points = np.stack([rho * np.cos(3 * angle), rho * np.sin(3 * angle), z], axis=-1)
    return points[rho > max(0.0, distance - inner)]  # not across the axis


def worst(found: Floats, truth: Floats) -> float:
    """Largest error over the largest value: of points at one distance."""
    axes = tuple(range(1, truth.ndim))
    return float(np.sqrt(((found - truth) ** 2).sum(axes)).max() / np.sqrt((truth**2).sum(axes)).max())


def test_ring_lies_between_the_bounds_which_close_in():
    track = ring(1e-3, 1.5e-3, 10e-6, around=128)
    exact = ring_resistance(1e-3, 1.5e-3, 10e-6)
    distances = []
    for elements in (2, 8):
        conduction = solve_sheet(track, RHO, 1.0, elements)
        below, above = (bound / exact - 1 for bound in conduction.bounds)
        assert below < 1e-7  # what parabolas and Gauss's rule leave of the ring
        assert above > -1e-7
        distances.append(above - below)
        assert conduction.resistance == pytest.approx(exact, rel=distances[-1])
    assert distances[1] < 1e-5
    assert np.log2(distances[0] / distances[1]) / 2 > 3


def test_current_of_a_ring_is_one_over_the_radius():
    conduction = solve_sheet(ring(1e-3, 1.5e-3, 10e-6), RHO, 1.0, 6)
    radius = np.hypot(*np.moveaxis(conduction.stations.left[0] * 0, 0, 0)[:2]) + 1.25e-3 - 0.25e-3 * conduction.across
    exact = np.log(1.5e-3 / radius) / np.log(1.5)
    np.testing.assert_allclose(conduction.stream, np.broadcast_to(exact, conduction.stream.shape), atol=2e-6)
    # In the middle of the innermost element: a little less than at the edge.
    edge = 0.5e-3 / (1e-3 * np.log(1.5))
    assert 0.97 * edge < conduction.crowding < edge


@cache
def square_bounds(elements: int, resolution: float = 1.0) -> tuple[float, float]:
    """Squares that a corner counts for, from below and above."""
    track = square(5e-3, 1e-3, 10e-6)
    bounds = solve_sheet(track, RHO, resolution, elements).bounds
    low, high = ((bound / (RHO / 10e-6) - 20) / 4 for bound in bounds)
    return low, high


def test_corner_is_the_published_one():
    assert abs(coil_corners.SQUARES - coil_corners.PUBLISHED) < 5e-4
    low, high = square_bounds(8, 2.0)
    assert low < coil_corners.SQUARES < high
    assert 0.5 * (low + high) == pytest.approx(coil_corners.SQUARES, abs=2e-4)


def test_corners_bounds_close_in():
    distance = {}
    for elements, resolution in ((8, 1.0), (8, 2.0)):
        low, high = square_bounds(elements, resolution)
        assert low < coil_corners.SQUARES < high
        distance[resolution] = high - low
    # The current at the inner corner is infinite as r^(−1/3): graded elements halved everywhere leave r^(4/3) of it.
    assert distance[2.0] < distance[1.0] / 2
    assert distance[1.0] < 3e-3


def test_resistance_goes_with_resistivity_and_one_over_thickness():
    thin, thick = (solve_sheet(square(2e-3, 1e-3, t), rho, 1.0, 4) for t, rho in ((10e-6, RHO), (20e-6, 3 * RHO)))
    assert thick.resistance == pytest.approx(1.5 * thin.resistance, rel=1e-12)
    np.testing.assert_allclose(thick.stream, thin.stream, atol=1e-12)


SECTION = (1e-3, 2e-3, 0.6e-3)  # inner and outer radius, thickness


@cache
def solid_ring() -> tuple[SheetCurrents, float]:
    track = ring(*SECTION)
    return solve_solid(track, solve_sheet(track, RHO, 1.0, 6), RHO, 1.0, 6)[:2]


def test_solid_ring_has_the_closed_forms_resistance():
    _, resistance = solid_ring()
    assert resistance == pytest.approx(ring_resistance(*SECTION), rel=1e-6)


def test_curl_inside_a_solid_ring_is_its_current_density():
    faces, _ = solid_ring()
    rng = np.random.default_rng(1)
    rho, z, phi = rng.uniform(1.05e-3, 1.95e-3, 12), rng.uniform(-0.25e-3, 0.25e-3, 12), rng.uniform(0, 6, 12)
    points = np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=-1)
    _, gradient = faces.layer_jet(points, 1)
    curl = np.stack([gradient[:, k, j] - gradient[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=-1)
    density = 1 / (SECTION[2] * np.log(2) * rho)
    expected = MU_0 * density[:, None] * np.stack([-np.sin(phi), np.cos(phi), 0 * phi], axis=-1)
    assert worst(curl, expected) < 1e-4
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-4 * np.abs(gradient).max()


@pytest.mark.parametrize("distance", [0.1e-3, 0.5e-3, 3e-3, 0.1])
def test_field_of_a_solid_ring_is_a_sum_of_solenoids(distance):
    points = off_the_ring(*SECTION, distance)
    found, truth = solid_ring()[0].layer_jet(points, 1), ring_jet(*SECTION, points, 1)
    assert worst(found[0], truth[0]) < 2e-5
    assert worst(found[1], truth[1]) < 1e-4


def test_field_inside_a_solid_ring_is_a_sum_of_windings():
    """Of eighty, each of even density: their J is that of the ring to the square of their build."""
    rho, z = (grid.ravel() for grid in np.meshgrid(np.linspace(1.1e-3, 1.9e-3, 5), np.linspace(-0.25e-3, 0.25e-3, 3)))
    points = np.stack([rho, 0 * rho, z], axis=-1)
    radii = np.linspace(SECTION[0], SECTION[1], 81)
    truth = sum(
        thick_solenoid_jet(points, a, b, SECTION[2], np.log(b / a) / np.log(2), 0)[0] for a, b in pairwise(radii)
    )
    assert worst(solid_ring()[0].layer_jet(points, 0)[0], truth) < 1e-4


def test_vector_potential_of_a_solid_ring_turns_to_b():
    """A from the sheets within the metal, B from the faces: two descriptions of one current."""
    currents = _solve_track(ring(*SECTION), RHO, 1e-3, 1.0, "solid").currents
    points, step = off_the_ring(*SECTION, 0.8e-3), 1e-5
    slopes = [
        (currents.vector_potential(points + move) - currents.vector_potential(points - move)) / (2 * step)
        for move in step * np.eye(3)
    ]
    slope = np.stack(slopes, axis=-1)
    curl = np.stack([slope[:, k, j] - slope[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=-1)
    assert worst(curl, currents.jet(points, 0)[0]) < 1e-3  # the sheets, for integrals, are coarser


def test_solid_square_ring_obeys_the_laws():
    """Against no closed form: Ampère round a side, no curl outside, µ0 J within that adds up to 1 A."""
    track = square(2e-3, 1e-3, 0.5e-3)
    faces, resistance, _ = solve_solid(track, solve_sheet(track, RHO, 2.0, 2), RHO, 2.0, 2)
    low, high = solve_sheet(track, RHO, 2.0, 2).bounds
    assert low * (1 - 1e-9) <= resistance <= high
    t = 2 * np.pi * np.arange(64) / 64
    circle = np.array([1.5e-3, 0.2e-3, 0]) + 1e-3 * np.stack([np.cos(t), 0 * t, np.sin(t)], axis=-1)
    steps = 1e-3 * np.stack([-np.sin(t), 0 * t, np.cos(t)], axis=-1) * 2 * np.pi / 64
    B, gradient = faces.layer_jet(circle, 1)
    assert float((B * steps).sum()) / MU_0 == pytest.approx(-1.0, abs=1e-4)
    curl = gradient - gradient.transpose(0, 2, 1)
    assert np.abs(curl).max() < 1e-3 * np.abs(gradient).max()
    x, wx = np.polynomial.legendre.leggauss(8)
    places = np.array([[1.5e-3 + 0.5e-3 * a, 0.1e-3, 0.25e-3 * b] for a in x for b in x])
    inside = faces.layer_jet(places, 1)[1]
    density = (inside[:, 0, 2] - inside[:, 2, 0]) / MU_0  # (curl B)_y/µ0
    assert float(np.outer(wx, wx).ravel() @ density) * 0.5e-3 * 0.25e-3 == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("thickness", [0.1e-3, 0.3e-3])
@pytest.mark.parametrize("model", ["sheet", "filament", "solid"])
def test_models_keep_what_they_state(model, thickness):
    """At the clearance, against the sum of solenoids."""
    inner, outer = 4.8e-3, 5.2e-3
    track, clearance = ring(inner, outer, thickness, around=96), 0.4e-3
    found = _solve_track(track, RHO, clearance, 1.0, model)
    points = off_the_ring(inner, outer, thickness, clearance)
    actual = worst(found.currents.jet(points, 0)[0], ring_jet(inner, outer, thickness, points, 0)[0])
    assert found.model == model
    assert actual < found.model_error + 5e-6  # of the rules, and of 96 parabolas for a circle
    if model != "solid" and found.model_error > 1e-5:
        assert actual > found.model_error / 30  # no empty statement either


@pytest.mark.parametrize(
    ("thickness", "clearance", "model"),
    [(10e-6, 1e-3, "sheet"), (0.4e-3, 1e-3, "sheet"), (0.5e-3, 1e-3, "solid"), (0.4e-3, 0.2, "filament")],
)
def test_models_are_chosen_by_thickness_and_clearance(thickness, clearance, model):
    found = _solve_track(ring(4.8e-3, 5.2e-3, thickness), RHO, clearance, 1.0, None)
    assert found.model == model
    assert found.model_error < 1e-4


def test_evenly_spread_is_a_solenoid_without_build():
    """A ribbon round a cylinder: the current is even across it, as turns of wire force it to be."""
    angle = np.linspace(0, 2 * np.pi, 129)
    way = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    up = np.array([0, 0, 4e-3])
    stations = Stations(5e-3 * way + up, 5e-3 * way - up, way, np.zeros(64, dtype=bool))
    points = np.random.default_rng(2).uniform(-4e-3, 4e-3, (40, 3)) * [0.8, 0.8, 3]
    found = evenly_spread(stations, 30.0).jet(points, 1)
    truth = thick_solenoid_jet(points, 5e-3, 5e-3, 8e-3, 30.0, 1)
    # Seen along the current, outwards upwards, left is down: the turns go the other way.
    sign = np.sign(found[0][0, 2] / truth[0][0, 2])
    assert worst(sign * found[0], truth[0]) < 2e-6
    assert worst(sign * found[1], truth[1]) < 1e-5
    expected = self_inductance(CoaxialWinding(5e-3, 5e-3, 8e-3, 30.0))
    sheets = evenly_spread(stations, 30.0)
    places, strengths = sheets.elements((2, 12))
    flux = float((sheets.vector_potential(places.reshape(-1, 3)) * strengths.reshape(-1, 3)).sum())
    assert flux == pytest.approx(expected, rel=5e-4)
