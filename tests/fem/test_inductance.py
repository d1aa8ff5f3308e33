"""Inductances against closed forms, sums over filaments and published formulas; flux linkages against reciprocity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from references.coil_filaments import racetrack_inductance
from scipy.spatial.transform import RigidTransform, Rotation
from solved_coils import solved

import magfem
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fem.coil_currents import CoilCurrents
from magfem.fem.conduction import evenly_spread
from magfem.fem.inductance import flux_linkage, inductance_matrix
from magfem.fem.sheet_currents import SheetCurrents
from magfem.fields.coaxial_inductance import (
    CoaxialWinding,
    loops_mutual_inductance,
    mutual_inductance,
    nagaoka_coefficient,
    self_inductance,
    sheet_inductance,
)
from magfem.fields.filament import Filaments
from magfem.geometry import SphereMagnet
from magfem.geometry.circuit import Stations
from magfem.geometry.material import PermanentMagnet
from magfem.typing import Floats


def polygon(radius: float, height: float, sides: int = 256) -> CoilCurrents:
    """A loop of straight filaments as long as the circle."""
    angle = 2 * np.pi * np.arange(sides) / sides
    radius *= 1 + (np.pi / sides) ** 2 / 6
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), height + 0 * angle], axis=-1)
    wire = Filaments(corners, np.roll(corners, -1, axis=0), np.ones(sides))
    return CoilCurrents(filaments=wire, offset=np.zeros((sides, 3)))


def band(radius: float, length: float, turns: float = 1.0, height: float = 0.0, around: int = 64) -> CoilCurrents:
    """A current sheet on a cylinder, of patches."""
    angle = np.linspace(0, 2 * np.pi, 2 * around + 1)
    way = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    low, high = (radius * way + np.array([0, 0, height + side * length / 2]) for side in (-1, 1))
    sheets = evenly_spread(Stations(high, low, way, np.zeros(around, dtype=bool)), turns)
    return CoilCurrents(sheets=sheets, within=sheets)


def tube(radius: float, length: float, turns: float) -> CoilCurrents:
    """A solenoid without build, of eight bands."""
    rows = [band(radius, length / 8, turns / 8, length * (2 * n - 7) / 16).sheets for n in range(8)]
    sheets = SheetCurrents.joined(rows)
    return CoilCurrents(sheets=sheets, within=sheets)


def winding(inner: float, outer: float, length: float, centre: float, turns: float) -> CoilCurrents:
    return CoilCurrents(windings=np.array([[inner, outer, length, centre, turns, 1e-4]]))


def test_loops_of_filaments_follow_maxwell():
    for radius, distance in ((30e-3, 10e-3), (10e-3, 40e-3), (20e-3, 20e-3)):
        matrix = inductance_matrix([polygon(20e-3, 0.0), winding(radius, radius, 0.0, distance, 3.0)])
        assert matrix[0, 1] == pytest.approx(3 * loops_mutual_inductance(20e-3, radius, distance), rel=2e-4, abs=0)
    # Both of filaments
    pair = inductance_matrix([polygon(20e-3, 0.0), polygon(30e-3, 10e-3)])
    assert pair[0, 1] == pytest.approx(loops_mutual_inductance(20e-3, 30e-3, 10e-3), rel=2e-4)


@pytest.mark.parametrize("shape", [0.5, 2.0])
def test_solenoids_of_patches_follow_nagaoka(shape):
    """Diameter over length. The sheet's own vector potential has its logarithm at the edges."""
    radius = 10e-3
    length = 2 * radius / shape
    expected = MU_0 * math.pi * radius**2 * 50**2 / length * nagaoka_coefficient(radius, length)
    assert expected == pytest.approx(sheet_inductance(radius, length, 50), rel=1e-12, abs=0)
    matrix = inductance_matrix([tube(radius, length, 50)])
    assert matrix[0, 0] == pytest.approx(expected, rel=3e-4)


def test_patches_and_windings_link_as_the_closed_form():
    inner, outer = tube(10e-3, 20e-3, 40), winding(15e-3, 20e-3, 10e-3, 5e-3, 100)
    expected = mutual_inductance(
        CoaxialWinding(10e-3, 10e-3, 20e-3, 40), CoaxialWinding(15e-3, 20e-3, 10e-3, 100, 5e-3)
    )
    assert inductance_matrix([inner, outer])[0, 1] == pytest.approx(expected, rel=1e-5)


def test_thick_solenoid_is_its_closed_form():
    solution = solved("solenoid_20x30x30")
    expected = self_inductance(CoaxialWinding(10e-3, 15e-3, 30e-3, 1000))
    assert solution.inductance[0, 0] == pytest.approx(expected, rel=1e-9)


def test_reciprocity_of_unlike_circuits():
    """Each direction by itself: the vector potential of one over the other's current."""
    square = np.array([[12.0, 3, 8], [25, 5, 10], [22, 18, 12], [9, 14, 9]]) * 1e-3
    ends = np.roll(square, -1, axis=0)
    share = np.linspace(0, 1, 201)[:, None, None]
    chain = (square + share * (ends - square)).transpose(1, 0, 2)
    start, end = chain[:, :-1].reshape(-1, 3), chain[:, 1:].reshape(-1, 3)
    frame = CoilCurrents(filaments=Filaments(start, end, np.ones(len(start))), offset=np.zeros_like(start))
    circuits = {
        "patches": band(7e-3, 5e-3, 7),
        "winding": winding(2e-3, 4e-3, 4e-3, 9e-3, 20),
        "filaments": frame,
    }
    for name, first in circuits.items():
        for other, second in circuits.items():
            if name < other:
                there, back = both_ways(first, second)
                assert there == pytest.approx(back, rel=2e-4, abs=0), (name, other)


def test_reciprocity_of_a_racetrack():
    there, back = both_ways(band(7e-3, 5e-3, 7), solved("racetrack_coil_60x20").circuits[0].currents)
    assert there == pytest.approx(back, rel=1e-4)


def both_ways(first: CoilCurrents, second: CoilCurrents) -> tuple[float, float]:
    """Mutual inductance (H), the first driven and the second driven."""
    there = float((first.vector_potential(second.elements()[0]) * second.elements()[1]).sum())
    back = float((second.vector_potential(first.elements()[0]) * first.elements()[1]).sum())
    return there, back


def test_racetrack_is_the_sum_over_filaments():
    """The walls that stand for the winding have no thickness; what they store more than it is taken off."""
    sums = {cells: racetrack_inductance(40e-3, 10e-3, 10e-3, 10e-3, 200, cells) for cells in (4, 6)}
    exact = sums[6] + (sums[6] - sums[4]) / (6**2 / 4**2 - 1)
    for resolution in (0.5, 1.0):
        assert solved("racetrack_coil_60x20", resolution).inductance[0, 0] == pytest.approx(exact, rel=5e-4)


def test_planar_coil_is_a_stack_of_rings():
    """Its turns as coaxial rings of the trace's section: Maxwell's formula between them, each with its own. What the
    return strip and the drift of the spiral add is left out."""
    radii = 6e-3 - 50e-6 - (5e-3 - 100e-6) / 24 * (np.arange(24) + 0.5)
    matrix = np.array(loops_mutual_inductance(radii[:, None], radii, 1e-12 * np.eye(24)))
    own = [self_inductance(CoaxialWinding(r - 50e-6, r + 50e-6, 9e-6)) for r in radii]
    np.fill_diagonal(matrix, own)
    found = solved("planar_coil_12mm", 0.5).inductance[0, 0]
    assert found == pytest.approx(matrix.sum(), rel=0.01)


def test_planar_coil_agrees_with_the_current_sheet_formula():
    """S. S. Mohan et al., IEEE J. Solid-State Circuits 34, 1419 (1999), eq. 4 and table II, circular: within a few
    percent for spirals whose gap is no wider than the trace."""
    fill, mean = (12 - 2) / (12 + 2), 7e-3
    sheet = MU_0 * 24**2 * mean / 2 * (math.log(2.46 / fill) + 0.20 * fill**2)
    assert solved("planar_coil_12mm", 0.5).inductance[0, 0] == pytest.approx(sheet, rel=0.04)


@pytest.fixture(scope="session")
def stator_inductance() -> Floats:
    return solved("stator_1.6x5.5", 0.5).inductance


def test_stator_stores_energy_whatever_its_currents(stator_inductance):
    np.testing.assert_array_equal(stator_inductance, stator_inductance.T)
    assert (np.linalg.eigvalsh(stator_inductance) > 0).all()
    coupling = abs(stator_inductance[0, 1]) / math.sqrt(stator_inductance[0, 0] * stator_inductance[1, 1])
    assert coupling < 0.2  # nearly at right angles
    solution, currents = solved("stator_1.6x5.5", 0.5), np.array([0.7, -1.3])
    (first, mutual), (_, second) = stator_inductance
    expected = 0.5 * (first * 0.49 + second * 1.69) - mutual * 0.91
    assert solution.energy(currents) == pytest.approx(expected, rel=1e-12, abs=0)


def sphere(direction: Floats) -> SphereMagnet:
    return SphereMagnet(diameter=5e-3, material=PermanentMagnet(1.2, 1.0, tuple(direction)))


@pytest.mark.parametrize("name", ["planar_coil_12mm", "helmholtz_pair_200", "loop_50"])
def test_linkage_with_a_sphere_is_its_moment_times_the_coils_field(name):
    """Outside it a sphere is a dipole, and the mean of a harmonic field over it is that in its middle."""
    coil = solved(name)
    direction = np.array([0.48, -0.6, 0.64])
    magnet = magfem.exact(sphere(direction))
    middle = np.array([1e-3, -2e-3, 0.5 * coil.geometry.region.extent + 5e-3])
    placed = magnet.at(RigidTransform.from_components(middle, Rotation.identity()))
    expected = float(magnet.moment @ coil.B(middle))
    assert flux_linkage(coil, placed)[0] == pytest.approx(expected, rel=3e-4)


def test_linkage_does_not_depend_on_the_apex():
    coil = solved("loop_50")
    other = 2.0 * solved("helmholtz_pair_200").at(
        RigidTransform.from_components([0.02, 0.01, 0.03], Rotation.from_rotvec([0.4, -0.3, 0.1]))
    )
    chosen = [
        flux_linkage(coil, other, np.array(apex))[0] for apex in ([0, 0, 0], [0.01, -0.02, 0.03], [0, 0.03, -0.02])
    ]
    np.testing.assert_allclose(chosen, flux_linkage(coil, other)[0], rtol=1e-4)


def test_linkage_of_coils_is_mutual_inductance_times_current():
    loop, pair = solved("loop_50"), solved("helmholtz_pair_200")
    coaxial = sum(
        mutual_inductance(CoaxialWinding(25e-3, 25e-3, 0.0), CoaxialWinding(95e-3, 105e-3, 14e-3, 120, side * 50e-3))
        for side in (-1, 1)
    )
    assert flux_linkage(loop, 3.0 * pair)[0] == pytest.approx(3 * coaxial, rel=1e-6)


def test_linkage_with_a_coil_inside_is_mutual_inductance_times_current():
    loop, pair = solved("loop_50"), solved("helmholtz_pair_200")
    expected = flux_linkage(loop, 3.0 * pair)[0]
    assert flux_linkage(pair, 3.0 * loop)[0] == pytest.approx(expected, rel=1e-3)


def test_linkage_wants_a_field_in_tesla():
    with pytest.raises(InputError, match="multiply a coil's field by its current"):
        flux_linkage(solved("loop_50"), solved("helmholtz_pair_200"))
