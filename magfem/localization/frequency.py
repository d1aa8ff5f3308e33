"""The rotation, found in the samples: a spectrum for the start, then least squares over all axes at once.

A rotor that follows a stator whose two fields are neither equal nor perpendicular does not turn evenly: it swings twice
a turn about where it would be, φ = θ + s_c cos 2θ + s_s sin 2θ. That puts a third harmonic into the field, by which it
is known, and makes the first one's ellipse look rounder or flatter than it is, by which it spoils poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from magfem.errors import InputError
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.typing import ArrayLike, Booleans, Complexes, Floats

_PER_LINE = 4  # points of the spectrum per 1/(time sampled): a peak is met within an eighth of its width
_MOST_STEPS = 30
FALSE_ALARM = 1e-6
"""Probability that noise alone is taken for a rotation."""

_MOST_DRIFTS = 80  # either way, half a turn at the ends of the record from one to the next


@dataclass(frozen=True, eq=False)
class Frequency:
    """A rotation whose frequency may drift, f = at_middle + drift·(t − middle), and that may swing.

    at_middle, deviation: (...) Hz, with its standard deviation; there it does not depend on the phase.  drift: (...)
    Hz/s.  middle: s, the mean of the times.  swing: (..., 2) rad, s_c and s_s above, θ being zero at the middle; None
    for a rotor that turns evenly.  swing_covariance: (..., 2, 2).
    """

    at_middle: Floats
    deviation: Floats
    drift: Floats
    middle: float
    swing: Floats | None = None
    swing_covariance: Floats | None = None

    @property
    def at_zero(self) -> Floats:
        """(...) Hz at time zero."""
        return self.at_middle - self.drift * self.middle

    def turns(self, times: Floats) -> Floats:
        """(..., n) turns since the middle, at `times` (n,) s."""
        return self._turns(times, self.at_middle[..., None], self.drift[..., None], (..., None, slice(None)))

    def angle(self, time: Floats) -> Floats:
        """(...) rad that the rotor has turned by since time zero, at `time` (...) s, broadcast with the rotations."""
        both = [self._turns(one, self.at_middle, self.drift, (...,)) for one in (time, np.zeros(()))]
        return np.asarray(2 * np.pi * (both[0] - both[1]))

    def _turns(self, times: Floats, f: Floats, d: Floats, spread: Any) -> Floats:
        tau = times - self.middle
        even = f * tau + 0.5 * d * tau**2
        if self.swing is None:
            return even
        swing = self.swing[spread]
        double = 4 * np.pi * even
        return np.asarray(even + (swing[..., 0] * np.cos(double) + swing[..., 1] * np.sin(double)) / (2 * np.pi))


@dataclass(frozen=True, eq=False)
class Spectrum:
    """frequencies (f,) Hz; power (..., f) T², of the sinusoid that fits best at each, its mean square over the axes."""

    frequencies: Floats
    power: Floats

    @property
    def peak(self) -> Floats:
        """(...) Hz, where the power is largest."""
        found: Floats = self.frequencies[np.argmax(self.power, axis=-1)]
        return found


def spectrum(
    samples: ArrayLike, times: ArrayLike, frequencies: ArrayLike | None = None, highest: float | None = None
) -> Spectrum:
    """The spectrum of `samples` (..., n, 3) T, summed over their axes, gaps (NaN) allowed (Fig. 6.3h and i).

    By least squares at every frequency for itself (Lomb's periodogram with a free mean), so sampling may be uneven.
    frequencies: (f,) Hz; by default lines four to each 1/(time sampled), from one turn in that time to `highest`, which
    is half the mean rate unless stated.
    """
    b, t = real_numbers(samples, SAMPLES), real_numbers(times, TIMES)
    if b.ndim < 2 or t.shape != (b.shape[-2],) or t.size < 4 or not np.ptp(t) > 0:
        raise InputError(
            f"a spectrum needs samples (..., n, 3) and times (n,), n of 4 or more, got {b.shape}, {t.shape}"
        )
    used = np.isfinite(b)
    lines = (
        _lines(t, highest)
        if frequencies is None
        else real_numbers(frequencies, "frequencies must be numbers (f,) in Hz")
    )
    return Spectrum(lines, _power(np.where(used, b, 0.0), used, _waves(lines, t - t.mean())))


def find_frequency(
    samples: ArrayLike,
    times: ArrayLike,
    near: ArrayLike | None = None,
    *,
    drift: bool = False,
    swing: bool = False,
    known: bool = False,
    weight: ArrayLike | None = None,
) -> Frequency:
    """The rotation in `samples` (..., n, c) T, whose c axes, of one sensor or many, all see one motor.

    near: Hz, where to begin; None for the peak of the spectrum.  drift: whether the frequency may change.  swing:
    whether the rotor may turn unevenly.  known: take the frequency `near` as it is, and find what else is asked for.
    weight: (c,), one over the variance of a sample, T⁻²; None where all axes are equally noisy, by what is left over.

    Variable projection: the amplitudes are eliminated at every step, so only frequency, drift and swing are left, and
    Gauss–Newton on these is exact where it ends. Raises InputError where no frequency is found.
    """
    b, t = real_numbers(samples, SAMPLES), real_numbers(times, TIMES)
    used = np.isfinite(b)
    b = np.where(used, b, 0.0)
    lead, columns = b.shape[:-2], b.shape[-1]
    middle, span = float(t.mean()), float(np.ptp(t))
    tau = t - middle
    weights = np.ones(columns) if weight is None else np.broadcast_to(np.asarray(weight, dtype=float), (columns,))
    f, d = _start(b, t, used, near, drift)
    chosen = [0] * (not known) + [1] * drift + [2, 3] * swing  # of frequency, drift, and the swing's two parts
    if (known and near is None) or not chosen:
        raise InputError("state the known frequency, and what is to be found beside it: drift or swing")
    unit = np.array([span, span**2, 1.0, 1.0])[chosen]  # what the unknowns are large by: turns over the record, rad
    theta = np.concatenate([f[..., None], d[..., None], np.zeros((*lead, 2))], axis=-1)
    for _ in range(_MOST_STEPS):
        information, gradient, misfit = _linearised(b, tau, used, theta, weights, chosen)
        scaled = information / (unit[:, None] * unit)
        if not np.all(np.linalg.det(scaled) > 0):
            raise _lost()
        step = np.linalg.solve(scaled, (gradient / unit)[..., None])[..., 0]
        size = np.abs(step).max(axis=-1)
        step = step * np.minimum(1.0, 0.25 / np.maximum(size, 1e-300))[..., None]  # beyond it has left the peak
        theta[..., chosen] += step / unit
        if np.all(size < 1e-13 * np.maximum(1.0, np.abs(theta[..., 0]) * span)):
            break
    scale: Floats = np.ones(lead)
    if weight is None:
        scale = misfit / np.maximum(used.sum(axis=(-2, -1)) - 3 * columns - len(chosen), 1)
    covariance = scale[..., None, None] * np.linalg.inv(scaled) / (unit[:, None] * unit)
    variance = np.zeros(lead) if known else covariance[..., 0, 0]
    if not known and near is None and not np.all(_stands_out(b, used, weights, misfit, scale, 0.5 * t.size)):
        raise _lost()
    if not np.all((theta[..., 0] > 0) & (size < 1e-6) & (variance >= 0) & (variance * span**2 < 0.1)):
        raise _lost()
    return Frequency(
        theta[..., 0],
        np.sqrt(variance),
        theta[..., 1],
        middle,
        theta[..., 2:] if swing else None,
        covariance[..., -2:, -2:] if swing else None,
    )


def _stands_out(b: Floats, used: Booleans, weight: Floats, misfit: Floats, scale: Floats, lines: float) -> Booleans:
    """(...) whether a sinusoid takes more off the misfit than noise alone would, the best of so many lines."""
    count = np.maximum(used.sum(axis=-2, keepdims=True), 1)
    centred = np.where(used, b - b.sum(axis=-2, keepdims=True) / count, 0.0)
    taken = np.einsum("...na,a->...", centred**2, weight) - misfit
    return np.asarray(taken > scale * chi2.isf(FALSE_ALARM / max(lines, 1.0), 2 * b.shape[-1]))


def _lost() -> InputError:
    return InputError(
        "no rotation frequency stands out of the noise in these samples: state it, or take more or longer samples"
    )


def _start(b: Floats, t: Floats, used: Booleans, near: ArrayLike | None, drift: bool) -> tuple[Floats, Floats]:
    """(...) Hz at the middle and (...) Hz/s, from where both are refined: the peak of the spectrum.

    Where the frequency drifts, of the spectra of the samples with each of many drifts undone, up to twenty turns more
    or less from the middle to the ends. Near a stated frequency, which is that at time zero, lines are tried that lead
    back to it.
    """
    lead, middle, span = b.shape[:-2], float(t.mean()), float(np.ptp(t))
    tau = t - middle
    most = _MOST_DRIFTS if drift else 0
    drifts = np.asarray(np.arange(-most, most + 1) * 2.0 / span**2, dtype=np.float64)
    if near is None:
        found = [_all_lines(b, t, used, chirp) for chirp in _chirps(tau, drifts)]
        lines, power = found[0][0], np.stack([one[1] for one in found], axis=-2)
        best = power.reshape(*lead, -1).argmax(axis=-1)  # of drifts × lines
        return lines[best % lines.size], drifts[best // lines.size]
    start = np.array(np.broadcast_to(real_numbers(near, "a frequency must be a number in Hz"), lead))
    if not np.all(np.isfinite(start) & (start > 0)):
        raise InputError(f"a rotation frequency must be a positive number in Hz, got {near!r}")
    if not drift:
        return start, np.zeros(lead)
    about = np.arange(-_PER_LINE, _PER_LINE + 1) / (_PER_LINE * span)
    lines = np.maximum(start[..., None, None] + middle * drifts[:, None] + about, 1e-3 / span)  # (..., drifts, f)
    power = np.stack(
        [_power(b, used, _waves(lines[..., k, :], tau), chirp) for k, chirp in enumerate(_chirps(tau, drifts))],
        axis=-2,
    )
    best = power.reshape(*lead, -1).argmax(axis=-1)
    return (
        np.take_along_axis(lines.reshape(*lead, -1), best[..., None], axis=-1)[..., 0],
        drifts[best // about.size],
    )


def _all_lines(b: Floats, t: Floats, used: Booleans, chirp: Complexes | None = None) -> tuple[Floats, Floats]:
    """Lines (f,) Hz up to half the mean rate, four to each 1/(time sampled), and their power (..., f) T².

    Of evenly sampled records by a fast Fourier transform.
    """
    lines = _lines(t, None)
    interval = np.ptp(t) / (t.size - 1)
    if not np.allclose(np.diff(t), interval, rtol=1e-6, atol=0):
        return lines, _power(b, used, _waves(lines, t - t.mean()), chirp)
    padded = _PER_LINE * t.size
    count = np.maximum(used.sum(axis=-2, keepdims=True), 1)
    centred = np.where(used, b - b.sum(axis=-2, keepdims=True) / count, 0.0)
    amplitude = np.fft.fft(centred if chirp is None else centred * chirp[:, None], padded, axis=-2)
    frequencies = np.arange(_PER_LINE, padded // 2) / (padded * interval)  # from one turn in the time sampled
    power = 2 * np.sum(np.abs(amplitude[..., _PER_LINE : padded // 2, :]) ** 2 / count**2, axis=-1)
    return frequencies, np.asarray(power)


def _waves(lines: Floats, tau: Floats) -> Complexes:
    """(..., f, n) of lines (..., f) Hz."""
    return np.asarray(np.exp(-2j * np.pi * lines[..., None] * tau))


def _chirps(tau: Floats, drifts: Floats) -> Complexes:
    """(d, n): multiplied with samples they undo each of the drifts."""
    return np.asarray(np.exp(-1j * np.pi * drifts[:, None] * tau**2))


def _lines(t: Floats, highest: float | None) -> Floats:
    span = np.ptp(t)
    top = 0.5 * (t.size - 1) / span if highest is None else highest
    step = 1 / (_PER_LINE * span)
    lines = np.arange(1 / span, top, step)
    if lines.size < 1:
        raise InputError("the samples are too few or too short to look for a frequency: state it")
    return lines


def _power(b: Floats, used: Booleans, waves: Complexes, chirp: Complexes | None = None) -> Floats:
    """(..., f) T²: what the best of each of `waves` (..., f, n) takes off the mean square, summed over axes."""
    count = np.maximum(used.sum(axis=-2, keepdims=True), 1)
    centred = np.where(used, b - b.sum(axis=-2, keepdims=True) / count, 0.0)
    amplitude = waves @ (centred if chirp is None else centred * chirp[:, None])  # (..., f, c)
    power: Floats = 2 * np.sum(np.abs(amplitude) ** 2 / count**2, axis=-1)
    return power


def _linearised(
    b: Floats, tau: Floats, used: Booleans, theta: Floats, weight: Floats, chosen: list[int]
) -> tuple[Floats, Floats, Floats]:
    """Information (..., k, k) and gradient (..., k) of the `chosen` of frequency, drift and both parts of the swing,
    `theta` (..., 4), and the weighted misfit (...), all amplitudes eliminated.
    """
    f, d, s_c, s_s = (theta[..., k, None] for k in range(4))
    even = 2 * np.pi * (f * tau + 0.5 * d * tau**2)
    cos2, sin2 = np.cos(2 * even), np.sin(2 * even)
    angle = even + s_c * cos2 + s_s * sin2
    cos, sin = np.cos(angle), np.sin(angle)
    here = np.swapaxes(used, -1, -2)[..., None]  # (..., c, n, 1)
    X = np.stack([np.ones_like(cos), cos, sin], axis=-1)[..., None, :, :] * here  # (..., c, n, 3)
    y = np.swapaxes(b, -1, -2)[..., None]  # (..., c, n, 1); zero where not used
    Xt = np.swapaxes(X, -1, -2)
    normal = np.linalg.inv(Xt @ X)
    c = normal @ (Xt @ y)  # (..., c, 3, 1)
    speed = -c[..., 1, :] * sin[..., None, :] + c[..., 2, :] * cos[..., None, :]  # (..., c, n) per rad
    pace = 2 * np.pi * (1 - 2 * s_c * sin2 + 2 * s_s * cos2)  # of the angle, per turn of the even rotation
    every = (pace * tau, 0.5 * pace * tau**2, cos2, sin2)
    by = np.stack([every[k] for k in chosen], axis=-1)  # (..., n, k)
    D = speed[..., None] * by[..., None, :, :] * here
    # What changes and what is left, side by side, weighted, all columns of samples in one: (..., c · n, k + 1).
    both = np.concatenate([D - X @ (normal @ (Xt @ D)), y - X @ c], axis=-1) * np.sqrt(weight)[:, None, None]
    both = both.reshape(*both.shape[:-3], -1, both.shape[-1])
    product = np.swapaxes(both, -1, -2) @ both
    return product[..., :-1, :-1], product[..., :-1, -1], product[..., -1, -1]
