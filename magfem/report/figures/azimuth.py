"""A check on diametric magnets: how |B| changes around the axis of magnetisation, where symmetry would forbid it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magfem.fields import Shell
from magfem.fields.terms import frame_about
from magfem.report.figures.style import FEM, MODEL, RIVALS, Picture, drawing, figure, grid, png, wrapped
from magfem.typing import Floats, Points, Vectors

_COUNT = 181
POLAR = 90.0  # degrees from the axis of magnetisation


def azimuth_ring(region: Shell, direction: Floats) -> tuple[float, Points]:
    """Radius (m) and points (n, 3) of a circle about the axis of magnetisation, once round, near the device."""
    radius = region.hull.radius + region.clearance
    axis = np.array([0.0, 0.0, 1.0])
    along = np.linalg.norm(np.cross(direction, axis)) < 1e-6 * np.linalg.norm(direction)
    frame = frame_about(direction, None if along else axis)
    angle = np.radians(np.linspace(0, 360, _COUNT))
    x, y = frame[:, 0], frame[:, 1]
    return radius, radius * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)


def azimuth_figure(radius: float, solution: Vectors, model: Vectors, rivals: Sequence[tuple[str, Vectors]]) -> Picture:
    """|B| (mT) on the circle against the azimuth from the device's z axis: FEM, this model and other families."""
    angle = np.linspace(0, 360, _COUNT)
    sizes = np.linalg.norm(solution, axis=-1) * 1e3
    with drawing():
        drawn = figure(3.9)
        axes = drawn.add_subplot()
        axes.plot(angle, sizes, color=FEM, linewidth=4, alpha=0.35, label="FEM")
        axes.plot(angle, np.linalg.norm(model, axis=-1) * 1e3, color=MODEL, linewidth=1.3, label="this model")
        for number, (label, field) in enumerate(rivals):
            size, colour = np.linalg.norm(field, axis=-1) * 1e3, RIVALS[number % len(RIVALS)]
            axes.plot(angle, size, "--", color=colour, label=wrapped(label))
        axes.axhline(sizes.mean(), color="#9aa2aa", linewidth=1, linestyle=":", label="if it were axisymmetric")
        axes.set(xlim=(0, 360), xticks=range(0, 361, 45), xlabel="azimuth about the magnetisation axis, from z (°)")
        axes.set_ylabel("|B| (mT)")
        grid(axes)
        drawn.legend(loc="outside lower center", ncols=1, handlelength=2.6)
        content = png(drawn)
    ratio = float(sizes.max() / sizes.min())
    return Picture(
        "azimuth",
        content,
        f"Curve of |B| against the azimuth about the magnetisation axis; it varies by a factor of {ratio:.3g}.",
        f"|B| on a circle of radius {radius * 1e3:.3g} mm about the magnetisation axis, at {POLAR:.0f}° from it. "
        f"It varies by a factor of {ratio:.3g}: the field of a diametric cylinder is not one of revolution about its "
        "magnetisation, and neither are sums of sources that are symmetric only by reflection.",
    )
