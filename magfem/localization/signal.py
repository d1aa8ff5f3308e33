"""From samples of a field that turns to its static part and the two quadratures of every rotation frequency.

    b(t) = b₀ + Σ_j C_j cos 2πf_j t + S_j sin 2πf_j t + noise

is linear in b₀, C_j and S_j: weighted least squares gives them with their covariance, whatever the rate, and with gaps.
Averages over whole turns, as a Fourier transform takes them, are the special case of even sampling of whole turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from magfem.errors import InputError
from magfem.localization.frequency import Frequency, find_frequency
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.localization.sensor import stated_deviation, stated_step
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Vectors

STRONGEST = 100.0  # T, beyond what any sensor reads: samples in another unit

LARGEST_CONDITION = 10.0
"""Of the scaled design: beyond, what is called one frequency could as well be another, or the static field."""


@dataclass(frozen=True, eq=False)
class RotatingField:
    """What the samples say of one rotation frequency, at one three-axis sensor or many.

    static, cosine, sine: (..., 3) T, of the field b₀ + C cos φ + S sin φ with φ = 2π(f t + ½ d t²).  covariance:
    (..., 6, 6) T² of (C, S).  joint_covariance: (..., 9, 9) T² of (b₀, C, S).  turning: the frequency f with its drift
    d. Where it was found, its error makes the phase at time zero uncertain, not the ellipse, and is not in the
    covariances.  noise: (..., 3) T, the standard deviation of a sample, stated or found.  residual: (..., 3) T, the
    root of the mean square of what is left, over the degrees of freedom.  count, saturated: (..., 3), samples that were
    used, and left out because the sensor was full.
    """

    static: Vectors
    cosine: Vectors
    sine: Vectors
    covariance: Floats
    joint_covariance: Floats
    turning: Frequency
    noise: Vectors
    residual: Vectors
    count: Integers
    saturated: Integers

    @property
    def frequency(self) -> Floats:
        """(...) Hz at time zero."""
        return self.turning.at_zero

    @property
    def strength(self) -> Floats:
        """(...) T, the largest field during a turn, b_iso of the dissertation."""
        return np.asarray(np.linalg.norm(np.stack([self.cosine, self.sine], axis=-1), ord=2, axis=(-2, -1)))

    @property
    def signal_to_noise(self) -> Floats:
        """(...) dB, mean power of the turning field over that of the noise of a sample (6.1.3)."""
        power = 0.5 * np.sum(self.cosine**2 + self.sine**2, axis=-1)
        return np.asarray(10 * np.log10(power / np.maximum(np.sum(self.noise**2, axis=-1), np.finfo(float).tiny)))


def demodulate(
    samples: ArrayLike,
    times: ArrayLike,
    frequency: ArrayLike | Frequency | None = None,
    *,
    noise: ArrayLike | None = None,
    resolution: float = 0.0,
    saturation: float = np.inf,
    drift: bool = False,
    swing: bool = False,
) -> RotatingField:
    """The static field and the quadratures of one frequency in `samples` (..., n, 3) T taken at `times` (n,) s.

    frequency: Hz, a number or (...), or what `find_frequency` gave; None where it is to be found, within half the mean
    rate of the samples.  drift: find how it drifts as well, and the frequency itself from near the given one.  swing:
    find how unevenly the rotor turns (see `frequency`); the quadratures are those of even turning.  noise: T, standard
    deviation of a sample, a number or (3,); None to take it from what is left over.  resolution: T, the step of the
    readings, whose share of the noise is added to a stated `noise`.  saturation: T; readings at or beyond it are left
    out, as NaN are.

    Raises InputError for samples that do not determine the unknowns, saying why.
    """
    b, t, missing, saturated = _checked(samples, times, saturation)
    lead = b.shape[:-2]
    sigma = None if noise is None else _stated_noise(noise, resolution)
    if isinstance(frequency, Frequency):
        turning = frequency
    elif frequency is None or drift or swing:
        weight = None if sigma is None else 1 / np.maximum(sigma, np.finfo(float).tiny) ** 2
        known = frequency is not None and not drift
        turning = find_frequency(
            *(np.where(missing, np.nan, b), t, frequency), drift=drift, swing=swing, known=known, weight=weight
        )
    else:
        turning = _constant(frequency, lead, float(t.mean()))
    # One design for all leading axes where they share the frequency.
    stated = not isinstance(frequency, Frequency) and frequency is not None and np.ndim(frequency) == 0
    shared = stated and not drift and not swing
    turns = turning.turns(t)
    design = _design([turns.reshape(-1, t.size)[0] if shared and turns.size else turns])
    fitted = _fit(b, design, missing, sigma, saturated)
    if turning.swing is not None:
        fitted = replace(fitted, by_swing=_by_swing(fitted, design, ~missing, turning, t))
    return _rotating(fitted, 0, turning)


def _by_swing(fitted: _Fitted, X: Floats, used: Booleans, turning: Frequency, times: Floats) -> Floats:
    """(..., k, 3, 2) how the coefficients answer to the swing's parts: least squares once more, of what it changes."""
    even = replace(turning, swing=None).turns(times)
    C, S = fitted.coefficients[..., 1, None, :], fitted.coefficients[..., 2, None, :]
    speed = S * X[..., 1, None] - C * X[..., 2, None]
    by = np.stack([np.cos(4 * np.pi * even), np.sin(4 * np.pi * even)], axis=-1)  # (..., n, 2)
    change = np.where(used[..., None], speed[..., None] * by[..., :, None, :], 0.0)  # (..., n, 3, 2)
    right = np.einsum("...nk,...nas->...kas", X, change)
    return np.asarray(-np.einsum("...akl,...las->...kas", fitted.inverse, right))


def demodulate_several(
    samples: ArrayLike,
    times: ArrayLike,
    frequencies: Sequence[float] | Floats,
    *,
    noise: ArrayLike | None = None,
    resolution: float = 0.0,
    saturation: float = np.inf,
) -> tuple[RotatingField, ...]:
    """The quadratures of several motors at once, one `RotatingField` for each of `frequencies` (m,) Hz.

    Otherwise as `demodulate`. Raises InputError where two frequencies cannot be told from each other, or one from the
    static field, in samples of this length.
    """
    b, t, missing, saturated = _checked(samples, times, saturation)
    words = "frequencies must be a list of numbers in Hz"
    given = real_numbers(frequencies, words)
    if given.ndim != 1 or not given.size:
        raise InputError(f"{words}, got {frequencies!r}")
    motors = [_constant(f, (), float(t.mean())) for f in given]
    sigma = None if noise is None else _stated_noise(noise, resolution)
    fitted = _fit(b, _design([one.turns(t) for one in motors]), missing, sigma, saturated, given)
    return tuple(_rotating(fitted, j, _constant(f, b.shape[:-2], float(t.mean()))) for j, f in enumerate(given))


def quadrature_covariance(times: ArrayLike, frequency: float, *, noise: ArrayLike, resolution: float = 0.0) -> Floats:
    """(6, 6) T² of (C, S) from samples at `times` (n,) s with this noise, as `demodulate` states it; see there.

    For whole turns, evenly sampled, 2 σ²/n on the diagonal.
    """
    t = real_numbers(times, TIMES)
    sigma = _stated_noise(noise, resolution)
    X = _design([_constant(frequency, (), float(t.mean())).turns(t)])
    normal = X.T @ X
    _separable(normal, None)
    return np.asarray(np.kron(np.linalg.inv(normal)[1:, 1:], np.diag(sigma**2)))


@dataclass(frozen=True, eq=False)
class _Fitted:
    """coefficients (..., k, 3), the matrices (..., 3, k, k) that noise variances multiply, noise, residual, counts;
    by_swing (..., k, 3, 2), how the coefficients answer to the swing, None where there is none.
    """

    coefficients: Floats
    inverse: Floats
    noise: Vectors
    residual: Vectors
    count: Integers
    saturated: Integers
    by_swing: Floats | None = None


def _checked(samples: ArrayLike, times: ArrayLike, saturation: float) -> tuple[Floats, Floats, Booleans, Integers]:
    """Samples with zeros where there are none, times, which are missing, and how many were saturated."""
    b, t = real_numbers(samples, SAMPLES), real_numbers(times, TIMES)
    if b.ndim < 2 or b.shape[-1] != 3 or t.shape != (b.shape[-2],):
        raise InputError(f"samples must be (..., n, 3) and times (n,), got {b.shape} and {t.shape}")
    if not b.size:
        raise InputError(f"there are no samples: {b.shape}")
    if not np.isfinite(t).all():
        raise InputError("times must be finite numbers in s")
    if t.size < 2 or not np.ptp(t) > 0:
        raise InputError(
            f"a turning field needs samples at different times, got {t.size} in {np.ptp(t) if t.size else 0:g} s"
        )
    if np.isinf(b).any():
        raise InputError("samples must be finite; those that are missing are NaN")
    if np.nanmax(np.abs(b), initial=0.0) > STRONGEST:
        raise InputError(f"samples are fields in T, got {np.nanmax(np.abs(b)):.3g}: multiply those in µT by 1e-6")
    full = np.abs(b) >= saturation
    missing = np.isnan(b) | full
    return np.where(missing, 0.0, b), t, missing, full.sum(axis=-2)


def _stated_noise(noise: ArrayLike, resolution: float) -> Floats:
    step = stated_step(resolution, "resolution")
    return np.asarray(np.sqrt(stated_deviation(noise, "noise") ** 2 + step**2 / 12))  # of rounding: step/√12


def _constant(frequency: ArrayLike, lead: tuple[int, ...], middle: float) -> Frequency:
    """A stated frequency that does not drift."""
    words = "a rotation frequency must be a positive number in Hz"
    given = real_numbers(frequency, words)
    if not np.all(np.isfinite(given) & (given > 0)):
        raise InputError(f"{words}, got {frequency!r}")
    try:
        each = np.array(np.broadcast_to(given, lead))
    except ValueError:
        raise InputError(
            f"frequencies {given.shape} do not fit samples with leading axes {lead}: state one, or one for each"
        ) from None
    return Frequency(each, np.zeros(lead), np.zeros(lead), middle)


def _design(turns: Sequence[Floats]) -> Floats:
    """(..., n, 1 + 2m): one, cosine and sine of every frequency's turns (..., n)."""
    columns = [np.ones_like(turns[0])]
    for one in turns:
        columns += [np.cos(2 * np.pi * one), np.sin(2 * np.pi * one)]
    return np.stack(columns, axis=-1)


def _fit(
    b: Floats,
    X: Floats,
    missing: Booleans,
    sigma: Floats | None,
    saturated: Integers,
    frequencies: Floats | None = None,
) -> _Fitted:
    """Least squares of samples b (..., n, 3) on a design X (..., n, k), each axis of the sensor for itself."""
    k = X.shape[-1]
    if missing.any():
        used = ~missing
        count = used.sum(axis=-2)
        products = np.einsum("...nk,...nl->...nkl", X, X).reshape(*X.shape[:-1], k * k)
        normal = (np.swapaxes(used, -1, -2).astype(float) @ products).reshape(*count.shape, k, k)  # (..., 3, k, k)
    else:
        count = np.full((*b.shape[:-2], 3), b.shape[-2])
        normal = (np.swapaxes(X, -1, -2) @ X)[..., None, :, :]
    if count.min(initial=k + 1) <= k:
        raise InputError(
            f"{count.min()} usable samples on an axis of the sensor do not determine {k} unknowns and the noise: take "
            "more, and look at gaps and saturation"
        )
    _separable(normal, frequencies)
    inverse = np.broadcast_to(np.linalg.inv(normal), (*b.shape[:-2], 3, k, k))
    right = np.swapaxes(X, -1, -2) @ b  # (..., k, 3); samples that are missing are zero
    coefficients = np.einsum("...akl,...la->...ka", inverse, right)
    left = np.where(missing, 0.0, b - X @ coefficients)
    residual = np.sqrt(np.sum(left**2, axis=-2) / (count - k))
    # Samples without any noise: what rounding of numbers leaves keeps weights finite.
    least = 1e-10 * np.abs(b).max(axis=(-2, -1))[..., None]
    noise = np.maximum(residual if sigma is None else np.broadcast_to(sigma, residual.shape), least)
    if sigma is None:
        # The coefficients' posterior is Student's t with ν = n − k degrees of freedom, its covariance ν/(ν − 2) larger.
        freedom = (count - k).astype(float)
        inverse = inverse * (freedom / np.maximum(freedom - 2, 1.0))[..., None, None]
    return _Fitted(coefficients, inverse, noise, residual, count, saturated)


def _separable(normal: Floats, frequencies: Floats | None) -> None:
    size = np.einsum("...kk->...k", normal)
    # A sine sampled at its own zeros is a column of rounding errors: it must not be scaled up to count.
    scale = np.sqrt(np.maximum(size, 1e-8 * size.max(axis=-1, keepdims=True)))
    eigenvalues = np.linalg.eigvalsh(normal / (scale[..., :, None] * scale[..., None, :]))
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.sqrt(eigenvalues[..., -1] / np.maximum(eigenvalues[..., 0], 0.0))
    if np.all(condition < LARGEST_CONDITION):
        return
    if frequencies is not None and len(frequencies) > 1:
        listed = ", ".join(f"{one:g}" for one in frequencies)
        raise InputError(
            f"the samples cannot tell the frequencies {listed} Hz from each other or from a static field: they must be "
            "further apart than about one over the time sampled, and not mirrored at half the rate of the samples"
        )
    raise InputError(
        "the samples cannot tell the turning field from a static one: they must cover most of a turn, and the "
        "frequency must not be near a multiple of half the rate of the samples"
    )


def _rotating(fitted: _Fitted, j: int, turning: Frequency) -> RotatingField:
    """Frequency j of a fit about the middle of the times, its quadratures turned back to time zero."""
    first = 1 + 2 * j
    C, S = fitted.coefficients[..., first, :], fitted.coefficients[..., first + 1, :]
    chosen = np.array([0, first, first + 1])
    own = fitted.inverse[..., chosen[:, None], chosen] * (fitted.noise**2)[..., None, None]
    back = 2 * np.pi * turning.turns(np.zeros(1))  # (..., 1) rad, of time zero seen from the middle
    c, s = np.cos(back), np.sin(back)
    # C cos(φ + back) + S sin(φ + back): the quadratures that belong to φ, zero at time zero.
    one, none = np.ones_like(c), np.zeros_like(c)
    rows = [np.stack(row, axis=-1) for row in ((one, none, none), (none, c, s), (none, -s, c))]
    turn = np.stack(rows, axis=-2)  # (..., 1, 3, 3)
    own = turn @ own @ np.swapaxes(turn, -1, -2)  # (..., 3, 3, 3)
    joint = np.einsum("...apq,ab->...paqb", own, np.eye(3)).reshape(*C.shape[:-1], 9, 9)
    if fitted.by_swing is not None and turning.swing_covariance is not None:
        by = np.einsum("...pq,...qas->...pas", turn[..., 0, :, :], fitted.by_swing[..., chosen, :, :])
        flat = by.reshape(*C.shape[:-1], 9, 2)
        joint = joint + flat @ turning.swing_covariance @ np.swapaxes(flat, -1, -2)
    return RotatingField(
        static=fitted.coefficients[..., 0, :],
        cosine=c * C + s * S,
        sine=c * S - s * C,
        covariance=joint[..., 3:, 3:],
        joint_covariance=joint,
        turning=turning,
        noise=fitted.noise,
        residual=fitted.residual,
        count=fitted.count,
        saturated=fitted.saturated,
    )
