"""Balls and boxes: what lies within, points drawn from them, and what a larger region surely holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull, SphereHull
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Shell
from magfem.fields.workspace_region import Ball, Box, bounding_ball, surely_holds

BALL = Ball((0.01, 0.0, -0.02), 0.05)
BOX = Box((-0.01, -0.02, -0.03), (0.04, 0.05, 0.06))


@pytest.mark.parametrize(("region", "volume"), [(BALL, 4 / 3 * math.pi * 0.05**3), (BOX, 0.05 * 0.07 * 0.09)])
def test_contains_agrees_with_the_volume_and_with_one_point_at_a_time(region, volume):
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.1, 0.1, (40000, 3))
    inside = region.contains(points)
    assert inside.mean() * 0.2**3 == pytest.approx(volume, rel=0.06)  # 3 standard deviations of the count
    assert [bool(region.contains(point)) for point in points[:500]] == inside[:500].tolist()
    assert region.contains(points.reshape(4, 100, 100, 3)).shape == (4, 100, 100)


@pytest.mark.parametrize("region", [BALL, BOX])
def test_random_points_fill_the_region_to_its_edge(region):
    points = region.random_points(np.random.default_rng(2), 5000)
    ball = bounding_ball(region)
    assert points.shape == (5000, 3) and region.contains(points).all()
    distance = np.linalg.norm(points - ball.centre, axis=1)
    assert distance.max() == pytest.approx(ball.radius, rel=1e-12)  # the sphere, or a corner
    np.testing.assert_allclose(points.mean(axis=0), ball.centre, atol=0.003)


def test_bounding_ball_of_a_box_touches_its_corners():
    ball = bounding_ball(BOX)
    assert math.dist(ball.centre, BOX.low) == pytest.approx(ball.radius)
    assert math.dist(ball.centre, BOX.high) == pytest.approx(ball.radius)
    assert bounding_ball(BALL) is BALL and bounding_ball(Everywhere()) is None


POSE = RigidTransform.from_components([0.1, -0.05, 0.02], Rotation.from_rotvec([0.3, -0.2, 0.9]))
REGIONS = [
    Everywhere(),
    BALL,
    BOX,
    Shell(SphereHull(0.01), 0.02, 0.11),
    Shell(CylinderHull(0.02, 0.05), 0.005, 0.1),
    Shell(CylinderHull(0.02, 0.05), 0.005, 0.1, z=(0.02, 0.09)),
    Shell(CylinderHull(0.02, 0.05), 0.005, 0.1, rho=(0.02, 0.07)),
    PlacedRegion(Shell(CylinderHull(0.02, 0.05), 0.005, 0.1, z=(0.0, 0.09)), POSE),
]


@pytest.mark.parametrize("region", REGIONS, ids=lambda region: region.describe())
def test_a_ball_that_is_surely_held_has_all_its_points_inside(region):
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(400):
        x, y, z = rng.uniform(-0.1, 0.1, 3) + (POSE.translation if isinstance(region, PlacedRegion) else 0)
        ball = Ball((x, y, z), rng.uniform(0.001, 0.03))
        if surely_holds(region, ball):
            held += 1
            assert region.contains(ball.random_points(rng, 300)).all()
        else:
            assert not isinstance(region, Everywhere)
    assert held > 0


def test_unknown_regions_hold_nothing_for_sure():
    assert not surely_holds(Intersection((BALL, BOX)), Ball((0.01, 0.01, 0.0), 1e-3))


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan, math.inf])
def test_balls_without_a_radius_are_refused(radius):
    with pytest.raises(InputError, match="positive, finite radius"):
        Ball((0.0, 0.0, 0.0), radius)


@pytest.mark.parametrize("high", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, math.inf), (math.nan, 1.0, 1.0)])
def test_boxes_without_a_volume_are_refused(high):
    with pytest.raises(InputError, match="finite corners"):
        Box((0.0, 0.0, 0.0), high)
