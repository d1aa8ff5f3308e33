"""Relative errors with their places: the worst of them, how they grow with distance, and what small fields count as."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.fields.field import Field
from magfem.fields.norms import FLOOR
from magfem.fields.region import SampledRegion, Shell
from magfem.fields.region_parts import bounding_box
from magfem.typing import ArrayLike, Floats, Jet, Points

QUANTITIES = ("B", "gradient")
_APART = 0.1  # of the points' extent: worst points nearer to each other than this are one place
_GROUPS = 12  # of distances
_FEWEST = 4  # points that make a group
_ALIKE = 0.05  # distances that differ by less than this share are one


@dataclass(frozen=True, eq=False)
class LocatedErrors:
    """Errors (n,) at points (n, 3) m, each at its distance (n,) m from the hull, or from a workspace's middle."""

    points: Points
    distance: Floats
    error: Floats

    @property
    def norms(self) -> dict[str, float]:
        """The largest error and the root mean square."""
        return {"max": float(self.error.max()), "rms": float(np.sqrt(np.mean(self.error**2)))}

    def worst(self, count: int = 5) -> list[dict[str, Any]]:
        """The largest errors, worst first, each from a place of its own: point and distance (m), error."""
        apart = _APART * float(np.linalg.norm(np.ptp(self.points, axis=0)))
        left = np.ones(self.error.size, dtype=bool)
        found: list[dict[str, Any]] = []
        while left.any() and len(found) < count:
            k = int(np.argmax(np.where(left, self.error, -1.0)))
            found.append(
                {
                    "point": self.points[k].tolist(),
                    "distance": float(self.distance[k]),
                    "error": float(self.error[k]),
                }
            )
            left &= np.linalg.norm(self.points - self.points[k], axis=1) > apart
        return found

    def by_distance(self) -> list[dict[str, float]]:
        """Errors of groups of equally many points, nearest first: mean distance (m), largest error and RMS."""
        order = np.argsort(self.distance, kind="stable")
        groups = max(1, min(_GROUPS, order.size // _FEWEST))
        if np.ptp(self.distance) < _ALIKE * self.distance.max():
            groups = 1
        return [
            {"distance": float(self.distance[group].mean()), **LocatedErrors(*self._rows(group)).norms}
            for group in np.array_split(order, groups)
        ]

    def _rows(self, which: Any) -> tuple[Points, Floats, Floats]:
        return self.points[which], self.distance[which], self.error[which]


def distance_in(region: SampledRegion, points: ArrayLike) -> Floats:
    """What errors are told over, (...) m at points (..., 3): distance from a shell's hull, or from the middle."""
    array = np.asarray(points, dtype=float)
    if isinstance(region, Shell):
        return region.hull.distance(array)
    distance: Floats = np.linalg.norm(array - middle(region), axis=-1)
    return distance


def distance_name(region: SampledRegion) -> str:
    """What `distance_in` counts from."""
    return "the hull" if isinstance(region, Shell) else "the middle of the region"


def middle(region: SampledRegion) -> Floats:
    """A region's middle (3,) m: that of its box."""
    centre: Floats = bounding_box(region).mean(axis=0)
    return centre


@dataclass(frozen=True, eq=False)
class LargestSizes:
    """How large B and its gradient get at every distance of a region: smaller values count against a share of that.

    distance: (l,) m, ascending.  size: by quantity (l,).
    """

    distance: Floats
    size: dict[str, Floats]

    def errors(self, difference: Floats, size: Floats, distance: Floats, quantity: str) -> Floats:
        """Relative errors (...) in the norm of `fields.norms`, of sizes of differences and of fields (...)."""
        if len(self.distance) == 1:
            largest = np.full(distance.shape, self.size[quantity][0])
        else:
            least = max(float(self.distance[0]), 1e-300)
            logarithm = np.log(np.maximum(distance, least))
            known = np.log(np.maximum(self.distance, least))
            largest = np.exp(np.interp(logarithm, known, np.log(np.maximum(self.size[quantity], 1e-300))))
        floored = np.maximum(size, FLOOR * largest)
        errors: Floats = np.divide(difference, floored, out=np.zeros_like(difference), where=floored > 0)
        return errors


def largest_sizes(field: Field, region: SampledRegion) -> LargestSizes:
    """Of a field in a region, by random points of it."""
    layers = region.layers(np.random.default_rng(2), layers=32, per_layer=72)
    jet = field.jet(layers, 1, outside="extrapolate")
    distance = distance_in(region, layers).mean(axis=1)
    return LargestSizes(distance, {key: sizes(jet, k).max(axis=1) for k, key in enumerate(QUANTITIES)})


def sizes(jet: Jet, derivative: int) -> Floats:
    """|B| (...) of a jet, or the Frobenius norm of its gradient."""
    part = jet[derivative]
    axes = (-1,) if derivative == 0 else (-2, -1)
    size: Floats = np.sqrt(np.sum(part**2, axis=axes))
    return size
