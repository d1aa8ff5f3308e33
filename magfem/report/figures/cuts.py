"""Two planes through a region of any kind: their windows, points, the region's outline and the device within."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import binary_dilation

from magfem.fields import Shell
from magfem.fields.region import SampledRegion
from magfem.fields.region_parts import bounding_box
from magfem.report.figures.style import BLUE, GREY
from magfem.typing import Booleans, Floats, Points

MILLI = 1e3
_FLAT = 0.7  # height over width below which a region is told by a plane along it rather than a second one across
_EDGE = 0.04  # of the window, left free around the region
_FINE = 360  # points along the longer side, for outlines


@dataclass(frozen=True)
class Cut:
    """A window on a plane: two axes by name, the window's corners along them, the plane's place along the third (m)."""

    horizontal: str
    vertical: str
    low: tuple[float, float]
    high: tuple[float, float]
    height: float

    @property
    def columns(self) -> tuple[int, int]:
        """The two axes as columns of points."""
        return "xyz".index(self.horizontal), "xyz".index(self.vertical)

    @property
    def normal(self) -> int:
        """The third axis as a column of points."""
        return 3 - sum(self.columns)

    @property
    def words(self) -> str:
        """`xz plane, y = 0`."""
        place = 0.0 if abs(self.height) < 1e-12 else self.height * MILLI
        return f"{self.horizontal}{self.vertical} plane, {'xyz'[self.normal]} = {place:.3g}{' mm' if place else ''}"

    def points(self, count: int) -> tuple[Floats, Floats, Points]:
        """Middles of tiles, `count` along the longer side: places (h,) and (v,) m along the axes, points (v, h, 3)."""
        sides = np.subtract(self.high, self.low)
        numbers = np.maximum(np.round(count * sides / sides.max()).astype(int), 2)
        along = [
            low + side * (np.arange(number) + 0.5) / number
            for low, side, number in zip(self.low, sides, numbers, strict=True)
        ]
        points = np.empty((numbers[1], numbers[0], 3))
        points[..., self.columns[0]], points[..., self.columns[1]] = np.meshgrid(*along)
        points[..., self.normal] = self.height
        return along[0], along[1], points


def cuts(region: SampledRegion) -> tuple[Cut, Cut]:
    """The xz plane and the yz plane through a region; of a flat one the xz plane and the nearest xy plane."""
    low, high = bounding_box(region)
    middle = 0.5 * (low + high)
    if isinstance(region, Shell):  # through the device
        middle = np.clip(np.zeros(3), low, high)
    flat = high[2] - low[2] < _FLAT * min(high[0] - low[0], high[1] - low[1])
    across = _cut("x", "z", low, high, float(middle[1]))
    if not flat:
        return across, _cut("y", "z", low, high, float(middle[0]))
    return across, _cut("x", "y", low, high, _level(region, low, high, middle))


def _cut(horizontal: str, vertical: str, low: Floats, high: Floats, height: float) -> Cut:
    columns = ["xyz".index(horizontal), "xyz".index(vertical)]
    edge = _EDGE * (high - low)[columns].max()
    (left, bottom), (right, top) = (low[columns] - edge).tolist(), (high[columns] + edge).tolist()
    return Cut(horizontal, vertical, (left, bottom), (right, top), height)


def _level(region: SampledRegion, low: Floats, high: Floats, middle: Floats) -> float:
    """The height of the lowest xy plane above the device: where fields and errors are largest."""
    if not isinstance(region, Shell):
        return float(middle[2])
    heights = np.linspace(max(0.0, float(low[2])), float(high[2]), 2001)
    inside = region.contains(np.stack([0 * heights, 0 * heights, heights], axis=-1))
    return float(heights[inside.argmax()]) if inside.any() else float(middle[2])


def tiles(region: SampledRegion, points: Points) -> Booleans:
    """The tiles (v, h) of a map that show a region: those with their middle (v, h, 3) in it, and their neighbours."""
    shown: Booleans = binary_dilation(region.contains(points), np.ones((3, 3)))
    if isinstance(region, Shell):
        shown &= region.hull.distance(points) > 0.3 * region.clearance
    return shown


def draw_region(axes: Axes, region: SampledRegion, cut: Cut, filled: bool = False) -> bool:
    """The region's outline, the device's hull in grey; hatched outside it, or if `filled` the region in blue.

    Returns whether the plane cuts the hull.
    """
    horizontal, vertical, points = cut.points(_FINE)
    inside = region.contains(points)
    place = horizontal * MILLI, vertical * MILLI
    if filled:
        axes.contourf(*place, inside, levels=[0.5, 1.5], colors=["#d6e8f5"])
    elif not inside.all():
        axes.contourf(*place, inside, levels=[-0.5, 0.5], colors=["white"], hatches=["////"])
    cut_hull = False
    if isinstance(region, Shell):
        device = region.hull.distance(points) <= 1e-9
        cut_hull = bool(device.any())
        if cut_hull:
            axes.contourf(*place, device, levels=[0.5, 1.5], colors=["#c3c9cf"])
    if _both(inside):
        axes.contour(*place, inside, levels=[0.5], colors=[BLUE if filled else GREY], linewidths=1)
    return cut_hull


def frame_cut(axes: Axes, cut: Cut) -> None:
    """Limits and labels of the window's axes, in mm."""
    (left, bottom), (right, top) = cut.low, cut.high
    axes.set(
        xlim=(left * MILLI, right * MILLI),
        ylim=(bottom * MILLI, top * MILLI),
        xlabel=f"{cut.horizontal} (mm)",
        ylabel=f"{cut.vertical} (mm)",
        aspect="equal",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))


def _both(mask: Booleans) -> bool:
    return bool(mask.any()) and not bool(mask.all())
