"""Calibrated pinhole cameras: projection, rays, and points from what two or more of them see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import InputError
from magfem.typing import ArrayLike, Floats, Points, Vectors

_SMALLEST_ANGLE = 1e-3  # rad between rays: nearer to parallel, a pixel's error is 1000 times as large in depth
_STEPS = 4  # of Gauss–Newton on the reprojection error, from a linear start


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera without distortion (undistort the pixels first).

    focal_length: (fx, fy) px.  principal_point: (cx, cy) px.  pose: of the camera in the world; its z looks ahead, its
    x is to the right and its y down in the picture. Pixel (u, v) of a point (x, y, z) in the camera's frame is
    (fx x/z + cx, fy y/z + cy). Source: Hartley and Zisserman, Multiple View Geometry, 2nd ed., § 6.1.
    """

    focal_length: tuple[float, float]
    principal_point: tuple[float, float]
    pose: RigidTransform = field(default_factory=RigidTransform.identity)

    def __post_init__(self) -> None:
        if not (np.isfinite([*self.focal_length, *self.principal_point]).all() and min(self.focal_length) > 0):
            raise InputError("camera: focal lengths must be positive and the principal point finite, all in pixels")
        if not np.isfinite(self.pose.as_matrix()).all():
            raise InputError("camera: the pose must be finite")

    @classmethod
    def looking_at(
        cls,
        target: ArrayLike,
        position: ArrayLike,
        focal_length: float,
        principal_point: tuple[float, float] = (0.0, 0.0),
        up: ArrayLike = (0.0, 0.0, 1.0),
    ) -> Camera:
        """A camera at `position` (3,) m whose middle sees `target` (3,) m, with `up` (3,) upwards in the picture."""
        place = np.asarray(position, dtype=float)
        ahead = np.asarray(target, dtype=float) - place
        right = np.cross(ahead, np.asarray(up, dtype=float))
        if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(ahead) * np.linalg.norm(up):
            raise InputError("camera: it must look at a point other than its own, and not along `up`")
        ahead, right = ahead / np.linalg.norm(ahead), right / np.linalg.norm(right)
        turn = Rotation.from_matrix(np.stack([right, np.cross(ahead, right), ahead], axis=1))
        return cls((focal_length, focal_length), principal_point, RigidTransform.from_components(place, turn))

    @property
    def centre(self) -> Points:
        """(3,) m in the world."""
        return np.asarray(self.pose.translation)

    @cached_property
    def axes(self) -> Floats:
        """(3, 3), columns the camera's x, y and z in the world."""
        return np.asarray(self.pose.rotation.as_matrix())

    @cached_property
    def matrix(self) -> Floats:
        """P (3, 4): homogeneous pixels of homogeneous points, K [R | t]."""
        (fx, fy), (cx, cy) = self.focal_length, self.principal_point
        inner = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        return np.asarray(inner @ self.pose.inv().as_matrix()[:3])

    def project(self, points: ArrayLike) -> Floats:
        """Pixels (..., 2) of points (..., 3) m. Raises InputError for points that are not in front of the camera."""
        return self.project_with_derivative(points)[0]

    def project_with_derivative(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Pixels (..., 2) of points (..., 3) m and their derivatives (..., 2, 3) px/m."""
        seen = np.asarray(points, dtype=float) @ self.matrix[:, :3].T + self.matrix[:, 3]
        depth = seen[..., 2:]
        if not np.all(depth > 0):
            raise InputError("camera: all points must be finite and in front of the camera")
        pixels = seen[..., :2] / depth
        derivative = (self.matrix[:2, :3] - pixels[..., None] * self.matrix[2, :3]) / depth[..., None]
        return pixels, derivative

    def rays(self, pixels: ArrayLike) -> Vectors:
        """Unit vectors (..., 3) in the world from the centre towards what pixels (..., 2) show."""
        offset = (np.asarray(pixels, dtype=float) - self.principal_point) / self.focal_length
        ahead = np.concatenate([offset, np.ones((*offset.shape[:-1], 1))], axis=-1)
        found: Vectors = ahead @ self.axes.T
        found /= np.linalg.norm(found, axis=-1, keepdims=True)
        return found


@dataclass(frozen=True)
class Triangulation:
    """points: (n, 3) m.  residuals: (n,) px, root mean square over all coordinates.  unit_covariance: (n, 3, 3) m², for
    pixels with deviation 1; it scales with the square of theirs."""

    points: Points
    residuals: Floats
    unit_covariance: Floats


def triangulate(cameras: Sequence[Camera], pixels: ArrayLike) -> Triangulation:
    """Points from their pixels in two or more cameras, matched: pixels (c, n, 2), one row of n for every camera.

    Linear (DLT: two homogeneous equations a camera, smallest singular vector, in coordinates scaled to the cameras'
    distances), then Gauss–Newton on the reprojection error, which is the maximum likelihood for equal noise of all
    pixels (Hartley and Zisserman, §§ 12.2–12.5). Raises InputError for fewer than two cameras, pixels that are not
    finite, cameras in one place, and rays that are parallel or meet behind a camera.
    """
    seen = np.asarray(pixels, dtype=float)
    if len(cameras) < 2:
        raise InputError(f"triangulation: at least two cameras are needed, got {len(cameras)}")
    if seen.ndim != 3 or seen.shape[0] != len(cameras) or seen.shape[2] != 2:
        raise InputError(f"triangulation: pixels must have the shape ({len(cameras)}, n, 2), got {seen.shape}")
    if not np.isfinite(seen).all():
        raise InputError("triangulation: pixels must be finite; leave out points that one camera misses")
    rays = np.stack([camera.rays(view) for camera, view in zip(cameras, seen, strict=True)])
    widest = np.max(
        [np.linalg.norm(np.cross(rays[a], rays[b]), axis=-1) for a in range(len(rays)) for b in range(a)], axis=0
    )
    parallel = int(np.sum(widest < _SMALLEST_ANGLE))
    if parallel:
        raise InputError(
            f"triangulation: the rays of {parallel} of {seen.shape[1]} points are parallel to {_SMALLEST_ANGLE:g} rad; "
            f"place the cameras apart, with the points off the line through both"
        )
    points = _linear(cameras, seen)
    for _ in range(_STEPS):
        residual, derivative = _reprojection(cameras, seen, points)
        normal = np.einsum("cnij,cnik->njk", derivative, derivative)
        step = np.linalg.solve(normal, np.einsum("cnij,cni->nj", derivative, residual)[..., None])[..., 0]
        points = points + step
    residual, derivative = _reprojection(cameras, seen, points)
    covariance = np.linalg.inv(np.einsum("cnij,cnik->njk", derivative, derivative))
    return Triangulation(points, np.sqrt(np.mean(residual**2, axis=(0, 2))), covariance)


def _linear(cameras: Sequence[Camera], seen: Floats) -> Points:
    centres = np.array([camera.centre for camera in cameras])
    middle, size = centres.mean(axis=0), np.ptp(centres, axis=0).max()
    if not size > 0:
        raise InputError("triangulation: the cameras stand in one place; two views need two places")
    scaling = np.block([[size * np.eye(3), middle[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
    rows = []
    for camera, pixels in zip(cameras, seen, strict=True):
        offset = (pixels - camera.principal_point) / camera.focal_length
        matrix = camera.pose.inv().as_matrix()[:3] @ scaling
        rows += [offset[:, :1] * matrix[2] - matrix[0], offset[:, 1:] * matrix[2] - matrix[1]]
    homogeneous = np.linalg.svd(np.stack(rows, axis=1))[2][:, -1]
    found: Points = middle + size * homogeneous[:, :3] / homogeneous[:, 3:]
    return found


def _reprojection(cameras: Sequence[Camera], seen: Floats, points: Points) -> tuple[Floats, Floats]:
    """Residuals (c, n, 2) px and derivatives (c, n, 2, 3) px/m."""
    try:
        projected = [camera.project_with_derivative(points) for camera in cameras]
    except InputError:
        raise InputError(
            "triangulation: some rays meet behind a camera; check the order of the cameras and of the points"
        ) from None
    return seen - np.array([pixels for pixels, _ in projected]), np.array([slope for _, slope in projected])
