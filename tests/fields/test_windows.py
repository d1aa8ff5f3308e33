"""Windows of shells, balls and boxes: where their random points lie, and what model files say of them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from magfem.errors import CardError, InputError
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Everywhere, Intersection, Shell
from magfem.fields.region_json import region_from_dict, region_to_dict
from magfem.fields.workspace_region import Ball, Box
from magfem.fitting import load_model

SHELL = Shell(CylinderHull(4e-3, 1e-3), 0.5e-3, 6e-3)
FRONT = replace(SHELL, z=(1e-3, 6e-3), rho=(0.0, 6e-3))
SIDE = replace(SHELL, z=(0.0, 6e-3), rho=(3e-3, 6e-3))
BEHIND = replace(SHELL, z=(-math.inf, -2e-3))
WINDOWS = pytest.mark.parametrize("window", [FRONT, SIDE, BEHIND], ids=["front", "side", "behind"])
BALL = Ball((1e-3, -2e-3, 3e-3), 5e-3)
BOX = Box((-1e-3, 0.0, 2e-3), (1e-3, 4e-3, 3e-3))


def hull_distance(points):
    """To a cylinder of diameter 4 mm and length 1 mm about the origin, m."""
    beside = np.maximum(np.hypot(points[..., 0], points[..., 1]) - 2e-3, 0)
    return np.hypot(beside, np.maximum(np.abs(points[..., 2]) - 0.5e-3, 0))


def by_hand(window: Shell, points):
    """Inside the window and the shell, to 1e-12 m."""
    z, rho, distance = points[..., 2], np.hypot(points[..., 0], points[..., 1]), hull_distance(points)
    inside = (distance >= window.clearance - 1e-12) & (distance <= window.extent + 1e-12)
    for value, (low, high) in ((z, window.z), (rho, window.rho)):
        inside &= (value >= low - 1e-12) & (value <= high + 1e-12)
    return inside


@WINDOWS
def test_points_of_windows_lie_inside(window) -> None:
    points = window.layers(np.random.default_rng(1), 20, 30, 5)
    assert points.shape == (25, 30, 3)
    assert by_hand(window, points).all() and window.contains(points).all()


@WINDOWS
def test_windows_contain_what_lies_between_their_limits(window) -> None:
    points = np.random.default_rng(2).uniform(-9e-3, 9e-3, (4000, 3))
    expected = by_hand(window, points)
    assert np.array_equal(window.contains(points), expected) and 20 < expected.sum() < 3000
    assert window.windowed and not SHELL.windowed


@WINDOWS
def test_layers_of_windows_go_outwards(window) -> None:
    """Each layer begins where the one before ends, and none is thick where the field is steep."""
    distance = hull_distance(window.layers(np.random.default_rng(3), 30, 40)).reshape(30, 40)
    assert np.all(distance[1:].min(axis=1) >= distance[:-1].max(axis=1) - 1e-12)
    assert np.ptp(distance, axis=1).max() < 1.5e-3 and np.median(np.ptp(distance, axis=1)) < 0.3e-3


@pytest.mark.parametrize(
    ("window", "on_near_side"),
    [
        (FRONT, lambda p: np.isclose(p[..., 2], 1e-3, atol=1e-12)),
        (SIDE, lambda p: np.isclose(np.hypot(p[..., 0], p[..., 1]), 3e-3, atol=1e-12)),
        (BEHIND, lambda p: np.isclose(p[..., 2], -2e-3, atol=1e-12)),
    ],
    ids=["front", "side", "behind"],
)
def test_nearest_points_lie_on_the_near_side(window, on_near_side) -> None:
    nearest = window.layers(np.random.default_rng(4), 10, 30, 6)[10:]
    assert on_near_side(nearest).all() and by_hand(window, nearest).all()
    distance = hull_distance(nearest)
    assert distance.min() == pytest.approx(
        hull_distance(window.layers(np.random.default_rng(5), 64, 40)).min(), rel=0.1
    )


def test_nearest_points_of_a_shell_lie_at_its_clearance() -> None:
    nearest = SHELL.layers(np.random.default_rng(4), 10, 30, 6)[10:]
    np.testing.assert_allclose(hull_distance(nearest), 0.5e-3, rtol=1e-9)


@pytest.mark.parametrize("region", [SHELL, FRONT, SIDE, BEHIND, BALL, BOX])
def test_points_follow_from_their_seed(region) -> None:
    one, same, other = (region.layers(np.random.default_rng(seed), 6, 20, 2) for seed in (7, 7, 8))
    assert np.array_equal(one, same) and not np.array_equal(one, other)


def test_windows_without_room_are_refused() -> None:
    with pytest.raises(InputError, match=r"hardly any point lies in the region: 0.5 to 6 mm .* z ≥ 20 mm"):
        replace(SHELL, z=(20e-3, math.inf)).layers(np.random.default_rng(0), 4, 5)


def test_points_of_workspaces_lie_inside_and_fill_them() -> None:
    (ball,), (box,) = BALL.layers(np.random.default_rng(1), 40, 50), BOX.layers(np.random.default_rng(1), 40, 50)
    distance = np.linalg.norm(ball - BALL.centre, axis=1)
    assert distance.max() == pytest.approx(5e-3, rel=1e-9) and BALL.contains(ball).all()
    within = distance[distance < 5e-3 * (1 - 1e-9)]
    assert np.mean(within < 5e-3 * 0.5 ** (1 / 3)) == pytest.approx(0.5, abs=0.06)  # half the volume
    assert box.min(axis=0).tolist() == list(BOX.low) and box.max(axis=0).tolist() == list(BOX.high)
    assert BOX.contains(box).all()


@pytest.mark.parametrize(
    ("region", "words"),
    [
        (SHELL, "0.5 to 6 mm from the body's hull, all round"),
        (FRONT, "0.5 to 6 mm from the body's hull, z from 1 to 6 mm and ρ ≤ 6 mm"),
        (SIDE, "0.5 to 6 mm from the body's hull, z from 0 to 6 mm and ρ from 3 to 6 mm"),
        (BEHIND, "0.5 to 6 mm from the body's hull, z ≤ -2 mm"),
        (BALL, "within 5 mm of (1, -2, 3) mm"),
        (BOX, "x, y, z from -1 to 1, 0 to 4, 2 to 3 mm"),
    ],
)
def test_regions_say_where_they_are(region, words) -> None:
    assert region.describe() == words


# Model files


@pytest.mark.parametrize("region", [SHELL, FRONT, SIDE, BEHIND, BALL, BOX, Everywhere()])
def test_regions_come_back_from_json(region) -> None:
    text = json.dumps(region_to_dict(region), allow_nan=False)
    assert region_from_dict(json.loads(text)) == region


def damaged(region: Any, **changes: Any) -> dict[str, Any]:
    return json.loads(json.dumps({**region_to_dict(region), **changes}))


@pytest.mark.parametrize(
    "data",
    [
        damaged(SHELL, clearance=-1e-3),
        damaged(SHELL, clearance=6e-3),
        damaged(SHELL, clearance="1 mm"),
        damaged(FRONT, z=[2e-3, 1e-3]),
        damaged(FRONT, z=[1e-3]),
        damaged(FRONT, z=1e-3),
        damaged(FRONT, rho=[-1e-3, 1e-3]),
        damaged(FRONT, rho=[2e-3, 2e-3]),
        damaged(FRONT, rho=["0", None]),
        damaged(SHELL, hull={}),
        damaged(BALL, radius=0.0),
        damaged(BALL, radius=None),
        damaged(BALL, centre=[0.0, 0.0]),
        damaged(BALL, centre="origin"),
        damaged(BOX, low=[0.0, 5e-3, 0.0]),
        damaged(BOX, high=[1e-3, 4e-3, None]),
        damaged(BOX, low=[math.nan, 0.0, 0.0]),
        damaged(BOX, kind="cube"),
        {"kind": "ball"},
        {"kind": "box", "low": [0, 0, 0]},
        {"kind": "shell"},
        {},
    ],
)
def test_damaged_regions_are_refused_by_the_model_file(data, tmp_path) -> None:
    whole = load_model("ring_magnet_4x1.5x1").to_dict()
    path = tmp_path / "damaged.json"
    path.write_text(json.dumps({**whole, "region": data}))
    with pytest.raises(CardError, match=r"not a whole field model: .*: region]") as refused:
        load_model(path)
    assert "\n" not in str(refused.value)


def test_other_regions_are_in_no_model_file() -> None:
    with pytest.raises(InputError, match="of type Intersection cannot be written"):
        region_to_dict(Intersection((SHELL, BALL)))


def test_window_that_begins_at_the_clearance_of_a_thin_body_has_its_near_points_there() -> None:
    """Half a coil's thickness makes its plane z = clearance lie nearer to the hull than the clearance."""
    thin = Shell(CylinderHull(12e-3, 9e-6), 0.5e-3, 5e-3, (0.5e-3, 5e-3), (0.0, 6e-3))
    points = thin.layers(np.random.default_rng(0), 8, 20, 10)
    assert thin.contains(points).all()
    np.testing.assert_allclose(thin.hull.distance(points[8:]), 0.5e-3, rtol=1e-9)
