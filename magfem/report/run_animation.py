"""A run as an animation: the rod in side view (and from above in space), and the angles as they come."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from magfem.report.figures.style import GREY, drawing, grid
from magfem.report.run_pictures import MAGNETS, MILLI, VIEWS, draw_rod
from magfem.scenario.run import Run
from magfem.scenario.summary import told_angles
from magfem.typing import Floats

_FRAMES, _PER_SECOND, _DPI, _COLOURS = 100, 12, 72, 64


def animation(run: Run) -> bytes:
    """A GIF of up to 100 pictures, evenly over the steps, each with the plant and what was wanted."""
    steps = np.unique(np.linspace(0, len(run.steps) - 1, _FRAMES).round().astype(int))
    actual, wanted = told_angles(run, run.stacked("actual")), told_angles(run, run.wanted)
    lines = run.stacked("plant")
    names = ["side view"] if run.scenario.planar else ["side view", "top view"]
    with drawing():
        drawn = Figure(figsize=(3.6 * len(names) + 4.2, 3.6), dpi=_DPI)
        panels = drawn.subplots(1, len(names) + 1, width_ratios=[1.0] * len(names) + [1.1])
        drawn.subplots_adjust(0.08, 0.15, 0.98, 0.91, wspace=0.25)
        limits = {name: _square(VIEWS[name][0].project(lines) * MILLI) for name in names}

        def show(k: int) -> None:
            for axes, name in zip(panels, names, strict=False):
                seen, across, up = VIEWS[name]
                axes.clear()
                x, y = seen.project(run.steps[0].plant).T * MILLI
                axes.plot(x, y, color=GREY, linewidth=0.8, linestyle=":")
                draw_rod(axes, seen, lines[k], run, k, "#1f2429", "")
                for m, direction in enumerate(run.wanted[k]):
                    start = seen.project(run.steps[k].places[m]) * MILLI
                    tip = 12 * seen.project(direction)
                    axes.annotate(
                        "",
                        tuple(start + tip),
                        tuple(start),
                        arrowprops={"arrowstyle": "->", "color": MAGNETS[m % len(MAGNETS)], "linestyle": "--"},
                    )
                axes.set(**limits[name], aspect="equal")
                axes.set(xlabel=across, ylabel=up, title=f"{name}, step {k}")
                grid(axes)
            last = panels[-1]
            last.clear()
            for m in range(actual.shape[1]):
                colour = MAGNETS[m % len(MAGNETS)]
                last.plot(wanted[: k + 1, m], color=colour, linewidth=0.9, linestyle="--")
                last.plot(actual[: k + 1, m], color=colour, label=f"magnet {m + 1}")
            low, high = min(actual.min(), wanted.min()), max(actual.max(), wanted.max())
            last.set(xlim=(0, len(run.steps)), ylim=(low - 4, high + 4), xlabel="step", title="angle of rotation (deg)")
            last.legend(loc="upper left", ncols=2)

        canvas: Any = FigureCanvasAgg(drawn)  # untyped in some releases of Matplotlib
        pictures = []
        for k in steps.tolist():
            show(k)
            canvas.draw()
            pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return _gif(pictures)


def _square(flat: Floats) -> dict[str, tuple[float, float]]:
    """Limits of a square about points (..., 2) mm, with room for the arrows."""
    low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
    middle, half = (low + high) / 2, float((high - low).max()) / 2 + 12
    x, y = middle.tolist()
    return {"xlim": (x - half, x + half), "ylim": (y - half, y + half)}


def _gif(pictures: list[Image.Image]) -> bytes:
    """The pictures as one file, in colours that they share."""
    palette = pictures[-1].convert("P", palette=Image.Palette.ADAPTIVE, colors=_COLOURS)
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    content = io.BytesIO()
    first.save(content, format="GIF", save_all=True, append_images=others, duration=round(1000 / _PER_SECOND), loop=0)
    return content.getvalue()
