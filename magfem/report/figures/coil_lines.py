"""A coil's field per ampere along a line, and how it changes along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magfem.fields import Field
from magfem.report.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, Picture, drawing, figure, grid, png
from magfem.report.workplace import Line
from magfem.typing import Floats

MILLI = 1e3
_SAMPLES = 401
_COLOURS = (BLUE, ORANGE, GREEN, PURPLE)


def line_figure(fields: Sequence[tuple[str, Field, Floats]], line: Line, where: str) -> Picture:
    """Above: B per ampere along the line; below: its derivative along the line.

    fields: by the words of the legend, each with the unit vector (3,) along which its B is taken.
    """
    place, points = line.points(_SAMPLES)
    with drawing():
        drawn = figure(4.4)
        above, below = drawn.subplots(2, 1, sharex=True)
        component = ""
        for number, (label, field, along) in enumerate(fields):
            B, gradient = field.jet(points, 1)
            colour = _COLOURS[number % len(_COLOURS)]
            component = _component(along)
            named = f"{label}: $B_{{{component}}}$" if len(fields) > 1 else None
            above.plot(place * MILLI, B @ along * MILLI, color=colour, label=named)
            slope = np.einsum("i,nij,j->n", along, gradient, line.direction)
            below.plot(place * MILLI, slope, color=colour)
        for axes in (above, below):
            grid(axes)
            low, high = axes.get_ylim()
            if low < 0.2 * (high - low) and high > -0.2 * (high - low):
                axes.axhline(0, color=INK, linewidth=0.6)
        name = "B" if len(fields) > 1 else f"B_{{{component}}}"
        above.set_ylabel(f"${name}$ (mT/A)")
        below.set_ylabel(f"$∂{name}/∂{line.axis}$ (T/m/A)")
        below.set_xlabel(f"{line.axis} (mm)")
        if len(fields) > 1:
            drawn.legend(loc="outside lower center", ncols=2)
        content = png(drawn)
    return Picture(
        f"line_{line.axis}",
        content,
        f"Curves of B per ampere, and of its derivative, along {line.axis}, {where}.",
        f"B per ampere along {line.axis}, {where}, and how fast it changes.",
    )


def _component(along: Floats) -> str:
    """`z` for a direction along a coordinate axis, `b` for any other."""
    for name, axis in zip("xyz", np.eye(3), strict=True):
        if abs(along @ axis) > 1 - 1e-4:
            return name
    return "b"
