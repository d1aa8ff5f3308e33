"""Regions taken apart: shells, balls and boxes, each in its place; the box about them, points in them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fields.hull import BoxHull, CylinderHull, Hull, PolytopeHull, SphereHull
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Region, Shell
from magfem.fields.workspace_region import Ball, Box
from magfem.typing import Floats, Points

_SEED = 1
_MOST_DRAWS = 200


@dataclass(frozen=True)
class RegionPart:
    """A region that is neither placed nor intersected, whose own frame `pose` maps to the frame of the field."""

    region: Region
    pose: RigidTransform


def region_parts(region: Region) -> tuple[RegionPart, ...]:
    """What a point of the region lies in, all of it: shells, balls, boxes; nothing at all for all of space."""
    if isinstance(region, Everywhere):
        return ()
    if isinstance(region, PlacedRegion):
        return tuple(RegionPart(part.region, region.pose * part.pose) for part in region_parts(region.region))
    if isinstance(region, Intersection):
        return tuple(part for one in region.regions for part in region_parts(one))
    return (RegionPart(region, RigidTransform.identity()),)


def region_points(region: Region, count: int = 2560) -> Points:
    """Random points (count, 3) m of the region, the same every time, as its own `layers` draws them.

    Raises InputError for a region that offers none, such as all of space, or of which hardly anything is left.
    """
    drawn_by = [(part.pose, getattr(part.region, "layers", None)) for part in region_parts(region)]
    sources = [(pose, layers) for pose, layers in drawn_by if layers]
    if not sources:
        raise InputError(f"the field's region ({region.describe()}) offers no points of its own: say which")
    rng = np.random.default_rng(_SEED)
    found = np.empty((0, 3))
    for draw in range(_MOST_DRAWS):
        pose, layers = sources[draw % len(sources)]
        points = pose.apply(layers(rng, 64, -(-count // 64)).reshape(-1, 3))
        if len(drawn_by) > 1:
            points = rng.permutation(points[region.contains(points)])
        found = np.concatenate([found, points])
        if len(found) >= count:
            return found[:count]
    raise InputError(f"hardly any point lies in the field's region ({region.describe()}): say which points")


def bounding_box(region: Region) -> Floats:
    """Lowest and highest corner (2, 3) m of a box that holds the region, edges along the axes of the field's frame.

    Raises InputError for a region without end or without points.
    """
    boxes = [box for part in region_parts(region) if (box := _box(part)) is not None]
    if not boxes:
        raise InputError(f"the field's region ({region.describe()}) has no bounding box: say between which bounds")
    low, high = (np.array(corners) for corners in zip(*boxes, strict=True))
    box = np.stack([low.max(axis=0), high.min(axis=0)])
    if not np.all(box[0] < box[1]):
        raise InputError(f"the field's region is empty ({region.describe()})")
    return box


def _box(part: RegionPart) -> Floats | None:
    """Lowest and highest corner (2, 3) in the field's frame; None for a region of an unknown kind."""
    region, pose = part.region, part.pose
    if isinstance(region, Ball):
        centre = pose.apply(np.array(region.centre))
        return np.stack([centre - region.radius, centre + region.radius])
    if isinstance(region, Box):
        low, high = np.array(region.low), np.array(region.high)
    elif isinstance(region, Shell):
        low, high = _shell_box(region)
    else:
        return None
    if not np.all(low <= high):
        return np.stack([low, high])  # nothing is in it, however it is turned
    corners = pose.apply(np.array(list(product(*zip(low, high, strict=True)))))
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _shell_box(shell: Shell) -> tuple[Floats, Floats]:
    """The box around the hull and the shell's extent, cut by the window."""
    low, high = _hull_box(shell.hull)
    reach = np.array([shell.rho[1], shell.rho[1], np.inf])
    low, high = np.maximum(low - shell.extent, -reach), np.minimum(high + shell.extent, reach)
    low[2], high[2] = max(low[2], shell.z[0]), min(high[2], shell.z[1])
    return low, high


def _hull_box(hull: Hull) -> tuple[Floats, Floats]:
    if isinstance(hull, PolytopeHull):
        vertices = np.array(hull.vertices)
        return vertices.min(axis=0), vertices.max(axis=0)
    if isinstance(hull, CylinderHull):
        half = np.array([hull.diameter, hull.diameter, hull.length]) / 2
    elif isinstance(hull, BoxHull):
        half = np.array(hull.size) / 2
    elif isinstance(hull, SphereHull):
        half = np.full(3, hull.diameter / 2)
    else:
        half = np.full(3, hull.radius)
    return -half, half
