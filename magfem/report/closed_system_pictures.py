"""Pictures of a closed system's run (Figs. 6.8 and S6.10): the way through the tubes, errors, modes, an animation."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from magfem.report.figures.style import (
    BLUE,
    COPPER,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    Picture,
    drawing,
    figure,
    grid,
    png,
)
from magfem.scenario.closed_system.record import LOCALIZING, MANIPULATING, MOVING, SWITCHING, ClosedRun
from magfem.typing import Floats

MILLI = 1e3
_WIDE = 7.4  # inches
_COLOURS = {LOCALIZING: BLUE, MOVING: SKY, MANIPULATING: ORANGE, SWITCHING: PURPLE}
_PER_SECOND, _DPI, _PALETTE = 6, 80, 64
_COIL_RADIUS = 24e-3  # m, as it is drawn
_MARGIN = 12.0  # mm about the network


def draw(run: ClosedRun) -> list[Picture]:
    """The way, the errors over time, and the modes."""
    return [way_picture(run), error_picture(run)]


def way_picture(run: ClosedRun) -> Picture:
    """The network from above, with localized poses and bent tips."""
    with drawing():
        drawn = figure(4.6, _WIDE)
        axes = drawn.subplots()
        _tubes(axes, run)
        colours = (BLUE, GREEN, PURPLE, SKY, ORANGE)
        for k, target in enumerate(run.reached):
            own = [one for one in run.localizations if one.target == target]
            p = MILLI * np.array([one.position for one in own]).reshape(-1, 3)
            a = np.array([one.axis for one in own]).reshape(-1, 3)
            colour = colours[k % len(colours)]
            axes.quiver(p[:, 0], p[:, 1], a[:, 0], a[:, 1], color=colour, width=3e-3, scale=22, label=f"to {target}")
            axes.plot(p[:, 0], p[:, 1], ".", color=colour, markersize=4)
        true = MILLI * np.array([one.true.position for one in run.localizations])
        axes.plot(true[:, 0], true[:, 1], "+", color=INK, markersize=4, linewidth=0.6, label="true")
        for one in run.bendings:
            start, end = MILLI * one.position, MILLI * one.tip
            axes.plot([start[0], end[0]], [start[1], end[1]], color=COPPER, linewidth=2)
        axes.plot([], [], color=COPPER, linewidth=2, label="bent tip")
        drawn.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=6)
        content = png(drawn)
    return Picture(
        "way",
        content,
        "The network of tubes from above with the localized positions and axes of the motor.",
        f"Localized positions and axes (arrows) of the motor on its way to {', '.join(run.reached)}, true places, and "
        "the tip as the field bends it before junctions, where no wall is in its way (Fig. S6.10).",
    )


def error_picture(run: ClosedRun) -> Picture:
    """Errors of the localizations over time, above the modes."""
    times = np.array([one.time for one in run.localizations])
    off = MILLI * np.array([one.position_error for one in run.localizations])
    stated = MILLI * np.array([one.position_deviation for one in run.localizations])
    turned = np.degrees([one.axis_error for one in run.localizations])
    stated_axis = np.degrees([one.axis_deviation for one in run.localizations])
    with drawing():
        drawn = figure(4.6, _WIDE)
        panels = drawn.subplots(3, sharex=True, height_ratios=[1.0, 1.0, 0.32])
        for axes, values, expected, label in (
            (panels[0], off, stated, "position off by (mm)"),
            (panels[1], turned, stated_axis, "axis off by (deg)"),
        ):
            axes.plot(times, values, ".-", color=BLUE, linewidth=0.8, markersize=4, label="error")
            axes.plot(
                times, np.minimum(expected, 3 * values.max()), color=GREY, linestyle=":", label="stated deviation"
            )
            axes.set(ylabel=label, ylim=(0, None))
            grid(axes)
        for mode in run.modes:
            panels[2].axvspan(mode.start, mode.end, color=_COLOURS[mode.name], linewidth=0)
        for name, colour in _COLOURS.items():
            panels[2].plot([], [], color=colour, linewidth=5, label=f"{name} {100 * run.share(name):.0f} %")
        panels[2].set(yticks=[], xlabel="time (s)", xlim=(0, run.duration))
        handles = [one.get_legend_handles_labels() for one in (panels[0], panels[2])]
        drawn.legend(*(a + b for a, b in zip(*handles, strict=True)), loc="outside lower center", ncols=3)
        content = png(drawn)
    return Picture(
        "errors",
        content,
        "Errors of position and axis over time, and the modes that the time is spent in.",
        "Errors of the localizations over time with the deviations that they state, and the modes: melting and setting "
        "the alloy that locks the rotor takes most of the time.",
    )


def animation(run: ClosedRun) -> bytes:
    """A GIF from above: the motor as localized, the arm over it, and the mode."""
    events: list[tuple[float, str, Floats, Floats, Floats | None]] = [
        (one.time, LOCALIZING, one.tool, one.position, None) for one in run.localizations
    ] + [(one.time, MANIPULATING, one.tool, one.position, one.tip) for one in run.bendings]
    events.sort(key=lambda one: one[0])
    frames: list[Image.Image] = []
    with drawing():
        drawn = Figure(figsize=(7.4, 5.0), dpi=_DPI)
        axes = drawn.subplots()
        drawn.subplots_adjust(0.09, 0.11, 0.98, 0.92)
        canvas: Any = FigureCanvasAgg(drawn)  # typed in some releases of Matplotlib only
        for k, (time, mode, tool, place, tip) in enumerate(events):
            axes.clear()
            _tubes(axes, run)
            trail = MILLI * np.array([one[3] for one in events[: k + 1]])
            axes.plot(trail[:, 0], trail[:, 1], color=BLUE, linewidth=0.8)
            axes.plot(*(MILLI * place[:2]), "o", color=BLUE, markersize=6)
            on = mode == MANIPULATING
            coil = Circle(
                tuple(MILLI * tool[:2]), MILLI * _COIL_RADIUS, color=COPPER, alpha=0.45 if on else 0.1, zorder=0
            )
            axes.add_patch(coil)
            for one in run.system.sensors:
                at = MILLI * (tool + one.pose.translation)
                axes.plot(at[0], at[1], "s", color=GREY if on else GREEN, markersize=5)
            if tip is not None:
                axes.plot(*(MILLI * np.array([place[:2], tip[:2]])).T, color=ORANGE, linewidth=4)
            words = "coil on, rotor locked, tip bent" if on else "rotor turning, sensors reading"
            axes.set_title(f"{time:5.0f} s   {words}", loc="left")
            canvas.draw()
            picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
            frame = picture.quantize(_PALETTE)
            frames += [frame] * (3 if on else 1)
    buffer = io.BytesIO()
    frames[0].save(
        buffer, "GIF", save_all=True, append_images=frames[1:], duration=1000 // _PER_SECOND, loop=0, optimize=True
    )
    return buffer.getvalue()


def _tubes(axes: Axes, run: ClosedRun) -> None:
    """The network from above, its nodes named."""
    network = run.system.network
    nodes = MILLI * np.array(list(network.nodes.values()))
    low, high = nodes.min(axis=0) - _MARGIN, nodes.max(axis=0) + _MARGIN
    wall = 0.5 * MILLI * network.inner_diameter
    for name in network.nodes:
        if not network.children(name):
            line = MILLI * network.way(name).points[:, :2]
            slope = np.gradient(line, axis=0)
            left = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / np.linalg.norm(slope, axis=1)[:, None]
            outline = np.concatenate([line + wall * left, (line - wall * left)[::-1]])
            axes.fill(outline[:, 0], outline[:, 1], color=PALE, linewidth=0, zorder=-1)
    for name, place in zip(network.nodes, nodes, strict=True):
        axes.annotate(name, place, (0, 12), textcoords="offset points", color=GREY, ha="center")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
