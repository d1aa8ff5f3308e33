"""Pictures of a simulated scenario: angles and currents over the steps, shapes, the comparison without force."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from magfem.report.figures.style import BLUE, GREY, INK, ORANGE, PURPLE, SKY, Picture, drawing, figure, grid, png
from magfem.report.run_scene import rods_picture
from magfem.report.scenes import View, view
from magfem.scenario.angles import axes_of_rotation, between
from magfem.scenario.run import Run
from magfem.scenario.summary import told_angles
from magfem.typing import Floats, Points, Vectors

log = logging.getLogger("magfem")

MILLI = 1e3
MAGNETS = (BLUE, ORANGE, PURPLE, SKY)
"""Colours of the magnets from the base to the tip, as in the dissertation's figures the first two blue and red."""

_WIDE = 7.4  # inches
_MOST_SHAPES = 8
_X, _Y, _Z = np.eye(3)
VIEWS: dict[str, tuple[View, str, str]] = {
    "side view": (View(_X, _Z, -_Y, 1.0), "x (mm)", "z (mm)"),
    "top view": (View(_X, _Y, _Z, 1.0), "x (mm)", "y (mm)"),
    "isometric view": (view(1.0), "", ""),
}
"""Projections of the shapes, each with its axes' labels."""


def draw(run: Run) -> tuple[Picture, ...]:
    """All pictures of a run."""
    log.info("scenario: pictures")
    found = [angles_picture(run), shapes_picture(run), currents_picture(run), rods_picture(run)]
    if run.torque_only is not None and np.isfinite(run.torque_only[0]).any():
        found += [forces_picture(run), forces_angles_picture(run)]
    return tuple(found)


def angles_picture(run: Run) -> Picture:
    """Wanted, measured and predicted angles of rotation; in space also how far the axes are from the wanted ones."""
    steps = np.arange(len(run.steps))
    spatial = not run.scenario.planar
    measured, predicted, wanted = run.stacked("measured"), run.stacked("predicted"), run.wanted
    with drawing():
        drawn = figure(4.6 if spatial else 3.4, _WIDE)
        panels = drawn.subplots(2 if spatial else 1, sharex=True, squeeze=False)[:, 0]
        top = panels[0]
        for m, colour in _magnets(run):
            top.plot(steps, _deg(run, measured)[:, m], color=colour, label=f"magnet {m + 1}, measured")
            top.plot(steps, _deg(run, predicted)[:, m], color=colour, linewidth=1, linestyle=":", label="predicted")
            values = _deg(run, wanted)[:, m]
            top.plot(steps, values, color=colour, linewidth=0.9, linestyle="--", drawstyle="steps-post", label="wanted")
        top.set_ylabel("angle of rotation (deg)")
        if spatial:
            apart = np.degrees(between(axes_of_rotation(measured), axes_of_rotation(wanted)))
            for m, colour in _magnets(run):
                panels[1].plot(steps, apart[:, m], color=colour)
            panels[1].set_ylabel("∠ axis (deg)")
            panels[1].set_ylim(bottom=0)
        _finish(drawn, panels, run)
        content = png(drawn)
    words = "Angles of rotation from the global z axis" + (", and angles between axes" if spatial else "")
    return Picture(
        "angles",
        content,
        f"{words}, wanted, measured and predicted, over {len(run.steps)} steps.",
        f"{words}, over the steps of the loop: measured on the plant, predicted by the controller’s model at the same "
        "currents, and wanted. Pale lines are where a new target begins.",
    )


def currents_picture(run: Run) -> Picture:
    """The currents, and the joints where any moves."""
    steps, currents, joints = np.arange(len(run.steps)), run.stacked("currents"), run.stacked("joints")
    moving = joints.size > 0 and float(np.abs(joints).max()) > 1e-6
    with drawing():
        drawn = figure(4.4 if moving else 3.0, _WIDE)
        panels = drawn.subplots(2 if moving else 1, sharex=True, squeeze=False)[:, 0]
        colours = colormaps["turbo"](np.linspace(0.05, 0.95, len(run.system.coils)))
        for coil, values, colour in zip(run.system.coils, currents.T, colours, strict=True):
            panels[0].plot(steps, values, color=colour, linewidth=1.1, label=f"coil {coil.name}")
        limit = _limit(run)
        for sign in (-1, 1):
            panels[0].axhline(sign * limit, color=GREY, linewidth=0.8, linestyle="--")
        panels[0].set_ylabel("current (A)")
        if moving:
            for joint, values, style in zip(run.system.joints, joints.T, ("-", "--", "-.", ":") * 9, strict=False):
                panels[1].plot(steps, np.degrees(values), color=INK, linestyle=style, label=joint.name)
            panels[1].set_ylabel("joints (deg)")
            panels[1].legend(loc="best")
        _finish(drawn, panels, run, columns=7)
        content = png(drawn)
    return Picture(
        "currents",
        content,
        f"Currents of {len(run.system.coils)} coils over {len(run.steps)} steps.",
        f"Currents of the coils; dashed: the limit of {limit:g} A." + (" Below: the joints." if moving else ""),
    )


def shapes_picture(run: Run) -> Picture:
    """The plant's shapes at the start and where targets ended, in views that show them in mm."""
    chosen = shown_steps(run)
    names = ["side view"] if run.scenario.planar else list(VIEWS)
    lines = [run.steps[k].plant for k in chosen]
    colours = step_colours(len(chosen))
    with drawing():
        drawn = figure(4.2 if len(names) == 1 else 3.3, _WIDE)
        for axes, name in zip(drawn.subplots(1, len(names), squeeze=False)[0], names, strict=True):
            for k, line, colour in zip(chosen, lines, colours, strict=True):
                label = "start" if k == chosen[0] else f"target {run.steps[k].target + 1}"
                draw_rod(axes, VIEWS[name][0], line, run, k, colour, label)
            _true_to_scale(axes, name)
            axes.set(**_limits(VIEWS[name][0], np.array(lines)), adjustable="box")
        handles, labels = axes.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 7))
        content = png(drawn)
    return Picture(
        "shapes",
        content,
        f"Shapes of the rod at the start and at {len(chosen) - 1} targets.",
        "The plant’s shape at the start and where targets ended; magnets are thick, the rod’s base is the dot.",
    )


def forces_picture(run: Run) -> Picture:
    """The shape with magnetic forces, and that of the same currents without, where they differ most (Fig. 2.7)."""
    assert run.torque_only is not None
    with_force, without = run.stacked("plant"), run.torque_only[0]
    apart = np.linalg.norm(with_force - without, axis=-1).max(axis=1)
    k = int(np.nanargmax(apart))
    names = ["side view"] if run.scenario.planar else ["side view", "top view"]
    with drawing():
        drawn = figure(2.6 if len(names) == 1 else 5.0, _WIDE)
        panels = drawn.subplots(len(names), 2, squeeze=False)
        for row, name in zip(panels, names, strict=True):
            for axes, line, title in zip(row, (with_force[k], without[k]), ("with", "without"), strict=True):
                draw_rod(axes, VIEWS[name][0], line, run, k, INK if title == "with" else GREY, "")
                other = without[k] if title == "with" else with_force[k]
                x, y = VIEWS[name][0].project(other).T * MILLI
                axes.plot(x, y, color=GREY, linewidth=0.7, linestyle=":")
                axes.set_title(f"{title} magnetic forces")
                _true_to_scale(axes, name)
                axes.set(**_limits(VIEWS[name][0], np.stack([with_force[k], without[k]])), adjustable="box")
        content = png(drawn)
    return Picture(
        "forces",
        content,
        f"The rod's shape with and without magnetic forces at step {k}.",
        f"The shape at step {k}, where they differ most ({1e3 * apart[k]:.2g} mm): left with magnetic forces, right as "
        "it would be at the same currents if the magnets felt torques alone. Dotted: the other one.",
    )


def forces_angles_picture(run: Run) -> Picture:
    """Angles of the magnets with and without magnetic forces over the steps."""
    assert run.torque_only is not None
    steps = np.arange(len(run.steps))
    actual, without = told_angles(run, run.stacked("actual")), told_angles(run, run.torque_only[1])
    with drawing():
        drawn = figure(3.2, _WIDE)
        axes = drawn.subplots()
        for m, colour in _magnets(run):
            axes.plot(steps, actual[:, m], color=colour, label=f"magnet {m + 1}, with forces")
            axes.plot(steps, without[:, m], color=colour, linestyle="--", linewidth=1, label="without")
        axes.set_ylabel("angle of rotation (deg)")
        _finish(drawn, [axes], run, columns=2)
        content = png(drawn)
    return Picture(
        "forces_angles",
        content,
        "Angles of rotation with and without magnetic forces.",
        "The magnets’ angles at the currents of the run, with magnetic forces and without.",
    )


def shown_steps(run: Run) -> list[int]:
    """The first step and the last of up to `_MOST_SHAPES` targets, evenly chosen."""
    which = np.unique(np.linspace(0, len(run.endings) - 1, min(_MOST_SHAPES, len(run.endings))).round().astype(int))
    return [0, *(run.endings[k].last for k in which.tolist())]


def step_colours(count: int) -> list[Any]:
    """Grey for the start, then along a colour map."""
    return [GREY, *colormaps["viridis"](np.linspace(0.0, 0.88, count - 1))]


def draw_rod(axes: Axes, seen: View, line: Points, run: Run, step: int, colour: Any, label: str) -> None:
    """One centreline (n, 3) m in a projection, its magnets thick, in mm."""
    x, y = seen.project(line).T * MILLI
    axes.plot(x, y, color=colour, linewidth=1.6, label=label or None, solid_capstyle="butt")
    axes.plot(x[0], y[0], "o", color=INK, markersize=3.5)
    for m, node in enumerate(run.rod.chain.magnet_node.tolist()):
        axes.plot(x[node - 1 : node + 2], y[node - 1 : node + 2], color=MAGNETS[m % len(MAGNETS)], linewidth=4.5)


def _true_to_scale(axes: Axes, name: str) -> None:
    _, across, up = VIEWS[name]
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=across, ylabel=up)
    grid(axes)
    if not across:
        axes.set_title(name)
        axes.set_axis_off()
    elif not axes.get_title():
        axes.set_title(name)


def _limits(seen: View, lines: Points) -> dict[str, tuple[float, float]]:
    """Limits in mm about centrelines (..., 3) m, 4 mm around them."""
    flat = seen.project(lines.reshape(-1, 3)) * MILLI
    (left, low), (right, high) = flat.min(axis=0) - 4, flat.max(axis=0) + 4
    return {"xlim": (float(left), float(right)), "ylim": (float(low), float(high))}


def _magnets(run: Run) -> list[tuple[int, str]]:
    return [(m, MAGNETS[m % len(MAGNETS)]) for m in range(len(run.rod.magnets))]


def _deg(run: Run, axes: Vectors) -> Floats:
    return told_angles(run, axes)


def _limit(run: Run) -> float:
    limits = [one.current_limit for one in run.system.coils if one.current_limit is not None]
    stated = run.scenario.settings.get("current_limit", np.inf)
    return float(min([stated, *limits]))


def _finish(drawn: Any, panels: Any, run: Run, columns: int = 3) -> None:
    starts = np.flatnonzero(np.diff(run.target_of_step)) + 1
    for axes in panels:
        for start in starts.tolist():
            axes.axvline(start, color="#d9dde1", linewidth=0.7, zorder=0)
        axes.set_xlim(0, max(len(run.steps) - 1, 1))
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("step")
    handles, labels = panels[0].get_legend_handles_labels()
    rows = -(-len(handles) // columns)
    order = [row * columns + column for column in range(columns) for row in range(rows)]  # legends fill columns first
    order = [k for k in order if k < len(handles)]
    drawn.legend([handles[k] for k in order], [labels[k] for k in order], loc="outside lower center", ncols=columns)
