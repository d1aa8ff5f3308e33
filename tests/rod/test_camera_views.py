"""Centrelines from pictures without matched points, and the simulated pictures themselves."""

from __future__ import annotations

import numpy as np
import pytest
from rod.curves import LENGTH, circle, jointed
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from magfem.errors import InputError
from magfem.rod import (
    Camera,
    fit_centreline,
    fit_centreline_to_views,
    magnet_poses,
    simulate_views,
    triangulate,
)
from magfem.rod.camera_views import match_lines

CAMERAS = (
    Camera.looking_at((0, 0, 0.02), (0.3, 0.0, 0.02), 6000.0, (640.0, 512.0)),
    Camera.looking_at((0, 0, 0.02), (0.0, 0.3, 0.06), 6000.0, (640.0, 512.0)),
)
THIRD = Camera.looking_at((0, 0, 0.02), (-0.15, 0.15, 0.25), 6000.0, (640.0, 512.0))
S = np.linspace(0, LENGTH, 120)
OBLIQUE = Rotation.from_rotvec([0.3, -0.2, 0.5])  # the rod's plane lies askew to both cameras
BENDS, LENGTHS, STRAIGHT = (0.9, 0.0, -0.7, 0.0), (0.02, 0.005, 0.02, 0.005), ((0.02, 0.025), (0.045, 0.05))


def test_simulated_pictures_have_the_noise_and_shares_asked_for():
    points = OBLIQUE.apply(circle(np.linspace(0, LENGTH, 20000), 1.0)[0])
    views = simulate_views(CAMERAS, points, np.random.default_rng(1), noise=0.4, missing=0.3, outliers=0.1)
    for camera, view in zip(CAMERAS, views, strict=True):
        good = view.labels >= 0
        assert len(view.pixels) == pytest.approx(14000, abs=5 * np.sqrt(20000 * 0.21))
        assert np.mean(~good) == pytest.approx(0.1, abs=5 * np.sqrt(0.09 / 14000))
        away = view.pixels[good] - camera.project(points[view.labels[good]])
        assert np.sum(away**2) / 0.16 == pytest.approx(away.size, abs=5 * np.sqrt(2 * away.size))
    again = simulate_views(CAMERAS, points, np.random.default_rng(1), noise=0.4, missing=0.3, outliers=0.1)
    assert np.array_equal(views[0].pixels, again[0].pixels)


def test_matched_points_triangulate_to_a_centreline():
    """Markers that both cameras recognise: the way by triangulation and the cloud."""
    points, _ = circle(S, 1.2)
    views = simulate_views(CAMERAS, points, np.random.default_rng(2), noise=0.3, missing=0.2)
    labels, first, second = np.intersect1d(views[0].labels, views[1].labels, return_indices=True)
    cloud = triangulate(CAMERAS, [views[0].pixels[first], views[1].pixels[second]]).points
    found = fit_centreline(cloud, LENGTH, (0, 0, 0), arc_lengths=S[labels])
    deviation = np.sqrt(np.trace(found.position_covariance(S[1:]), axis1=1, axis2=2))
    assert np.all(np.linalg.norm(found.position(S[1:]) - points[1:], axis=-1) < 5 * deviation)


@pytest.mark.parametrize("bend", [0.05, 1.0, 2.0])
def test_exact_pictures_give_the_curve_back(bend):
    points = OBLIQUE.apply(circle(S, bend)[0])
    pixels = [camera.project(points)[::-1] for camera in CAMERAS]
    found = fit_centreline_to_views(CAMERAS, pixels, LENGTH, (0, 0, 0), degree=10)
    assert np.allclose(found.position(S), points, atol=1e-7)
    assert found.noise < 1e-3


def test_lines_are_matched_by_their_epipolar_planes():
    """The same curve sampled differently in the two pictures: matched nodes show one place."""
    s = LENGTH * np.linspace(0, 1, 80) ** 1.5
    other = LENGTH * np.linspace(0, 1, 70) ** 0.8
    lines = [camera.project(OBLIQUE.apply(circle(at, 1.2)[0])) for camera, at in zip(CAMERAS, (s, other), strict=True)]
    first, second = match_lines(CAMERAS, lines)
    assert np.abs(s[first] - other[second]).max() < 0.03 * LENGTH
    assert np.all(np.diff(first) >= 0) and np.all(np.diff(second) >= 0)


@pytest.mark.parametrize("outliers", [0.0, 0.2])
def test_pictures_scatter_as_stated(outliers):
    """100 pairs of pictures, cold: Mahalanobis distances of position at two places follow χ²(3) within one in a
    thousand, and 10 % for the linearised, estimated covariance."""
    rng = np.random.default_rng(4)
    at = np.array([0.02, 0.05])
    points, exact = OBLIQUE.apply(circle(S, 1.3)[0]), OBLIQUE.apply(circle(at, 1.3)[0])
    sums, noise = np.zeros(2), []
    for _ in range(100):
        views = simulate_views(CAMERAS, points, rng, noise=0.5, missing=0.1, outliers=outliers)
        found = fit_centreline_to_views(CAMERAS, [view.pixels for view in views], LENGTH, (0, 0, 0))
        away = found.position(at) - exact
        sums += np.einsum("ni,ni->n", away, np.linalg.solve(found.position_covariance(at), away[..., None])[..., 0])
        noise.append(found.noise)
    low, high = chi2.ppf([0.0005, 0.9995], 300)
    assert np.all((0.9 * low < sums) & (sums < 1.1 * high)), sums / 300
    assert np.mean(noise) == pytest.approx(0.5, rel=0.05)


def test_rods_of_all_shapes_are_found_cold():
    """60 rods of two arcs and two magnets, bent up to 1.5 rad either way, 15 % outliers: none is lost."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        bends = (rng.uniform(-1.5, 1.5), 0.0, rng.uniform(-1.5, 1.5), 0.0)
        turn = Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)])
        points = turn.apply(jointed(S, bends, LENGTHS)[0])
        views = simulate_views(CAMERAS, points, rng, noise=0.5, outliers=0.15)
        found = fit_centreline_to_views(
            CAMERAS, [v.pixels for v in views], LENGTH, (0, 0, 0), base_tangent=(0, 0, 1), straight=STRAIGHT, degree=4
        )
        assert np.linalg.norm(found.position(S) - points, axis=-1).max() < 3e-4


def test_fits_follow_a_moving_rod():
    """A rod that swings through its straight shape, seen with noise, gaps and outliers, each fit from the last one.

    It swings until it points nearly into the first camera: the third holds it there.
    """
    magnets, cameras = np.array([0.0225, 0.0475]), (*CAMERAS, THIRD)
    rng, last, errors, expected = np.random.default_rng(6), None, [], []
    for swing in np.linspace(-1, 1, 41):
        bends = (1.2 * swing, 0.0, 0.9 * swing, 0.0)
        views = simulate_views(cameras, jointed(S, bends, LENGTHS)[0], rng, missing=0.1, outliers=0.1)
        last = fit_centreline_to_views(
            cameras,
            [view.pixels for view in views],
            LENGTH,
            (0, 0, 0),
            base_tangent=(0, 0, 1),
            straight=STRAIGHT,
            degree=4,
            start=last,
        )
        poses = magnet_poses(last, magnets)
        errors.append(poses.directions - jointed(magnets, bends, LENGTHS)[1])
        expected.append(poses.direction_covariance)
    measured = np.sqrt(np.mean(np.sum(np.square(errors), axis=-1)))
    assert measured == pytest.approx(np.sqrt(np.mean(np.trace(expected, axis1=2, axis2=3))), rel=0.25)
    assert np.degrees(measured) < 0.3


def test_a_curve_that_strays_where_nothing_was_seen_shows_its_gap():
    """The last sixth of the rod is hidden from both cameras: the gap is as wide as that stretch in the pictures."""
    points, _ = circle(S, 0.6)
    hidden = int(0.83 * S.size)
    pixels = [camera.project(points) for camera in CAMERAS]
    whole = fit_centreline_to_views(CAMERAS, pixels, LENGTH, (0, 0, 0))
    part = fit_centreline_to_views(CAMERAS, [view[:hidden] for view in pixels], LENGTH, (0, 0, 0))
    assert whole.gap < np.linalg.norm(np.diff(pixels[1], axis=0), axis=-1).max()
    assert part.gap == pytest.approx(np.linalg.norm(pixels[1][-1] - pixels[1][hidden - 1]), rel=0.05)


def test_seen_poses_agree_with_poses_of_the_curve():
    points, _ = circle(S, 1.0)
    pixels = [camera.project(points) for camera in CAMERAS]
    found = magnet_poses(fit_centreline_to_views(CAMERAS, pixels, LENGTH, (0, 0, 0), degree=9), [0.01, 0.04])
    exact, tangent = circle(np.array([0.01, 0.04]), 1.0)
    assert np.allclose(found.positions, exact, atol=1e-7) and np.allclose(found.directions, tangent, atol=1e-5)


PIXELS = [camera.project(circle(S, 1.0)[0]) for camera in CAMERAS]
TOGETHER = Camera.looking_at((0, 0, 0.0), (0.6, 0.0, 0.04), 6000.0)


@pytest.mark.parametrize(
    ("cameras", "pixels", "words"),
    [
        (CAMERAS[:1], PIXELS[:1], "at least two cameras"),
        (CAMERAS, PIXELS[:1], "at least two cameras"),
        (CAMERAS, [PIXELS[0], PIXELS[1][:4]], "4 points cannot fix"),
        (CAMERAS, [PIXELS[0], np.full((50, 2), np.nan)], "pixels must be finite"),
        (CAMERAS, [PIXELS[0], PIXELS[1].ravel()], "pixels must be an array of shape"),
        ((CAMERAS[0], CAMERAS[0]), [PIXELS[0], PIXELS[0]], "from one direction"),
        (
            (Camera.looking_at((0, 0, 0), (0.3, 0.0, 0.02), 6000.0), TOGETHER),
            PIXELS,
            "from one direction",
        ),
    ],
)
def test_pictures_without_depth_are_refused(cameras, pixels, words):
    with pytest.raises(InputError, match=words) as error:
        fit_centreline_to_views(cameras, pixels, LENGTH, (0, 0, 0))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("change", [{"noise": -1.0}, {"missing": 1.0}, {"outliers": np.nan}])
def test_pictures_that_cannot_be_simulated_are_refused(change):
    with pytest.raises(InputError, match="views: noise"):
        simulate_views(CAMERAS, circle(S, 1.0)[0], np.random.default_rng(0), **change)
