"""Ellipses by conic least squares: known ellipses, and NumPy's own least squares of the same conic."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.localization.ellipse_fit import principal_axes


def ellipse(major, minor, tilt, centre=(0.0, 0.0), count=40):
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False) + 0.1
    x, y = major * np.cos(angle), minor * np.sin(angle)
    return np.column_stack([x * np.cos(tilt) - y * np.sin(tilt), x * np.sin(tilt) + y * np.cos(tilt)]) + centre


@pytest.mark.parametrize("scale", [1.0, 2e-5])
@pytest.mark.parametrize("tilt", [0.0, 0.7, 2.0])
def test_known_ellipses_come_back(scale, tilt):
    major, minor = principal_axes(scale * ellipse(2.0, 1.2, tilt, (0.3, -0.5)))
    assert np.hypot(*major) == pytest.approx(2.0 * scale, rel=1e-9)
    assert np.hypot(*minor) == pytest.approx(1.2 * scale, rel=1e-9)
    assert abs(major @ [np.cos(tilt), np.sin(tilt)]) == pytest.approx(2.0 * scale, rel=1e-9)
    assert abs(major @ minor) < 1e-9 * scale**2


def test_part_of_an_ellipse_is_enough():
    major, minor = principal_axes(ellipse(2.0, 1.2, 0.4)[:12])
    assert np.hypot(*major) == pytest.approx(2.0, rel=1e-6)
    assert np.hypot(*minor) == pytest.approx(1.2, rel=1e-6)


def test_noisy_points_keep_to_the_least_squares_conic():
    points = ellipse(2.0, 1.2, 0.4) + np.random.default_rng(1).normal(0, 0.05, (40, 2))
    x, y = (points - points.mean(axis=0)).T
    a, b, c, d, e = np.linalg.lstsq(np.column_stack([x * x, x * y, y * y, x, y]), np.ones(40), rcond=None)[0]
    for axis in principal_axes(points):  # both ends of both axes are on the conic, and its normal there is the axis
        form = np.array([[a, b / 2], [b / 2, c]])
        centre = np.linalg.solve(2 * form, [-d, -e])
        for end in (centre + axis, centre - axis):
            assert end @ form @ end + end @ [d, e] == pytest.approx(1.0, rel=1e-9)
            normal = 2 * form @ end + [d, e]
            assert abs(normal[0] * axis[1] - normal[1] * axis[0]) < 1e-9


def test_missing_points_do_not_count():
    points = ellipse(2.0, 1.2, 0.4) + np.random.default_rng(1).normal(0, 0.05, (40, 2))
    gaps = points.copy()
    gaps[[3, 11, 12], 0] = np.nan
    expected = principal_axes(np.delete(points, [3, 11, 12], axis=0))
    for found, wanted in zip(principal_axes(np.stack([gaps, gaps])), expected, strict=True):
        np.testing.assert_allclose(np.abs(found), np.broadcast_to(np.abs(wanted), (2, 2)), rtol=1e-9)


def test_what_is_no_ellipse_is_nan():
    t = np.linspace(-2, 2, 30)
    hyperbola = np.concatenate([np.column_stack([s * np.cosh(t), np.sinh(t)]) for s in (1, -1)])
    for points in (hyperbola, np.zeros((10, 2)), ellipse(2.0, 1.0, 0.0)[:4]):
        assert np.isnan(principal_axes(points)).all()
