"""Isoline functions of a rotor: from its field model to what the published localization looks up (eqs. 6.4 to 6.6).

The rotor's frame has the axis of rotation along +z and the moment along +x; both span the magnetization plane. There
the places of one field strength b_iso lie on a closed curve much like an ellipse, whose semi-axes c_x and c_z follow
power laws of b_iso. Any sensor lies in the magnetization plane twice a turn: then the field is greatest, and a quarter
of a turn later it is least and perpendicular to the plane. The three functions tell, along the isoline,

    p_e(b_iso, β)   where it is                                              (6.4)
    b_ratio(β)      the greatest field over the least                        (6.5)
    α(β)            the angle from p_e to the field's own axis of rotation   (6.6)

What β is makes a difference. Eq. 6.4 is p_e = (c_x cos β, c_z sin β), so that β is the ellipse's *eccentric* angle; eq.
6.13 then turns by β as if it were the *polar* angle θ of p_e. With tan θ = (c_z / c_x) tan β the two differ by up to
asin((c_x − c_z) / (c_x + c_z)), 6.6° for a dipole, whose c_x / c_z is 4^(1/6) = 1.26: an error of the rotor's axis that
no measurement is to blame for. `parametrisation` chooses:

    "eccentric"  as published
    "polar"      p_e = r (cos β, sin β) on the same ellipse, r = c_x c_z / √((c_z cos β)² + (c_x sin β)²): consistent

For a dipole, in the polar angle θ: b_ratio = √(1 + 3 cos²θ) and tan α = 2 cot θ. Source: ch. 6 of the dissertation,
6.3.5; the closed forms follow from (6.15) and hold the fits in the tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias, get_args

import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from magfem.errors import ConvergenceError, InputError
from magfem.fields.field import Field
from magfem.localization.ellipse_fit import principal_axes
from magfem.localization.rotor import Model, as_rotor
from magfem.typing import ArrayLike, Floats, Vectors

Parametrisation: TypeAlias = Literal["eccentric", "polar"]

STRENGTHS: Floats = np.geomspace(5e-6, 5e-4, 41)
"""T: isolines that the power laws are fitted to, 10 to 46 mm from the rotor of 1 × 3 mm."""
FITTED_AT = 1e-4
"""T: the isoline that b_ratio(β) and α(β) are fitted on, then used for all."""
FITTED_ANGLES: Floats = np.radians(np.arange(1.0, 361.0))
"""rad: β of those fits, 1° to 360°."""

_RATIO_TERMS, _ANGLE_TERMS = 8, 20
_RAYS = np.radians(np.arange(0.0, 360.0))
_QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # R_z(π/2)


@dataclass(frozen=True)
class PowerLaw:
    """factor · b^exponent + offset in m, b in T."""

    factor: float
    exponent: float
    offset: float

    def __call__(self, strengths: ArrayLike) -> Floats:
        lengths: Floats = self.factor * np.asarray(strengths, dtype=float) ** self.exponent + self.offset
        return lengths


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """mean + Σ (cosine_k cos kwβ + sine_k sin kwβ), k from 1; w: `frequency`, free."""

    mean: float
    cosine: Floats
    sine: Floats
    frequency: float

    def __call__(self, beta: ArrayLike) -> Floats:
        turned = self._turned(beta)
        return self.mean + np.cos(turned) @ self.cosine + np.sin(turned) @ self.sine

    def slope(self, beta: ArrayLike) -> Floats:
        """d/dβ per rad."""
        turned, order = self._turned(beta), self.frequency * np.arange(1, self.cosine.size + 1)
        slopes: Floats = np.cos(turned) @ (order * self.sine) - np.sin(turned) @ (order * self.cosine)
        return slopes

    def _turned(self, beta: ArrayLike) -> Floats:
        order = np.arange(1, self.cosine.size + 1)
        turned: Floats = np.multiply.outer(np.asarray(beta, dtype=float), self.frequency * order)
        return turned


@dataclass(frozen=True, eq=False)
class CosineSum:
    """mean + Σ amplitude_k cos(2π frequency_k β − phase_k), all of them free; frequencies per rad, phases in rad."""

    mean: float
    amplitude: Floats
    frequency: Floats
    phase: Floats

    def __call__(self, beta: ArrayLike) -> Floats:
        values: Floats = self.mean + np.cos(self._turned(beta)) @ self.amplitude
        return values

    def slope(self, beta: ArrayLike) -> Floats:
        """d/dβ per rad."""
        slopes: Floats = -np.sin(self._turned(beta)) @ (2 * np.pi * self.frequency * self.amplitude)
        return slopes

    def _turned(self, beta: ArrayLike) -> Floats:
        turned: Floats = np.multiply.outer(np.asarray(beta, dtype=float), 2 * np.pi * self.frequency) - self.phase
        return turned


@dataclass(frozen=True, eq=False)
class IsolineFunctions:
    """The isoline functions of one rotor.

    along_moment, along_axis: c_x and c_z of 6.4.  ratio_series: 6.5.  angle_sum: 6.6.  field: what they describe.
    """

    field: Field
    parametrisation: Parametrisation
    along_moment: PowerLaw
    along_axis: PowerLaw
    ratio_series: FourierSeries
    angle_sum: CosineSum

    def position(self, strength: ArrayLike, beta: ArrayLike) -> Vectors:
        """p_e (..., 2) m along the moment and along the axis, of strengths in T and β in rad, broadcast (6.4)."""
        return ellipse_position(self.along_moment(strength), self.along_axis(strength), beta, self.parametrisation)

    def distance(self, strength: ArrayLike, beta: ArrayLike) -> Floats:
        """|p_e| (...) m."""
        lengths: Floats = np.linalg.norm(self.position(strength, beta), axis=-1)
        return lengths

    def ratio(self, beta: ArrayLike) -> Floats:
        """b_ratio (6.5)."""
        return self.ratio_series(beta)

    def angle(self, beta: ArrayLike) -> Floats:
        """α rad (6.6)."""
        return self.angle_sum(beta)

    def polar_angle(self, strength: ArrayLike, beta: ArrayLike) -> Floats:
        """The polar angle rad of p_e: β itself where the parametrisation is polar."""
        x, z = np.moveaxis(self.position(strength, beta), -1, 0)
        angles: Floats = np.arctan2(z, x)
        return angles

    def beta_of_ratio(self, ratio: ArrayLike) -> Floats:
        """β rad in [0, π/2] whose ratio is nearest, to a thousandth of a degree (6.8)."""
        wanted = np.asarray(ratio, dtype=float)
        values, angles = self._lookup
        above = np.clip(np.searchsorted(values, wanted), 1, values.size - 1)
        nearer = np.where(wanted - values[above - 1] <= values[above] - wanted, above - 1, above)
        return np.where(np.isnan(wanted), np.nan, angles[nearer])

    @cached_property
    def _lookup(self) -> tuple[Floats, Floats]:
        angles = np.linspace(0, np.pi / 2, 90_001)
        values = self.ratio(angles)
        order = values.argsort()
        return values[order], angles[order]


def isoline_functions(
    model: Model,
    parametrisation: Parametrisation = "eccentric",
    strengths: ArrayLike = STRENGTHS,
    fitted_at: float = FITTED_AT,
) -> IsolineFunctions:
    """Fit the isoline functions to a rotor: its field model, or the model's name or file. Takes about 0.1 s.

    strengths: (s,) T, at least four isolines for the power laws. fitted_at: T, the isoline of the other two.

    Raises InputError for what cannot be used, ConvergenceError where the field has no such isolines.
    """
    field = as_rotor(model).field
    if parametrisation not in get_args(Parametrisation):
        raise InputError(f'parametrisation must be "eccentric" or "polar", got {parametrisation!r}')
    levels = np.asarray(strengths, dtype=float)
    if levels.ndim != 1 or np.unique(levels).size < 4 or not (np.isfinite(levels) & (levels > 0)).all():
        raise InputError("strengths must be at least four different positive field strengths in T, shape (s,)")
    if not (np.isfinite(fitted_at) and fitted_at > 0):
        raise InputError(f"fitted_at must be a positive field strength in T, got {fitted_at!r}")
    radii = isoline_radii(field, levels[:, None], _RAYS)
    outlines = radii[..., None] * np.stack([np.cos(_RAYS), np.sin(_RAYS)], axis=-1)
    # One of the two semi-axes lies along the moment by symmetry, the one with the greater first component.
    axes = np.abs(np.stack(principal_axes(outlines), axis=-2))
    moment_is_major = axes[:, 0, 0] > axes[:, 0, 1]
    lengths = np.linalg.norm(axes, axis=-1)
    along_moment = _power_law(levels, np.where(moment_is_major, lengths[:, 0], lengths[:, 1]))
    along_axis = _power_law(levels, np.where(moment_is_major, lengths[:, 1], lengths[:, 0]))
    places = ellipse_position(along_moment(fitted_at), along_axis(fitted_at), FITTED_ANGLES, parametrisation)
    ratio, angle = field_along(field, places)
    return IsolineFunctions(
        field, parametrisation, along_moment, along_axis, _fourier_series(ratio), _cosine_sum(angle)
    )


def ellipse_position(
    along_moment: ArrayLike, along_axis: ArrayLike, beta: ArrayLike, parametrisation: Parametrisation
) -> Vectors:
    """Places (..., 2) on ellipses of semi-axes c_x and c_z, at eccentric or polar angles β rad."""
    c_x, c_z, angle = np.broadcast_arrays(along_moment, along_axis, np.asarray(beta, dtype=float))
    cosine, sine = np.cos(angle), np.sin(angle)
    if parametrisation == "eccentric":
        return np.stack([c_x * cosine, c_z * sine], axis=-1)
    radius = c_x * c_z / np.hypot(c_z * cosine, c_x * sine)
    return np.stack([radius * cosine, radius * sine], axis=-1)


def isoline_radii(field: Field, strengths: ArrayLike, polar: ArrayLike) -> Floats:
    """Distances (...) m from the rotor at which |B| is `strengths` T, at polar angles rad in the magnetization plane.

    Where others cut a grid by contours: |B| falls as r^-n with n about 3, so that r (|B|/b)^(1/3) is nearer, and the
    error shrinks by the factor 1 − n/3. Raises ConvergenceError where it does not.
    """
    strength, angle = np.broadcast_arrays(np.asarray(strengths, dtype=float), np.asarray(polar, dtype=float))
    rays = np.stack([np.cos(angle), np.zeros(angle.shape), np.sin(angle)], axis=-1)
    radius: Floats = np.full(angle.shape, 0.02)
    for _ in range(200):
        size = np.linalg.norm(field.B(radius[..., None] * rays, outside="extrapolate"), axis=-1)
        factor = np.clip(np.cbrt(size / strength), 0.1, 10.0)
        radius = np.asarray(radius * factor)
        if np.abs(factor - 1).max(initial=0) < 1e-13:
            return radius
    if np.abs(factor - 1).max() < 1e-10:
        return radius
    raise ConvergenceError(
        f"no isoline of {1e6 * strength.flat[np.abs(factor - 1).argmax()]:.4g} µT was found in the rotor's "
        "magnetization plane: the field model does not fall off with the distance there"
    )


def field_along(field: Field, places: Vectors) -> tuple[Floats, Floats]:
    """b_ratio (...) and α (...) rad of the field at `places` (..., 2) m in the magnetization plane (6.3.5).

    b_max: the field as the moment passes; b_min: a quarter of a turn later; the field turns about b_max × b_min.
    """
    points = np.stack([places[..., 0], np.zeros(places.shape[:-1]), places[..., 1]], axis=-1)
    greatest = field.B(points, outside="extrapolate")
    least = field.B(points @ _QUARTER_TURN, outside="extrapolate") @ _QUARTER_TURN.T  # R b(Rᵀ p), of rows
    ratio = np.linalg.norm(greatest, axis=-1) / np.linalg.norm(least, axis=-1)
    axis = np.cross(greatest, least)
    cosine = (axis * points).sum(axis=-1)
    return ratio, np.arctan2(np.linalg.norm(np.cross(axis, points), axis=-1), cosine)


def _power_law(strengths: Floats, lengths: Floats) -> PowerLaw:
    """Unweighted least squares; strengths in units of 100 µT, lengths in mm, so that all parameters are about one."""
    b, c = strengths / 1e-4, lengths * 1e3

    def residuals(parameters: Floats) -> Floats:
        off: Floats = parameters[0] * b ** parameters[1] + parameters[2] - c
        return off

    start = [float(np.interp(1.0, b[b.argsort()], c[b.argsort()])), -1 / 3, 0.0]
    found = least_squares(residuals, start, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    return PowerLaw(float(1e-3 * found[0] * 1e4 ** found[1]), float(found[1]), float(1e-3 * found[2]))


def _fourier_series(values: Floats) -> FourierSeries:
    """Linear in all but the base frequency: that is scanned, then refined."""
    order = np.arange(1, _RATIO_TERMS + 1)

    def solved(frequency: float) -> tuple[float, Floats]:
        turned = np.multiply.outer(FITTED_ANGLES, frequency * order)
        columns = np.column_stack([np.ones(FITTED_ANGLES.size), np.cos(turned), np.sin(turned)])
        coefficients = np.linalg.lstsq(columns, values, rcond=None)[0]
        return float(np.linalg.norm(columns @ coefficients - values)), coefficients

    scanned = np.linspace(0.5, 2.5, 81)
    best = scanned[np.argmin([solved(w)[0] for w in scanned.tolist()])]
    step = scanned[1] - scanned[0]
    frequency = float(
        minimize_scalar(
            lambda w: solved(w)[0], bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-9}
        ).x
    )
    coefficients = solved(frequency)[1]
    return FourierSeries(
        float(coefficients[0]), coefficients[1 : 1 + order.size], coefficients[1 + order.size :], frequency
    )


def _cosine_sum(values: Floats) -> CosineSum:
    """The largest terms of the discrete Fourier transform, then least squares in all that is free."""
    spectrum = np.fft.rfft(values)[1 : values.size // 2] * 2 / values.size
    largest = np.sort(np.argsort(-np.abs(spectrum))[:_ANGLE_TERMS])
    frequency = (largest + 1) / (2 * np.pi)
    phase = -np.angle(spectrum[largest]) + 2 * np.pi * frequency * FITTED_ANGLES[0]
    start = np.concatenate([[values.mean()], np.abs(spectrum[largest]), 2 * np.pi * frequency, phase])

    def parts(parameters: Floats) -> tuple[float, Floats, Floats]:
        amplitude, turn, shift = parameters[1:].reshape(3, -1)
        return parameters[0], amplitude, np.multiply.outer(FITTED_ANGLES, turn) - shift

    def residuals(parameters: Floats) -> Floats:
        mean, amplitude, turned = parts(parameters)
        off: Floats = mean + np.cos(turned) @ amplitude - values
        return off

    def jacobian(parameters: Floats) -> Floats:
        _, amplitude, turned = parts(parameters)
        sine = amplitude * np.sin(turned)
        ones = np.ones((FITTED_ANGLES.size, 1))
        return np.hstack([ones, np.cos(turned), -FITTED_ANGLES[:, None] * sine, sine])

    found = least_squares(residuals, start, jac=jacobian, x_scale="jac", max_nfev=100).x
    amplitude, turn, shift = found[1:].reshape(3, -1)
    return CosineSum(float(found[0]), amplitude, turn / (2 * np.pi), shift)
