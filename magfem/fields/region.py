"""Where a field model holds: regions answer `contains`, and nothing is extrapolated without being asked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fields.hull import Hull
from magfem.typing import ArrayLike, Booleans, Points


class Region(Protocol):
    """A part of space."""

    def contains(self, points: ArrayLike) -> Booleans:
        """True (...) where `points` (..., 3) m lie in the region."""
        ...

    def describe(self) -> str:
        """The region in words, for error messages and reports."""
        ...


class SampledRegion(Region, Protocol):
    """A bounded part of space whose points can be drawn, so that a model of it can be fitted and judged."""

    def layers(self, rng: np.random.Generator, layers: int = 64, per_layer: int = 40, nearest: int = 0) -> Points:
        """Random points (l, p, 3) m; errors are relative to the largest field of the same layer."""
        ...


@dataclass(frozen=True)
class Everywhere:
    """All of space: closed forms and solutions hold up to rounding and their stated error."""

    def contains(self, points: ArrayLike) -> Booleans:
        inside: Booleans = np.isfinite(np.asarray(points, dtype=float)).all(axis=-1)
        return inside

    def describe(self) -> str:
        return "everywhere"


@dataclass(frozen=True)
class Shell:
    """All points whose distance to a convex hull lies between `clearance` and `extent`: all round, or in a window.

    A window keeps those with z between its two values, and ρ, the distance from the z axis, between its two.
    """

    hull: Hull
    clearance: float  # m
    extent: float  # m
    z: tuple[float, float] = (-math.inf, math.inf)  # m
    rho: tuple[float, float] = (0.0, math.inf)  # m

    @property
    def windowed(self) -> bool:
        """Whether the shell is not there all round."""
        return self.z != (-math.inf, math.inf) or self.rho != (0.0, math.inf)

    def contains(self, points: ArrayLike) -> Booleans:
        array = np.asarray(points, dtype=float)
        distance = self.hull.distance(array)
        slack = 1e-12 * self.extent  # points made to lie on the limit are inside
        if array.ndim == 1:  # one point, faster without arrays
            x, y, z = array.tolist()
            return np.asarray(
                self.clearance - slack <= float(distance) <= self.extent + slack
                and self.z[0] - slack <= z <= self.z[1] + slack
                and self.rho[0] - slack <= math.hypot(x, y) <= self.rho[1] + slack
            )
        inside: Booleans = (distance >= self.clearance - slack) & (distance <= self.extent + slack)
        if self.windowed:
            z, rho = array[..., 2], np.hypot(array[..., 0], array[..., 1])
            inside &= (z >= self.z[0] - slack) & (z <= self.z[1] + slack)
            inside &= (rho >= self.rho[0] - slack) & (rho <= self.rho[1] + slack)
        return inside

    def describe(self) -> str:
        shell = f"{self.clearance * 1e3:.4g} to {self.extent * 1e3:.4g} mm from the body's hull"
        limits = [_limits(name, pair) for name, pair in (("z", self.z), ("ρ", self.rho))]
        return f"{shell}, {' and '.join(limit for limit in limits if limit) or 'all round'}"

    def layers(self, rng: np.random.Generator, layers: int = 64, per_layer: int = 40, nearest: int = 0) -> Points:
        """Random points (layers + nearest, per_layer, 3) m; all points of a layer share one hull distance.

        Layers lie denser where the field is steeper: half of them are spread evenly over the distance and
        half over its logarithm, one at random in each cell, and the two limits are always among them. Half of
        a layer's points are uniform over its surface, the others make sure of axes, edges, walls and faces.
        The last `nearest` layers lie at the clearance itself. In a window the points of a layer share their
        distance nearly, and the nearest ones lie on the window's near sides as well.
        """
        if self.windowed:
            return self._windowed_layers(rng, layers, per_layer, nearest)
        even = layers // 2
        cells = (np.arange(even) + rng.random(even)) / even
        steep = (np.arange(layers - even) + rng.random(layers - even)) / (layers - even)
        ratio = self.extent / self.clearance if self.clearance > 0 else 1e3
        distances = np.concatenate(
            [
                self.clearance + (self.extent - self.clearance) * cells,
                self.extent * ratio ** (steep - 1.0),
            ]
        )
        distances = np.sort(distances)
        distances[0], distances[-1] = self.clearance, self.extent
        uniform = self.hull.offset_points(distances, per_layer - per_layer // 2, rng)
        spread = np.concatenate([uniform, self.hull.marked_points(distances, per_layer // 2, rng)], axis=1)
        if not nearest:
            return spread
        closest = self.hull.marked_points(np.full(nearest, self.clearance), per_layer, rng)
        return np.concatenate([spread, closest])

    def _windowed_layers(self, rng: np.random.Generator, layers: int, per_layer: int, nearest: int) -> Points:
        """As `layers`, from points of the whole shell, and those moved onto the window's near sides."""
        whole = replace(self, z=(-math.inf, math.inf), rho=(0.0, math.inf))
        found, on_sides = np.empty((0, 3)), np.empty((0, 3))
        wanted, wanted_near = layers * per_layer, nearest * per_layer
        for _ in range(400):
            if len(found) >= 2 * wanted and len(on_sides) >= 2 * wanted_near:
                break
            drawn = whole.layers(rng, layers, per_layer, 1).reshape(-1, 3)
            found = np.concatenate([found, drawn[self.contains(drawn)]])
            moved = self._onto_near_sides(drawn)
            on_sides = np.concatenate([on_sides, moved[self.contains(moved)]])
        if len(found) < wanted or len(on_sides) < wanted_near:
            raise InputError(f"hardly any point lies in the region: {self.describe()}")
        chosen = [rng.permutation(found)[:wanted], rng.permutation(on_sides)[:wanted_near]]
        sorted_ = [points[np.argsort(self.hull.distance(points), kind="stable")] for points in chosen]
        return np.concatenate(sorted_).reshape(-1, per_layer, 3)

    def _onto_near_sides(self, points: Points) -> Points:
        """Points (n, 3) moved onto the side of the window that faces the hull: its plane, wall or offset surface."""
        moved = points.copy()
        if self.z[0] > 0 or self.z[1] < 0:
            side = 1.0 if self.z[0] > 0 else -1.0
            moved[:, 2] = self.z[0] if self.z[0] > 0 else self.z[1]
            for _ in range(4):  # where that side lies nearer than the clearance, the clearance is the near side
                moved[:, 2] += side * np.maximum(self.clearance - self.hull.distance(moved), 0.0)
        elif self.rho[0] > 0:
            moved[:, :2] *= self.rho[0] / np.maximum(np.hypot(moved[:, 0], moved[:, 1]), 1e-300)[:, None]
        return moved


def _limits(name: str, pair: tuple[float, float]) -> str:
    """A window's limits along one coordinate, in mm; empty where there are none."""
    low, high = pair
    bounded_below = low > (0.0 if name == "ρ" else -math.inf)
    if bounded_below and high < math.inf:
        return f"{name} from {low * 1e3:.4g} to {high * 1e3:.4g} mm"
    if bounded_below:
        return f"{name} ≥ {low * 1e3:.4g} mm"
    return f"{name} ≤ {high * 1e3:.4g} mm" if high < math.inf else ""


@dataclass(frozen=True)
class PlacedRegion:
    """A region of a source frame, seen from the frame that `pose` places it in."""

    region: Region
    pose: RigidTransform

    def contains(self, points: ArrayLike) -> Booleans:
        array = np.asarray(points, dtype=float)
        local = self.pose.inv().apply(array.reshape(-1, 3)).reshape(array.shape)
        return self.region.contains(local)

    def describe(self) -> str:
        x, y, z = self.pose.translation * 1e3
        return f"{self.region.describe()}, placed at ({x:.4g}, {y:.4g}, {z:.4g}) mm"


@dataclass(frozen=True)
class Intersection:
    """The points that lie in all of several regions: where a sum of fields holds."""

    regions: tuple[Region, ...]

    def contains(self, points: ArrayLike) -> Booleans:
        inside: Booleans = np.logical_and.reduce([region.contains(points) for region in self.regions])
        return inside

    def describe(self) -> str:
        return " and ".join(region.describe() for region in self.regions)
