"""Rods as cameras see them: pictures of their axis, and the centreline from two of these without matched points."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.errors import ConvergenceError, InputError
from magfem.rod.cameras import Camera, triangulate
from magfem.rod.centreline import Centreline
from magfem.rod.centreline_fit import adopted, enough, finite, in_company, rod_of, rough_shape, walked
from magfem.rod.curve_fit import Task, farthest_from, fit_curve, nearest_of, nearest_places
from magfem.rod.moving_frame import smallest_turn
from magfem.threads import one_thread_for_algebra
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Points, Vectors

_NODES = 60  # of the line through each picture's pixels, along which the pictures are matched
_BENDS, _WAYS, _BEST = (0.6, 1.2, 2.0, 2.8), 8, 4  # arcs to start from: how far bent, in how many directions, how many


@dataclass(frozen=True)
class View:
    """What one camera sees of a rod: pixels (n, 2), and which of the rod's points each shows (n,), −1 for outliers."""

    pixels: Floats
    labels: Integers


def simulate_views(
    cameras: Sequence[Camera],
    points: ArrayLike,
    generator: np.random.Generator,
    *,
    noise: float = 0.5,
    missing: float = 0.0,
    outliers: float = 0.0,
) -> tuple[View, ...]:
    """Pictures of points (n, 3) m on a rod's axis, as a segmentation would give them, in random order.

    noise: px, standard deviation of either coordinate.  missing: share of the points that a camera does not see.
    outliers: share of its pixels that show something else, anywhere in a frame half as large again as the rod's.
    """
    place = finite(points, "points", (-1, 3))
    if not (0 <= noise < np.inf and 0 <= missing < 1 and 0 <= outliers < 1):
        raise InputError("views: noise must not be negative, and the shares missing and outliers lie from 0 to below 1")
    views = []
    for camera in cameras:
        labels = generator.permutation(np.flatnonzero(generator.random(len(place)) >= missing))
        pixels = camera.project(place[labels]) + noise * generator.standard_normal((labels.size, 2))
        wrong = generator.random(labels.size) < outliers
        low, high = (pixels.min(axis=0), pixels.max(axis=0)) if labels.size else (0.0, 0.0)
        margin = np.max(np.asarray(high) - low) / 4
        pixels[wrong] = generator.uniform(low - margin, high + margin, (int(wrong.sum()), 2))
        views.append(View(pixels, np.where(wrong, -1, labels)))
    return tuple(views)


@dataclass(frozen=True)
class CameraPixels:
    """Pixels (n, 2) of several cameras, one after the other: `ends` (c + 1,) are where each camera's begin and end."""

    cameras: tuple[Camera, ...]
    values: Floats
    ends: tuple[int, ...]

    def seen(self, points: Points) -> tuple[Floats, Floats]:
        """Every point as its datum's camera sees it."""
        parts = [
            camera.project_with_derivative(points[start:end])
            for camera, (start, end) in zip(self.cameras, pairwise(self.ends), strict=True)
        ]
        return np.concatenate([pixels for pixels, _ in parts]), np.concatenate([slope for _, slope in parts])

    def nearest(self, points: Points) -> Integers:
        """By distance in each camera's picture."""
        parts = zip(self.cameras, pairwise(self.ends), strict=True)
        return np.concatenate([nearest_of(self.values[start:end], c.project(points)) for c, (start, end) in parts])

    def gap(self, points: Points, used: Booleans) -> float:
        """In the picture where it is largest."""
        parts = zip(self.cameras, pairwise(self.ends), strict=True)
        return max(farthest_from(self.values[a:b][used[a:b]], c.project(points)) for c, (a, b) in parts)


@one_thread_for_algebra()
def fit_centreline_to_views(
    cameras: Sequence[Camera],
    pixels: Sequence[ArrayLike],
    length: float,
    base: ArrayLike,
    *,
    base_tangent: ArrayLike | None = None,
    straight: tuple[tuple[float, float], ...] = (),
    degree: int = 6,
    robust: bool = True,
    start: Centreline | None = None,
) -> Centreline:
    """The centreline whose pictures pass nearest to the pixels of two or more cameras. No pixel needs a match.

    pixels: (n, 2) px for every camera, in any order, on the rod's axis. The rest as for `fit_centreline`; distances
    count in pixels. Without `start` the first two pictures are matched along their lines by epipolar distance, which
    needs pictures of a rod that does not cross itself there. Raises InputError and ConvergenceError.
    """
    if len(cameras) < 2 or len(cameras) != len(pixels):
        raise InputError(
            f"views: at least two cameras and pixels of each are needed, got {len(cameras)} cameras and "
            f"{len(pixels)} arrays of pixels"
        )
    seen = [finite(view, "pixels", (-1, 2)) for view in pixels]
    basis, origin, tangent = rod_of(length, base, base_tangent, straight, degree)
    ends = tuple(int(n) for n in np.cumsum([0] + [len(view) for view in seen]))
    data = CameraPixels(tuple(cameras), np.concatenate(seen), ends)
    task = Task(basis, origin, tangent, data, slide=True, robust=robust)
    enough(task, min(len(view) for view in seen))
    rays = [camera.rays(camera.project(origin)) for camera in cameras]
    if max(np.linalg.norm(np.cross(a, rays[0])) for a in rays[1:]) < 1e-3:
        raise InputError(
            "views: all cameras see the rod's base from one direction; depth needs cameras that look across each other"
        )
    if start is not None:
        c = adopted(start, task)
        return fit_curve(task, c, nearest_places(task, task.curve(c)), rough=False)
    fits: list[Centreline] = []
    for c in _starts(task, cameras, seen):
        with suppress(ConvergenceError, InputError, np.linalg.LinAlgError):
            fits.append(fit_curve(task, c, nearest_places(task, task.curve(c)), rough=True))
    if not fits:
        raise ConvergenceError(
            "views: no centreline of this length fits half of the pixels; a start nearby or fewer outliers would help"
        )
    return max(fits, key=lambda fit: float(np.mean(fit.used)) / (fit.noise + 1e-300))


def match_lines(cameras: Sequence[Camera], lines: Sequence[Floats]) -> tuple[Integers, Integers]:
    """Which nodes of two pictures' lines (n, 2), (m, 2) px, both from base to tip, show the same place of the rod.

    Both orders are kept: the pairs are the monotone path of least summed squared epipolar distance, by dynamic
    programming along antidiagonals. Where a line runs along its epipolar lines the distance says nothing, and the path
    goes on evenly.
    """
    first, second = lines
    rays = [camera.rays(line) for camera, line in zip(cameras, lines, strict=True)]
    baseline = cameras[1].centre - cameras[0].centre
    # Distance of both rays, as an angle: the triple product of baseline and rays over the planes' normals.
    planes = np.cross(baseline, rays[0])
    cost = (planes @ rays[1].T / np.linalg.norm(planes, axis=-1, keepdims=True)) ** 2
    n, m = len(first), len(second)
    evenly = (np.linspace(0, 1, n)[:, None] - np.linspace(0, 1, m)) ** 2
    cost = cost + 1e-6 * np.median(cost) * evenly + 1e-30
    total = np.full((n + 1, m + 1), np.inf)
    total[0, 0] = 0.0
    came = np.zeros((n + 1, m + 1), dtype=np.int64)
    for diagonal in range(2, n + m + 1):
        i = np.arange(max(1, diagonal - m), min(n, diagonal - 1) + 1)
        j = diagonal - i
        ways = np.stack([total[i - 1, j - 1], total[i - 1, j], total[i, j - 1]])
        came[i, j] = np.argmin(ways, axis=0)
        total[i, j] = cost[i - 1, j - 1] + ways.min(axis=0)
    pairs = []
    row, column = n, m
    while row > 0 and column > 0:
        pairs.append((row - 1, column - 1))
        way = came[row, column]
        row, column = row - int(way != 2), column - int(way != 1)
    matched = np.array(pairs[::-1])
    return matched[:, 0], matched[:, 1]


def _starts(task: Task, cameras: Sequence[Camera], seen: list[Floats]) -> list[Floats]:
    """Coefficients (K, 3) to start from: of the matched pictures, and those arcs whose pictures are nearest.

    Where a rod points into a camera its picture folds back on itself, and matching along lines fails.
    """
    starts, tangent, straight_on = [], task.base_tangent, task.basis.length
    lines = [_line(camera.project(task.base), view) for camera, view in zip(cameras[:2], seen[:2], strict=True)]
    first, second = match_lines(cameras[:2], lines)
    try:
        points = triangulate(cameras[:2], np.stack([lines[0][first], lines[1][second]])).points
    except InputError:
        pass
    else:
        s = walked(points, task.base, straight_on, ordered=True)
        starts.append(rough_shape(task, points, s))
        if tangent is None:
            tangent = task.curve(starts[0]).tangent(0.0)
    if tangent is not None:
        arcs = [_arc(task, tangent, bend, way) for bend in _BENDS for way in np.arange(_WAYS) * 2 * np.pi / _WAYS]
        starts += sorted(arcs, key=lambda c: _distance(task, c))[:_BEST]
    return starts


def _arc(task: Task, tangent: Vectors, bend: float, way: float) -> Floats:
    """Coefficients (K, 3) of a circle's arc that turns by `bend` rad from the unit tangent (3,) at the base."""
    side = Rotation.from_quat(smallest_turn(tangent)).apply([np.cos(way), np.sin(way), 0.0])
    s, weights = task.basis.quadrature
    angle = bend * s / task.basis.length
    place = (np.sin(angle)[:, None] * tangent + (1 - np.cos(angle))[:, None] * side) * task.basis.length / bend
    if task.base_tangent is not None:
        place = place - s[:, None] * task.base_tangent
    found: Floats = task.basis.functions(s).T @ (weights[:, None] * place)
    return found


def _distance(task: Task, coefficients: Floats) -> float:
    """Median distance of the data from a curve's pictures, px; infinite when the curve leaves a camera's front."""
    curve = task.curve(coefficients)
    try:
        seen = task.data.seen(curve.position(nearest_places(task, curve)))[0]
    except InputError:
        return np.inf
    return float(np.median(np.linalg.norm(task.data.values - seen, axis=-1)))


def _line(base: Floats, pixels: Floats) -> Floats:
    """Nodes (n, 2) px from base to tip along pixels (m, 2): medians of those that lie equally far along."""
    pixels = pixels[in_company(pixels)]
    reach = float(np.linalg.norm(np.ptp(pixels, axis=0))) * 4
    order = np.argsort(walked(pixels, base, reach, ordered=False))
    groups = np.array_split(order, min(_NODES, max(len(order) // 3, 2)))
    return np.array([np.median(pixels[group], axis=0) for group in groups])
