"""Workspaces: the ball or the box within which a coil system, or a coil's model, is used."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.fields.region import Everywhere, PlacedRegion, Region, Shell
from magfem.typing import ArrayLike, Booleans, Points

_SLACK = 1e-12  # of the size: points made to lie on the limit are inside


@dataclass(frozen=True)
class Ball:
    """All points up to `radius` from `centre`."""

    centre: tuple[float, float, float]  # m
    radius: float  # m

    def __post_init__(self) -> None:
        if not (0 < self.radius < math.inf and all(map(math.isfinite, self.centre))):
            raise InputError("a ball needs a finite centre and a positive, finite radius")

    def contains(self, points: ArrayLike) -> Booleans:
        array = np.asarray(points, dtype=float)
        reach = self.radius * (1 + _SLACK)
        if array.ndim == 1:  # one point, several times faster without arrays
            return np.asarray(math.dist(array.tolist(), self.centre) <= reach)
        inside: Booleans = np.sum((array - self.centre) ** 2, axis=-1) <= reach**2
        return inside

    def describe(self) -> str:
        return f"within {_mm(self.radius)} mm of {_place(self.centre)}"

    def layers(self, rng: np.random.Generator, layers: int = 64, per_layer: int = 40, nearest: int = 0) -> Points:
        """Random points (1, layers · per_layer, 3) m, as one layer: there is no body to count distances from."""
        return self.random_points(rng, layers * per_layer)[None]

    def random_points(self, rng: np.random.Generator, count: int) -> Points:
        """Points (count, 3) m, half uniform over the volume, half over its surface, where errors are largest."""
        direction = rng.normal(size=(count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        share = np.cbrt(rng.random(count))
        share[: count // 2] = 1.0
        points: Points = self.centre + self.radius * share[:, None] * direction
        return points


@dataclass(frozen=True)
class Box:
    """All points between two corners, edges along the axes."""

    low: tuple[float, float, float]  # m
    high: tuple[float, float, float]  # m

    def __post_init__(self) -> None:
        if not all(-math.inf < low < high < math.inf for low, high in zip(self.low, self.high, strict=True)):
            raise InputError("a box needs finite corners, the higher one above the lower one along every axis")

    def contains(self, points: ArrayLike) -> Booleans:
        array = np.asarray(points, dtype=float)
        slack = _SLACK * max(map(abs, (*self.low, *self.high)))
        if array.ndim == 1:  # one point, several times faster without arrays
            limits = zip(self.low, array.tolist(), self.high, strict=True)
            return np.asarray(all(low - slack <= value <= high + slack for low, value, high in limits))
        inside: Booleans = np.all(
            (array >= np.subtract(self.low, slack)) & (array <= np.add(self.high, slack)), axis=-1
        )
        return inside

    def describe(self) -> str:
        sides = (f"{_mm(low)} to {_mm(high)}" for low, high in zip(self.low, self.high, strict=True))
        return "x, y, z from " + ", ".join(sides) + " mm"

    def layers(self, rng: np.random.Generator, layers: int = 64, per_layer: int = 40, nearest: int = 0) -> Points:
        """Random points (1, layers · per_layer, 3) m, as one layer: there is no body to count distances from."""
        return self.random_points(rng, layers * per_layer)[None]

    def random_points(self, rng: np.random.Generator, count: int) -> Points:
        """Points (count, 3) m, half uniform over the volume, half on its faces, the eight corners first."""
        low, high = np.array(self.low), np.array(self.high)
        share = rng.random((count, 3))
        surface = np.arange(count // 2)
        share[surface, surface % 3] = np.round(share[surface, surface % 3])
        corners = min(8, count)
        share[:corners] = np.indices((2, 2, 2)).reshape(3, 8).T[:corners]
        points: Points = low + share * (high - low)
        return points


def bounding_ball(region: Region) -> Ball | None:
    """The smallest ball that holds a workspace; None for regions of other kinds."""
    if isinstance(region, Ball):
        return region
    if isinstance(region, Box):
        low, high = np.array(region.low), np.array(region.high)
        x, y, z = ((low + high) / 2).tolist()
        return Ball((x, y, z), float(np.linalg.norm(high - low)) / 2)
    return None


def surely_holds(region: Region, ball: Ball) -> bool:
    """Whether a region holds all of a ball; false also where that is not known for sure.

    The distance to a hull changes by no more than the way: within the ball it is that of the centre ± the radius.
    """
    centre, radius = np.array(ball.centre), ball.radius
    if isinstance(region, PlacedRegion):
        x, y, z = region.pose.inv().apply(centre).tolist()
        return surely_holds(region.region, Ball((x, y, z), radius))
    if isinstance(region, Shell):
        distance = float(region.hull.distance(centre))
        slack, rho = _SLACK * region.extent, float(np.hypot(*centre[:2]))
        within = region.clearance <= distance - radius + slack and distance + radius - slack <= region.extent
        within &= region.z[0] <= centre[2] - radius + slack and centre[2] + radius - slack <= region.z[1]
        within &= rho + radius - slack <= region.rho[1] and (region.rho[0] == 0 or region.rho[0] <= rho - radius)
        return bool(within)
    if isinstance(region, Ball):
        return math.dist(centre, region.centre) + radius <= region.radius * (1 + _SLACK)
    if isinstance(region, Box):
        return bool(region.contains(centre - radius) and region.contains(centre + radius))
    return isinstance(region, Everywhere)


def _mm(length: float) -> str:
    return f"{length * 1e3:.4g}"


def _place(centre: tuple[float, float, float]) -> str:
    return "the origin" if not any(centre) else f"({', '.join(map(_mm, centre))}) mm"
