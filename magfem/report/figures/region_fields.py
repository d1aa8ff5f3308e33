"""Fields and errors of models whose region is no shell all round a magnet: maps in planes, curves along a line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from magfem.fields import Field, Shell
from magfem.fields.region import SampledRegion
from magfem.fields.region_parts import bounding_box
from magfem.fitting import FieldModel, Validation
from magfem.fitting.located_errors import distance_in, largest_sizes, middle, sizes
from magfem.report.figures.cuts import MILLI, Cut, draw_region, frame_cut, tiles
from magfem.report.figures.style import (
    BLUE,
    DPI,
    ERROR,
    FEM,
    GREEN,
    MAGNITUDE,
    MODEL,
    ORANGE,
    WIDTH,
    Picture,
    drawing,
    figure,
    grid,
    percent_log,
    plain_log,
    png,
)
from magfem.typing import Floats, Points

WORDS = {"B": "B", "gradient": "the gradient"}
_TILES, _LINES, _SAMPLES = 100, 40, 401
_TICKS = tuple(d * 10.0**p for p in range(-3, 4) for d in (1, 2, 5))


def map_axes(cut: Cut) -> tuple[Figure, Axes, Axes]:
    """A figure with a map of a cut's own shape and its colour bar."""
    ratio = (cut.high[1] - cut.low[1]) / (cut.high[0] - cut.low[0])
    left, bottom, top, bar = 0.68, 0.46, 0.34, 0.94  # inches
    width = WIDTH - left - bar
    height = min(width * ratio, 4.2)
    width = height / ratio
    whole = bottom + height + top
    drawn = Figure(figsize=(WIDTH, whole), dpi=DPI)
    axes = drawn.add_axes((left / WIDTH, bottom / whole, width / WIDTH, height / whole))
    beside = drawn.add_axes(((left + width + 0.1) / WIDTH, bottom / whole, 0.13 / WIDTH, height / whole))
    return drawn, axes, beside


def region_field_map(model: FieldModel, cut: Cut) -> Picture:
    """|B| in colours and field lines, within the model's region."""
    horizontal, vertical, points = cut.points(_TILES)
    inside = tiles(model.region, points)
    size = np.full(inside.shape, np.nan)
    size[inside] = np.linalg.norm(model.B(points[inside], outside="extrapolate"), axis=-1) * MILLI
    low, high = (float(q) for q in np.quantile(size[inside], (0.002, 0.9995)))
    across, up, seeds = cut.points(_LINES)
    flow = np.full((*seeds.shape[:2], 2), np.nan)
    known = model.region.contains(seeds)
    flow[known] = model.B(seeds[known], outside="extrapolate")[:, list(cut.columns)]
    flow /= np.maximum(np.linalg.norm(flow, axis=-1, keepdims=True), 1e-300)
    with drawing():
        drawn, axes, beside = map_axes(cut)
        norm = LogNorm(max(low, 1e-4 * high), high)
        image = axes.pcolormesh(
            horizontal * MILLI, vertical * MILLI, size, norm=norm, cmap=MAGNITUDE, rasterized=True, shading="nearest"
        )
        axes.streamplot(
            across * MILLI,
            up * MILLI,
            np.ma.masked_invalid(flow[..., 0]),
            np.ma.masked_invalid(flow[..., 1]),
            color="#ffffffb0",
            linewidth=0.7,
            arrowsize=0.7,
            density=1.0,
        )
        hull = draw_region(axes, model.region, cut)
        frame_cut(axes, cut)
        bar = drawn.colorbar(image, cax=beside)
        axes.set_title(f"|B| (m{model.unit})", loc="left")
        plain_log(bar.ax.yaxis, fine=high < 1e3 * low)
        bar.ax.minorticks_off()
        content = png(drawn)
    return Picture(
        f"field_{cut.horizontal}{cut.vertical}",
        content,
        f"Map of the flux density in the {cut.words}, from {low:.3g} to {high:.3g} m{model.unit}, with field lines.",
        f"|B| and field lines in the {cut.words}, where the model holds"
        + ("; grey is the device's hull." if hull else "."),
    )


def cut_errors(model: FieldModel, truth: Field, cut: Cut, count: int = _TILES) -> dict[str, Floats]:
    """Relative errors (v, h) of B and of the gradient in a plane, NaN outside the region."""
    _, _, points = cut.points(count)
    inside = tiles(model.region, points)
    theirs = truth.jet(points[inside], 1, outside="extrapolate")
    ours = model.jet(points[inside], 1, outside="extrapolate")
    difference = tuple(a - b for a, b in zip(ours, theirs, strict=True))
    largest, distance = largest_sizes(model, model.region), distance_in(model.region, points[inside])
    found = {}
    for k, key in enumerate(("B", "gradient")):
        found[key] = np.full(points.shape[:2], np.nan)
        found[key][inside] = largest.errors(sizes(difference, k), sizes(theirs, k), distance, key)
    return found


def draw_errors(axes: Axes, region: SampledRegion, cut: Cut, errors: Floats, top: float) -> Any:
    """A map of relative errors (v, h), its colours from `top` four decades down; hatched outside the region."""
    count = max(errors.shape)
    horizontal, vertical, _ = cut.points(count)
    image = axes.pcolormesh(
        horizontal * MILLI,
        vertical * MILLI,
        np.maximum(errors, 1e-16),
        norm=LogNorm(top * 1e-4, top),
        cmap=ERROR,
        rasterized=True,
    )
    draw_region(axes, region, cut)
    frame_cut(axes, cut)
    return image


def decade(largest: float) -> float:
    """The power of ten at or above an error, where its colours end."""
    return float(10.0 ** np.ceil(np.log10(max(largest, 1e-14))))


def region_error_map(model: FieldModel, found: Validation, errors: dict[str, Floats], cut: Cut, key: str) -> Picture:
    """Relative error of B or of the gradient in a plane."""
    with drawing():
        drawn, axes, beside = map_axes(cut)
        image = draw_errors(axes, model.region, cut, errors[key], decade(found.found[key]["max"]))
        bar = drawn.colorbar(image, cax=beside, extend="min")
        axes.set_title(f"relative error of {WORDS[key]}", loc="left")
        percent_log(bar.ax.yaxis)
        bar.ax.minorticks_off()
        content = png(drawn)
    largest = 100 * float(np.nanmax(errors[key]))
    return Picture(
        f"residual_{key}",
        content,
        f"Map of the relative error of {WORDS[key]} in the {cut.words}; the largest value is {largest:.2g} %.",
        f"Model against FEM: relative error of {WORDS[key]} in the {cut.words}. Hatched: outside the region.",
    )


def draw_distance(axes: Axes, found: Validation, key: str, log: bool) -> None:
    """Largest error and RMS of groups of points against their distance, and the stated bound."""
    groups = found.by_distance[key]
    distance = np.array([group["distance"] for group in groups]) * MILLI
    axes.plot(distance, [group["max"] for group in groups], "o-", color=MODEL, markersize=3.5, label="largest")
    axes.plot(distance, [group["rms"] for group in groups], "o--", color=MODEL, markersize=2.5, label="RMS", alpha=0.7)
    axes.axhline(found.bound[key], color=ORANGE, linewidth=1.2, label="stated bound")
    axes.set_yscale("log")
    if log:
        axes.set_xscale("log")
        low, high = distance.min() / 1.001, distance.max() * 1.001
        ticks = [tick for tick in _TICKS if low <= tick <= high]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    percent_log(axes.yaxis)
    axes.minorticks_off()
    axes.set_xlabel(f"distance from {found.distance_from} (mm)")
    axes.set_title(f"relative error of {WORDS[key]}", loc="left")
    grid(axes)
    axes.legend(loc="best")


def region_distance_figure(model: FieldModel, found: Validation, key: str) -> Picture:
    """Error against distance, of points all over the region."""
    with drawing():
        drawn = figure(3.3)
        draw_distance(drawn.add_subplot(), found, key, log=isinstance(model.region, Shell))
        content = png(drawn)
    return Picture(
        f"distance_{key}",
        content,
        f"Curves of the largest and of the root mean square error of {WORDS[key]} against the distance from "
        f"{found.distance_from}.",
        f"Relative error of {WORDS[key]} against the distance from {found.distance_from}, at {found.points} random "
        "points of the region.",
    )


@dataclass(frozen=True)
class RegionLine:
    """A line along one axis through a region: its other two coordinates are those of `start` (3,) m."""

    axis: int
    start: Points
    low: float
    high: float

    @property
    def words(self) -> str:
        """`z, at x = 0, y = 0`."""
        others = [k for k in range(3) if k != self.axis]
        places = ", ".join(f"{'xyz'[k]} = {self.start[k] * MILLI + 0.0:.4g}" for k in others)
        return f"{'xyz'[self.axis]}, at {places} mm"

    def points(self, count: int) -> tuple[Floats, Points]:
        """Coordinates (count,) m along the axis, and points (count, 3)."""
        along = np.linspace(self.low, self.high, count)
        points = np.tile(self.start, (count, 1))
        points[:, self.axis] = along
        return along, points


def region_lines(region: SampledRegion) -> tuple[RegionLine, ...]:
    """The lines along z and x through the device, or a workspace's middle, as far as they meet the region."""
    low, high = bounding_box(region)
    through = np.clip(np.zeros(3), low, high) if isinstance(region, Shell) else middle(region)
    found = []
    for axis in (2, 0):
        line = RegionLine(axis, through, float(low[axis]), float(high[axis]))
        along, points = line.points(2001)
        inside = np.flatnonzero(region.contains(points))
        if inside.size > 20:
            found.append(RegionLine(axis, through, float(along[inside[0]]), float(along[inside[-1]])))
    return tuple(found)


def region_line_figure(model: FieldModel, truth: Field | None, line: RegionLine) -> Picture:
    """The three components of B along a line, where the model holds; below, how far the solution is from them."""
    along, points = line.points(_SAMPLES)
    B = model.B(points, outside="nan") * MILLI
    with drawing():
        drawn = figure(3.2 if truth is None else 4.8)
        panels = drawn.subplots(1 if truth is None else 2, 1, sharex=True, squeeze=False)[:, 0]
        above = panels[0]
        if truth is not None:
            theirs = truth.B(points, outside="extrapolate") * MILLI
            shown = np.where(np.isfinite(B), theirs, np.nan)
            for k in range(3):
                label = "FEM" if k == 0 else None
                above.plot(along * MILLI, shown[:, k], color=FEM, linewidth=3.2, alpha=0.3, label=label)
            apart = np.linalg.norm(B - theirs, axis=1) / np.linalg.norm(theirs, axis=1)
            panels[1].semilogy(along * MILLI, np.maximum(apart, 1e-14), color=MODEL)
            panels[1].set_ylabel("difference from FEM")
            percent_log(panels[1].yaxis)
            panels[1].minorticks_off()
        for k, colour in enumerate((BLUE, ORANGE, GREEN)):
            above.plot(along * MILLI, B[:, k], color=colour, linewidth=1.3, label=f"$B_{'xyz'[k]}$")
        above.set_ylabel(f"B (m{model.unit})")
        panels[-1].set_xlabel(f"{'xyz'[line.axis]} (mm)")
        for axes in panels:
            grid(axes)
        drawn.legend(loc="outside lower center", ncols=4)
        content = png(drawn)
    return Picture(
        f"line_{'xyz'[line.axis]}",
        content,
        f"Curves of the three components of B along {line.words}.",
        f"B along {line.words}" + (", and how far the FEM solution is from it." if truth is not None else "."),
    )
