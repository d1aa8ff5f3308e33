"""Where a field model holds: regions answer `contains`, and nothing is extrapolated without being asked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fields.hull import Hull, hull_from_dict, hull_to_dict
from magfem.typing import ArrayLike, Booleans, Points


class Region(Protocol):
    """A part of space."""

    def contains(self, points: ArrayLike) -> Booleans:
        """True (...) where `points` (..., 3) m lie in the region."""
        ...

    def describe(self) -> str:
        """The region in words, for error messages and reports."""
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
    """All points whose distance to a convex hull lies between `clearance` and `extent`, all round."""

    hull: Hull
    clearance: float  # m
    extent: float  # m

    def contains(self, points: ArrayLike) -> Booleans:
        distance = self.hull.distance(np.asarray(points, dtype=float))
        slack = 1e-12 * self.extent  # points made to lie on the limit are inside
        inside: Booleans = (distance >= self.clearance - slack) & (distance <= self.extent + slack)
        return inside

    def describe(self) -> str:
        return f"{self.clearance * 1e3:.4g} to {self.extent * 1e3:.4g} mm from the body's hull, all round"

    def layers(self, rng: np.random.Generator, layers: int = 64, per_layer: int = 40) -> Points:
        """Random points (layers, per_layer, 3) m; all points of a layer share one hull distance.

        Layers lie denser where the field is steeper: half of them are spread evenly over the distance and
        half over its logarithm, one at random in each cell, and the two limits are always among them. Half of
        a layer's points are uniform over its surface, the others make sure of axes, edges, walls and faces.
        """
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
        return np.concatenate([uniform, self.hull.marked_points(distances, per_layer // 2, rng)], axis=1)


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


def region_to_dict(region: Region) -> dict[str, Any]:
    """The region as JSON-ready data (SI units)."""
    if isinstance(region, Everywhere):
        return {"kind": "everywhere"}
    if isinstance(region, Shell):
        return {
            "kind": "shell",
            "hull": hull_to_dict(region.hull),
            "clearance": region.clearance,
            "extent": region.extent,
        }
    raise InputError(f"a region of type {type(region).__name__} cannot be written to a model file")


def region_from_dict(data: dict[str, Any]) -> Region:
    """Inverse of `region_to_dict`."""
    if data.get("kind") == "everywhere":
        return Everywhere()
    if data.get("kind") == "shell":
        shell = Shell(hull_from_dict(data["hull"]), float(data["clearance"]), float(data["extent"]))
        if not 0 <= shell.clearance < shell.extent < math.inf:
            raise InputError("a shell needs a clearance of 0 or more and a larger extent")
        return shell
    raise InputError(f"unknown region kind {data.get('kind')!r}; known: everywhere, shell")
