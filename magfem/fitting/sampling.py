"""Field data of a source over a device's region, in layers of equal hull distance; and errors on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fields.norms import relative_errors
from magfem.fields.region import Shell
from magfem.fitting.located_errors import LocatedErrors
from magfem.typing import Booleans, Floats, Jet, Points

SHAPES = {"training": (28, 24, 4), "selection": (24, 24, 10), "heldout": (64, 34, 15)}
"""Layers, points in each, and further layers at the clearance itself: there errors are largest, and local."""


@dataclass(frozen=True)
class LayeredData:
    """Field data on layers of equal hull distance: points, B and gradient, shapes (l, p, …).

    The first `spread` layers are spread over the region, the others lie at its clearance.
    """

    points: Points
    B: Floats
    gradient: Floats
    spread: int

    @property
    def flat(self) -> Points:
        """All points (n, 3) m."""
        return self.points.reshape(-1, 3)


def sample(source: Field, region: Shell, seed: int) -> dict[str, LayeredData]:
    """Training, selection and held-out data, no point of one among those of another.

    Raises InputError for a field that is not finite or vanishes.
    """
    seeds = np.random.SeedSequence(seed).spawn(len(SHAPES))
    return {
        name: _layers(source, region, np.random.default_rng(own), *shape)
        for (name, shape), own in zip(SHAPES.items(), seeds, strict=True)
    }


def _layers(
    source: Field, region: Shell, rng: np.random.Generator, layers: int, per_layer: int, nearest: int
) -> LayeredData:
    points = region.layers(rng, layers, per_layer, nearest)
    B, gradient = source.jet(points, 1)
    if not (np.isfinite(B).all() and np.isfinite(gradient).all()):
        raise InputError("cannot fit this field: it holds values that are not finite in the device's region")
    if not (B.any(axis=(1, 2)).all() and gradient.any(axis=(1, 2, 3)).all()):
        raise InputError("cannot fit this field: it vanishes at some distance from the device, or does not change")
    return LayeredData(points, B, gradient, layers)


def layer_errors(jet: Jet, data: LayeredData, counted: Booleans | None = None) -> dict[str, Any]:
    """Largest relative errors over the `counted` (l, p) samples (default: all); root mean square of the spread ones."""
    counted = np.ones(data.points.shape[:2], dtype=bool) if counted is None else counted
    spread = counted & (np.arange(counted.shape[0]) < data.spread)[:, None]
    result: dict[str, Any] = {"points": int(np.count_nonzero(counted))}
    for key, found, truth in zip(("B", "gradient"), jet, (data.B, data.gradient), strict=True):
        errors = relative_errors(found.reshape(truth.shape), truth)
        result[key] = {"max": float(errors[counted].max()), "rms": float(np.sqrt(np.mean(errors[spread] ** 2)))}
    return result


def worst_places(jet: Jet, data: LayeredData, region: Shell) -> dict[str, Any]:
    """The largest error of each, and where it is: point and hull distance, m."""
    worst: dict[str, Any] = {}
    for key, found, truth in zip(("B", "gradient"), jet, (data.B, data.gradient), strict=True):
        errors = relative_errors(found.reshape(truth.shape), truth)
        (worst[key],) = LocatedErrors(data.flat, region.hull.distance(data.flat), errors.ravel()).worst(1)
    return worst
