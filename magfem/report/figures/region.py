"""Where a model holds: the device, the clearance around it and the outer limit, to scale."""

from __future__ import annotations

import numpy as np

from magfem.fields import Shell
from magfem.report.figures.planes import Plane, outline
from magfem.report.figures.style import BLUE, INK, Picture, drawing, figure, length, png
from magfem.report.surface import Surface

MILLI = 1e3


def region_figure(region: Shell, surfaces: tuple[Surface, ...]) -> Picture:
    """The region in the xz plane, to scale."""
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
