"""The picture of a localization: the signal with its fit, the spectrum, and the poses next to the sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch

from magfem.localization import Pose, RotatingField, spectrum
from magfem.localization.recorded import Setup
from magfem.report.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    Picture,
    drawing,
    figure,
    grid,
    png,
)
from magfem.report.scenes import View, axes_cross, scale_bar, view
from magfem.samples.recording import Recording
from magfem.typing import Floats, Points

MILLI, MICRO = 1e3, 1e6
AXES = (BLUE, ORANGE, GREEN)
"""Colours of the three axes of a sensor."""

_WIDE = 7.4  # inches
_TURNS = 8  # of the slowest motor that the signal shows at most
_SHOWN = 3000  # samples of a curve that still are single dots
_LONG_AGO = 1e5  # s after the zero of the clock: beyond, times are shown from a whole second on


def localization_picture(
    recording: Recording, setup: Setup, entries: Sequence[dict[str, Any]], poses: Sequence[Pose]
) -> Picture:
    """The recording's last window with the sinusoids that were fitted to it, the spectrum, and all poses in space.

    entries: all poses as plain data (`poses_file`).  poses: those of the last window, one for every motor.
    """
    window = entries[-1]["window"]
    name = _strongest(poses, entries[-1]["sensors"])
    own = recording.subset(recording.sensor == recording.sensors.index(name))
    last = own.subset((own.times >= window[0]) & (own.times <= window[1]))
    with drawing():
        drawn = figure(5.2, _WIDE)
        halves: Any = drawn.subfigures(1, 2)
        left, right = halves
        *signal, below = left.subplots(4, height_ratios=(1, 1, 1, 1.6))
        _signal(signal, last, poses, entries[-1]["sensors"].index(name))
        _spectrum(below, last, poses, setup)
        _space(right, right.subplots(), setup, entries, len(poses))
        content = png(drawn)
    many = f"{len(entries)} poses" if len(entries) > 1 else "the pose"
    of = f" of sensor {name}" if name else ""
    return Picture(
        "localization",
        content,
        f"The signal{of} with its fit, its spectrum, and {many} next to the sensors.",
        f"Left: samples{of} (dots), the sinusoids fitted to them (lines), and the spectrum with the frequency of "
        f"rotation. Right: {many} next to the sensors; arrows are axes of rotation.",
    )


def _strongest(poses: Sequence[Pose], names: Sequence[str]) -> str:
    """The name of the sensor that sees most of the first motor."""
    return names[int(np.argmax([float(field.strength) for field in poses[0].fields]))]


def _signal(panels: Sequence[Axes], last: Recording, poses: Sequence[Pose], place: int) -> None:
    fields = [pose.fields[place] for pose in poses]
    slowest = min(float(pose.frequency) for pose in poses)
    begin = float(last.times[0])
    end = min(float(last.times[-1]), begin + _TURNS / slowest)
    dense = np.linspace(begin, end, 1200)
    fitted = fields[0].static + sum(_turning(field, dense) for field in fields)
    seen = (last.times >= begin) & (last.times <= end)
    zero = np.floor(begin) if abs(begin) > _LONG_AGO else 0.0
    style = {"marker": ".", "markersize": 3.0, "linestyle": "none"} if seen.sum() < _SHOWN else {"linewidth": 0.4}
    for axis, (panel, colour) in enumerate(zip(panels, AXES, strict=True)):
        panel.plot(last.times[seen] - zero, MICRO * last.B[seen, axis], color=GREY, **style)
        panel.plot(dense - zero, MICRO * fitted[:, axis], color=colour, linewidth=1.3)
        panel.set_ylabel(f"b{'xyz'[axis]} (µT)")
        grid(panel)
        panel.sharex(panels[0])
        panel.tick_params(labelbottom=axis == 2)
    panels[-1].set_xlabel(f"time after {zero:.0f} s (s)" if zero else "time (s)")


def _turning(field: RotatingField, times: Floats) -> Floats:
    """(n, 3) T, the part of a field that turns, at `times` (n,) s."""
    angle = field.turning.angle(times)
    found: Floats = np.cos(angle)[:, None] * field.cosine + np.sin(angle)[:, None] * field.sine
    return found


def _spectrum(panel: Axes, last: Recording, poses: Sequence[Pose], setup: Setup) -> None:
    found = spectrum(last.B, last.times)
    amplitude = MICRO * np.sqrt(2 * found.power)  # of all axes together
    panel.fill_between(found.frequencies, amplitude, color=PALE, linewidth=0)
    panel.plot(found.frequencies, amplitude, color=INK, linewidth=1.0)
    top = 1.3 * float(amplitude.max())
    for k, pose in enumerate(poses):
        frequency = float(pose.frequency)
        panel.axvline(frequency, color=PURPLE, linewidth=1.0, linestyle="--")
        stated = "stated" if setup.frequencies else "found"
        panel.annotate(
            f"{frequency:.4g} Hz {stated}",
            (frequency, top * (0.97 - 0.12 * k)),
            (4, 0),
            textcoords="offset points",
            color=PURPLE,
            va="top",
        )
    panel.set(xlabel="frequency (Hz)", ylabel="amplitude (µT)", xlim=(0, float(found.frequencies[-1])), ylim=(0, top))
    grid(panel)


def _space(drawn: SubFigure, panel: Axes, setup: Setup, entries: Sequence[dict[str, Any]], motors: int) -> None:
    """Sensors with their axes; poses as dots with the axes of rotation, the last ones large and above the floor."""
    places = np.array([entry["position"] for entry in entries])
    shown = np.concatenate([places, [one.pose.translation for one in setup.sensors.values()]])
    corners, floor = _floor(shown)
    shared = view(1.0)
    bare = View(shared.right, shared.up, shared.towards, 1.0)
    size = 0.15 * float(np.ptp(bare.project(np.concatenate([shown, corners])), axis=0).max())
    tips = places + size * np.array([entry["axis"] for entry in entries])
    flat = bare.project(np.concatenate([shown, corners, tips]))
    low, high = flat.min(axis=0), flat.max(axis=0)
    half = 0.6 * float((high - low).max())
    middle = (low + high) / 2
    seen = View(shared.right, shared.up, shared.towards, half, middle[0] * shared.right + middle[1] * shared.up)
    limit = half * MILLI
    panel.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    panel.set_axis_off()
    for line in floor:
        panel.plot(*_flat(seen, line).T, color=PALE, linewidth=0.6, zorder=0)
    for one in setup.sensors.values():
        turn = one.pose.rotation.as_matrix()
        for column, colour in zip(turn.T, AXES, strict=True):
            _arrow(panel, seen, one.pose.translation, one.pose.translation + 0.6 * size * column, colour, 1.4)
        panel.plot(*_flat(seen, one.pose.translation), "s", color=INK, markersize=4)
    if len(entries) > motors:
        for motor in range(motors):
            panel.plot(*_flat(seen, places[motor::motors]).T, color=PURPLE, linewidth=1.0)
    step = max(1, len(entries) // motors // 12) * motors
    for number, entry in enumerate(entries):
        position, axis = np.array(entry["position"]), np.array(entry["axis"])
        last = number >= len(entries) - motors
        if last:
            foot = np.array([position[0], position[1], corners[0, 2]])
            panel.plot(*_flat(seen, np.array([position, foot])).T, color=GREY, linewidth=0.7, linestyle=":")
        panel.plot(*_flat(seen, position), "o", color=PURPLE, markersize=5 if last else 2.5)
        if last or number % step < motors:
            _arrow(panel, seen, position, position + size * axis, PURPLE, 1.5)
    axes_cross(panel, seen)
    scale_bar(panel, seen)
    handles = [Line2D([], [], color=PURPLE, marker="o", markersize=4, label="magnet, its axis")]
    first = Line2D([], [], color=AXES[0], marker="s", markersize=4, markerfacecolor=INK, markeredgecolor=INK)
    handles += [first, *(Line2D([], [], color=colour) for colour in AXES[1:])]
    for handle, label in zip(handles[1:], ("sensor, its x", "y", "z"), strict=True):
        handle.set_label(label)
    drawn.legend(handles=handles, loc="outside lower center", ncols=4, handlelength=1.0, columnspacing=1.0)


def _floor(shown: Points) -> tuple[Points, list[Points]]:
    """Corners (4, 3) m and lines (2, 3) m of a grid at the lowest height, for the eye to judge depth by."""
    height = float(shown[:, 2].min())
    low, high = shown[:, :2].min(axis=0), shown[:, :2].max(axis=0)
    span = max(float((high - low).max()), 1e-3)
    step = next(s * 10.0**p for p in range(-4, 2) for s in (1, 2, 5) if s * 10.0**p * 6 >= span)
    low, high = step * np.floor(low / step - 0.5), step * np.ceil(high / step + 0.5)
    lines = []
    for k in range(2):
        for value in np.arange(low[k], high[k] + 0.5 * step, step):
            ends = np.full((2, 3), height)
            ends[:, k] = value
            ends[:, 1 - k] = low[1 - k], high[1 - k]
            lines.append(ends)
    corners = np.array([[x, y, height] for x in (low[0], high[0]) for y in (low[1], high[1])])
    return corners, lines


def _flat(seen: View, points: Points) -> Floats:
    return seen.project(points) * MILLI


def _arrow(panel: Axes, seen: View, start: Points, end: Points, colour: str, width: float) -> None:
    ends = [tuple(_flat(seen, one).tolist()) for one in (start, end)]
    arrow = FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=8, shrinkA=0, shrinkB=0)
    arrow.set(color=colour, linewidth=width)
    panel.add_patch(arrow)
