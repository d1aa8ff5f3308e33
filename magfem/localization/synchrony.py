"""Whether a rotor turns as its stator asks (Fig. 6.3g–i): in step, at another rate, or not at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from magfem.errors import InputError
from magfem.localization.frequency import find_frequency
from magfem.localization.real_numbers import SAMPLES, TIMES, real_numbers
from magfem.localization.signal import demodulate
from magfem.typing import ArrayLike

FALSE_ALARM = 1e-6
"""Probability that noise alone is taken for a rotation."""

OFF = 4.0
"""Deviations of the found frequency from the asked one, beyond which the rotor is out of step."""

LOCKED, IN_STEP, OUT_OF_STEP = "locked", "in step", "out of step"


@dataclass(frozen=True, eq=False)
class Synchrony:
    """What the samples say of a rotation that was asked for.

    outcome: "in step"; "out of step", another frequency stands out; or "locked", none does.  asked: Hz.  frequency,
    deviation: Hz, what is found, NaN when locked, and its standard deviation.  strength: T, the largest field of a turn
    at the frequency that is found, or asked where none is.  share: of the variance, without the mean, that this one
    frequency explains.
    """

    outcome: str
    asked: float
    frequency: float
    deviation: float
    strength: float
    share: float


def synchrony(samples: ArrayLike, times: ArrayLike, asked: float, *, noise: ArrayLike | None = None) -> Synchrony:
    """Compare `samples` (n, 3) T at `times` (n,) s with the frequency that was `asked` for, Hz.

    noise: T, standard deviation of a sample, one number or (3,); None to take it from what is left over. A rotor that
    is not molten free shows no frequency; one that slips shows another. The stator's own field turns at the asked
    frequency too, a hundred times weaker than the rotor's: see `stator_influence`. Raises InputError for samples of
    another shape.
    """
    b, t = real_numbers(samples, SAMPLES), real_numbers(times, TIMES)
    if b.ndim != 2 or b.shape[1:] != (3,):
        raise InputError(f"synchrony looks at one record of one sensor, (n, 3) in T, got {b.shape}")
    at_asked = demodulate(b, t, asked, noise=noise)
    spread = float(np.nansum(np.nanvar(b, axis=0)))
    try:
        turning = find_frequency(b, t)
    except InputError:
        turning = None
    found = at_asked if turning is None else demodulate(b, t, turning, noise=noise)
    quadratures = np.concatenate([found.cosine, found.sine])
    # Six numbers of noise alone would be this large with that probability; a spectrum offers many lines to choose from.
    tried = max(1.0, 0.5 * t.size)
    power = float(quadratures @ np.linalg.solve(found.covariance, quadratures))
    share = float(0.5 * np.sum(quadratures**2) / spread) if spread > 0 else 0.0
    strength = float(found.strength)
    if turning is None or power < chi2.isf(FALSE_ALARM / tried, 6):
        return Synchrony(LOCKED, asked, float("nan"), float("nan"), float(at_asked.strength), share)
    f, deviation = float(turning.at_middle), float(turning.deviation)
    in_step = abs(f - asked) < max(OFF * deviation, 1e-9 * asked)
    return Synchrony(IN_STEP if in_step else OUT_OF_STEP, asked, f, deviation, strength, share)
