"""How far a field is from that at the centre, in a plane."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap

from magfem.fields import Field
from magfem.report.coil_numbers import deviation
from magfem.report.figures.planes import Plane, frame, outline, square
from magfem.report.figures.style import INK, Picture, drawing, png
from magfem.report.surface import Surface
from magfem.typing import Points

MILLI = 1e3
_MAP = 48
_LEVELS = (0.0, 0.001, 0.01, 0.05, 0.1, 0.2, 0.5)
_COLOURS = ("#0b4f7d", "#2b7bb0", "#6aaed6", "#b5d4e9", "#dfecf6", "#f3f7fb")


def homogeneity_figure(
    field: Field, centre: Points, plane: Plane, surfaces: tuple[Surface, ...], whose: str = ""
) -> Picture:
    """|B − B(centre)| / |B(centre)| in steps; `whose` names the field where there are several."""
    side, points = plane.points(_MAP)
    found = deviation(field.B(points), field.B(centre))
    with drawing():
        drawn, axes, bar_axes = square()
        colours = ListedColormap(_COLOURS).with_extremes(over="white")
        image = axes.contourf(
            side * MILLI,
            side * MILLI,
            np.minimum(found, 1e3),
            levels=_LEVELS,
            cmap=colours,
            norm=BoundaryNorm(_LEVELS, len(_COLOURS)),
            extend="max",
        )
        axes.contour(side * MILLI, side * MILLI, np.minimum(found, 1e3), levels=[0.01], colors=[INK], linewidths=1.2)
        outline(axes, surfaces, plane, INK)
        horizontal, vertical = centre[list(plane.columns)] * MILLI
        axes.plot(horizontal, vertical, "+", color="white", markersize=7)
        frame(axes, plane)
        bar = drawn.colorbar(image, cax=bar_axes, spacing="uniform")
        bar.set_ticks(_LEVELS, labels=[f"{100 * level:g} %" for level in _LEVELS])
        axes.set_title("deviation from the centre", loc="left")
        content = png(drawn)
    of = f" of {whose}" if whose else ""
    return Picture(
        f"homogeneity_{plane.horizontal}{plane.vertical}",
        content,
        f"Map of the deviation of B{of} from that at the centre, in the {plane.words}.",
        f"Deviation of B{of} from that at the centre (+), in the {plane.words}; the dark line is 1 %.",
    )
