"""Pictures of studies of localization (Figs. 6.4e–f, 6.6c, 6.7, S6.6, S6.8, S6.11 of the dissertation)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import LogNorm

from magfem.report import isoline_pictures, stator_pictures
from magfem.report.figures.style import (
    BLUE,
    ERROR,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    Picture,
    drawing,
    figure,
    grid,
    plain_log,
    png,
)
from magfem.scenario.localization_study import Study
from magfem.scenario.localization_study.curves import Curves
from magfem.scenario.localization_study.isolines import IsolineErrors
from magfem.scenario.localization_study.range_study import REACH, RangeErrors
from magfem.scenario.localization_study.stator import StatorResult
from magfem.scenario.localization_study.tracks import PathResult, Tracks
from magfem.scenario.localization_study.workspace import WorkspaceMaps
from magfem.typing import Floats

MILLI, MICRO, NANO, DEGREE = 1e3, 1e6, 1e9, 180 / np.pi
_WIDE = 7.4  # inches
_TICKS = (10, 20, 50, 100, 200, 400)


def draw(study: Study) -> list[Picture]:
    """The pictures of a study that was run."""
    drawers: dict[str, Callable[[Any], list[Picture]]] = {
        "isolines": isoline_errors,
        "range": range_errors,
        "tracks": tracks,
        "curves": curves,
        "stator": stator,
        "workspace": workspaces,
    }
    return drawers[study.kind](study.result)


def isoline_errors(found: IsolineErrors) -> list[Picture]:
    """Errors over β, isoline by isoline: ours with the bound, and the published algorithm's."""
    beta = np.degrees(found.study.beta)
    colours = _colours(found.study.strengths.size)
    rows = (
        ("distance", MILLI, "distance (mm)", 7.0),
        ("direction", DEGREE, "direction (deg)", 11.0),
        ("axis", DEGREE, "axis (deg)", 23.0),
        ("beta", DEGREE, "β (deg)", 23.0),
    )
    with drawing():
        drawn = figure(9.2, _WIDE)
        panels = drawn.subplots(len(rows), 2, sharex=True, sharey="row")
        for (name, scale, label, measured), (ours, theirs) in zip(rows, panels, strict=True):
            for k, colour in enumerate(colours):
                words = f"{found.study.strengths[k] * MICRO:.3g} µT"
                ours.semilogy(beta, scale * found.found[name][k], color=colour, label=words)
                if name in found.bound:
                    bound = scale * found.bound[name][k]
                    ours.semilogy(beta, np.where(np.isfinite(bound), bound, np.nan), color=colour, linestyle=":")
                theirs.semilogy(beta, scale * found.published[name][k], color=colour)
            for axes in (ours, theirs):
                axes.axhline(measured, color=GREY, linewidth=0.9, linestyle="--")
                grid(axes)
            plain_log(ours.yaxis)
            ours.set_ylabel(label)
        panels[0, 0].plot([], [], color=GREY, linestyle=":", label="Cramér–Rao bound")
        panels[0, 0].plot([], [], color=GREY, linewidth=0.9, linestyle="--", label="largest that was measured")
        panels[0, 0].set_title("magfem")
        panels[0, 1].set_title("published algorithm")
        for axes in panels[-1]:
            axes.set(xlabel="β (deg)", xticks=range(0, 91, 15))
        drawn.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        content = png(drawn)
    return [
        Picture(
            "isoline_errors",
            content,
            "Errors of localized poses over the position angle on five isolines, by two methods.",
            f"Root-mean-square errors of {found.study.draws} poses at every point, one sensor, on the same samples "
            "(Fig. 6.6c). Dotted: the Cramér–Rao bound, which is infinite at 0° and 90°. Dashed: the largest error "
            "that the dissertation measured.",
        )
    ]


def range_errors(found: RangeErrors) -> list[Picture]:
    """Errors of direction and axis over the distance (Fig. S6.11)."""
    distances = MILLI * found.study.distances
    colours = _colours(found.study.noises.size)
    with drawing():
        drawn = figure(3.9, _WIDE)
        panels = drawn.subplots(1, 2, sharey=True)
        for axes, mean, deviation, bound, label in (
            (panels[0], found.direction, found.direction_deviation, found.direction_bound, "direction"),
            (panels[1], found.axis, found.axis_deviation, found.axis_bound, "axis"),
        ):
            for k, colour in enumerate(colours):
                m, d = DEGREE * mean[k], DEGREE * deviation[k]
                words = f"{found.study.noises[k] * NANO:.4g} nT"
                axes.loglog(distances, m, color=colour, label=words)
                axes.fill_between(distances, np.maximum(m - d, 1e-4), m + d, color=colour, alpha=0.15, linewidth=0)
                axes.loglog(distances, DEGREE * bound[k], color=colour, linestyle=":", linewidth=1)
            axes.axhline(DEGREE * REACH, color=GREY, linewidth=0.9, linestyle="--")
            axes.set(title=label, xlabel="distance (mm)", ylim=(3e-3, 200))
            axes.set_xticks(_TICKS, [str(one) for one in _TICKS])
            axes.minorticks_off()
            grid(axes)
        plain_log(panels[0].yaxis)
        panels[0].set_ylabel("error (deg)")
        panels[0].plot([], [], color=GREY, linestyle=":", label="bound, RMS")
        drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
        content = png(drawn)
    low, high = np.degrees(found.study.beta)
    return [
        Picture(
            "range",
            content,
            "Errors of direction and axis over the distance for five sensors.",
            f"Means and standard deviations of {found.study.draws} poses, β of {low:.0f}–{high:.0f}°, by the largest "
            "value of uniform noise (Fig. S6.11). Errors grow as the cube of the distance, until they are guesses. "
            "Dotted: the bound for Gaussian noise of the same variance. Dashed: 10°.",
        )
    ]


def tracks(found: Tracks) -> list[Picture]:
    """One picture for each path: seen from two sides, and errors along it."""
    return [_path(found, one) for one in found.paths]


def _path(found: Tracks, one: PathResult) -> Picture:
    times = found.study.sampling.duration * np.arange(len(one.position))
    methods = (
        ("published, one sensor", one.published, ORANGE),
        ("each window alone, two sensors", one.alone, PURPLE),
        ("smoothed, two sensors", one.smoothed, BLUE),
    )
    with drawing():
        drawn = figure(6.6, _WIDE)
        halves: Any = drawn.subfigures(2, 1, height_ratios=[1.25, 1.0])
        views = halves[0].subplots(1, 2)
        reach = 8 + MILLI * max(np.abs(one.position[:, :2]).max(), found.study.spacing / 2)
        top = 6 + MILLI * one.position[:, 2].max()
        for axes, (i, j), labels in zip(views, ((0, 2), (0, 1)), (("x", "z"), ("x", "y")), strict=True):
            axes.plot(MILLI * one.position[:, i], MILLI * one.position[:, j], color=INK, linewidth=2.5, alpha=0.25)
            for name, method, colour in methods:
                p, a = MILLI * method.position, method.axis
                axes.plot(p[:, i], p[:, j], ".", color=colour, markersize=2.5, label=name)
                if method is not one.alone:
                    some = slice(None, None, 6)
                    axes.quiver(
                        *(p[some, i], p[some, j], a[some, i], a[some, j]), color=colour, alpha=0.6, width=3e-3, scale=18
                    )
            for sensor in found.study.sensors:
                at = MILLI * sensor.pose.translation
                axes.plot(at[i], at[j], "s", color=GREEN, markersize=5)
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach) if labels[1] == "y" else (-4, top), aspect="equal")
            axes.set(xlabel=f"{labels[0]} (mm)", ylabel=f"{labels[1]} (mm)")
            grid(axes)
        errors = halves[1].subplots(1, 2)
        for name, method, colour in methods:
            off, _, turned = one.errors(method)
            errors[0].semilogy(times, MILLI * off, color=colour, linewidth=1, label=name)
            errors[1].semilogy(times, DEGREE * turned, color=colour, linewidth=1)
        for axes, label, limit in zip(errors, ("position off by (mm)", "axis off by (deg)"), (1.0, 3.0), strict=True):
            axes.axhline(limit, color=GREY, linewidth=0.9, linestyle="--")
            axes.set(xlabel="time (s)", ylabel=label, ylim=(limit / 30, None))
            plain_log(axes.yaxis)
            grid(axes)
        drawn.legend(*errors[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        content = png(drawn)
    return Picture(
        f"track_{one.name.replace(' ', '_')}",
        content,
        f"The {one.name} path as localized by three methods, and their errors along it.",
        f"The {one.name} path (broad grey) in {len(one.position)} windows of "
        f"{found.study.sampling.duration:g} s, the axis as arrows, the sensors as squares, and errors "
        "along it (Fig. 6.7). Dashed: the limits of 1 mm and 3°, for root mean squares. The published "
        "algorithm begins at the true place and hands its faults on.",
    )


def curves(found: Curves) -> list[Picture]:
    """The isoline functions with their sensitivities, and the bias that their parametrisation makes."""
    beta = np.degrees(np.linspace(np.radians(10.0), np.radians(80.0), found.bias.size))
    with drawing():
        drawn = figure(3.0, _WIDE)
        axes = drawn.subplots()
        for values, colour, label in (
            (found.bias, ORANGE, "as published: eccentric β in (6.13)"),
            (found.mended_bias, BLUE, "polar angle in (6.13)"),
            (found.dipole_bias, GREEN, "closed form of a dipole"),
        ):
            axes.plot(beta, DEGREE * values, color=colour, label=label)
        axes.set(xlabel="polar angle β (deg)", ylabel="axis off by (deg)", ylim=(0, None))
        axes.legend()
        grid(axes)
        content = png(drawn)
    bias = Picture(
        "axis_bias",
        content,
        "Axis error without noise over the position angle, by three methods.",
        "How far the axis is off without any noise on the isoline of 100 µT of the finite rotor. `localize` with the "
        "rotor's model has no such error.",
    )
    return [*isoline_pictures.draw(found.curves), bias]


def stator(found: StatorResult) -> list[Picture]:
    """The sensor's noise, the stator's field beside the rotor's, and the bias of poses."""
    with drawing():
        drawn = figure(2.9, _WIDE)
        left, right = drawn.subplots(1, 2, width_ratios=[2.2, 1.0], sharey=True)
        for k, (name, colour) in enumerate((("x", BLUE), ("y", ORANGE), ("z", GREEN))):
            left.plot(found.times, MICRO * found.signal[:, k], color=colour, linewidth=0.7, label=f"b$_{name}$")
        step = (
            2 * MICRO * found.study.noise.resolution or 0.2
        )  # two steps of the readings: else bars would beat with them
        values = MICRO * found.signal.ravel()
        bins = np.arange(values.min(), values.max() + step, step)
        right.hist(values, bins=bins, orientation="horizontal", color=GREY)
        left.set(xlabel="time (s)", ylabel="field less its mean (µT)")
        right.set(xlabel="samples")
        left.legend(ncols=3, loc="lower right", bbox_to_anchor=(1, 1))
        content = png(drawn)
    noise = Picture(
        "sensor_noise",
        content,
        "The sensor's noise signal over time, and its distribution.",
        f"Signal of the sensor in a static field, less its mean, in steps of {found.study.noise.resolution * MICRO:g} "
        "µT (Fig. S6.6a).",
    )
    return [noise, *stator_pictures.draw(found.influence)]


def workspaces(found: WorkspaceMaps) -> list[Picture]:
    """Maps of the bound of position and axis, arrangement by arrangement; and the best places."""
    study = found.study
    count = len(found.maps)
    rows = (
        ("position", MILLI, "position (mm)", np.array([0.1, 0.2, 0.5, 1, 2, 5, 10, 20]), MILLI * study.position),
        ("axis", DEGREE, "axis (deg)", np.array([0.5, 1, 2, 5, 10, 20, 40, 80]), DEGREE * study.axis),
    )
    with drawing():
        drawn = figure(3.6, _WIDE)
        panels = drawn.subplots(2, count, sharex=True, sharey=True, squeeze=False)
        for (name, scale, label, levels, limit), line in zip(rows, panels, strict=True):
            for one, spacing, axes in zip(found.maps, study.spacings, line, strict=True):
                values = np.clip(scale * getattr(one, name), levels[0], levels[-1]).T
                filled = axes.contourf(
                    MILLI * found.x,
                    MILLI * found.z,
                    values,
                    levels=levels,
                    norm=LogNorm(levels[0], levels[-1]),
                    cmap=ERROR,
                )
                axes.contour(MILLI * found.x, MILLI * found.z, values, levels=[limit], colors="white", linewidths=1.6)
                if spacing > 0:
                    unsafe = one.wrong_branch.T
                    axes.contour(
                        *(MILLI * found.x, MILLI * found.z, unsafe),
                        levels=[0.005],
                        colors=[ORANGE],
                        linewidths=1.2,
                        linestyles="--",
                    )
                at = MILLI * np.array([0.0] if spacing == 0 else [-spacing / 2, spacing / 2])
                axes.plot(at, 0 * at, "s", color=GREEN, markersize=5, clip_on=False)
                axes.set(aspect="equal", ylim=(0, None))
            line[0].set_ylabel("z (mm)")
            bar = drawn.colorbar(filled, ax=line.tolist(), label=label, shrink=0.95)
            bar.set_ticks(levels.tolist(), labels=[f"{one:g}" for one in levels])
            bar.minorticks_off()
        for axes, spacing in zip(panels[0], study.spacings, strict=True):
            axes.set_title("one sensor" if spacing == 0 else f"two, {MILLI * spacing:.3g} mm apart")
        for axes in panels[1]:
            axes.set_xlabel("x (mm)")
        content = png(drawn)
    maps = Picture(
        "workspaces",
        content,
        "Maps of the bounds of position and axis about one sensor and about pairs of sensors.",
        f"Cramér–Rao bound about sensors (squares) of {study.noise.deviation * MICRO:.3g} µT with "
        f"{study.sampling.duration:g} s at {study.sampling.rate:g} Hz, medians over all directions of the "
        "rotor’s axis. White: the limits of "
        f"{MILLI * study.position:g} mm and {DEGREE * study.axis:g}°. Beyond the dashed line a wrong branch is "
        "likelier than once in 200; with one sensor the branch must be known.",
    )
    return [maps, _placed(found)]


def _placed(found: WorkspaceMaps) -> Picture:
    half = MILLI * found.study.plate / 2
    at = MILLI * np.array([one.pose.translation for one in found.placed])
    line = np.linspace(-half, half, found.study.placed)
    with drawing():
        drawn = figure(3.4, 3.6)
        axes = drawn.subplots()
        axes.plot([-half, half, half, -half, -half], [-half, -half, half, half, -half], color=GREY, linewidth=0.8)
        axes.plot(line, 0 * line, "s", color=GREY, markersize=5, label=f"in a line: {MILLI * found.line_bound:.2f} mm")
        axes.plot(at[:, 0], at[:, 1], "s", color=GREEN, label=f"placed best: {MILLI * found.placed_bound:.2f} mm")
        axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
        drawn.legend(*axes.get_legend_handles_labels(), loc="outside lower center")
        content = png(drawn)
    return Picture(
        "placed",
        content,
        "Places of sensors on a plate: in a line, and those with the least bound.",
        f"{found.study.placed} sensors on a plate, in a line and where the bound of the position is least for a rotor "
        "anywhere in the middle of the map.",
    )


def _colours(count: int) -> Sequence[Any]:
    found: Floats = colormaps["viridis"](np.linspace(0.0, 0.88, count))
    return list(found)
