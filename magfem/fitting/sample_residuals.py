"""What measured samples say against a model: residuals in T, relative to the field, and in standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from magfem.errors import InputError
from magfem.fitting.alignment import NAMES, Alignment
from magfem.fitting.candidate import Candidate
from magfem.fitting.located_errors import LocatedErrors, distance_in, largest_sizes
from magfem.fitting.model import FieldModel
from magfem.samples import Samples
from magfem.typing import Booleans, Floats, Points

CONFIDENCE = 0.99
"""That no sample of a true model lies beyond its noise allowance."""


@dataclass(frozen=True, eq=False)
class SampleResiduals:
    """Samples in a model's region, and how far the model is from them.

    points: (n, 3) m in the model's frame.  residual: (n, 3) T or T/A, measured less model; NaN where not measured.
    sigma: (n, 3) or None.  errors: relative, at their places; beyond_noise: of them, what noise cannot explain; equal
    where sigma is not known.  outside: how many samples the region does not hold.  aligned: whether the model was seen
    through the sensor's alignment and background that its own fit has found.
    """

    points: Points
    residual: Floats
    sigma: Floats | None
    errors: LocatedErrors
    beyond_noise: LocatedErrors
    outside: int
    aligned: bool

    @property
    def sizes(self) -> Floats:
        """|residual| (n,) of the measured components."""
        size: Floats = np.sqrt(np.nansum(self.residual**2, axis=1))
        return size

    @property
    def standardised(self) -> Floats | None:
        """Every measured component (m,) over its standard deviation; None where that is not known."""
        if self.sigma is None:
            return None
        over = self.residual / self.sigma
        return over[~np.isnan(over)]


def sample_residuals(model: FieldModel, samples: Samples, aligned: bool | None = None) -> SampleResiduals:
    """Hold a model against samples.

    aligned: whether the samples are seen by a sensor that sits as the model's fit found it; None: if they are the
    samples that it was fitted to, by their source. Raises InputError when no sample lies in the region.
    """
    if aligned is None:
        own = (model.provenance.get("samples") or {}).get("source")
        aligned = own is not None and own == samples.source
    found = _Alignment.of(model) if aligned else _Alignment({}, np.zeros(3))
    points = found.places(samples.points)
    inside: Booleans = model.region.contains(points)
    if not inside.any():
        raise InputError(
            f"none of the {samples.count} samples lies in the model's region, {model.region.describe()}: "
            f"check frame and units [{samples.source}]"
        )
    points, kept = points[inside], samples.subset(inside)
    predicted = found.reading(model, kept.points)
    residual = kept.B - predicted
    size = np.sqrt(np.sum(np.where(kept.measured, kept.B, predicted) ** 2, axis=1))
    difference = np.sqrt(np.nansum(residual**2, axis=1))
    allowed = np.zeros(kept.count)
    if kept.sigma is not None:
        # |noise|² of a sample is at most its largest variance times chi-square.
        freedom = kept.measured.sum(axis=1)
        allowed = np.nanmax(kept.sigma, axis=1) * np.sqrt(chi2.isf((1 - CONFIDENCE) / kept.count, freedom))
    distance = distance_in(model.region, points)
    largest = largest_sizes(model, model.region)

    def relative(lengths: Floats) -> LocatedErrors:
        return LocatedErrors(points, distance, largest.errors(lengths, size, distance, "B"))

    return SampleResiduals(
        points=points,
        residual=residual,
        sigma=kept.sigma,
        errors=relative(difference),
        beyond_noise=relative(np.maximum(difference - allowed, 0.0)),
        outside=int(np.count_nonzero(~inside)),
        aligned=bool(found.values) or bool(found.background.any()),
    )


@dataclass(frozen=True, eq=False)
class _Alignment:
    """What a fit has found of the sensor: free parameters by name, and the background (3,) T."""

    values: dict[str, float]
    background: Floats

    @classmethod
    def of(cls, model: FieldModel) -> _Alignment:
        """As the model's report has it."""
        found = model.report.get("measurement") or {}
        free = {name: float(one["value"]) for name, one in found.get("free", {}).items() if name in NAMES}
        background = found.get("background", {}).get("value", [0.0, 0.0, 0.0])
        return cls(free, np.array(background, dtype=float))

    @property
    def _fixed(self) -> Alignment:
        return Alignment({name: (value - 1.0, value + 1.0) for name, value in self.values.items()})

    @property
    def _theta(self) -> Floats:
        return np.array(list(self.values.values()))

    def places(self, points: Points) -> Points:
        """Nominal points (n, 3) in the source's frame."""
        return self._fixed.in_source_frame(points, self._theta)

    def reading(self, model: FieldModel, points: Points) -> Floats:
        """What the sensor reads (n, 3) at nominal points (n, 3), all of them in the region."""
        whole = Candidate("", "", model.lowered, np.zeros(model.lowered.coefficient.size, dtype=np.int64))
        (reading,) = self._fixed.columns(whole, points, self._theta)
        return np.asarray(reading + self.background)
