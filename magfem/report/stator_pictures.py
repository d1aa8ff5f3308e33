"""Pictures of the stator's influence: its field beside the rotor's (Fig. S6.6b), and the bias of localized poses."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from magfem.localization.stator_influence import StatorInfluence
from magfem.report.figures.style import BLUE, GREEN, GREY, ORANGE, Picture, drawing, figure, grid, plain_log, png
from magfem.typing import Floats

MILLI, MICRO = 1e3, 1e6
_WIDE = 7.4  # inches
_PUBLISHED = (10.0, 100.0)  # "one to two orders", 6.2
_TICKS = (5, 10, 15, 20, 30, 40)


def draw(influence: StatorInfluence) -> list[Picture]:
    """The fields with their ratio, and the bias of poses."""
    return [field_picture(influence), bias_picture(influence)]


def field_picture(influence: StatorInfluence) -> Picture:
    """Greatest fields of a turn over the distance, and the rotor's over the stator's."""
    fields = influence.fields
    distances = MILLI * fields.distances
    colours = colormaps["viridis"](np.linspace(0.0, 0.85, len(fields.directions)))
    with drawing():
        drawn = figure(3.7, _WIDE)
        left, right = drawn.subplots(1, 2)
        for name, rotor, stator, ratio, colour in zip(
            fields.directions, fields.rotor, fields.stator, fields.ratio, colours, strict=True
        ):
            left.loglog(distances, MICRO * rotor, color=colour, label=name)
            left.loglog(distances, MICRO * stator, color=colour, linestyle="--")
            right.loglog(distances, ratio, color=colour)
        left.plot([], [], color=GREY, label="rotor b$_\\mathrm{r}$")
        left.plot([], [], color=GREY, linestyle="--", label="stator b$_\\mathrm{s}$")
        right.axhspan(*_PUBLISHED, color=ORANGE, alpha=0.12, linewidth=0)
        right.text(distances[-1], 12, "the dissertation’s “one to two orders”", ha="right", va="bottom", fontsize=8.5)
        left.set_ylabel("greatest field of a turn (µT)")
        right.set(ylabel="b$_\\mathrm{r}$ / b$_\\mathrm{s}$", ylim=(8, 1000))
        for axes in (left, right):
            _distance_axis(axes, distances)
            plain_log(axes.yaxis)
        drawn.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        content = png(drawn)
    low, high = fields.ratio.min(), fields.ratio.max()
    return Picture(
        "stator_field",
        content,
        "Fields of rotor and stator over the distance, and their ratio.",
        f"Fields of the rotor and of the stator at quadrature currents of {MILLI * influence.current:.4g} mA, the "
        f"greatest of a turn, and their ratio, {low:.0f} to {high:.0f} (Fig. S6.6b).",
    )


def bias_picture(influence: StatorInfluence) -> Picture:
    """Errors of poses localized without noise: by the stator's field, and with the rotor's uneven turning."""
    distances = MILLI * influence.added.distances
    with drawing():
        drawn = figure(3.7, _WIDE)
        left, right = drawn.subplots(1, 2)
        for bias, colour, name in (
            (influence.added, BLUE, "stator’s field added"),
            (influence.uneven, ORANGE, "and the rotor’s uneven turning"),
            (influence.mended, GREEN, "the swing found and undone"),
        ):
            left.loglog(distances, 100 * bias.position, color=colour, label=name)
            right.loglog(distances, np.degrees(bias.axis), color=colour)
            right.loglog(distances, np.degrees(bias.direction), color=colour, linestyle="--")
        left.loglog(
            distances, 100 * np.abs(influence.added.distance), color=BLUE, linestyle=":", label="distance alone"
        )
        left.plot([], [], color=GREY, label="right: axis")
        left.plot([], [], color=GREY, linestyle="--", label="right: direction of the position")
        left.set_ylabel("position, share of the distance (%)")
        right.set_ylabel("angle (deg)")
        for axes in (left, right):
            _distance_axis(axes, distances)
            plain_log(axes.yaxis)
        drawn.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        content = png(drawn)
    return Picture(
        "stator_bias",
        content,
        "Errors of localized poses that the stator makes, over the distance.",
        "What the stator does to a pose at β = 45°, without noise, at the worst azimuth. Its field acts like "
        f"{100 * influence.added_moment:.2g} % more moment. As the coils’ fields in the rotor are neither equal nor "
        f"perpendicular, a rotor that follows them swings by {np.degrees(influence.unevenness):.2g}° twice a turn, "
        "which matters more, unless the swing is found from the samples.",
    )


def _distance_axis(axes: Axes, distances: Floats) -> None:
    axes.set_xlabel("distance (mm)")
    axes.set_xlim(distances[0], distances[-1])
    shown = [tick for tick in _TICKS if distances[0] - 1e-9 <= tick <= distances[-1] + 1e-9]
    axes.set_xticks(shown, [str(tick) for tick in shown])
    axes.minorticks_off()
    grid(axes)
