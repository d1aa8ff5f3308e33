"""Measurements beside predictions, and the remanence that each of them implies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.fields import Field
from magfem.fitting.readings import Reading
from magfem.report.numbers import number, percent


@dataclass(frozen=True)
class Compared:
    """One measurement, the value predicted for it at the nominal remanence (T), and the remanence it implies (T)."""

    measurement: Reading
    predicted: float

    remanence: float
    uncertainty: float | None  # T, of the implied remanence


def compare(measurements: tuple[Reading, ...], field: Field, nominal: float) -> tuple[Compared, ...]:
    """Each measurement beside `field`, the prediction at the nominal remanence (T), to which B is proportional."""
    found = []
    for m in measurements:
        predicted = float(field.B(m.position, outside="extrapolate") @ m.direction)
        scale = nominal / predicted
        spread = None if m.uncertainty is None else abs(m.uncertainty * scale)
        found.append(Compared(m, predicted, m.value * scale, spread))
    return tuple(found)


def reading(compared: tuple[Compared, ...], nominal: float) -> str:
    """How to read the table, in a few sentences."""
    implied = np.array([one.remanence for one in compared])
    mean, low, high = float(implied.mean()), float(implied.min()), float(implied.max())
    text = (
        f"B is proportional to the remanence, so each measurement implies one; their mean is {number(mean)} T, "
        f"{percent(abs(mean / nominal - 1))} {'below' if mean < nominal else 'above'} the nominal "
        f"{number(nominal)} T."
    )
    known = [one.uncertainty for one in compared if one.uncertainty is not None]
    if len(compared) < 2 or len(known) < len(compared):
        return text
    lower = max(one.remanence - (one.uncertainty or 0.0) for one in compared)
    upper = min(one.remanence + (one.uncertainty or 0.0) for one in compared)
    if lower <= upper:
        return f"{text} One remanence between {number(lower)} and {number(upper)} T fits all of them."
    distance = np.array([np.linalg.norm(one.measurement.position) for one in compared])
    nearest = compared[int(distance.argmin())]
    # |B| falls like 1/r³ out there: what shift in distance would explain the nearest one's deviation alone.
    shift = float(distance.min()) / 3 * abs(1 - nearest.remanence / mean)
    return (
        f"{text} They spread from {number(low)} to {number(high)} T, more than the stated uncertainty of the readings "
        "explains, so no single remanence fits them all: a magnet's shape cannot do that, whereas a sensor distance "
        f"that is off by {number(1e3 * shift, 1)} mm, which alone would move the nearest reading to the mean, or a "
        "small background field can. Take the mean as a scale for this magnet, good to the spread, not as a "
        "material constant."
    )
