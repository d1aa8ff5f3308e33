"""Any terms as solid harmonics, by a fit in a region: what loops, paths, oblate sources and discs become for others.

They are no finite sums of solid harmonics. Their common field is fitted by least squares at points of the region. Tried
are, from few to many, until other points of the region are content:

- exterior harmonics at a few centres along the body's axis, of order 0 for a body of revolution, and, where the region
  is a ball or a box, interior ones about its middle;
- close to the body, dipoles on rings that fill it. n dipoles around a ring of radius ρ look smooth from a distance d
  but for a share of e^{−nd/ρ}, so n follows from how near the region comes. For a body of revolution the dipoles of a
  ring are alike: an axial and a radial amplitude for each ring.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import ceil

import numpy as np

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.fields.norms import relative_errors
from magfem.fields.region import Region, Shell
from magfem.fields.term_kinds import HARMONIC, INTERIOR, PATH
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics
from magfem.fields.workspace_region import Ball, Box, bounding_ball
from magfem.fitting.candidate import Candidate, independent
from magfem.fitting.families.harmonics import all_orders
from magfem.fitting.least_squares import solve_least_squares
from magfem.typing import Booleans, Floats, Points

_OF_REVOLUTION = ((1, 3), (1, 6), (2, 4), (3, 4), (4, 5), (6, 5), (8, 6), (10, 6))
_GENERAL = ((1, 2), (1, 4), (1, 6), (3, 4), (5, 4))
"""Centres along the axis and highest degree, from few coefficients to many."""

_SPACINGS = (2.5, 1.5, 1.0, 0.7, 0.5)
"""Of rings, in distances between body and region."""

_SMOOTH = 12.0  # n d/ρ: of the waviness of a ring's n dipoles, e^{−12} remains
_MOST_SOURCES, _MOST_PARAMETERS = 800, 600

_FAMILY = "mpem"
_SEED = 0
_SAFETY = 1.5  # on the largest error found: other random points may hit a little harder
_GOOD_ENOUGH = 0.1  # of the tolerance: what is better is not worth more sources


@dataclass(frozen=True)
class HarmonicFit:
    """Solid harmonics, and the relative errors of B they leave at points that were not fitted.

    maximum: one and a half times the largest one found.  rms: the root of the mean square.
    """

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
    training, judged = _points(region, rng, 40, 20).reshape(-1, 3), _points(region, rng, 120, 40)
    whole = terms.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
    wanted = rest.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
    target = rest.jet(training, 0)[0]
    size = np.linalg.norm(target, axis=1, keepdims=True)
    weight = 1 / np.maximum(size, 1e-2 * size.max())
    best: HarmonicFit | None = None
    for candidate in _candidates(rest, region, training):
        columns = candidate.columns(training, 0)[0] * weight
        solved = solve_least_squares(columns.reshape(len(columns), -1).T, (target * weight).ravel())
        fitted = candidate.with_parameters(solved.parameters)
        found = fitted.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
        errors = relative_errors(whole + found - wanted, whole)
        tried = HarmonicFit(fitted, _SAFETY * float(errors.max()), float(np.sqrt(np.mean(errors**2))))
        if best is None or tried.maximum < best.maximum:
            best = tried
        if best.maximum <= _GOOD_ENOUGH * tolerance:
            break
    assert best is not None
    return best


def _points(region: Region, rng: np.random.Generator, layers: int, nearest: int) -> Points:
    """Random points (l, n, 3) of a region, the nearest layers where errors are largest, and local."""
    if isinstance(region, Ball | Box | Shell):
        return region.layers(rng, layers, 30, nearest)
    raise InputError(f"harmonics are fitted in a Ball, a Box or a shell about a body, not {region.describe()}")


def _candidates(rest: Terms, region: Region, points: Points) -> Iterator[Candidate]:
    """Sets of harmonics to fit, from small to large; none has a centre in the region, of which `points` are many."""
    body = _body(rest)
    frame = frame_about(body.axis)
    hull = CylinderHull(2 * body.radius, 2 * body.half)
    away = float(hull.distance((points - body.centre) @ frame).min())
    reach = min(max(body.half, 0.5 * body.radius), body.half + 0.5 * away)
    inner = bounding_ball(region)
    for count, degree in _OF_REVOLUTION if body.revolved else _GENERAL:
        along = reach * np.cos((np.arange(count) + 0.5) * np.pi / count)  # Chebyshev's points
        places = body.centre + along[:, None] * body.axis
        parts = [_harmonics(HARMONIC, degree, place, reach, frame, body.revolved) for place in places]
        if inner is not None:
            parts.append(_harmonics(INTERIOR, min(degree, 6), np.array(inner.centre), inner.radius, np.eye(3), False))
        yield independent(_FAMILY, f"{count} centres, degrees up to {degree}", concatenate(parts))
    for spacing in _SPACINGS if away > 0 else ():
        dipoles = _rings(body, frame, spacing * away, away)
        if dipoles.terms.kind.size <= _MOST_SOURCES and dipoles.parameters <= _MOST_PARAMETERS:
            yield dipoles


def _rings(body: _Body, frame: Floats, spacing: float, away: float) -> Candidate:
    """Dipoles on rings about the axis that fill a body, with that spacing, seen from as near as `away`."""
    inset = min(0.5 * away, 0.5 * body.radius), min(0.5 * away, 0.5 * body.half)
    width, half = body.radius - inset[0], body.half - inset[1]
    heights = np.linspace(-half, half, max(1 if half == 0 else 2, round(2 * half / spacing) + 1))
    radii = np.linspace(0, width, max(2, round(width / spacing) + 1))
    parts: list[Terms] = []
    parameter: list[int] = []
    for ring, (height, radius) in enumerate(product(heights, radii)):
        distance = away + min(body.radius - radius, body.half - abs(height))
        count = 1 if radius == 0 else max(4, ceil(_SMOOTH * radius / distance))
        for azimuth in 2 * np.pi * np.arange(count) / count:
            radial = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            centre = body.centre + frame @ (radius * radial + [0, 0, height])
            axes = frame_about(body.axis, frame @ radial)
            free = 3 if not body.revolved else 2 if radius > 0 else 1  # axial, radial, azimuthal
            sine = [False, False, True][:free]
            parts.append(harmonics(away, [1] * free, [0, 1, 1][:free], sine, np.ones(free), centre, axes))
            first = 2 * ring if body.revolved else 3 * len(parts)
            parameter += range(first, first + free)
    index = np.unique(parameter, return_inverse=True)[1]
    return Candidate(_FAMILY, f"dipoles on {ring + 1} rings", concatenate(parts), index)


def _harmonics(kind: int, top: int, centre: Points, radius: float, frame: Floats, revolved: bool) -> Terms:
    """All harmonics up to a degree, of order 0 alone if `revolved`."""
    index = [one for one in all_orders(range(1, top + 1)) if not revolved or one[1] == 0]
    degree, order, sine = map(list, zip(*index, strict=True))
    return harmonics(radius, degree, order, sine, np.ones(len(index)), centre, frame, kind)


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
