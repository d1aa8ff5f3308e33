"""Cameras against geometry by hand, triangulation against stereo's depth formula and against the scatter of noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import chi2

from magfem.errors import InputError
from magfem.rod import Camera, triangulate

RNG = np.random.default_rng
POINTS = RNG(1).uniform(-0.03, 0.03, (50, 3))
PAIR = (
    Camera.looking_at((0, 0, 0), (0.4, 0.0, 0.1), 3000.0, (640.0, 512.0)),
    Camera.looking_at((0, 0, 0), (0.1, 0.4, -0.05), 3500.0, (600.0, 500.0)),
)


def test_projection_by_hand():
    """A camera at (1, 2, 3) m that looks along −z of the world, its x along the world's x: y is down, so −y."""
    turn = Rotation.from_matrix(np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]))
    camera = Camera((800.0, 900.0), (320.0, 240.0), RigidTransform.from_components([1.0, 2.0, 3.0], turn))
    assert np.allclose(camera.project([1.5, 2.25, 1.0]), [320 + 800 * 0.5 / 2, 240 - 900 * 0.25 / 2])
    assert np.allclose(camera.project([1.0, 2.0, -5.0]), [320, 240])
    assert np.array_equal(camera.centre, [1, 2, 3])


def test_projection_by_homogeneous_coordinates():
    """K [R | t] X, divided by its third coordinate, with R and t from the pose's own definition."""
    for camera in PAIR:
        R, c = camera.pose.rotation.as_matrix(), camera.pose.translation
        K = np.array(
            [
                [camera.focal_length[0], 0, camera.principal_point[0]],
                [0, camera.focal_length[1], camera.principal_point[1]],
                [0, 0, 1],
            ]
        )
        P = K @ np.hstack([R.T, -R.T @ c[:, None]])
        x = np.hstack([POINTS, np.ones((50, 1))]) @ P.T
        assert np.allclose(camera.project(POINTS), x[:, :2] / x[:, 2:], rtol=1e-12)
        assert np.allclose(camera.matrix, P, atol=1e-9)


def test_looking_at():
    """The target is in the middle, up is up (pixels count downwards), and right is right."""
    camera = Camera.looking_at((0, 0, 0), (0.5, 0, 0), 1000.0, (320, 240))
    assert np.allclose(camera.project([0, 0, 0]), [320, 240])
    assert np.allclose(camera.project([0, 0, 0.05]), [320, 240 - 100])
    assert np.allclose(camera.project([0, 0.05, 0]), [320 + 100, 240])  # looking along −x, +y is to the right
    assert np.linalg.det(camera.axes) == pytest.approx(1)


def test_rays_pass_through_their_points():
    for camera in PAIR:
        rays = camera.rays(camera.project(POINTS))
        assert np.allclose(np.cross(rays, POINTS - camera.centre), 0, atol=1e-15)
        assert np.all(np.sum(rays * (POINTS - camera.centre), axis=-1) > 0)


def test_derivative_of_projection():
    h = 1e-6
    for camera in PAIR:
        exact = camera.project_with_derivative(POINTS)[1]
        for axis, shift in enumerate(h * np.eye(3)):
            difference = (camera.project(POINTS + shift) - camera.project(POINTS - shift)) / (2 * h)
            assert np.allclose(exact[..., axis], difference, rtol=1e-6, atol=1e-3)


def test_exact_pixels_give_the_points_back():
    found = triangulate(PAIR, [camera.project(POINTS) for camera in PAIR])
    assert np.allclose(found.points, POINTS, atol=1e-13)
    assert found.residuals.max() < 1e-9
    third = Camera.looking_at((0, 0, 0), (-0.2, 0.1, 0.4), 2000.0)
    assert np.allclose(
        triangulate((*PAIR, third), [c.project(POINTS) for c in (*PAIR, third)]).points, POINTS, atol=1e-13
    )


def test_side_by_side_cameras_give_depth_by_disparity():
    """Z = f b / d: the textbook's formula for two cameras with parallel axes, b apart."""
    f, b = 1200.0, 0.06
    pair = [Camera((f, f), (0, 0), RigidTransform.from_translation([x, 0, 0])) for x in (0.0, b)]
    left, right = np.array([[100.0, 40.0], [-30.0, 5.0]]), np.array([[20.0, 40.0], [-90.0, 5.0]])
    depth = f * b / (left[:, 0] - right[:, 0])
    exact = np.stack([left[:, 0] * depth / f, left[:, 1] * depth / f, depth], -1)
    assert np.allclose(triangulate(pair, [left, right]).points, exact, rtol=1e-12)
    # And its error: σ_Z = Z²/(f b) σ_d with σ_d = √2 σ.
    deviation = np.sqrt(triangulate(pair, [left, right]).unit_covariance[:, 2, 2])
    assert np.allclose(deviation, depth**2 / (f * b) * np.sqrt(2), rtol=0.02)


def test_scatter_is_as_stated():
    """Mahalanobis distances of 4000 noisy points follow χ²(3); residuals have the one degree of freedom left."""
    points = RNG(2).uniform(-0.03, 0.03, (4000, 3))
    noise = RNG(3).normal(0, 0.7, (2, 4000, 2))
    found = triangulate(PAIR, np.array([c.project(points) for c in PAIR]) + noise)
    away = found.points - points
    sums = np.einsum("ni,nij,nj->", away, np.linalg.inv(0.7**2 * found.unit_covariance), away)
    low, high = chi2.ppf([0.0005, 0.9995], 12000)
    assert low < sums < high
    low, high = chi2.ppf([0.0005, 0.9995], 4000)
    assert low < np.sum(4 * found.residuals**2) / 0.7**2 < high


EXACT = np.array([camera.project(POINTS) for camera in PAIR])
BESIDE = Camera.looking_at((0, 0, 0), (-0.4, 0.0, -0.1), 3000.0)


@pytest.mark.parametrize(
    ("cameras", "pixels", "words"),
    [
        (PAIR[:1], EXACT[:1], "at least two cameras"),
        (PAIR, EXACT[:1], r"shape \(2, n, 2\)"),
        (PAIR, np.where(EXACT > 700, np.nan, EXACT), "finite; leave out"),
        ((PAIR[0], PAIR[0]), EXACT[[0, 0]], "parallel"),
        ((PAIR[0], BESIDE), np.array([[[640.0, 512.0]], [[0.0, 0.0]]]), "off the line through both"),
        (
            (Camera((1e3, 1e3), (0, 0)), Camera((1e3, 1e3), (0, 0), RigidTransform.from_translation([0.1, 0, 0]))),
            [[[0.0, 0]], [[50.0, 0]]],
            "behind a camera",
        ),
    ],
)
def test_views_without_depth_are_refused(cameras, pixels, words):
    with pytest.raises(InputError, match=words) as error:
        triangulate(cameras, pixels)
    assert "\n" not in str(error.value)


def test_cameras_that_are_none_are_refused():
    with pytest.raises(InputError, match="focal lengths"):
        Camera((0.0, 1000.0), (0, 0))
    with pytest.raises(InputError, match="focal lengths"):
        Camera((np.nan, 1000.0), (0, 0))
    with pytest.raises(InputError, match="not along `up`"):
        Camera.looking_at((0, 0, 0), (0, 0, 1), 1000.0)
    with pytest.raises(InputError, match="in front"):
        PAIR[0].project([1.0, 0, 0.2])
    with pytest.raises(InputError, match="in front"):
        PAIR[0].project([np.nan, 0, 0])
