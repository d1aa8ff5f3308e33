"""How near the parts of a track come to each other in the plan, and whether outlines cross themselves."""

from __future__ import annotations

import numpy as np

from magfem.geometry.circuit import Stations
from magfem.typing import Floats

_ALONG = 6.0  # pitches along the track within which its parts are neighbours at a bend, not of another turn


def smallest_gap(stations: Stations, pitch: float) -> float:
    """The smallest gap (m) between the turns of a flat track, 0 when they touch; at most `pitch` (m), turn to turn.

    Leads are left out; a track is not held against itself along six pitches.
    """
    from shapely import STRtree, bounds, box, distance, polygons

    turns = np.flatnonzero(~stations.lead)
    rows = 2 * turns[:, None] + np.arange(3)
    corners = np.concatenate([stations.left[rows], stations.right[rows[:, ::-1]]], axis=1)[..., :2]
    parts = polygons(corners)
    middle = 0.5 * (stations.left + stations.right)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
    begin, end = along[rows[:, 0]], along[rows[:, 2]]
    west, south, east, north = bounds(parts).T
    one, other = STRtree(parts).query(box(west - pitch, south - pitch, east + pitch, north + pitch))
    apart = begin[other] - end[one] > _ALONG * pitch
    one, other = one[apart], other[apart]
    return float(distance(parts[one], parts[other]).min(initial=pitch))


def crosses_itself(points: Floats) -> bool:
    """Whether the closed polygon through `points` (n, 2) meets itself."""
    from shapely import LinearRing

    return not LinearRing(points).is_simple


def signed_area(points: Floats) -> float:
    """Of the polygon through `points` (n, 2) m, m²; positive when they go right-handed about +z."""
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
