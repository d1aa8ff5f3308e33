"""The curves of Figs. 6.4e–f and S6.8: isoline functions beside the field they are fitted to, and how errors spread.

A pose is read off from b_ratio: an error of it becomes one of β by ∂β/∂b_ratio = 1/(∂b_ratio/∂β), and one of α by
∂α/∂b_ratio = (∂α/∂β)(∂β/∂b_ratio). For a dipole, in the polar angle θ,

    b_ratio = √(1 + 3 cos²θ)       ∂b_ratio/∂θ = −3 cos θ sin θ / b_ratio
    tan α = 2 |cot θ|              ∂α/∂θ = −2 / (1 + 3 cos²θ), its sign changing with that of cos θ

so that β is lost where b_ratio has no slope, at 0° and 90°, while α's slope grows from −1/2 to −2: it amplifies errors
of θ beyond 54.7°, where 3 cos²θ = 1. The dissertation's β is the eccentric angle (see `isolines`), by tan θ =
(c_z / c_x) tan β and dθ/dβ = c_x c_z / (c_x² cos²β + c_z² sin²β).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.localization.isolines import (
    FITTED_AT,
    IsolineFunctions,
    Parametrisation,
    field_along,
    isoline_functions,
    isoline_radii,
)
from magfem.localization.rotor import Model
from magfem.typing import ArrayLike, Floats

STRENGTHS: Floats = np.array([6e-6, 10e-6, 20e-6, 50e-6, 100e-6])
"""T: the isolines of Fig. 6.6."""
ANGLES: Floats = np.radians(np.arange(0.25, 360.0, 0.5))
"""rad: β all round, never quite where a slope is zero."""


@dataclass(frozen=True, eq=False)
class AngularCurves:
    """b_ratio and α rad along β (n,), their slopes per rad, and what follows for errors of b_ratio.

    Sensitivities are infinite where b_ratio has no slope.
    """

    ratio: Floats
    angle: Floats
    ratio_slope: Floats
    angle_slope: Floats

    @property
    def beta_sensitivity(self) -> Floats:
        """∂β/∂b_ratio (n,) rad."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / self.ratio_slope)

    @property
    def angle_sensitivity(self) -> Floats:
        """∂α/∂b_ratio (n,) rad."""
        return np.asarray(self.angle_slope * self.beta_sensitivity)


@dataclass(frozen=True, eq=False)
class IsolineCurves:
    """The isoline functions of a rotor along β (n,) rad, beside its field.

    strengths: (s,) T.  distance: (s, n) m, |p_e| by the fit.  field_distance: (s, n) m, of the field's own isoline at
    the polar angle of p_e.  field_ratio: (n,) and field_angle: (n,) rad, of the field where b_ratio and α are fitted.
    fitted: by the fits.  dipole: by the closed forms.
    """

    functions: IsolineFunctions
    beta: Floats
    strengths: Floats
    distance: Floats
    field_distance: Floats
    field_ratio: Floats
    field_angle: Floats
    fitted: AngularCurves
    dipole: AngularCurves


def curves(
    model: Model | IsolineFunctions,
    parametrisation: Parametrisation = "eccentric",
    strengths: ArrayLike = STRENGTHS,
    beta: ArrayLike = ANGLES,
) -> IsolineCurves:
    """The curves of a rotor, or of its isoline functions (then `parametrisation` is theirs). strengths (s,) T, β (n,).

    Raises as `isoline_functions` does.
    """
    functions = model if isinstance(model, IsolineFunctions) else isoline_functions(model, parametrisation)
    levels, angles = np.atleast_1d(np.asarray(strengths, dtype=float)), np.atleast_1d(np.asarray(beta, dtype=float))
    polar = functions.polar_angle(levels[:, None], angles)
    ratio, angle = field_along(functions.field, functions.position(FITTED_AT, angles))
    return IsolineCurves(
        functions=functions,
        beta=angles,
        strengths=levels,
        distance=functions.distance(levels[:, None], angles),
        field_distance=isoline_radii(functions.field, levels[:, None], polar),
        field_ratio=ratio,
        field_angle=angle,
        fitted=AngularCurves(
            functions.ratio(angles),
            functions.angle(angles),
            functions.ratio_series.slope(angles),
            functions.angle_sum.slope(angles),
        ),
        dipole=_dipole_curves(functions, angles),
    )


def dipole_curves(theta: ArrayLike) -> AngularCurves:
    """Of a dipole, along the polar angle θ (n,) rad."""
    angle = np.asarray(theta, dtype=float)
    cosine, sine = np.cos(angle), np.sin(angle)
    ratio = np.sqrt(1 + 3 * cosine**2)
    return AngularCurves(
        ratio,
        np.arctan2(2 * np.abs(cosine), sine),
        -3 * cosine * sine / ratio,
        -2 * np.sign(cosine) / ratio**2,
    )


def _dipole_curves(functions: IsolineFunctions, beta: Floats) -> AngularCurves:
    """Of a dipole along the functions' own β."""
    along = dipole_curves(functions.polar_angle(FITTED_AT, beta))
    if functions.parametrisation == "polar":
        return along
    long, short = functions.along_moment(FITTED_AT), functions.along_axis(FITTED_AT)
    slope = long * short / ((long * np.cos(beta)) ** 2 + (short * np.sin(beta)) ** 2)
    return AngularCurves(along.ratio, along.angle, along.ratio_slope * slope, along.angle_slope * slope)
