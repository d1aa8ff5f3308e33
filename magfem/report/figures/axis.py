"""B along the line through the device's centre that its moment points along."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from magfem.fields import Field, Shell
from magfem.fitting.readings import Reading
from magfem.report.figures.rival import Rival
from magfem.report.figures.style import (
    DASHES,
    EXACT,
    FEM,
    MEASURED,
    MODEL,
    RIVALS,
    Picture,
    drawing,
    figure,
    grid,
    percent_log,
    plain_log,
    png,
    wrapped,
)
from magfem.typing import Booleans, Floats

MILLI = 1e3
_SAMPLES = 601
_WIDE = 12.0
"""Ratio of the farthest to the nearest distance from which both axes are logarithmic."""


def axis_name(direction: Floats) -> str:
    """`z` for a direction along a coordinate axis, `m` otherwise."""
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if abs(direction @ unit) > 1 - 1e-9:
            return name
    return "m"


def axis_figure(
    model: Field,
    region: Shell,
    direction: Floats,
    solution: Field | None,
    closed_form: Field | None,
    rivals: Sequence[Rival],
    measurements: tuple[Reading, ...],
) -> Picture:
    """Above: the component of B along `direction` (a unit vector); below: relative differences."""
    reach = region.hull.radius + region.extent
    distance = _outside(region, direction, reach)
    wide = distance[-1] / distance[0] > _WIDE
    along = distance if wide else np.linspace(-reach, reach, 2 * _SAMPLES)
    line = along[:, None] * direction
    inside = region.contains(line)
    name = axis_name(direction)
    with drawing():
        drawn = figure(5.4)
        above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        if solution is not None:
            values = solution.B(line, outside="extrapolate") @ direction
            above.plot(along * MILLI, values * MILLI, color=FEM, linewidth=3.2, alpha=0.35, label="FEM")
        if closed_form is not None:
            values = closed_form.B(line, outside="extrapolate") @ direction
            above.plot(along * MILLI, values * MILLI, ":", color=EXACT, label="closed form, recoil permeability 1")
        values = model.B(line, outside="nan") @ direction
        above.plot(along * MILLI, values * MILLI, color=MODEL, linewidth=1.3, label="model, in its region")
        _measured(above, measurements, direction)
        if wide:
            above.set(xscale="log", yscale="log")
            plain_log(above.yaxis)
        _differences(below, along, line, inside, model, solution, closed_form, measurements, direction)
        for number, rival in enumerate(rivals):
            _rival(below, along, line, inside, rival, solution or model, number)
        if wide:
            ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200, 500) if distance[0] <= t / MILLI <= distance[-1]]
            below.set_xticks(ticks, [str(t) for t in ticks])
            below.minorticks_off()
        for axes in (above, below):
            grid(axes)
        above.set_ylabel(f"$B_{name}$ (mT)")
        below.set_xlabel(f"{name} (mm), from the centre" if wide else f"{name} (mm)")
        drawn.legend(loc="outside lower center", ncols=1, handlelength=2.6)
        content = png(drawn)
    return Picture(
        "axis",
        content,
        f"Curve of B along the {name} axis through the centre, and below it the relative differences.",
        f"B along the {name} axis, and how far the curves lie from "
        + ("the FEM solution." if solution is not None else "the model."),
    )


def _rival(
    axes: Axes,
    along: Floats,
    line: Floats,
    inside: Booleans,
    rival: Rival,
    reference: Field,
    number: int,
) -> None:
    """How far another family's fit lies from the reference, where it is meant to hold."""
    truth = reference.B(line, outside="extrapolate")
    apart = np.linalg.norm(rival.terms.jet(line, 0)[0] - truth, axis=-1) / np.linalg.norm(truth, axis=-1)
    shown = np.where(inside & rival.window.contains(line), apart, np.nan)
    colour = RIVALS[number % len(RIVALS)]
    axes.plot(along * MILLI, shown, DASHES[number % len(DASHES)], color=colour, label=wrapped(rival.label))


def _outside(region: Shell, direction: Floats, reach: float) -> Floats:
    """Distances from the centre, on the positive half of the line, that lie in the region: (n,) m, ascending."""
    along = np.linspace(0, reach, 20001)
    along = along[region.contains(along[:, None] * direction)]
    return np.geomspace(along[0], along[-1], _SAMPLES)


def _on_line(measurements: tuple[Reading, ...], direction: Floats) -> list[tuple[float, float, Reading]]:
    """Measurements on the line and along it: position along it (m), value (T)."""
    found = []
    for m in measurements:
        across = m.position - (m.position @ direction) * direction
        share = float(m.direction @ direction)
        if np.linalg.norm(across) < 1e-9 and abs(share) > 1 - 1e-9:
            found.append((float(m.position @ direction), m.value * share, m))
    return found


def _measured(axes: Axes, measurements: tuple[Reading, ...], direction: Floats) -> None:
    points = _on_line(measurements, direction)
    if points:
        axes.plot(
            [p * MILLI for p, _, _ in points],
            [v * MILLI for _, v, _ in points],
            "o",
            color=MEASURED,
            markersize=5,
            markeredgecolor="white",
            label="measured",
        )


def _differences(
    axes: Axes,
    along: Floats,
    line: Floats,
    inside: Booleans,
    model: Field,
    solution: Field | None,
    closed_form: Field | None,
    measurements: tuple[Reading, ...],
    direction: Floats,
) -> None:
    """Relative distance of every curve from the reference, on a logarithmic axis, where the region is."""
    reference = solution or model
    truth = reference.B(line, outside="extrapolate")
    size = np.linalg.norm(truth, axis=-1)

    def against(field: Field) -> Floats:
        apart = np.linalg.norm(field.B(line, outside="extrapolate") - truth, axis=-1) / size
        return np.where(inside, np.maximum(apart, 1e-12), np.nan)

    if closed_form is not None:
        axes.semilogy(along * MILLI, against(closed_form), ":", color=EXACT)
    if solution is not None:
        axes.semilogy(along * MILLI, against(model), color=MODEL, linewidth=1.3)
    for position, value, _ in _on_line(measurements, direction):
        predicted = float(reference.B(position * direction, outside="extrapolate") @ direction)
        axes.plot(
            position * MILLI, abs(value / predicted - 1), "o", color=MEASURED, markersize=5, markeredgecolor="white"
        )
    axes.set_yscale("log")
    axes.set_ylabel("difference" if solution is None else "difference from FEM")
    percent_log(axes.yaxis)
    axes.minorticks_off()
