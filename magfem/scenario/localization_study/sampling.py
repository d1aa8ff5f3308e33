"""When a study's sensors take samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.geometry.card import Table
from magfem.typing import Floats

FEWEST, MOST = 4, 1_000_000  # samples of a pose: fewer say nothing, more do not fit a machine


@dataclass(frozen=True)
class Sampling:
    """Every 1/rate for `duration`; Hz and s."""

    rate: float
    duration: float

    @property
    def times(self) -> Floats:
        """(n,) s."""
        return np.arange(round(self.duration * self.rate)) / self.rate


def read_sampling(table: Table, duration: str = "duration") -> Sampling:
    """Of a table with `rate`, and with how long under the key `duration`. Raises CardError for what is none."""
    found = Sampling(table.quantity("rate", "frequency"), table.quantity(duration, "time"))
    for key, value in (("rate", found.rate), (duration, found.duration)):
        if not 0 < value < np.inf:
            raise table.error(f"{key} must be positive", key)
    count = found.rate * found.duration
    if not FEWEST <= round(count) <= MOST:
        raise table.error(f"{count:.6g} samples of a pose: between {FEWEST} and {MOST} are possible", duration)
    return found


def read_frequency(table: Table, sampling: Sampling) -> float:
    """Hz, of a table with `frequency`, which `sampling` must not mistake for another. Raises CardError."""
    frequency = table.quantity("frequency", "frequency")
    if not 0 < frequency < 0.5 * sampling.rate:
        raise table.error(f"frequency must be positive and below half the rate of {sampling.rate:g} Hz", "frequency")
    return frequency
