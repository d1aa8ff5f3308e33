"""One picture of a model against samples: where the residuals are, how they spread, whether noise explains them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from magfem.fitting import FieldModel, Validation
from magfem.fitting.sample_residuals import SampleResiduals
from magfem.report.figures.cuts import MILLI
from magfem.report.figures.style import (
    BLUE,
    ERROR,
    GREEN,
    GREY,
    INK,
    MODEL,
    ORANGE,
    Picture,
    drawing,
    figure,
    grid,
    percent_log,
    png,
)
from magfem.typing import Floats, Points

_LINE = 0.05  # second over first extent of the samples, below which they lie on a line or in a plane
_ALIKE = 0.05  # distances that differ by less than this share are one
_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def residual_figure(model: FieldModel, residuals: SampleResiduals, found: Validation) -> Picture:
    """Above: the samples in two planes, coloured by |ΔB|. Below: their histogram, and relative errors."""
    factor, unit = _prefix(float(residuals.sizes.max()), found.unit)
    extent = np.ptp(residuals.points, axis=0)
    order = np.argsort(-extent, kind="stable")
    with drawing():
        drawn = figure(8.0, 9.4)
        line = _on_a_line(residuals.points)
        panels = drawn.subplot_mosaic("aa;he" if line else "ab;he")
        if line:
            _along(panels["a"], residuals, int(order[0]), factor, unit)
        else:
            first, second = _planes(extent)
            image = _scatter(panels["a"], residuals, first, factor)
            _scatter(panels["b"], residuals, second, factor)
            bar = drawn.colorbar(image, ax=[panels["a"], panels["b"]], pad=0.015, aspect=24)
            bar.set_label(f"|ΔB| ({unit})")
        _histogram(panels["h"], residuals, factor, unit)
        _relative(panels["e"], residuals, found)
        _heading(drawn, model, found)
        content = png(drawn)
    return Picture(
        "residuals",
        content,
        f"Residuals of {found.points} samples against {model.name}, where they are and how they are spread; "
        f"the largest is {found.found['B']['absolute_max'] / factor:.3g} {unit}.",
        f"Measured less model, {found.points} samples: where the residuals are, and how they are spread.",
    )


def _heading(drawn: Figure, model: FieldModel, found: Validation) -> None:
    verdict = "the stated bound is kept" if found.passed else "the stated bound is EXCEEDED"
    text = f"{model.name}\nagainst {found.reference}: {verdict}"
    drawn.suptitle(text, x=0.01, ha="left", fontsize=10.5, fontweight="bold")


def _on_a_line(points: Points) -> bool:
    """Whether points (n, 3) leave a straight line by no more than a small share of its length."""
    lengths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(lengths[1:2].sum() <= _LINE * lengths[0])


def _planes(extent: Floats) -> tuple[tuple[int, int], tuple[int, int]]:
    """Two pairs of axes: xz and yz, or xy where there is hardly any height."""
    flat = extent[2] < _LINE * extent[:2].max()
    return ((0, 1), (0, 2)) if flat else ((0, 2), (1, 2))


def _scatter(axes: Axes, residuals: SampleResiduals, pair: tuple[int, int], factor: float) -> PathCollection:
    order = np.argsort(residuals.sizes)  # the largest on top
    points, size = residuals.points[order] * MILLI, residuals.sizes[order] / factor
    image = axes.scatter(
        points[:, pair[0]],
        points[:, pair[1]],
        c=size,
        cmap=ERROR,
        vmin=0.0,
        s=float(np.clip(9000 / len(size), 6, 42)),
        edgecolors="#5a6168",
        linewidths=0.4,
    )
    first, second = ("xyz"[k] for k in pair)
    axes.set(xlabel=f"{first} (mm)", ylabel=f"{second} (mm)")
    extent = np.ptp(points[:, pair], axis=0)
    if extent.min() > 0.2 * extent.max():
        axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"seen along {'xyz'[3 - sum(pair)]}", loc="left")
    grid(axes)
    return image


def _along(axes: Axes, residuals: SampleResiduals, axis: int, factor: float, unit: str) -> None:
    """Samples on a line: the residual of every component along it."""
    order = np.argsort(residuals.points[:, axis])
    place = residuals.points[order, axis] * MILLI
    for k, colour in enumerate((BLUE, ORANGE, GREEN)):
        value = residuals.residual[order, k] / factor
        axes.plot(place, value, "o-", color=colour, markersize=3, linewidth=1, label=f"$ΔB_{'xyz'[k]}$")
    axes.axhline(0, color=INK, linewidth=0.6)
    axes.set(xlabel=f"{'xyz'[axis]} (mm)", ylabel=f"measured less model ({unit})")
    axes.legend(ncols=3)
    grid(axes)


def _histogram(axes: Axes, residuals: SampleResiduals, factor: float, unit: str) -> None:
    """Components over their deviations beside the normal curve; in T where deviations are not known."""
    over = residuals.standardised
    values = over if over is not None else residuals.residual[~np.isnan(residuals.residual)] / factor
    edge = float(np.quantile(np.abs(values), 0.998)) * 1.08
    edge = max(edge, 4.0) if over is not None else edge
    bins = int(np.clip(2 * np.sqrt(values.size), 12, 60))
    axes.hist(values, bins=np.linspace(-edge, edge, bins + 1).tolist(), density=True, color=MODEL, alpha=0.55)
    if over is not None:
        x = np.linspace(-edge, edge, 400)
        normal = np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi)
        axes.plot(x, normal, color=INK, label="noise alone")
        axes.set_xlabel("residual of a component, in standard deviations")
        axes.set_title(f"root mean square {np.sqrt(np.mean(values**2)):.3g} standard deviations", loc="left")
        axes.legend()
    else:
        axes.set_xlabel(f"residual of a component ({unit})")
        axes.set_title(f"root mean square {np.sqrt(np.mean(values**2)):.3g} {unit}", loc="left")
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)


def _relative(axes: Axes, residuals: SampleResiduals, found: Validation) -> None:
    """Relative errors against distance, or against the field where all samples are equally far away."""
    errors = residuals.errors
    alike = float(np.ptp(errors.distance)) < _ALIKE * float(errors.distance.max())
    if alike:
        place, label = np.arange(1, errors.error.size + 1, dtype=float), "number of the sample"
    else:
        place, label = errors.distance * MILLI, f"distance from {found.distance_from} (mm)"
    few = errors.error.size <= 300
    axes.plot(place, errors.error, "o", color=MODEL, markersize=4 if few else 2, alpha=0.6, label="samples")
    if residuals.sigma is not None:
        beyond = residuals.beyond_noise.error
        shown = beyond > 0
        axes.plot(place[shown], beyond[shown], "_", color=INK, markersize=6, label="beyond the noise")
    if not alike:
        groups = found.by_distance["B"]
        distance = [group["distance"] * MILLI for group in groups]
        axes.plot(distance, [group["rms"] for group in groups], color=GREY, label="RMS")
    axes.axhline(found.bound["B"], color=ORANGE, linewidth=1.2, label="stated bound")
    axes.set_yscale("log")
    low = float(np.quantile(errors.error, 0.02))
    axes.set_ylim(bottom=max(low / 3, 1e-12))
    percent_log(axes.yaxis)
    axes.minorticks_off()
    axes.set_xlabel(label)
    axes.set_title("relative error of B", loc="left")
    axes.legend(loc="lower right")
    grid(axes)


def _prefix(value: float, unit: str) -> tuple[float, str]:
    """The factor and unit in which a size of B reads well."""
    factor, prefix = next((one for one in _PREFIXES if value >= one[0]), _PREFIXES[-1])
    return factor, prefix + unit
