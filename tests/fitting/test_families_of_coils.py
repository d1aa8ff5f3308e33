"""Families for coils, and for the faces of magnets: errors on fresh points of the solutions, magpylib, and refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import magpylib
import numpy as np
import pytest

import magfem
from magfem.errors import InputError
from magfem.fem.coil_solution import CoilSolution
from magfem.fields.norms import relative_errors
from magfem.fields.region import Shell
from magfem.fields.term_kinds import CHARGE_DISC, LOOP, OBLATE, PATH
from magfem.fields.terms import harmonics
from magfem.fitting import FieldModel, Recipe
from magfem.fitting.families import charged_faces, closed_paths, displaced_multipoles, oblate_discs, winding_loops
from magfem.fitting.least_squares import solve_least_squares
from magfem.geometry import AXIAL, Coil, CylinderMagnet, PermanentMagnet

SPIRAL, SOLENOID, STATOR, RACETRACK = "planar_coil_12mm", "solenoid_24x48x60", "stator_1.6x5.5", "racetrack_coil_60x20"


def coil(name: str) -> Coil:
    geometry = magfem.load_geometry(name)
    assert isinstance(geometry, Coil)
    return geometry


def solved(name: str) -> CoilSolution:
    solution = magfem.solve(coil(name))
    assert isinstance(solution, CoilSolution)
    return solution


def fresh_errors(model: FieldModel, truth) -> tuple[float, float]:
    """Largest relative errors of B and gradient at points that nothing else uses."""
    assert isinstance(model.region, Shell)
    points = model.region.layers(np.random.default_rng(2027), 50, 40, 10)
    B, gradient = (
        float(relative_errors(ours, theirs).max())
        for ours, theirs in zip(model.jet(points), truth.jet(points), strict=True)
    )
    return B, gradient


def keeps(model: FieldModel, truth, B: float, gradient: float) -> bool:
    """Whether the fresh errors are below these and, with what the solution says of itself, below the stated bound."""
    found = fresh_errors(model, truth)
    bound = model.report["bound"]
    return found[0] <= min(B, bound["B"]) and found[1] <= min(gradient, bound["gradient"])


# Coils and their solutions


def test_planar_coil_along_its_true_path() -> None:
    solution = solved(SPIRAL)
    region = replace(solution.geometry.region, clearance=0.5e-3, extent=3e-3)
    model = magfem.fit(solution, Recipe(region=region))
    assert keeps(model, solution, 1e-3, 1e-2)
    assert model.unit == "T/A" and model.report["family"] == "closed_paths"
    assert model.report["condition"] <= 1e7 and set(model.lowered.kind.tolist()) == {PATH}
    # The moment of a flat spiral is about its turns' area; the fit's currents add up to those that flow.
    np.testing.assert_allclose(model.moment, solution.moment, atol=1e-3 * np.linalg.norm(solution.moment))


def test_no_axisymmetric_model_follows_the_planar_coil() -> None:
    """With leads and return strip it is not axisymmetric: order 0 alone leaves several per cent at best."""
    solution = solved(SPIRAL)
    region = replace(solution.geometry.region, clearance=0.5e-3, extent=3e-3)
    points = region.layers(np.random.default_rng(1), 30, 30).reshape(-1, 3)
    radii = np.linspace(0.5e-3, 6e-3, 24)
    columns = np.array(
        [magpylib.current.Circle(diameter=2 * radius, current=1).getB(points).ravel() for radius in radii]
    ).T
    B = solution.B(points)
    left = solve_least_squares(columns, B.ravel(), most_condition=1e7).residual
    assert np.sqrt(np.sum(left**2) / np.sum(B**2)) > 0.02


def test_solenoid_in_front_of_its_face() -> None:
    """5 to 125 mm in front of a winding 60 mm long, 12 to 24 mm in radius."""
    solution = solved(SOLENOID)
    region = replace(solution.geometry.region, clearance=5e-3, extent=125e-3, z=(30e-3, math.inf))
    model = magfem.fit(solution, Recipe(region=region))
    assert keeps(model, solution, 2e-4, 2e-3)
    assert model.report["family"] == "winding_loops" and model.report["condition"] <= 1e7
    assert set(model.lowered.kind.tolist()) == {LOOP}


def test_inner_circuit_of_the_stator() -> None:
    """The model of the catalogue, made by this family."""
    model = magfem.load_model("stator_1.6x5.5_inner")
    assert model.report["family"] == "closed_paths" and set(model.lowered.kind.tolist()) == {PATH}
    assert keeps(model, solved(STATOR).circuit("inner"), 1e-3, 1e-2)


def test_racetrack_is_its_winding() -> None:
    """One current for all filaments, in known shares: one ampere through all the turns."""
    solution = solved(RACETRACK)
    model = magfem.fit(solution)
    assert keeps(model, solution, 1e-3, 1e-2)
    assert model.report["parameters"] == 1 and model.report["condition"] == pytest.approx(1.0)
    assert model.lowered.coefficient.sum() == pytest.approx(solution.geometry.turns, rel=1e-3)


@pytest.mark.parametrize("name", [STATOR, "planar_coil_array_3x3"])
def test_a_coil_of_several_circuits_needs_a_name(name) -> None:
    geometry = coil(name)
    circuits = [circuit.name for circuit in geometry.circuits]
    assert len(circuits) > 1
    with pytest.raises(InputError, match=f"{len(circuits)} circuits: name one of {', '.join(circuits)}"):
        next(closed_paths(geometry, geometry.region))
    with pytest.raises(InputError, match="has no circuit 'middle'"):
        Recipe(geometry=geometry, circuit="middle")


# Candidates


def test_paths_are_closed_and_lie_in_the_conductor() -> None:
    """Nodes of the flat spiral's filaments are in its hull, those of the return strip a foil's thickness below."""
    geometry = coil(SPIRAL)
    candidate = next(closed_paths(geometry, geometry.region))
    terms = candidate.with_parameters(np.ones(candidate.parameters))
    terms.check_sources()
    below = geometry.hull.distance(terms.nodes)
    assert below.max() < 0.1e-3 and np.mean(below < 1e-9) > 0.8
    steps = np.linalg.norm(np.diff(terms.nodes, axis=0), axis=1)
    assert np.linalg.norm(terms.nodes[0] - terms.nodes[-1]) < 20 * np.median(steps)


def test_paths_are_magpylib_s_polylines() -> None:
    geometry = coil(SPIRAL)
    candidate = next(closed_paths(geometry, geometry.region))
    terms = candidate.with_parameters(np.ones(candidate.parameters))
    points = geometry.region.layers(np.random.default_rng(3), 5, 4).reshape(-1, 3)
    peer = np.zeros((len(points), 3))
    for k in range(terms.kind.size):
        nodes = terms.nodes[terms.node_start[k] : terms.node_start[k + 1]]
        closed = np.vstack([nodes, nodes[:1]])
        peer += magpylib.current.Polyline(current=terms.coefficient[k], vertices=closed).getB(points)
    np.testing.assert_allclose(terms.jet(points, 0)[0], peer, atol=1e-9 * np.abs(peer).max())


def test_loops_of_windings_lie_in_the_window_and_are_magpylib_s() -> None:
    geometry = coil(SOLENOID)
    (winding,) = geometry.circuits[0].parts
    points = geometry.region.layers(np.random.default_rng(3), 5, 4).reshape(-1, 3)
    sizes = []
    for candidate in winding_loops(geometry, geometry.region):
        terms = candidate.terms
        sizes.append(candidate.parameters)
        assert np.all(np.abs(terms.centre[:, 2] - winding.centre) <= winding.length / 2)
        assert np.all((terms.radius >= winding.inner_radius) & (terms.radius <= winding.outer_radius))
    assert sizes == sorted(set(sizes)) and len(sizes) > 2
    loops = next(winding_loops(geometry, geometry.region)).terms
    peer = magpylib.getB(
        [
            magpylib.current.Circle(diameter=2 * radius, current=1, position=centre)
            for radius, centre in zip(loops.radius, loops.centre, strict=True)
        ],
        points,
        sumup=True,
    )
    np.testing.assert_allclose(loops.jet(points, 0)[0], peer, atol=1e-12 * np.abs(peer).max())


# Faces of magnets


def test_charged_faces_are_the_rigid_ring(ring, ring_peer, ring_points) -> None:
    """One strength for each rim: that of the remanence, outside less inside. Equal to magpylib to rounding."""
    candidate = next(charged_faces(ring, ring.region))
    assert candidate.parameters == 2 and set(candidate.terms.kind.tolist()) == {CHARGE_DISC}
    points = ring_points.reshape(-1, 3)
    B = ring_peer.getB(points)
    (columns,) = candidate.columns(points, 0)
    solution = solve_least_squares(columns.reshape(2, -1).T, B.ravel())
    found = candidate.with_parameters(solution.parameters)
    found.check_sources()
    assert (
        relative_errors(found.jet(points, 0)[0].reshape(ring_points.shape), B.reshape(ring_points.shape)).max() < 1e-9
    )
    assert np.sort(solution.parameters) == pytest.approx(np.sort([-1.35, 1.35]), rel=1e-9)


def test_one_pair_of_faces_is_the_rigid_cylinder(disc) -> None:
    candidate = next(charged_faces(disc, disc.region))
    points = disc.region.layers(np.random.default_rng(5), 20, 20).reshape(-1, 3)
    peer = magpylib.magnet.Cylinder(dimension=(disc.diameter, disc.length), polarization=(0, 0, 1.2)).getB(points)
    (one,) = candidate.columns(points, 0)[0]
    np.testing.assert_allclose(1.2 * one, peer, atol=1e-10 * np.abs(peer).max())


@pytest.fixture(scope="module")
def disc() -> CylinderMagnet:
    material = PermanentMagnet(1.2, 1.0, AXIAL)
    return CylinderMagnet(diameter=8e-3, length=2e-3, material=material, clearance=2e-3, extent=12e-3)


def test_oblate_discs_describe_a_flat_magnet(disc) -> None:
    """Three discs of one radius, found within the magnet: below 0.2 % in B all round from 2 mm on."""
    model = magfem.fit(magfem.exact(disc), Recipe(family="oblate_discs", options={"discs": 3, "degrees": 8}))
    assert set(model.lowered.kind.tolist()) == {OBLATE}
    assert np.all(model.lowered.radius < disc.diameter / 2) and np.ptp(model.lowered.radius) == 0
    peer = magpylib.magnet.Cylinder(dimension=(disc.diameter, disc.length), polarization=(0, 0, 1.2))
    points = disc.region.layers(np.random.default_rng(6), 40, 30)
    assert relative_errors(model.B(points), peer.getB(points.reshape(-1, 3)).reshape(points.shape)).max() < 2e-3
    assert np.allclose(model.moment, magfem.exact(disc).moment, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("shared", [False, True])
def test_displaced_multipoles_are_found_where_they_are(disc, shared) -> None:
    """Two sources of two poles on the axis, with coefficients of their own or, as 5.2 is printed, shared."""
    heights, own = (0.3e-3, -1.1e-3), ((0.5, 0.1), (0.5, 0.1) if shared else (0.3, -0.2))
    terms = [
        harmonics(disc.hull.radius, [1, 2], [0, 0], [False, False], values, (0, 0, height))
        for height, values in zip(heights, own, strict=True)
    ]
    points = disc.region.layers(np.random.default_rng(8), 20, 20).reshape(-1, 3)
    B = sum(one.jet(points, 0)[0] for one in terms)
    member = next(displaced_multipoles(disc, disc.region, sources=2, orders=2, shared=shared))
    top = disc.length / 2 - 0.25 * disc.clearance
    candidate = member.make(np.array([top - heights[0], heights[0] - heights[1]]))
    assert candidate.parameters == member.parameters == (2 if shared else 4)
    (columns,) = candidate.columns(points, 0)
    found = solve_least_squares(columns.reshape(candidate.parameters, -1).T, B.ravel())
    assert found.parameters == pytest.approx(np.ravel(own)[: candidate.parameters], rel=1e-9)
    assert member.lower[1] >= 0.02 * disc.length > 0  # two sources never meet


# The choice among families


def test_search_takes_the_smallest_of_all_families(disc) -> None:
    """Of a rigid disc the charged faces, one number, met exactly. Within 10 s here."""
    model = magfem.fit(magfem.exact(disc), Recipe(family="search"))
    tried = {one["family"] for one in model.report["candidates"]}
    assert tried >= {"wall_and_face_loops", "charged_faces"}
    assert (model.report["family"], model.report["parameters"]) == ("charged_faces", 1)
    assert fresh_errors(model, magfem.exact(disc)) < (1e-8, 1e-6)


@pytest.mark.parametrize(
    ("name", "family", "words"),
    [
        ("ring_magnet_4x1.5x1", "closed_paths", "closed paths are for coils"),
        ("ring_magnet_4x1.5x1", "winding_loops", "need a coil of windings about z"),
        (RACETRACK, "winding_loops", "need a coil of windings about z"),
        (SOLENOID, "charged_faces", "need axial magnetisation"),
        (RACETRACK, "oblate_discs", "need a device of revolution"),
    ],
)
def test_families_refuse_devices_that_they_are_not_for(name, family, words) -> None:
    with pytest.raises(InputError, match=words):
        Recipe(geometry=magfem.load_geometry(name), family=family)


def test_oblate_discs_have_a_candidate_for_each_number(disc) -> None:
    found = [member.parameters for member in oblate_discs(disc, disc.region, discs=(1, 2), degrees=(2, 3))]
    assert found == [4, 6, 8, 12]
