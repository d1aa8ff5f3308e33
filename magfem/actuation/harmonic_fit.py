"""Any terms as solid harmonics, by a fit in a region: what loops, paths, oblate sources and discs become for others.

They are no finite sums of solid harmonics. Their common field is fitted by least squares at points of the region:
exterior harmonics at a few centres along the body's axis, of order 0 for a coil of revolution, and, where the region is
a ball or a box, interior ones about its middle. More and more of them are tried; other points of the region judge.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from magfem.errors import InputError
from magfem.fields.norms import relative_errors
from magfem.fields.region import Region, Shell
from magfem.fields.term_kinds import HARMONIC, INTERIOR, PATH
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics
from magfem.fields.workspace_region import Ball, Box, bounding_ball
from magfem.fitting.least_squares import solve_least_squares
from magfem.typing import Booleans, Floats, Points

_OF_REVOLUTION = ((1, 3), (1, 6), (2, 4), (3, 4), (4, 5), (6, 5), (8, 6), (10, 6))
_GENERAL = ((1, 2), (1, 4), (1, 6), (3, 4), (5, 4))
"""Centres along the axis and highest degree, from few coefficients to many."""

_SEED = 0
_GOOD_ENOUGH = 0.1  # of the tolerance: what is better is not worth more sources


@dataclass(frozen=True)
class HarmonicFit:
    """Solid harmonics, and the relative errors of B they leave at points that were not fitted."""

    terms: Terms
    maximum: float
    rms: float


def as_harmonics(terms: Terms, region: Region, tolerance: float) -> HarmonicFit:
    """Terms as exterior and interior solid harmonics alone: those that are stay, the others are fitted.

    The first set of harmonics with a tenth of `tolerance` is taken, else the best there is. The errors are those of
    all terms together, in the norm of `fields.norms`; zero where nothing had to be fitted.
    Raises InputError when points of the region cannot be drawn.
    """
    exactly = np.isin(terms.kind, (HARMONIC, INTERIOR))
    keep, rest = _chosen(terms, exactly), _chosen(terms, ~exactly)
    if rest is None:
        return HarmonicFit(terms, 0.0, 0.0)
    fit = _fitted(rest, terms, region, tolerance)
    return fit if keep is None else replace(fit, terms=keep + fit.terms)


def _chosen(terms: Terms, which: Booleans) -> Terms | None:
    """Some of the sources."""
    rows = np.flatnonzero(which)
    return concatenate([terms.source(int(k)) for k in rows]) if rows.size else None


def _fitted(rest: Terms, terms: Terms, region: Region, tolerance: float) -> HarmonicFit:
    """Harmonics for `rest`, and the errors they leave of `terms`, of which it is a part."""
    rng = np.random.default_rng(_SEED)
    training, judged = _points(region, rng, 600), _points(region, rng, 2400)
    whole = terms.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
    wanted = rest.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
    flat = training.reshape(-1, 3)
    target = rest.jet(flat, 0)[0]
    weight = 1 / np.maximum(np.linalg.norm(target, axis=1), 1e-2 * np.linalg.norm(target, axis=1).max())
    best: HarmonicFit | None = None
    for candidate in _candidates(rest, region):
        columns = np.stack([_one_column(candidate, flat, k) * weight[:, None] for k in range(candidate.degree.size)])
        solved = solve_least_squares(columns.reshape(len(columns), -1).T, (target * weight[:, None]).ravel())
        fitted = candidate.with_coefficients(solved.parameters)
        found = fitted.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
        errors = relative_errors(whole + found - wanted, whole, layered=judged.ndim == 3)
        tried = HarmonicFit(fitted, float(errors.max()), float(np.sqrt(np.mean(errors**2))))
        if best is None or tried.maximum < best.maximum:
            best = tried
        if best.maximum <= _GOOD_ENOUGH * tolerance:
            break
    assert best is not None
    return best


def _one_column(candidate: Terms, points: Points, k: int) -> Floats:
    """B (n, 3) of coefficient k at one."""
    return candidate.with_coefficients(np.arange(candidate.degree.size) == k).jet(points, 0)[0]


def _points(region: Region, rng: np.random.Generator, count: int) -> Points:
    """Random points of a region: (n, 3), or (layers, n, 3) with one hull distance each."""
    if isinstance(region, Ball | Box):
        return region.random_points(rng, count)
    if isinstance(region, Shell):
        return region.layers(rng, count // 30, 30)
    raise InputError(f"harmonics are fitted in a Ball, a Box or a shell about a body, not {region.describe()}")


def _candidates(rest: Terms, region: Region) -> Iterator[Terms]:
    """Sets of harmonics to fit, from small to large; none has a centre in the region."""
    body = _body(rest)
    frame = frame_about(body.axis)
    reach = max(body.half, 0.5 * body.radius)
    if isinstance(region, Shell):
        reach = min(reach, body.half + 0.5 * region.clearance)
    inner = bounding_ball(region)
    for count, degree in _OF_REVOLUTION if body.revolved else _GENERAL:
        along = reach * np.cos((np.arange(count) + 0.5) * np.pi / count)  # Chebyshev's points
        places = body.centre + along[:, None] * body.axis
        parts = [
            _harmonics(HARMONIC, degree, place, reach, frame, body.revolved)
            for place in places[~region.contains(places)]
        ]
        if inner is not None:
            parts.append(_harmonics(INTERIOR, min(degree, 6), np.array(inner.centre), inner.radius, np.eye(3), False))
        if parts:
            yield concatenate(parts)


def _harmonics(kind: int, top: int, centre: Points, radius: float, frame: Floats, revolved: bool) -> Terms:
    """All harmonics up to a degree, of order 0 alone if `revolved`."""
    index = [
        (degree, order, part)
        for degree in range(1, top + 1)
        for order in range(1 if revolved else degree + 1)
        for part in (0, 1)[: 1 + (order > 0)]
    ]
    degree, order, sine = map(list, zip(*index, strict=True))
    return harmonics(radius, degree, order, [bool(part) for part in sine], np.ones(len(index)), centre, frame, kind)


@dataclass(frozen=True)
class _Body:
    """What terms stand for: its axis, centre and half length, m, its radius about the axis, whether it is revolved."""

    axis: Floats
    centre: Points
    half: float
    radius: float
    revolved: bool


def _body(terms: Terms) -> _Body:
    """The body about the first source's axis."""
    paths = terms.kind == PATH
    places = [terms.centre[~paths]]
    for k in np.flatnonzero(paths):
        nodes = terms.nodes[terms.node_start[k] : terms.node_start[k + 1]]
        places.append(terms.centre[k] + nodes @ terms.frame[k].T)
    points = np.concatenate(places)
    axis, origin = terms.frame[0][:, 2], points.mean(axis=0)
    along = (points - origin) @ axis
    beside = float(np.linalg.norm(points - origin - along[:, None] * axis, axis=1).max())
    radius = beside + float(np.max(terms.radius[~paths], initial=0.0))
    turned = float(np.linalg.norm(np.cross(terms.frame[:, :, 2], axis), axis=1).max())
    middle, half = (along.max() + along.min()) / 2, (along.max() - along.min()) / 2
    revolved = not paths.any() and turned < 1e-9 and beside < 1e-9 * (radius + half)
    return _Body(axis, origin + middle * axis, float(half), radius, bool(revolved))
