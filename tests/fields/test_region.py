"""Hulls and regions: distances against brute force, offset points against distance and area."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import kstest

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull, hull_from_dict, hull_to_dict
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Shell
from magfem.fields.region_json import region_from_dict, region_to_dict

DISC = CylinderHull(diameter=4e-3, length=1e-3)
PIN = CylinderHull(diameter=1e-3, length=3e-3)
SHELL = Shell(DISC, clearance=0.5e-3, extent=6e-3)


@pytest.mark.parametrize("hull", [DISC, PIN])
def test_distance_is_the_smallest_over_all_points_of_the_body(hull: CylinderHull) -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-4e-3, 4e-3, (40, 3))

    def body(parameters: np.ndarray) -> np.ndarray:
        """A point of the solid cylinder from (radius, azimuth, height), each in units of its range."""
        radius, azimuth, height = (
            parameters[0] * hull.diameter / 2,
            parameters[1],
            parameters[2] * hull.length,
        )
        return np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), height])

    for point in points:
        start = [0.5, np.arctan2(point[1], point[0]) + 0.3, 0.0]
        nearest = minimize(
            lambda q, point=point: 1e6 * np.sum((body(q) - point) ** 2),
            start,
            bounds=[(0, 1), (-5, 5), (-0.5, 0.5)],
            options={"ftol": 1e-15, "gtol": 1e-10},
        )
        assert hull.distance(point) == pytest.approx(1e-3 * np.sqrt(nearest.fun), abs=1e-7)


def test_distance_broadcasts_and_takes_single_and_no_points() -> None:
    assert DISC.distance(np.zeros((2, 5, 3))).shape == (2, 5)
    assert DISC.distance(np.zeros((0, 3))).shape == (0,)
    assert DISC.distance(np.array([5e-3, 0, 0])) == pytest.approx(3e-3)
    assert DISC.distance(np.array([5e-3, 0, 4.5e-3])) == pytest.approx(5e-3)  # from the rim: 3-4-5


def test_radius_is_that_of_the_rim() -> None:
    assert PIN.radius == pytest.approx(np.sqrt(0.5**2 + 1.5**2) * 1e-3)


@pytest.mark.parametrize("hull", [DISC, PIN])
def test_offset_points_lie_at_their_distance(hull: CylinderHull) -> None:
    distances = np.array([1e-6, 0.5e-3, 2e-3, 50e-3])
    points = hull.offset_points(distances, 500, np.random.default_rng(2))
    assert points.shape == (4, 500, 3)
    np.testing.assert_allclose(hull.distance(points), np.broadcast_to(distances[:, None], (4, 500)), rtol=1e-9)


@pytest.mark.parametrize("hull", [DISC, PIN])
@pytest.mark.parametrize("distance", [0.0, 0.5e-3, 20e-3])
def test_offset_points_are_uniform_over_the_area(hull: CylinderHull, distance: float) -> None:
    # Uniform over a surface of revolution: the area below height z is the cumulated probability of z,
    # that inside radius rho on the caps likewise. Areas by trapezoids along a fine profile, not closed forms.
    profile = _profile(hull, distance)
    rho, z = profile[:, 0], profile[:, 1]
    band = np.pi * (rho[1:] + rho[:-1]) * np.hypot(np.diff(rho), np.diff(z))
    share = np.concatenate([[0.0], np.cumsum(band)]) / band.sum()

    points = hull.offset_points(np.array([distance]), 20_000, np.random.default_rng(3))[0]
    along = _along_profile(hull, distance, points)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(rho), np.diff(z)))])
    assert kstest(np.interp(along, arc, share), "uniform").pvalue > 1e-3
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    assert kstest((azimuth + np.pi) / (2 * np.pi), "uniform").pvalue > 1e-3


def _profile(hull: CylinderHull, distance: float) -> np.ndarray:
    """The half section of the offset surface from the lower pole to the upper, (n, 2) rho and z."""
    radius, half = hull.diameter / 2, hull.length / 2
    turn = np.linspace(0, np.pi / 2, 400)
    face = np.stack([np.linspace(0, radius, 400), np.full(400, half + distance)], axis=1)
    rim = np.stack([radius + distance * np.sin(turn), half + distance * np.cos(turn)], axis=1)
    upper = np.concatenate([face, rim])
    return np.concatenate([upper * [1, -1], upper[::-1]])


def _along_profile(hull: CylinderHull, distance: float, points: np.ndarray) -> np.ndarray:
    """Arc length of each point along `_profile`, from the lower pole."""
    radius, half = hull.diameter / 2, hull.length / 2
    rho, z = np.hypot(points[:, 0], points[:, 1]), np.abs(points[:, 2])
    angle = np.arctan2(np.maximum(rho - radius, 0), np.maximum(z - half, 0))
    if distance == 0:
        angle = np.where(z < half * (1 - 1e-12), np.pi / 2, 0.0)
    quarter = radius + distance * np.pi / 2 + half
    from_pole = np.minimum(rho, radius) + distance * angle + np.where(z < half * (1 - 1e-12), half - z, 0)
    return np.where(points[:, 2] < 0, from_pole, 2 * quarter - from_pole)


def test_shell_holds_what_lies_between_its_distances() -> None:
    heights = np.array([0.0, 0.9e-3, 1.0e-3, 1.1e-3, 6.4e-3, 6.5e-3, 6.6e-3])  # the face is at 0.5 mm
    points = np.stack([np.zeros(7), np.zeros(7), heights], axis=-1)
    assert SHELL.contains(points).tolist() == [False, False, True, True, True, True, False]
    assert SHELL.contains(points.reshape(1, 7, 3)).shape == (1, 7)
    assert SHELL.contains(np.zeros((0, 3))).shape == (0,)


def test_points_one_by_one_are_in_the_shell_as_many_at_once_are() -> None:
    """All round and in windows, on their limits and where there is no number."""
    hull = CylinderHull(4e-3, 1e-3)
    windows = [{}, {"z": (1e-3, 3e-3)}, {"rho": (1e-3, 4e-3)}, {"z": (-np.inf, 2e-3), "rho": (0.0, 4e-3)}]
    grid = np.stack(np.meshgrid(*[np.linspace(-5e-3, 5e-3, 11)] * 3), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, [[np.nan, 0, 3e-3], [0, 0, np.nan], [np.inf, 0, 0]]])
    for window in windows:
        region = Shell(hull, 0.5e-3, 3e-3, **window)
        at_once = region.contains(points)
        assert [bool(region.contains(point)) for point in points] == at_once.tolist()
        assert 0 < at_once.sum() < len(grid) and not at_once[-3:].any()
        low, high = region.z
        height, rho = points[at_once, 2], np.hypot(points[at_once, 0], points[at_once, 1])
        assert np.all((height >= low - 1e-12) & (height <= high + 1e-12))
        assert np.all((rho >= region.rho[0] - 1e-12) & (rho <= region.rho[1] + 1e-12))


def test_a_ring_bore_is_not_part_of_the_region() -> None:
    assert not SHELL.contains(np.zeros(3))


def test_layers_reach_both_limits_and_lie_in_the_region() -> None:
    layers = SHELL.layers(np.random.default_rng(4))
    assert layers.shape == (64, 40, 3)
    assert SHELL.contains(layers).all()
    distances = DISC.distance(layers)
    np.testing.assert_allclose(distances, np.broadcast_to(distances[:, :1], (64, 40)), rtol=1e-9)
    assert distances[0, 0] == pytest.approx(0.5e-3) and distances[-1, 0] == pytest.approx(6e-3)
    assert (np.diff(distances[:, 0]) > 0).all()
    assert np.median(distances[:, 0]) < 3.25e-3  # denser where the field is steeper


def test_the_same_seed_gives_the_same_layers() -> None:
    first, second = (SHELL.layers(np.random.default_rng(5), 8, 4) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_placed_region_moves_with_its_pose() -> None:
    pose = RigidTransform.from_components([0.01, 0.02, 0.03], Rotation.from_rotvec([0.4, -1.0, 0.2]))
    placed = PlacedRegion(SHELL, pose)
    local = np.random.default_rng(6).uniform(-8e-3, 8e-3, (6, 50, 3))
    world = pose.apply(local.reshape(-1, 3)).reshape(local.shape)
    np.testing.assert_array_equal(placed.contains(world), SHELL.contains(local))
    assert "placed at (10, 20, 30) mm" in placed.describe()


def test_an_intersection_holds_what_all_hold() -> None:
    both = Intersection((SHELL, Shell(PIN, 1e-3, 3e-3)))
    points = np.random.default_rng(7).uniform(-8e-3, 8e-3, (200, 3))
    expected = both.regions[0].contains(points) & both.regions[1].contains(points)
    np.testing.assert_array_equal(both.contains(points), expected)


def test_everywhere_leaves_out_only_what_is_not_finite() -> None:
    points = np.array([[1e9, 0, 0], [np.nan, 0, 0], [0, np.inf, 0]])
    assert Everywhere().contains(points).tolist() == [True, False, False]


def test_shell_describes_itself_in_millimetres() -> None:
    assert SHELL.describe() == "0.5 to 6 mm from the body's hull, all round"


@pytest.mark.parametrize("region", [Everywhere(), SHELL])
def test_regions_survive_a_model_file(region: Everywhere | Shell) -> None:
    assert region_from_dict(region_to_dict(region)) == region


def test_hulls_survive_a_model_file() -> None:
    assert hull_from_dict(hull_to_dict(PIN)) == PIN


def test_unknown_kinds_are_refused() -> None:
    with pytest.raises(InputError, match="unknown hull kind 'cone'; known: cylinder"):
        hull_from_dict({"kind": "cone"})
    with pytest.raises(InputError, match="unknown region kind None; known: everywhere, shell"):
        region_from_dict({})


def test_layers_meet_axis_edges_and_every_part() -> None:
    """What uniform points hardly ever meet: the axis, the equator, the ends of wall and face, at every distance."""
    layers = SHELL.layers(np.random.default_rng(0), 16, 24)
    hull = SHELL.hull
    rho, z = np.hypot(layers[..., 0], layers[..., 1]), np.abs(layers[..., 2])
    distance = hull.distance(layers)
    assert np.allclose(distance, distance[:, :1], atol=1e-12)
    assert np.all(rho.min(axis=1) <= 1e-3 * hull.diameter)
    assert np.all(z.min(axis=1) <= 1e-3 * hull.length)
    for on_part in (z <= hull.length / 2, rho <= hull.diameter / 2):
        assert np.all(on_part.sum(axis=1) >= 4)
