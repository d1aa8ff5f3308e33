"""The largest error at every distance from the hull: our model beside the families of the literature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.fields import Shell
from magfem.fields.norms import relative_errors
from magfem.report.figures.style import (
    DASHES,
    GREY,
    MODEL,
    RIVALS,
    Picture,
    drawing,
    figure,
    grid,
    percent_log,
    png,
    wrapped,
)
from magfem.typing import Booleans, Floats, Jet

MILLI = 1e3
_LAYERS, _PER_LAYER = 28, 150
_TICKS = tuple(d * 10.0**p for p in range(-3, 4) for d in (1, 2, 3, 5))
_FEWEST = 10  # points in a window that still tell a maximum


@dataclass(frozen=True)
class Contender:
    """A model, by the words of the legend, its (B, gradient) at the shared points, and which of these count."""

    label: str
    jet: Jet
    window: Booleans | None = None  # (l, p); None: all
    ours: bool = False


def distance_layers(region: Shell) -> tuple[Floats, Floats]:
    """Hull distances (l,) m across the region, and random points (l, p, 3) m at each."""
    distances = np.geomspace(region.clearance, region.extent, _LAYERS)
    return distances, region.hull.offset_points(distances, _PER_LAYER, np.random.default_rng(3))


def distance_figures(
    distances: Floats, truth: Jet, contenders: Sequence[Contender], stated: dict[str, float] | None
) -> tuple[Picture, Picture]:
    """Largest relative error per distance, for B and for the gradient.

    truth : the FEM solution's (B, gradient) at points (l, p, 3).  stated : its own error, drawn as a floor, if known.
    """
    pictures = []
    for derivative, (key, what) in enumerate((("B", "B"), ("gradient", "the gradient"))):
        with drawing():
            drawn = figure(3.9)
            axes = drawn.add_subplot()
            rival = 0
            for contender in contenders:
                errors = _largest(relative_errors(contender.jet[derivative], truth[derivative]), contender.window)
                style: dict[str, Any] = {"color": MODEL, "linewidth": 2.6, "zorder": 3}
                if not contender.ours:
                    style = {"color": RIVALS[rival % 5], "linestyle": DASHES[rival % 5]}
                    rival += 1
                axes.plot(distances * MILLI, errors, label=wrapped(contender.label), **style)
            if stated is not None:
                axes.axhline(stated[key], color=GREY, linewidth=1, label="FEM's own stated error")
            axes.set(xscale="log", yscale="log", xlabel="distance from the hull (mm)")
            axes.set_ylabel(f"largest relative error of {what}")
            percent_log(axes.yaxis)
            low, high = distances[0] * MILLI, distances[-1] * MILLI
            ticks = [t for t in _TICKS if low <= t * 1.001 and t <= high * 1.001]
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
            axes.minorticks_off()
            grid(axes)
            drawn.legend(loc="outside lower center", ncols=1, handlelength=2.6)
            content = png(drawn)
        pictures.append(
            Picture(
                f"distance_{key}",
                content,
                f"Curves of the largest relative error of {what} against the distance from the hull, "
                f"for {len(contenders)} models.",
                f"Largest relative error of {what} among {_PER_LAYER} random directions at each distance.",
            )
        )
    return pictures[0], pictures[1]


def _largest(errors: Floats, window: Booleans | None) -> Floats:
    """Largest of the errors (l, p) at every distance (l,); NaN where too few points lie in the window."""
    if window is None:
        window = np.ones(errors.shape, dtype=bool)
    found: Floats = np.where(window, errors, 0.0).max(axis=1)
    return np.where(window.sum(axis=1) < _FEWEST, np.nan, found)
