"""Workspace maps: linear programs, all corners of the currents' box, convex hulls, and single coils by hand."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.actuation import CoilSystem, SystemCoil, workspace_map
from magfem.actuation.zonotope import farthest, reach_along, reach_in_every_direction
from magfem.errors import InputError
from magfem.fields.terms import loops, uniform

JOINTS = [0.4, -1.0]
MOMENT = np.array([0.01, 0.02, -0.03])


@pytest.fixture(scope="module")
def bigmag():
    return magfem.load_system("bigmag")


def corners(generators):
    """All the vectors that generators (3, c) make at ±1."""
    return np.array(list(product([-1, 1], repeat=generators.shape[1]))) @ generators.T


def test_reach_is_that_of_the_convex_hull():
    rng = np.random.default_rng(1)
    for c in (3, 5, 8):
        generators = rng.normal(size=(4, 3, c))
        for k in range(4):
            made = corners(generators[k])
            inside = -ConvexHull(made).equations[:, 3].max()  # the nearest facet's distance
            assert reach_in_every_direction(generators)[k] == pytest.approx(inside, rel=1e-10)
            assert farthest(generators)[k] == pytest.approx(np.linalg.norm(made, axis=1).max(), rel=1e-12)


def test_farthest_vertex_of_flat_and_repeated_generators():
    """Many in one plane, parallel ones, zeros: whole numbers, turned anyhow, against all corners."""
    rng = np.random.default_rng(2)
    for k in range(120):
        generators = rng.integers(-2, 3, size=(3, 6)).astype(float)
        if k % 3 == 0:
            generators[2] = 0
        generators = Rotation.random(rng=rng).as_matrix() @ generators
        assert farthest(generators) == pytest.approx(np.linalg.norm(corners(generators), axis=1).max(), rel=1e-9)
    line = np.outer([1, 2, 2], [1.0, -3.0, 0.5])
    assert farthest(line) == pytest.approx(13.5) and reach_in_every_direction(line) == 0
    assert farthest(line[:, :1]) == pytest.approx(3.0) and reach_in_every_direction(line[:, :1]) == 0


def test_reach_along_a_direction_is_a_linear_program(bigmag):
    """max β with Σ I_k b_k = β d, |I| ≤ 8 A."""
    points = bigmag.workspace.random_points(np.random.default_rng(3), 12)
    direction = np.array([2.0, -1, 2]) / 3
    found = workspace_map(bigmag, points, JOINTS, MOMENT, direction)
    for k, point in enumerate(points):
        rows = bigmag.unit_fields(point, JOINTS)
        forces = [bigmag.wrench(MOMENT, RigidTransform.from_translation(point), one, JOINTS)[0] for one in np.eye(6)]
        for ours, made in ((found.field_along, rows[:3]), (found.force_along, np.transpose(forces))):
            size = np.abs(made).max()
            equal = np.hstack([made / size, -direction[:, None]])
            best = linprog([0] * 6 + [-1], A_eq=equal, b_eq=np.zeros(3), bounds=[(-8, 8)] * 6 + [(0, None)])
            assert ours[k] == pytest.approx(-best.fun * size, rel=1e-7)


def test_worst_and_best_directions_bound_all_others(bigmag):
    points = bigmag.workspace.random_points(np.random.default_rng(4), 5)
    found = workspace_map(bigmag, points, JOINTS, MOMENT)
    directions = np.random.default_rng(5).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    made = 8 * bigmag.unit_fields(points, JOINTS)[:, None, :3]
    reach = reach_along(made, directions)
    assert np.all(reach >= found.field_everywhere[:, None]) and np.all(reach <= found.field_best[:, None])
    assert np.all(reach.min(axis=1) < 1.1 * found.field_everywhere)
    best = np.linalg.norm(corners(made[0, 0]), axis=1).max()
    assert found.field_best[0] == pytest.approx(best, rel=1e-12)


def test_three_crossed_coils_at_the_centre():
    """Loops about x, y, z of one kind: the zonotope is a cube of half-edge µ₀ N I / (2 a)."""
    axes = [Rotation.from_euler("y", 90, degrees=True), Rotation.from_euler("x", 90, degrees=True), Rotation.identity()]
    coils = tuple(
        SystemCoil(str(k), loops(np.zeros(3), 0.1, 100.0), pose=RigidTransform.from_rotation(axis), current_limit=2.0)
        for k, axis in enumerate(axes)
    )
    found = workspace_map(CoilSystem("crossed", coils), [[0, 0, 0]], direction=[1, 1, 0], length=0.05)
    half = 4e-7 * np.pi * 200 / 0.2
    np.testing.assert_allclose(found.field_everywhere, half, rtol=1e-9)
    np.testing.assert_allclose(found.field_best, np.sqrt(3) * half, rtol=1e-9)
    np.testing.assert_allclose(found.field_along, np.sqrt(2) * half, rtol=1e-9)
    np.testing.assert_allclose(found.condition, 1, rtol=1e-9)


def test_condition_is_that_of_the_unit_fields(bigmag):
    points = bigmag.workspace.random_points(np.random.default_rng(6), 4)
    found = workspace_map(bigmag, points, JOINTS, length=0.02, limits=2.0)
    assert found.force_best is None and found.field_along is None
    for k, point in enumerate(points):
        rows = 2 * bigmag.unit_fields(point, JOINTS) * np.array([1] * 3 + [0.02] * 5)[:, None]
        assert found.condition[k] == pytest.approx(np.linalg.cond(rows), rel=1e-9)
        assert found.smallest[k] == pytest.approx(np.linalg.svd(rows)[1][-1], rel=1e-9)


def test_grids_keep_their_shape_and_say_where_nothing_is_promised(bigmag):
    grid = np.stack(np.meshgrid(np.linspace(-0.06, 0.06, 40), [0.0], np.linspace(-0.06, 0.06, 41), indexing="ij"), -1)
    found = workspace_map(bigmag, grid, moment=MOMENT)
    assert found.field_best.shape == (40, 1, 41)
    outside = ~bigmag.workspace.contains(grid)
    for part in (found.field_everywhere, found.field_best, found.force_best, found.condition, found.smallest):
        np.testing.assert_array_equal(np.isnan(part), outside)
    assert workspace_map(bigmag, [0, 0, 0]).field_best.shape == ()


def test_wrong_input_is_one_sentence(bigmag):
    for arguments, complaint in (
        ({"moment": [0, 0, 0]}, "moment must be three finite numbers that are not all zero"),
        ({"direction": [1, 0]}, "direction must be three finite numbers"),
        ({"length": 0.0}, "length must be positive"),
        ({"limits": 0}, "limits must be positive"),
        ({"joints": [0.0]}, "has the joints gamma_bottom, gamma_top"),
    ):
        with pytest.raises(InputError, match=complaint):
            workspace_map(bigmag, [0, 0, 0], **arguments)
    with pytest.raises(InputError, match="depends on current limits"):
        workspace_map(magfem.load_system("octomag"), [0, 0, 0])
    with pytest.raises(InputError, match="depends on current limits"):
        workspace_map(CoilSystem("b", (), uniform([0, 0, 1])), [0, 0, 0])
