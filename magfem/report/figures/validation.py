"""One picture of a validation: where a model's errors are, and how they fall with distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from magfem.fields import Field, Shell
from magfem.fitting import FieldModel, Validation
from magfem.fitting.located_errors import QUANTITIES
from magfem.report.figures.cuts import MILLI, Cut, cuts
from magfem.report.figures.region_fields import cut_errors, decade, draw_distance, draw_errors
from magfem.report.figures.style import GREY, ORANGE, Picture, drawing, figure, percent_log, png

_MAP = 128  # tiles along the longer side of a map
_NEAR = 0.05  # of the window: worst points nearer to the plane than this lie in it


def validation_figure(model: FieldModel, reference: Field, found: Validation) -> Picture:
    """Maps of the relative error of B and of the gradient in two planes; beside them, error against distance."""
    planes = cuts(model.region)
    mapped = [cut_errors(model, reference, plane, _MAP) for plane in planes]
    ratio = max((p.high[1] - p.low[1]) / (p.high[0] - p.low[0]) for p in planes)
    with drawing():
        drawn = figure(1.0 + 2 * min(max(3.6 * ratio, 2.4), 4.2), 13.0)
        panels = drawn.subplots(2, 3, width_ratios=(1, 1, 0.95))
        for row, key in enumerate(QUANTITIES):
            top = decade(found.found[key]["max"])
            for column, plane in enumerate(planes):
                axes = panels[row, column]
                image = draw_errors(axes, model.region, plane, mapped[column][key], top)
                _mark(axes, plane, found.worst_points[key] or ())
                axes.set_title(f"{key}: {plane.words}", loc="left")
            bar = drawn.colorbar(image, ax=panels[row, :2].tolist(), extend="min", pad=0.015, aspect=28, shrink=0.9)
            percent_log(bar.ax.yaxis)
            bar.ax.minorticks_off()
            draw_distance(panels[row, 2], found, key, log=isinstance(model.region, Shell))
        _heading(drawn, model, found)
        content = png(drawn)
    largest = {key: found.found[key]["max"] for key in QUANTITIES}
    return Picture(
        "validation",
        content,
        f"Maps of the relative error of {model.name} against {found.reference} in the {planes[0].words}, and the "
        f"{planes[1].words}, and curves of the error against distance; at most {largest['B']:.1e} in B and "
        f"{largest['gradient']:.1e} in the gradient.",
        f"Relative error against {found.reference}. × marks the worst of {found.points} random points in the plane, "
        "○ those beside it; hatched is outside the region.",
    )


def _heading(drawn: Figure, model: FieldModel, found: Validation) -> None:
    verdict = "the stated bound is kept" if found.passed else "the stated bound is EXCEEDED"
    drawn.suptitle(
        f"{model.name} against {found.reference}: {verdict}", x=0.01, ha="left", fontsize=10.5, fontweight="bold"
    )
    note = f"× worst random points in the plane, ○ beside it; hatched: not in the region, {model.region.describe()}"
    if isinstance(model.region, Shell):
        note += "; grey: the device's hull"
    drawn.supxlabel(note, x=0.01, ha="left", fontsize=8.5, color=GREY)


def _mark(axes: Axes, plane: Cut, worst: Sequence[dict[str, Any]]) -> None:
    """The worst points, seen along the plane's normal."""
    near = _NEAR * max(np.subtract(plane.high, plane.low))
    for one in worst:
        point = one["point"]
        in_plane = abs(point[plane.normal] - plane.height) < near
        axes.plot(
            point[plane.columns[0]] * MILLI,
            point[plane.columns[1]] * MILLI,
            "x" if in_plane else "o",
            color=ORANGE,
            markersize=7 if in_plane else 5,
            markeredgewidth=1.8 if in_plane else 1.0,
            markerfacecolor="none",
            clip_on=False,
        )
