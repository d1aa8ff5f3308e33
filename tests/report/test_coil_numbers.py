"""The numbers of coil reports against closed forms and conservation laws."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import magfem
from magfem.fem.coil_solution import CoilSolution
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.geometry import Coil, LoopCoil, Solenoid
from magfem.report.coil_numbers import (
    ball,
    conductor_numbers,
    coupling,
    cylinder,
    deviation,
    directions,
    field_per_watt,
    homogeneous_volume,
    largest_current,
)
from magfem.report.coil_outline import is_flat, paths, strips
from magfem.report.figures.current_density import density_map
from magfem.report.workplace import workplace
from magfem.typing import Floats, Jet, Points

RHO = 1 / 58e6  # Ω·m, copper


@dataclass(frozen=True)
class Linear(Evaluated):
    """A field that changes evenly: B = middle + slope · x."""

    middle: Floats
    slope: Floats

    @property
    def region(self) -> Region:
        return Everywhere()

    @property
    def unit(self) -> Unit:
        return "T/A"

    def evaluate(self, points: Points, order: int) -> Jet:
        B = self.middle + points @ self.slope.T
        return (B, np.tile(self.slope, (len(points), 1, 1)))[: order + 1]


def coil(name: str) -> Coil:
    geometry = magfem.load_geometry(name)
    assert isinstance(geometry, Coil)
    return geometry


@pytest.fixture(scope="module")
def spiral() -> CoilSolution:
    """The planar coil, coarsely."""
    solution = magfem.solve(coil("planar_coil_12mm"), resolution=0.5)
    assert isinstance(solution, CoilSolution)
    return solution


def test_homogeneous_volume_of_an_even_gradient_is_its_ellipsoid() -> None:
    field = Linear(np.array([0.0, 0.0, 2e-3]), np.diag([-0.05, -0.05, 0.1]))
    half = [0.01 * 2e-3 / slope for slope in (0.05, 0.05, 0.1)]  # where |slope · x| is 1 % of 2 mT
    found = homogeneous_volume(field, np.zeros(3), 1e-3)
    assert found == pytest.approx(4 * np.pi / 3 * np.prod(half), rel=2e-2)


def test_homogeneous_volume_ends_where_the_search_does() -> None:
    field = Linear(np.array([1e-3, 0.0, 0.0]), np.zeros((3, 3)))
    assert homogeneous_volume(field, np.ones(3), 2e-3) == pytest.approx(4 * np.pi / 3 * 8e-9, rel=1e-12, abs=0)


def test_deviation_is_relative_to_the_centre_and_infinite_without_a_field_there() -> None:
    B = np.array([[0.0, 0.0, 2.0], [0.0, 0.1, 2.0]])
    np.testing.assert_allclose(deviation(B, np.array([0.0, 0.0, 2.0])), [0.0, 0.05])
    assert np.isinf(deviation(B, np.zeros(3))).all()


def test_points_fill_ball_and_cylinder_to_their_walls() -> None:
    distance = np.linalg.norm(ball(np.array([1.0, 0.0, 0.0]), 0.5) - [1.0, 0.0, 0.0], axis=1)
    assert distance.max() == pytest.approx(0.5) and distance.min() < 0.1
    np.testing.assert_allclose(directions(500).mean(axis=0), 0, atol=0.01)
    points = cylinder(2.0, 6.0)
    assert np.hypot(*points.T[:2]).max() == pytest.approx(1.0)
    assert points[:, 2].max() == 3.0 == -points[:, 2].min()


def test_loops_wire_is_its_circumference() -> None:
    (one,) = conductor_numbers(LoopCoil(diameter=0.05, wire_diameter=0.001))
    assert one.turns == 1 and one.lead_length == 0
    assert one.length == pytest.approx(np.pi * 0.05)
    assert one.estimate == pytest.approx(RHO * np.pi * 0.05 / (np.pi / 4 * 1e-6))


def test_solenoids_wire_is_turns_times_the_mean_turn() -> None:
    geometry = coil("solenoid_24x48x60")
    assert isinstance(geometry, Solenoid)
    (one,) = conductor_numbers(geometry)
    assert one.turns == 1000
    assert one.length == pytest.approx(1000 * np.pi * 0.036)
    assert one.volume == pytest.approx(one.length * np.pi / 4 * 0.75e-3**2)


def test_foils_estimate_is_near_the_solved_resistance(spiral: CoilSolution) -> None:
    (one,) = conductor_numbers(spiral.geometry)
    assert one.turns == 24
    assert one.estimate == pytest.approx(spiral.circuits[0].resistance, rel=2e-3)  # bends of 1 to 6 mm and no corners


def test_turns_of_arrays_and_stators_are_those_of_their_coils() -> None:
    assert {one.turns for one in conductor_numbers(coil("planar_coil_array_3x3"))} == {24}
    assert [(one.name, one.turns) for one in conductor_numbers(coil("stator_1.6x5.5"))] == [
        ("inner", 12),
        ("outer", 12),
    ]


def test_field_per_watt_does_not_ask_how_the_window_is_wound() -> None:
    found = []
    for turns in (500, 1000):
        geometry = Solenoid(inner_diameter=0.02, outer_diameter=0.03, length=0.03, turns=turns)
        solution = magfem.solve(geometry)
        assert isinstance(solution, CoilSolution)
        found.append(field_per_watt(float(solution.B([0, 0, 0])[2]), solution.circuits[0].resistance))
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_the_largest_current_brings_the_density_to_its_limit() -> None:
    assert largest_current(2e9, 5e7) * 2e9 == pytest.approx(5e7)


def test_coupling_of_equal_coils_in_one_place_is_one() -> None:
    np.testing.assert_allclose(coupling(np.array([[4.0, -6.0], [-6.0, 9.0]])), [[1, -1], [-1, 1]])


def test_density_map_carries_one_ampere_along_the_whole_trace(spiral: CoilSolution) -> None:
    """∫ |J| dV is current times length where the current keeps to the track's direction."""
    (circuit,) = spiral.geometry.circuits
    found = density_map(circuit, spiral.circuits[0].currents.sheets)
    assert found is not None
    a, b, c, d = np.moveaxis(found.corners, 1, 0)
    area = 0.5 * np.abs((c - a)[:, 0] * (d - b)[:, 1] - (c - a)[:, 1] * (d - b)[:, 0])
    track = circuit.parts[0]
    total = float((found.density * area).sum()) * 9e-6
    assert total == pytest.approx(conductor_numbers(spiral.geometry)[0].length, rel=5e-3)
    assert area.sum() == pytest.approx(track.volume / 9e-6, rel=5e-3)


def test_windings_have_no_density_map() -> None:
    solution = magfem.solve(coil("solenoid_20x30x30"))
    assert isinstance(solution, CoilSolution)
    assert density_map(solution.geometry.circuits[0], solution.circuits[0].currents.sheets) is None


@pytest.mark.parametrize(
    ("name", "flat"),
    [("planar_coil_12mm", True), ("planar_coil_array_3x3", True), ("stator_1.6x5.5", False), ("loop_50", False)],
)
def test_flat_coils_are_told_from_others(name: str, flat: bool) -> None:
    assert is_flat(coil(name)) is flat


@pytest.mark.parametrize("name", ["planar_coil_12mm", "solenoid_20x30x30", "racetrack_coil_60x20"])
def test_arrows_turn_right_handed_about_z(name: str) -> None:
    (circuit,) = coil(name).circuits
    for path in paths(circuit):
        along = np.diff(path.points, axis=0)
        middle = 0.5 * (path.points[1:] + path.points[:-1])
        assert np.cross(middle, along)[:, 2].sum() > 0


def test_saddle_coils_arrows_turn_right_handed_about_x() -> None:
    (circuit,) = coil("saddle_coil_pair_40x60").circuits
    for path in paths(circuit):
        assert np.cross(path.points[:-1], np.diff(path.points, axis=0))[:, 0].sum() > 0


def test_strips_of_a_track_are_its_turns_and_its_leads() -> None:
    (track,) = coil("planar_coil_12mm").circuits[0].parts
    cut = strips(track)  # type: ignore[arg-type]
    length = {
        lead: sum(
            float(np.linalg.norm(np.diff(strip.middle, axis=0), axis=1).sum()) for strip in cut if strip.lead == lead
        )
        for lead in (False, True)
    }
    assert length[False] == pytest.approx(0.527816, rel=1e-4)
    assert length[True] == pytest.approx(track.lead_length, rel=1e-2)


def test_workplaces_keep_off_the_metal() -> None:
    flat = workplace(coil("planar_coil_12mm"))
    assert [plane.height for plane in flat.planes] == pytest.approx([0.2045e-3, 1.0045e-3, 2.0045e-3])
    assert flat.centre[2] == pytest.approx(1.0045e-3)
    stator = coil("stator_1.6x5.5")
    bore = workplace(stator).places[-1].points
    assert np.hypot(*bore.T[:2]).max() == pytest.approx(0.5 * stator.bore.diameter)  # type: ignore[attr-defined]
    within = workplace(replace(coil("solenoid_20x30x30"), name="a"))  # type: ignore[type-var]
    assert within.reach == pytest.approx(0.95 * 0.01, rel=1e-2)
