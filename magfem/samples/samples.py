"""Field data at points: of one source, or of a coil system at stated currents."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from magfem.errors import InputError
from magfem.typing import ArrayLike, Booleans, Floats, Integers, Points, Vectors

AXES = ("x", "y", "z")


class _AtPoints:
    """What samples of either kind tell of their points."""

    points: Points

    @property
    def count(self) -> int:
        """How many points, one for each row."""
        return len(self.points)

    @property
    def centre(self) -> Floats:
        """Middle (3,) m of the box about the points."""
        return np.asarray(0.5 * (self.points.min(axis=0) + self.points.max(axis=0)))

    @property
    def extent(self) -> Floats:
        """Edges (3,) m of the box about the points."""
        return np.asarray(np.ptp(self.points, axis=0))


@dataclass(frozen=True, eq=False, repr=False)
class Samples(_AtPoints):
    """B at n points, as measured or computed. The arrays are copied and cannot be written to.

    points: (n, 3) m.
    B: (n, 3) T, or T/A. NaN marks a component that was not measured (a probe of one axis); no row is NaN throughout.
    sigma: (n, 3) standard deviation of every component, in B's unit, or whatever broadcasts to it; None when unknown.
    Kept as NaN where B is.
    unit: "T" or "T/A".
    source: where they come from, a file's name or words.

    Raises InputError for other shapes, no samples, values that are not finite, deviations that are not positive.
    """

    points: Points
    B: Vectors
    sigma: Floats | None = None
    unit: Literal["T", "T/A"] = "T"
    source: str = ""

    def __post_init__(self) -> None:
        points, B = _rows("points", self.points), _rows("B", self.B)
        _same_count(points, B)
        _refuse(np.isinf(B), "B must be finite, or NaN where it was not measured")
        _refuse(
            np.asarray(np.isnan(B).all(axis=1, keepdims=True)), "no component of B was measured: one at least is needed"
        )
        if self.unit not in ("T", "T/A"):
            raise InputError(f'the unit of samples must be "T" or "T/A", got {self.unit!r}')
        _keep(self, points=points, B=B, sigma=_deviations(self.sigma, B))

    def __repr__(self) -> str:
        return f"Samples({self.count} points, {self.unit}, {self.source!r})"

    @property
    def measured(self) -> Booleans:
        """Which components (n, 3) were measured."""
        return ~np.isnan(self.B)

    def subset(self, which: Booleans | Integers | slice) -> Samples:
        """The samples of a mask (n,), of indices or of a slice."""
        return replace(
            self, points=self.points[which], B=self.B[which], sigma=None if self.sigma is None else self.sigma[which]
        )


@dataclass(frozen=True, eq=False, repr=False)
class SystemSamples(_AtPoints):
    """B at n points of a system of c coils, each row at currents of its own. The arrays are copied, and read-only.

    points: (n, 3) m.  currents: (n, c) A.  B: (n, 3) T, all components measured.
    sigma: (n, 3) T standard deviation of every component, or whatever broadcasts to it; None when unknown.
    source: where they come from, a file's name or words.

    Raises InputError for other shapes, no samples, values that are not finite, deviations that are not positive.
    """

    points: Points
    currents: Floats
    B: Vectors
    sigma: Floats | None = None
    source: str = ""

    def __post_init__(self) -> None:
        points, B, currents = _rows("points", self.points), _rows("B", self.B), _array("currents", self.currents)
        if currents.ndim != 2 or currents.shape[1] == 0:
            raise InputError(f"currents must be an array (n, coils), got shape {currents.shape}")
        _same_count(points, B, currents)
        _refuse(~np.isfinite(B), "B of a coil system must be finite")
        _refuse(~np.isfinite(currents), "currents must be finite")
        _keep(self, points=points, currents=currents, B=B, sigma=_deviations(self.sigma, B))

    def __repr__(self) -> str:
        return f"SystemSamples({self.count} points, {self.coils} coils, {self.source!r})"

    @property
    def coils(self) -> int:
        """How many coils."""
        return int(self.currents.shape[1])

    def subset(self, which: Booleans | Integers | slice) -> SystemSamples:
        """The samples of a mask (n,), of indices or of a slice."""
        return replace(
            self,
            points=self.points[which],
            currents=self.currents[which],
            B=self.B[which],
            sigma=None if self.sigma is None else self.sigma[which],
        )


def _array(name: str, values: ArrayLike) -> Floats:
    """A copy as floats."""
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be an array of numbers") from None


def _rows(name: str, values: ArrayLike) -> Floats:
    """A copy (n, 3); points are checked to be finite."""
    array = _array(name, values)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} must be an array (n, 3), got shape {array.shape}")
    if len(array) == 0:
        raise InputError("there are no samples: one at least is needed")
    if name == "points":
        _refuse(~np.isfinite(array), "points must be finite")
    return array


def _same_count(*arrays: Floats) -> None:
    counts = [len(array) for array in arrays]
    if len(set(counts)) > 1:
        raise InputError(f"points and values must be as many, got {', '.join(map(str, counts))} rows")


def _deviations(sigma: ArrayLike | None, B: Floats) -> Floats | None:
    """Standard deviations (n, 3), NaN where B is."""
    if sigma is None:
        return None
    given = _array("sigma", sigma)
    try:
        full = np.broadcast_to(given, B.shape)
    except ValueError:
        raise InputError(f"sigma must be one number, (3,) or (n, 3), got shape {given.shape}") from None
    full = np.where(np.isnan(B), np.nan, full)
    _refuse(~np.isnan(B) & ~((full > 0) & np.isfinite(full)), "standard deviations must be positive and finite")
    return full


def _refuse(wrong: Booleans, message: str) -> None:
    """InputError with the first row of `wrong` (n, k) that holds something wrong."""
    rows = np.flatnonzero(wrong.any(axis=1))
    if rows.size:
        raise InputError(f"{message} [sample {rows[0]}, the first being 0]")


def _keep(owner: object, **arrays: Floats | None) -> None:
    """Set the fields of a frozen dataclass to arrays that cannot be written to."""
    for name, array in arrays.items():
        if array is not None:
            array.flags.writeable = False
        object.__setattr__(owner, name, array)
