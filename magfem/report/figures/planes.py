"""Planes through a device: |B| with field lines, and maps of a model's relative error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from magfem.fields import Everywhere, Field, Shell
from magfem.fields.norms import FLOOR
from magfem.geometry import Geometry
from magfem.report.figures.style import (
    DPI,
    ERROR,
    INK,
    MAGNITUDE,
    ORANGE,
    WIDTH,
    Picture,
    drawing,
    percent_log,
    plain_log,
    png,
)
from magfem.report.surface import Surface
from magfem.typing import Floats, Points

MILLI = 1e3
_MAP = 128  # samples along a map's side
_LINES = 60  # samples along the side of the grid that field lines are traced on


@dataclass(frozen=True)
class Plane:
    """A square window on a plane: its two axes by name, the height of the plane along the third."""

    horizontal: str  # "x", "y" or "z"
    vertical: str
    half: float  # m, half the window's side
    height: float = 0.0  # m

    @property
    def normal_axis(self) -> str:
        """The axis that the plane stands across."""
        return next(iter(set("xyz") - {self.horizontal, self.vertical}))

    @property
    def words(self) -> str:
        """`xz plane, y = 0`."""
        height = f"{self.height * MILLI:.3g} mm" if self.height else "0"
        return f"{self.horizontal}{self.vertical} plane, {self.normal_axis} = {height}"

    @property
    def columns(self) -> tuple[int, int]:
        """The two axes as columns of points."""
        return "xyz".index(self.horizontal), "xyz".index(self.vertical)

    def points(self, count: int) -> tuple[Floats, Points]:
        """Middles of `count` × `count` tiles: positions along a side (count,) m and points (count, count, 3)."""
        side = self.half * (2 * (np.arange(count) + 0.5) / count - 1)
        points = np.empty((count, count, 3))
        horizontal, vertical = self.columns
        points[..., horizontal], points[..., vertical] = np.meshgrid(side, side)
        points[..., "xyz".index(self.normal_axis)] = self.height
        return side, points


def near_window(geometry: Geometry) -> float:
    """Half side (m) of a window that shows the device large and the region as far as both fit together."""
    radius, region = geometry.hull.radius, geometry.region
    return radius + min(region.extent, max(3 * radius, 4 * region.clearance))


def field_planes(geometry: Geometry, surfaces: tuple[Surface, ...]) -> tuple[Plane, Plane]:
    """The plane of magnetisation and axis, and the one that adds most to it."""
    half = near_window(geometry)
    if geometry.axisymmetric:  # across the axis B has no component in the middle plane: look just in front
        front = max(float(surface.points[:, 2].max()) for surface in surfaces) + geometry.region.clearance
        return Plane("x", "z", half), Plane("x", "y", half, front)
    return Plane("x", "z", half), Plane("x", "y", half)


def field_map(
    field: Field,
    surfaces: tuple[Surface, ...],
    plane: Plane,
    name: str = "",
    caption: str = "",
    counts: tuple[int, int] = (_MAP, _LINES),
) -> Picture:
    """|B| in colours, the direction of its part in the plane as field lines, the device's outline.

    What lies outside the field's region is left grey: terms of a model are infinite somewhere within the device.
    name, caption: of the picture, where those of a magnet do not fit.  counts: samples along a side, of |B| and of the
    field lines.
    """
    side, points = plane.points(counts[0])
    size = np.linalg.norm(field.B(points, outside="nan"), axis=-1) * MILLI
    coarse, seeds = plane.points(counts[1])
    direction = np.ma.masked_invalid(field.B(seeds, outside="nan")[..., list(plane.columns)])
    direction /= np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-300)
    low, high = (float(q) for q in np.nanquantile(size, (0.002, 0.9995)))
    with drawing():
        drawn, axes, bar_axes = square()
        axes.set_facecolor("#c8ccd0")
        image = axes.pcolormesh(
            side * MILLI,
            side * MILLI,
            size,
            norm=LogNorm(low, high),
            cmap=MAGNITUDE,
            rasterized=True,
            shading="nearest" if counts[0] >= _MAP else "gouraud",
        )
        axes.streamplot(
            coarse * MILLI,
            coarse * MILLI,
            direction[..., 0],
            direction[..., 1],
            color="#ffffffb0",
            linewidth=0.7,
            arrowsize=0.7,
            density=1.1,
        )
        outline(axes, surfaces, plane, "white")
        frame(axes, plane)
        bar = drawn.colorbar(image, cax=bar_axes)
        axes.set_title(f"|B| (m{field.unit})", loc="left")
        plain_log(bar.ax.yaxis, fine=high < 1e3 * low)
        bar.ax.minorticks_off()
        content = png(drawn)
    return Picture(
        name or f"field_{plane.horizontal}{plane.vertical}",
        content,
        f"Map of the flux density in the {plane.words}, from {low:.3g} to {high:.3g} m{field.unit}, with field lines.",
        caption
        or f"|B| and field lines in the {plane.words}; the white outline is the device"
        + _about_the_inside(field, plane),
    )


def _about_the_inside(field: Field, plane: Plane) -> str:
    if plane.height:
        return ", seen through the plane in front of it."
    everywhere = isinstance(field.region, Everywhere)
    return ", inside of which B is shown too." if everywhere else "; grey is outside the model's region."


def square() -> tuple[Figure, Axes, Axes]:
    """A figure with a square map and its colour bar, at the same place in all of them."""
    height, left, bottom, side = 3.9, 0.56, 0.46, 3.1  # inches
    drawn = Figure(figsize=(WIDTH, height), dpi=DPI)
    axes = drawn.add_axes((left / WIDTH, bottom / height, side / WIDTH, side / height))
    bar = drawn.add_axes(((left + side + 0.1) / WIDTH, bottom / height, 0.13 / WIDTH, side / height))
    return drawn, axes, bar


def _hatch_outside(axes: Axes, region: Shell, plane: Plane) -> None:
    """White with hatching wherever the model makes no promise."""
    side, points = plane.points(400)
    distance = region.hull.distance(points)
    levels = (-1.0, region.clearance), (region.extent, max(float(distance.max()), 2 * region.extent))
    for low, high in levels:
        axes.contourf(side * MILLI, side * MILLI, distance, levels=[low, high], colors=["white"], hatches=["////"])


def outline(axes: Axes, surfaces: tuple[Surface, ...], plane: Plane, colour: str) -> None:
    """The device cut by the plane; by the parallel plane through its middle when the plane passes it by."""
    normal = np.eye(3)["xyz".index(plane.normal_axis)]
    for surface in surfaces:
        cut, style = surface.section(plane.height * normal, normal), "solid"
        if cut.size == 0:
            cut, style = surface.section(surface.points.mean(axis=0), normal), "dotted"
        segments = cut[..., list(plane.columns)] * MILLI
        axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=1.3, linestyles=style))


def frame(axes: Axes, plane: Plane) -> None:
    """Limits and labels of the plane's axes, in mm."""
    limit = plane.half * MILLI
    axes.set(
        xlim=(-limit, limit),
        ylim=(-limit, limit),
        xlabel=f"{plane.horizontal} (mm)",
        ylabel=f"{plane.vertical} (mm)",
        aspect="equal",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]))


def error_map(
    model: Field,
    reference: Field,
    region: Shell,
    surfaces: tuple[Surface, ...],
    plane: Plane,
    derivative: int,
    worst: Floats | None = None,
) -> Picture:
    """Relative error of B (`derivative` 0) or of its gradient (1) in the region; hatched where none is promised.

    worst : a point (3,) m of the plane to mark.
    """
    what = ("B", "the gradient")[derivative]
    side, points = plane.points(_MAP)
    distance, tile = region.hull.distance(points), 2 * plane.half / _MAP
    shown = (distance > region.clearance - tile) & (distance < region.extent + tile)  # tiles cut by its edge too
    errors = np.full(shown.shape, np.nan)
    errors[shown] = _relative(model, reference, region, points[shown], derivative)
    largest = float(errors[region.contains(points)].max())
    top = 10.0 ** np.ceil(np.log10(largest))
    with drawing():
        drawn, axes, bar_axes = square()
        image = axes.pcolormesh(
            side * MILLI, side * MILLI, errors, norm=LogNorm(top * 1e-4, top), cmap=ERROR, rasterized=True
        )
        _hatch_outside(axes, region, plane)
        outline(axes, surfaces, plane, INK)
        frame(axes, plane)
        if worst is not None:
            horizontal, vertical = worst[list(plane.columns)] * MILLI
            axes.plot(horizontal, vertical, "x", color=ORANGE, markersize=7, markeredgewidth=1.8, clip_on=False)
        bar = drawn.colorbar(image, cax=bar_axes, extend="min")
        axes.set_title(f"relative error of {what}", loc="left")
        percent_log(bar.ax.yaxis)
        bar.ax.minorticks_off()
        content = png(drawn)
    mark = " × marks the worst held-out point." if worst is not None else ""
    return Picture(
        ("residual_B", "residual_gradient")[derivative],
        content,
        f"Map of the relative error of {what} in the {plane.words}; the largest value is {100 * largest:.2g} %.",
        f"Model against FEM: relative error of {what} in the {plane.words}. Hatched: outside the region.{mark}",
    )


def _relative(model: Field, reference: Field, region: Shell, points: Points, derivative: int) -> Floats:
    """Relative errors (n,) at points of the region, in the norm of `fields.norms`."""
    truth = reference.jet(points, derivative, outside="extrapolate")[derivative]
    found = model.jet(points, derivative, outside="extrapolate")[derivative]
    axes = tuple(range(1, truth.ndim))
    size, difference = (np.sqrt((a**2).sum(axis=axes)) for a in (truth, found - truth))
    # The floor counts against the largest value at the same distance, which falls smoothly: interpolate it.
    distances = np.geomspace(region.clearance, region.extent, 25)
    layers = region.hull.offset_points(distances, 80, np.random.default_rng(2))
    jet = model.jet(layers, derivative, outside="extrapolate")[derivative]
    largest = np.sqrt((jet**2).sum(axis=tuple(range(2, jet.ndim)))).max(axis=1)
    distance = region.hull.distance(points)
    floor = FLOOR * np.exp(np.interp(np.log(distance), np.log(distances), np.log(largest)))
    errors: Floats = difference / np.maximum(size, floor)
    return errors
