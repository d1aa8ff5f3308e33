"""Closed paths against magpylib's polylines, straight wires in closed form, filaments, the loop, and laws."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest
from references.jets import assert_harmonic, errors, relative, scattered
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.filament import Filaments
from magfem.fields.terms import Terms, closed_path, loops
from magfem.typing import Floats, Points

A, CURRENT = 0.01, 3.0  # m, A
NODES = A * np.array([[1, 0, 0], [0.3, 0.9, 0.2], [-0.8, 0.6, -0.1], [-0.7, -0.7, 0.3], [0.4, -0.8, 0]])
PATH = closed_path(NODES, CURRENT)


def filaments(nodes: Points) -> Filaments:
    return Filaments(nodes, np.roll(nodes, -1, axis=0), np.full(len(nodes), CURRENT))


def polygon(sides: int) -> Terms:
    angle = np.arange(sides) * 2 * np.pi / sides
    return closed_path(A * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1), CURRENT)


def off_the_wire(seed: int, count: int, clear: float, farthest: float = 5.0) -> Points:
    """Random points (count, 3) m at `clear` A from every filament at least."""
    points = A * scattered(seed, 20 * count, 0.05, farthest)
    start, step = NODES, np.roll(NODES, -1, axis=0) - NODES
    along = np.einsum("nfi,fi->nf", points[:, None] - start, step) / (step**2).sum(axis=1)
    nearest = start + np.clip(along, 0, 1)[..., None] * step
    return points[np.linalg.norm(points[:, None] - nearest, axis=-1).min(axis=1) > clear * A][:count]


def straight(points: Points, start: Floats, end: Floats) -> Floats:
    """A filament's B by its angles: µ0 I/(4πd) (cos α − cos β), with d the distance to its line.

    Beyond an end, where the cosines are close: cos² α − cos² β = d² (a² − b²)/(r_a² r_b²).
    """
    e = (end - start) / np.linalg.norm(end - start)
    a, b = (points - start) @ e, (points - end) @ e
    perpendicular = (points - start) - a[:, None] * e
    d2 = (perpendicular**2).sum(axis=1)
    alpha, beta = a / np.sqrt(a**2 + d2), b / np.sqrt(b**2 + d2)
    beside = a * b <= 0
    weight = np.empty(len(points))
    weight[beside] = (alpha - beta)[beside] / d2[beside]
    beyond = (a**2 - b**2) / ((a**2 + d2) * (b**2 + d2))
    weight[~beside] = beyond[~beside] / (alpha + beta)[~beside]
    return MU_0 * CURRENT / (4 * np.pi) * weight[:, None] * np.cross(e, perpendicular)


def test_field_matches_magpylib_polyline():
    peer = magpylib.current.Polyline(current=CURRENT, vertices=np.concatenate([NODES, NODES[:1]]))
    points = off_the_wire(1, 200, 0.05, 100.0)
    assert relative(PATH.jet(points, 0)[0], peer.getB(points)).max() < 1e-9  # the two µ₀ differ by 1.6e-10


@pytest.mark.parametrize("order", [0, 1, 2])
def test_jet_is_that_of_a_chain_of_filaments(order):
    points = off_the_wire(2, 200, 0.05, 30.0)
    assert errors(PATH.jet(points, order), filaments(NODES).jet(points, order)).max() < 2e-12


@pytest.mark.parametrize("distance", [1e-1, 1e-3, 1e-5])
def test_beside_the_wire_digits_are_lost_as_the_distance_only(distance):
    """A rectangle along the axes: distances to its sides are exact in the reference. Not as the distance squared."""
    corners = A * np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]])
    angle = np.arange(12) * np.pi / 6
    along = np.linspace(0.1, 0.9, 12)
    points = A * np.stack([along, distance * np.cos(angle), distance * np.sin(angle)], axis=-1)
    truth = sum(straight(points, corners[k - 1], corners[k]) for k in range(4))
    assert relative(closed_path(corners, CURRENT).jet(points, 0)[0], truth).max() < 1e-15 + 1e-15 / distance


@pytest.mark.parametrize("distance", [0.1, 1e-3, 1e-6])
def test_on_the_line_of_a_filament_beyond_its_end_nothing_is_lost(distance):
    corners = A * np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]])
    points = A * np.array([[-0.5, distance, 0], [1.5, 0, -distance], [4.0, 0, 0], [-2.0, 0, 0]])
    truth = sum(straight(points, corners[k - 1], corners[k]) for k in range(4))
    assert relative(closed_path(corners, CURRENT).jet(points, 0)[0], truth).max() < 1e-14


def test_polygons_tend_to_the_loop_with_order_two():
    """With corners on the circle; B, gradient and hessian alike."""
    points = A * scattered(3, 60, 0.1, 0.8)
    circle = loops(np.zeros((1, 3)), A, CURRENT).jet(points, 2)
    coarse, fine = (errors(polygon(sides).jet(points, 2), circle) for sides in (200, 400))
    np.testing.assert_allclose(np.log2(coarse / fine), 2.0, atol=0.05)


def test_centre_of_a_polygon():
    """µ0 I n tan(π/n)/(2π a) at the centre of a regular polygon of circumscribed radius a."""
    for sides in (3, 4, 7, 100):
        B = polygon(sides).jet(np.zeros((1, 3)), 0)[0][0]
        expected = MU_0 * CURRENT * sides * np.tan(np.pi / sides) / (2 * np.pi * A)
        np.testing.assert_allclose(B, [0, 0, expected], rtol=1e-13, atol=1e-15 * expected)


@pytest.mark.parametrize("reach", [0.3, 3.0])
def test_circulation_is_ampere_s_law(reach):
    """∮ B·dl on a circle about a side's middle: µ0 I where it links the wire once, zero where it goes round both ways.

    The trapezoidal rule converges exponentially.
    """
    start, end = NODES[0], NODES[1]
    middle, along = (start + end) / 2, (end - start) / np.linalg.norm(end - start)
    u = np.cross(along, [0, 0, 1.0])
    u /= np.linalg.norm(u)
    v = np.cross(along, u)
    angle = np.arange(600) * 2 * np.pi / 600
    circle = middle + reach * A * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
    tangent = np.cos(angle)[:, None] * v - np.sin(angle)[:, None] * u
    circulation = np.sum(PATH.jet(circle, 0)[0] * tangent) * reach * A * 2 * np.pi / 600
    linked = MU_0 * CURRENT if reach < 1 else 0.0
    assert circulation == pytest.approx(linked, rel=1e-12, abs=1e-12 * MU_0 * CURRENT)


def test_moment_is_that_of_its_far_field():
    """A magpylib dipole, wherever the path lies: what is left falls with the distance."""
    moved = closed_path(NODES + A * np.array([1.0, -2.0, 0.5]), CURRENT)
    np.testing.assert_allclose(moved.moment, PATH.moment, rtol=1e-13)
    dipole, directions = magpylib.misc.Dipole(moment=PATH.moment), A * scattered(4, 60, 1.0, 1.0)
    near, far = (relative(PATH.jet(d * directions, 0)[0], dipole.getB(d * directions)).max() for d in (100, 1000))
    assert far < 1e-2 and 0.9 < np.log10(near / far) < 2.1


def test_moment_of_a_plane_path_is_current_times_area():
    np.testing.assert_allclose(polygon(4).moment, [0, 0, CURRENT * 2 * A**2], rtol=1e-14, atol=1e-20)


def test_reversal_turns_the_field_and_the_first_node_does_not_matter():
    points = off_the_wire(5, 100, 0.1)
    jet = PATH.jet(points, 2)
    back = closed_path(NODES[::-1], CURRENT).jet(points, 2)
    assert errors(back, tuple(-part for part in jet)).max() < 1e-12
    assert errors(closed_path(np.roll(NODES, 2, axis=0), CURRENT).jet(points, 2), jet).max() < 1e-12
    assert errors(closed_path(NODES, -CURRENT).jet(points, 2), tuple(-part for part in jet)).max() == 0


def test_centre_and_frame_move_the_nodes():
    turn, centre = Rotation.from_rotvec([0.3, 1.1, -0.5]), A * np.array([1.0, -2.0, 0.5])
    points = off_the_wire(6, 100, 0.1)
    world = turn.apply(points) + centre
    by_nodes = closed_path(turn.apply(NODES) + centre, CURRENT).jet(world, 2)
    assert errors(closed_path(NODES, CURRENT, centre, turn.as_matrix()).jet(world, 2), by_nodes).max() < 1e-12
    assert errors(PATH.placed(RigidTransform.from_components(centre, turn)).jet(world, 2), by_nodes).max() < 1e-12


def test_a_node_on_a_side_changes_nothing():
    points = off_the_wire(7, 100, 0.1)
    split = np.insert(NODES, 1, 0.3 * NODES[0] + 0.7 * NODES[1], axis=0)
    assert errors(closed_path(split, CURRENT).jet(points, 2), PATH.jet(points, 2)).max() < 1e-12


def test_field_is_free_of_sources_and_curl():
    assert_harmonic(lambda x: PATH.jet(x, 0)[0], off_the_wire(8, 60, 0.3), 0.01 * A, 1e-9)


def test_field_on_the_path_is_not_finite():
    """On a side, away from rounding, and on a node: no large but wrong number."""
    square = closed_path(A * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), CURRENT)
    for point in ([0.5 * A, 0, 0], [A, 0, 0], [0, 0, 0]):
        assert not np.isfinite(square.jet(np.array([point]), 0)[0]).all()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_paths_that_enclose_nothing_are_refused(count):
    with pytest.raises(InputError, match="a closed path needs three nodes or more"):
        closed_path(NODES[:count], CURRENT).check_sources()
