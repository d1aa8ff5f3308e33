"""Where a model holds: the device and the region around it, to scale."""

from __future__ import annotations

import numpy as np

from magfem.fields import Shell
from magfem.fields.region import SampledRegion
from magfem.report.figures.cuts import Cut, draw_region, frame_cut
from magfem.report.figures.planes import Plane, outline
from magfem.report.figures.style import BLUE, INK, Picture, drawing, figure, length, png
from magfem.report.surface import Surface

MILLI = 1e3


def region_figure(region: Shell, surfaces: tuple[Surface, ...]) -> Picture:
    """A shell all round in the xz plane, to scale."""
    plane = Plane("x", "z", 1.08 * (region.hull.radius + region.extent))
    side, points = plane.points(500)
    distance = region.hull.distance(points)
    near, far = length(region.clearance), length(region.extent)
    with drawing():
        drawn = figure(4.0)
        axes = drawn.add_subplot()
        axes.contourf(
            side * MILLI, side * MILLI, distance, levels=[region.clearance, region.extent], colors=["#d6e8f5"]
        )
        axes.contour(
            side * MILLI,
            side * MILLI,
            distance,
            levels=[region.clearance, region.extent],
            colors=[BLUE],
            linewidths=1,
        )
        outline(axes, surfaces, plane, INK)
        top = (region.hull.distance(np.array([0.0, 0.0, 1e3])) - 1e3) * -MILLI  # the hull's height on the axis
        for text, height in ((f"{near} from the hull", region.clearance), (far, 0.85 * region.extent)):
            place = (0.0, top + height * MILLI)
            axes.annotate(text, place, (0, 3), textcoords="offset points", ha="center", color=BLUE)
        limit = plane.half * MILLI
        axes.set(xlim=(-limit, limit), ylim=(-limit, limit), xlabel="x (mm)", ylabel="z (mm)", aspect="equal")
        content = png(drawn)
    return Picture(
        "region",
        content,
        f"The region of validity in the xz plane: from {near} to {far} around the device's hull.",
        f"The model holds in the shaded part of space: {near} to {far} from the device's convex hull, all round.",
    )


def region_cut_figure(region: SampledRegion, cut: Cut) -> Picture:
    """A region of any kind in one plane, to scale, the device's hull in grey."""
    ratio = (cut.high[1] - cut.low[1]) / (cut.high[0] - cut.low[0])
    with drawing():
        drawn = figure(float(np.clip(0.7 + 3.6 * ratio, 1.8, 4.4)))
        axes = drawn.add_subplot()
        hull = draw_region(axes, region, cut, filled=True)
        frame_cut(axes, cut)
        content = png(drawn)
    device = " Grey: the device's hull." if hull else ""
    return Picture(
        f"region_{cut.horizontal}{cut.vertical}",
        content,
        f"The region of validity in the {cut.words}: {region.describe()}.",
        f"The model holds in the shaded part of the {cut.words}.{device}",
    )
