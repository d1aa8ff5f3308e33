"""Regions in the form that other programs can be told: shells around hulls, each in its place, and boxes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fields.hull import BoxHull, CylinderHull, Hull, PolytopeHull, SphereHull
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Region, Shell
from magfem.typing import Floats


@dataclass(frozen=True)
class PlacedShell:
    """A shell whose own frame `pose` maps to the frame of the field."""

    shell: Shell
    pose: RigidTransform


def placed_shells(region: Region) -> tuple[PlacedShell, ...] | None:
    """The shells that a point of the region lies in, all of them; none at all for all of space.

    None for a region that is made of anything else.
    """
    if isinstance(region, Everywhere):
        return ()
    if isinstance(region, Shell):
        return (PlacedShell(region, RigidTransform.identity()),)
    if isinstance(region, PlacedRegion):
        inner = placed_shells(region.region)
        return None if inner is None else tuple(PlacedShell(one.shell, region.pose * one.pose) for one in inner)
    if isinstance(region, Intersection):
        parts = [placed_shells(part) for part in region.regions]
        found = [part for part in parts if part is not None]
        return sum(found, ()) if len(found) == len(parts) else None
    return None


def bounding_box(region: Region) -> Floats:
    """Lowest and highest corner (2, 3) m of a box that holds the region, edges along the axes of the field's frame.

    Raises InputError for a region without end or without points.
    """
    shells = placed_shells(region)
    if not shells:
        raise InputError(f"the field's region ({region.describe()}) has no bounding box: say between which bounds")
    boxes = np.array([_box(one) for one in shells])
    box = np.stack([boxes[:, 0].max(axis=0), boxes[:, 1].min(axis=0)])
    if not np.all(box[0] < box[1]):
        raise InputError(f"the field's region is empty ({region.describe()})")
    return box


def _box(placed: PlacedShell) -> Floats:
    low, high = _hull_box(placed.shell.hull)
    corners = np.array(list(product(*zip(low - placed.shell.extent, high + placed.shell.extent, strict=True))))
    corners = placed.pose.apply(corners)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


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
