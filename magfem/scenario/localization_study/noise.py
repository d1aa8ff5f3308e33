"""A sensor's noise in a study: Gaussian of a deviation, or uniform up to a peak, then rounded to its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.geometry.card import Table
from magfem.localization import Sensor
from magfem.typing import Floats
from magfem.units import describe

GAUSSIAN, UNIFORM = "gaussian", "uniform"


@dataclass(frozen=True)
class Noise:
    """size: T, the standard deviation of Gaussian noise, or the largest value of uniform noise.  resolution: T."""

    size: float
    distribution: str = GAUSSIAN
    resolution: float = 0.0

    @property
    def deviation(self) -> float:
        """Standard deviation, T."""
        return self.size if self.distribution == GAUSSIAN else self.size / np.sqrt(3.0)

    @property
    def sensor(self) -> Sensor:
        """The sensor that is told as much."""
        return Sensor(noise=self.deviation, resolution=self.resolution)

    def added(self, samples: Floats, generator: np.random.Generator) -> Floats:
        """Samples with noise, rounded."""
        drawn = (
            generator.standard_normal(samples.shape)
            if self.distribution == GAUSSIAN
            else generator.uniform(-1.0, 1.0, samples.shape)
        )
        noisy = samples + self.size * drawn
        return np.asarray(self.resolution * np.round(noisy / self.resolution)) if self.resolution > 0 else noisy


def read_noise(table: Table) -> Noise:
    """Of a table with `noise`, `distribution` and `resolution`. Raises CardError for what is none."""
    distribution = table.text("distribution") if "distribution" in table else GAUSSIAN
    if distribution not in (GAUSSIAN, UNIFORM):
        raise table.error(
            f'distribution must be "{GAUSSIAN}" or "{UNIFORM}", got {describe(distribution)}', "distribution"
        )
    size = table.quantity("noise", "flux density")
    resolution = table.quantity("resolution", "flux density") if "resolution" in table else 0.0
    if not 0 < size < np.inf:
        raise table.error("noise must be positive", "noise")
    if not 0 <= resolution < np.inf:
        raise table.error("resolution must not be negative", "resolution")
    return Noise(size, distribution, resolution)


def quantities(table: Table, key: str, dimension: str) -> Floats:
    """A list of positive quantities at `key`, in SI. Raises CardError for anything else."""
    from magfem.units import quantity

    stated = table.value(key)
    if not isinstance(stated, list) or not stated:
        raise table.error(f"{key} must be a list of quantities with their units", key)
    try:
        return np.array([quantity(one, dimension) for one in stated])
    except InputError as error:
        raise table.error(str(error), key) from None
