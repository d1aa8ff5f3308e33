"""Pictures of a rotor's isoline functions (Figs. 6.4e–f) and of how errors of the field's ratio spread (Fig. S6.8)."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from magfem.localization.isoline_curves import IsolineCurves
from magfem.report.figures.style import BLUE, GREY, INK, ORANGE, Picture, drawing, figure, grid, png
from magfem.typing import Floats

MILLI, MICRO = 1e3, 1e6
_WIDE = 7.4  # inches
_WELL_TOLD = (25.0, 60.0)  # degrees of β, by the dissertation's 6.2
_QUARTER = 90.0


def draw(curves: IsolineCurves) -> list[Picture]:
    """Positions, ratio and angle all round; slopes and sensitivities over a quarter."""
    return [position_picture(curves), angular_picture(curves), sensitivity_picture(curves)]


def position_picture(curves: IsolineCurves) -> Picture:
    """|p_e| along the isolines, by the ellipse and by the field (Fig. 6.4e)."""
    degrees = np.degrees(curves.beta)
    off = np.abs(curves.distance / curves.field_distance - 1).max()
    with drawing():
        drawn = figure(3.6, _WIDE)
        axes = drawn.subplots()
        colours = colormaps["viridis"](np.linspace(0.0, 0.85, curves.strengths.size))
        for strength, fit, field, colour in zip(
            curves.strengths, curves.distance, curves.field_distance, colours, strict=True
        ):
            axes.plot(degrees, field * MILLI, color=colour, linewidth=2.2, alpha=0.45)
            axes.plot(degrees, fit * MILLI, color=colour, linewidth=1, label=f"{strength * MICRO:.4g} µT")
        axes.plot([], [], color=GREY, linewidth=2.2, alpha=0.45, label="field model")
        axes.plot([], [], color=GREY, linewidth=1, label="ellipse, power laws (6.4)")
        axes.set(ylabel="distance |p$_\\mathrm{e}$| (mm)", ylim=(0, None))
        _all_round(axes, curves)
        drawn.legend(loc="outside lower center", ncols=4)
        content = png(drawn)
    return Picture(
        "isoline_positions",
        content,
        f"Distances of {curves.strengths.size} isolines from the rotor along the position angle.",
        "Distance of the isolines from the rotor along the position angle β, of the field model and by ellipses whose "
        f"semi-axes follow power laws (Fig. 6.4e). An isoline is no ellipse: up to {100 * off:.1f} % lie between them.",
    )


def angular_picture(curves: IsolineCurves) -> Picture:
    """b_ratio and α all round, with what they are fitted to (Fig. 6.4f)."""
    degrees = np.degrees(curves.beta)
    ratio_off = np.abs(curves.fitted.ratio - curves.field_ratio).max()
    angle_off = np.degrees(np.abs(curves.fitted.angle - curves.field_angle)).max()
    with drawing():
        drawn = figure(4.4, _WIDE)
        upper, lower = drawn.subplots(2, sharex=True)
        for axes, fit, field, scale, label in (
            (upper, curves.fitted.ratio, curves.field_ratio, 1.0, "field ratio b$_\\mathrm{ratio}$"),
            (lower, curves.fitted.angle, curves.field_angle, np.degrees(1.0), "field angle α (deg)"),
        ):
            axes.plot(degrees, scale * field, color=INK, linewidth=3, alpha=0.25, label="field model at 100 µT")
            axes.plot(degrees, scale * fit, color=BLUE, linewidth=1.2, label="fit (6.5, 6.6)")
            axes.set_ylabel(label)
            _all_round(axes, curves)
        upper.set_xlabel("")
        lower.set_yticks(np.arange(0, 181, 45))
        drawn.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=2)
        content = png(drawn)
    return Picture(
        "isoline_angles",
        content,
        "Field ratio and field angle along the position angle, of the field model and by their fits.",
        f"Field ratio by a Fourier series of eight terms, off by at most {ratio_off:.1g}, and field angle by twenty "
        f"cosines, off by up to {angle_off:.2g}° near its corners (Fig. 6.4f). Each ratio stands for four values of β.",
    )


def sensitivity_picture(curves: IsolineCurves) -> Picture:
    """Functions, slopes and sensitivities over the quarter 0° to 90°, of the fits and of a dipole (Fig. S6.8)."""
    quarter = (curves.beta >= 0) & (np.degrees(curves.beta) <= _QUARTER)
    degrees, one = np.degrees(curves.beta[quarter]), np.degrees(1.0)
    fit, dipole = curves.fitted, curves.dipole
    panels: list[tuple[str, Floats, Floats, tuple[float, float]]] = [
        ("b$_\\mathrm{ratio}$", fit.ratio, dipole.ratio, (0.95, 2.05)),
        ("α (deg)", one * fit.angle, one * dipole.angle, (-2.0, 92.0)),
        ("∂b$_\\mathrm{ratio}$/∂β (1/deg)", fit.ratio_slope / one, dipole.ratio_slope / one, (-0.025, 0.002)),
        ("∂α/∂β", fit.angle_slope, dipole.angle_slope, (-3.2, 0.6)),
        ("∂β/∂b$_\\mathrm{ratio}$ (deg)", one * fit.beta_sensitivity, one * dipole.beta_sensitivity, (-300.0, 15.0)),
        ("∂α/∂b$_\\mathrm{ratio}$ (deg)", one * fit.angle_sensitivity, one * dipole.angle_sensitivity, (-15.0, 300.0)),
    ]
    with drawing():
        drawn = figure(6.4, _WIDE)
        for letter, axes, (label, fitted, exact, limits) in zip(
            "abcdef", drawn.subplots(3, 2, sharex=True).flat, panels, strict=True
        ):
            axes.axvspan(*_WELL_TOLD, color=ORANGE, alpha=0.10, linewidth=0)
            axes.plot(degrees, exact[quarter], color=INK, linewidth=3, alpha=0.25, label="dipole, closed form")
            axes.plot(degrees, fitted[quarter], color=BLUE, linewidth=1.2, label="fits (6.5, 6.6)")
            axes.set(ylabel=label, ylim=limits, xlim=(0, _QUARTER), xticks=np.arange(0, 91, 15))
            axes.set_title(letter, loc="left", fontweight="bold")
            grid(axes)
        handles, labels = axes.get_legend_handles_labels()
        for below in drawn.axes[-2:]:
            below.set_xlabel(_beta_label(curves))
        drawn.legend(handles, labels, loc="outside lower center", ncols=2)
        content = png(drawn)
    return Picture(
        "isoline_sensitivity",
        content,
        "Field ratio and field angle, their slopes, and the sensitivities of both angles to the ratio, over 0° to 90°.",
        "What an error of the field ratio does to the angles (Fig. S6.8): the functions, their slopes, and ∂β/∂b_ratio "
        "and ∂α/∂b_ratio. The waves in α’s slope are the fit’s, no field has them. Shaded: β that the dissertation "
        "calls least sensitive.",
    )


def _all_round(axes: Axes, curves: IsolineCurves) -> None:
    axes.set(xlabel=_beta_label(curves), xlim=(0, 360), xticks=np.arange(0, 361, 45))
    grid(axes)


def _beta_label(curves: IsolineCurves) -> str:
    return f"position angle β, {curves.functions.parametrisation} (deg)"
