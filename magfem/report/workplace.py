"""Where a coil's field is wanted: above a flat coil, within all others, in the bore of a stator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.fields.hull import CylinderHull
from magfem.geometry import Coil, Stator
from magfem.mesh.coil_surfaces import coil_surfaces
from magfem.report.coil_numbers import ball, cylinder
from magfem.report.coil_outline import is_flat
from magfem.report.figures.planes import Plane
from magfem.report.numbers import size
from magfem.typing import Floats, Points

_HEIGHTS = (1e-3, 2e-3)  # m, above flat coils, besides the clearance
_DISCS = (0.1, 0.25, 0.5)  # of a flat coil's half width
_BALLS = (0.1, 0.2, 0.4, 0.8)  # of the free ball around the centre
_FREE = 0.95  # of the distance from the centre to the nearest metal
_RINGS, _AROUND = 12, 48  # points that stand for a disc


@dataclass(frozen=True)
class Place:
    """A set of points (n, 3) m by the words that tables name it with."""

    words: str
    points: Points


@dataclass(frozen=True)
class Line:
    """A straight line through `start` (3,) m: points start + t·direction for t from `low` to `high` (m)."""

    axis: str  # "x", "y" or "z"
    start: Points
    low: float
    high: float

    @property
    def direction(self) -> Floats:
        """Unit vector (3,)."""
        unit: Floats = np.eye(3)["xyz".index(self.axis)]
        return unit

    def points(self, count: int) -> tuple[Floats, Points]:
        """Coordinates (count,) m along the axis, and points (count, 3)."""
        along = np.linspace(self.low, self.high, count)
        index = "xyz".index(self.axis)
        points = np.tile(self.start, (count, 1))
        points[:, index] += along
        return points[:, index].copy(), points


@dataclass(frozen=True)
class Workplace:
    """centre: (3,) m, the point whose field stands for all.  planes: for maps.  heights: of a flat coil's planes over
    its top, m, else empty.  places: in which the field's deviation from the centre is told.  reach: m, from the centre,
    that is free of metal."""

    centre: Points
    words: str
    planes: tuple[Plane, ...]
    heights: tuple[float, ...]
    lines: tuple[Line, ...]
    places: tuple[Place, ...]
    reach: float


def workplace(geometry: Coil) -> Workplace:
    """The place that suits a coil."""
    if is_flat(geometry):
        return _above(geometry)
    if isinstance(geometry, Stator):
        return _bore(geometry)
    return _within(geometry)


def disc(centre: Points, radius: float) -> Points:
    """Points (n, 3) m of a disc across z, its edge among them."""
    rho = radius * np.linspace(0.0, 1.0, _RINGS)
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    r, a = (grid.ravel() for grid in np.meshgrid(rho, angle))
    return centre + np.stack([r * np.cos(a), r * np.sin(a), 0 * r], axis=-1)


def _nodes(geometry: Coil) -> Points:
    """Points of the turns' surface (n, 3) m."""
    return np.concatenate([one.nodes[one.lead == 0].reshape(-1, 3) for one in coil_surfaces(geometry)])


def _above(geometry: Coil) -> Workplace:
    nodes = _nodes(geometry)
    top, half = float(nodes[:, 2].max()), 0.5 * float(np.ptp(nodes[:, :2], axis=0).min())
    region = geometry.region
    heights = sorted({region.clearance, *(h for h in _HEIGHTS if region.clearance < h <= region.extent)})
    chosen = heights[min(1, len(heights) - 1)]
    centre = np.array([0.0, 0.0, top + chosen])
    window = 1.15 * float(np.abs(nodes[:, :2]).max())
    return Workplace(
        centre=centre,
        words=f"above the middle, {size(chosen)} from the coil",
        planes=tuple(Plane("x", "y", window, top + height) for height in heights),
        heights=tuple(heights),
        lines=(
            Line("z", np.array([0.0, 0.0, top]), region.clearance, region.extent),
            Line("x", centre, -window, window),
        ),
        places=tuple(Place(f"disc of radius {size(share * half, 3)}", disc(centre, share * half)) for share in _DISCS),
        reach=chosen,
    )


def _bore(geometry: Stator) -> Workplace:
    bore = geometry.bore
    radius, long = bore.diameter / 2, bore.length
    parts = ((0.5, 0.25), (0.8, 0.5), (1.0, 1.0))
    return Workplace(
        centre=np.zeros(3),
        words="in the middle of the bore",
        planes=(Plane("x", "y", 1.25 * geometry.tube_inner_diameter / 2), Plane("x", "z", 0.65 * long)),
        heights=(),
        lines=(Line("z", np.zeros(3), -0.75 * long, 0.75 * long), Line("x", np.zeros(3), -radius, radius)),
        places=tuple(
            Place(
                f"cylinder ⌀ {size(wide * bore.diameter, 3)}, {size(part * long, 3)} long",
                cylinder(wide * bore.diameter, part * long),
            )
            for wide, part in parts
        ),
        reach=radius,
    )


def _within(geometry: Coil) -> Workplace:
    nodes = _nodes(geometry)
    free = _FREE * float(np.linalg.norm(nodes, axis=1).min())
    window = geometry.hull.radius * 1.05
    centre = np.zeros(3)
    wide = geometry.hull.diameter / 2 if isinstance(geometry.hull, CylinderHull) else float(np.abs(nodes[:, 0]).max())
    far = min(geometry.region.extent, 2 * geometry.hull.radius)
    return Workplace(
        centre=centre,
        words="in the middle",
        planes=(Plane("x", "z", window), Plane("x", "y", window)),
        heights=(),
        lines=(
            Line("z", centre, -float(np.abs(nodes[:, 2]).max()) - far, float(np.abs(nodes[:, 2]).max()) + far),
            Line("x", centre, -min(free, wide), min(free, wide)),
        ),
        places=tuple(Place(f"ball of radius {size(share * free, 3)}", ball(centre, share * free)) for share in _BALLS),
        reach=free,
    )
