"""Writing MPEM files: solid harmonics exactly, all other terms by a fit whose residual is stated.

MPEM knows axial multipoles alone. Three steps lead there:

- Solid harmonics of order 0 are what the format holds. Those of other orders are written exactly too: by the addition
  theorem P_l(n·r̂) = Σ_m S_lm(n) S_lm(r̂), in Schmidt's normalisation, axial multipoles along 2L + 1 directions n about
  one centre span all harmonics up to degree L.
- Loops, oblate sources, paths and discs are no finite sums of solid harmonics. Their common field is fitted by
  least squares at points of the region: exterior harmonics at a few centres along the body's axis, of order 0 for a
  coil of revolution, and, where the region is a ball or a box, interior ones about its middle. More and more of them
  are tried; other points of the region judge.
- `mag_manip` reads either A_Coeff or B_Coeff of a source and wants the other one as `~`.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import assoc_legendre_p_all

from magfem.actuation.coil_system import CoilSystem
from magfem.actuation.mpem import OFFSET
from magfem.errors import ConvergenceError, InputError
from magfem.fields.field import Field
from magfem.fields.norms import relative_errors
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Region, Shell
from magfem.fields.term_kinds import HARMONIC, INTERIOR, PATH
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics
from magfem.fields.workspace_region import Ball, Box
from magfem.files import write_text
from magfem.fitting.least_squares import solve_least_squares
from magfem.typing import Booleans, Floats, Points
from magfem.units import one_line

log = logging.getLogger("magfem")

TOLERANCE = 0.01
"""Largest relative error of B that a fit may leave, unless told otherwise."""

_LADDER_OF_REVOLUTION = ((1, 3), (1, 6), (2, 4), (3, 4), (4, 5), (6, 5), (8, 6), (10, 6))
_LADDER = ((1, 2), (1, 4), (1, 6), (3, 4), (5, 4))
"""Centres along the axis and highest degree, from few coefficients to many."""

_SEED = 0
_GOOD_ENOUGH = 0.1  # of the tolerance: what is better is not worth more sources


@dataclass(frozen=True)
class MpemExport:
    """What was written.

    exact: whether every term went over as it is, up to rounding.  maximum, rms: relative errors of B (norm of
    `fields.norms`) over points of the region that were not fitted, the worst coil's; zero when exact.
    residuals: (maximum, rms) by coil.  sources: how many the file has.  region: where the residual was measured.
    """

    path: Path
    exact: bool
    maximum: float
    rms: float
    residuals: dict[str, tuple[float, float]]
    sources: int
    region: str


@dataclass(frozen=True)
class _Source:
    """One source of the file."""

    position: Floats
    direction: Floats
    interior: bool
    coefficients: Floats  # (n,) of degrees 1 to n


def write_mpem(
    source: CoilSystem | Field,
    path: str | Path,
    workspace: Region | None = None,
    tolerance: float = TOLERANCE,
    strict: bool = True,
) -> MpemExport:
    """Write a coil system, or one coil's model, as an MPEM calibration file.

    source: a system; a model in T/A becomes a system of one coil; a field in T a background (`Offset`) without
    coils.  workspace: a Ball or Box where the file is to hold; by default the source's own region. The file's
    `Workspace_Dimensions` are then the box, the cube within the ball, or the cube around a region about a body.
    tolerance: of the fit, if one is needed, relative; strict: whether a larger residual is refused
    (ConvergenceError), else it is written all the same.

    Raises InputError for a field without terms, and for a fit without a region.
    """
    name, parts, region = _parts(source)
    region = workspace or region
    written: dict[str, list[_Source]] = {}
    residuals: dict[str, tuple[float, float]] = {}
    for label, terms in parts.items():
        exactly = np.isin(terms.kind, (HARMONIC, INTERIOR))
        keep, rest = _chosen(terms, exactly), _chosen(terms, ~exactly)
        residuals[label] = (0.0, 0.0)
        if rest is not None:
            fitted, residuals[label] = _fitted(rest, terms, region, tolerance)
            keep = fitted if keep is None else keep + fitted
        assert keep is not None
        written[label] = [one for k in range(keep.kind.size) for one in _axial_sources(keep.source(k))]
    worst = max(residuals, key=lambda label: residuals[label][0])
    maximum, rms = residuals[worst]
    exact = all(np.isin(terms.kind, (HARMONIC, INTERIOR)).all() for terms in parts.values())
    outcome = "exact" if exact else f"residual of B at most {maximum:.2%}, {rms:.2%} RMS"
    if maximum > tolerance and strict:
        raise ConvergenceError(
            f"axial multipoles describe {worst} of {name} to {maximum:.2g} of B at best, more than the tolerance of "
            f"{tolerance:.2g}: choose a smaller workspace, a larger tolerance, or strict=False to write it all the same"
        )
    file = Path(path)
    header = [f"{name}, written by magfem.", f"Per ampere, in T/A; {outcome}; region: {region.describe()}."]
    write_text(file, _text(name, written, _box(region), header))
    count = sum(map(len, written.values()))
    log.info("mpem: %d sources, %s", count, outcome)
    return MpemExport(file, exact, maximum, rms, residuals, count, region.describe())


def _parts(source: CoilSystem | Field) -> tuple[str, dict[str, Terms], Region]:
    """Name, terms by the file's names of coils, and region."""
    if isinstance(source, CoilSystem):
        labels = _labels([coil.name for coil in source.coils])
        parts = {label: coil.terms for label, coil in zip(labels, source.coils, strict=True)}
        if source.background is not None:
            parts[OFFSET] = source.background
        return source.name, parts, source.region
    terms: Terms | None = getattr(source, "lowered", None)
    if not isinstance(source, Field) or terms is None:
        raise InputError("write_mpem takes a coil system, a fitted model, or a field made of such")
    name = str(getattr(source, "name", "field"))
    return name, {"Coil_0" if source.unit == "T/A" else OFFSET: terms}, source.region


def _labels(names: list[str]) -> list[str]:
    """The coils' names where they are of the usual form, else Coil_0, Coil_1, …"""
    usual = all(re.fullmatch(r"Coil_\w+", name, re.ASCII) and OFFSET not in name for name in names)
    return names if usual else [f"Coil_{k}" for k in range(len(names))]


def _chosen(terms: Terms, which: Booleans) -> Terms | None:
    """Some of the sources."""
    rows = np.flatnonzero(which)
    return concatenate([terms.source(int(k)) for k in rows]) if rows.size else None


# Exactly: solid harmonics as axial multipoles


def _axial_sources(harmonic: Terms) -> list[_Source]:
    """One centre's solid harmonics (one source of Terms) as axial multipoles."""
    frame, position, radius = harmonic.frame[0], harmonic.centre[0], float(harmonic.radius[0])
    interior = bool(harmonic.kind[0] == INTERIOR)
    top = int(harmonic.degree.max())
    table = np.zeros((top + 1, 2 * top + 1))  # [l, m] the cosines, [l, −m] the sines
    column = np.where(harmonic.sine == 1, -harmonic.order, harmonic.order)
    np.add.at(table, (harmonic.degree, column), harmonic.coefficient)
    table[:, -top:] *= np.arange(-top, 0) != 0
    degree = np.arange(1, top + 1)
    scale = radius ** (1.0 - degree) if interior else radius ** (degree + 2.0)
    if not table[:, 1:].any():  # of revolution about the frame's z
        return [_Source(position, frame[:, 2], interior, table[1:, 0] * scale)]
    if not table[2:].any():  # a dipole, or a uniform field, whatever its direction
        moment = np.array([table[1, 1], table[1, -1], table[1, 0]])
        size = float(np.linalg.norm(moment))
        return [_Source(position, frame @ (moment / size), interior, np.array([size * scale[0]]))]
    directions = _spread_directions(2 * top + 1)
    surface = _schmidt(directions, top)
    weights = np.zeros((len(directions), top))
    for l in degree:  # noqa: E741
        columns = np.arange(-l, l + 1)
        weights[:, l - 1] = np.linalg.lstsq(surface[:, l, columns].T, table[l, columns], rcond=None)[0]
    return [
        _Source(position, frame @ direction, interior, row * scale)
        for direction, row in zip(directions, weights, strict=True)
    ]


def _spread_directions(count: int) -> Points:
    """Unit vectors (count, 3), spread over a half sphere by the golden angle: a direction and its opposite are one."""
    k = np.arange(count)
    z = 1 - (k + 0.5) / count
    azimuth = np.pi * (3 - np.sqrt(5)) * k
    rho = np.sqrt(1 - z**2)
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=-1)


def _schmidt(directions: Points, top: int) -> Floats:
    """Schmidt's semi-normalised surface harmonics (n, top + 1, 2·top + 1): [:, l, m] cosines, [:, l, −m] sines."""
    x, y, z = directions.T
    legendre = assoc_legendre_p_all(top, top, z, norm=True)[0]  # (l, m, n), with (−1)^m, ∫ P² dz = 1
    surface = np.zeros((len(directions), top + 1, 2 * top + 1))
    for l in range(top + 1):  # noqa: E741
        for m in range(l + 1):
            factor = (-1) ** m * np.sqrt((2 if m else 1) * 2 / (2 * l + 1))
            turning = (x + 1j * y) ** m / np.hypot(x, y) ** m
            surface[:, l, -m] = factor * legendre[l, m] * turning.imag
            surface[:, l, m] = factor * legendre[l, m] * turning.real
    return surface


# By a fit: everything else


def _fitted(rest: Terms, terms: Terms, region: Region, tolerance: float) -> tuple[Terms, tuple[float, float]]:
    """Harmonics for `rest`, and the relative residual (maximum, RMS) they leave of `terms`, of which it is a part."""
    rng = np.random.default_rng(_SEED)
    training, judged = _points(region, rng, 600), _points(region, rng, 2400)
    whole = terms.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
    wanted = rest.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
    flat = training.reshape(-1, 3)
    target = rest.jet(flat, 0)[0]
    weight = 1 / np.maximum(np.linalg.norm(target, axis=1), 1e-2 * np.linalg.norm(target, axis=1).max())
    best: tuple[Terms, tuple[float, float]] | None = None
    for candidate in _candidates(rest, region):
        columns = np.stack([_one_column(candidate, flat, k) * weight[:, None] for k in range(candidate.degree.size)])
        solved = solve_least_squares(columns.reshape(len(columns), -1).T, (target * weight[:, None]).ravel())
        fitted = candidate.with_coefficients(solved.parameters)
        found = fitted.jet(judged.reshape(-1, 3), 0)[0].reshape(judged.shape)
        errors = relative_errors(whole + found - wanted, whole, layered=judged.ndim == 3)
        residual = float(errors.max()), float(np.sqrt(np.mean(errors**2)))
        if best is None or residual[0] < best[1][0]:
            best = fitted, residual
        if best[1][0] <= _GOOD_ENOUGH * tolerance:
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
    if isinstance(region, PlacedRegion):
        inner = _points(region.region, rng, count)
        placed: Points = region.pose.apply(inner.reshape(-1, 3)).reshape(inner.shape)
        return placed
    if isinstance(region, Intersection):
        for one in region.regions:
            if isinstance(one, Ball | Box):
                points = one.random_points(rng, 4 * count)
                points = points[region.contains(points)][:count]
                if len(points) >= count // 4:
                    return points
    raise InputError("an MPEM export that needs a fit needs a workspace: give a Ball or a Box")


def _candidates(rest: Terms, region: Region) -> Iterator[Terms]:
    """Sets of harmonics to fit, from small to large."""
    axis, centre, half, revolved = _body(rest)
    frame = frame_about(axis)
    size = max(half, 0.1 * _reach(rest, centre))
    for count, degree in _LADDER_OF_REVOLUTION if revolved else _LADDER:
        places = size * np.cos((np.arange(count) + 0.5) * np.pi / count)  # Chebyshev's points
        parts = [_harmonics(HARMONIC, degree, centre + place * axis, size, frame, revolved) for place in places]
        middle = _middle(region)
        if middle is not None:
            parts.append(_harmonics(INTERIOR, min(degree, 6), np.array(middle.centre), middle.radius, np.eye(3), False))
        yield concatenate(parts)


def _harmonics(kind: int, top: int, centre: Points, radius: float, frame: Floats, revolved: bool) -> Terms:
    """All harmonics up to a degree, of order 0 alone if `revolved`."""
    index = [
        (l, m, part)
        for l in range(1, top + 1)
        for m in range(1 if revolved else l + 1)
        for part in (0, 1)[: 1 + (m > 0)]
    ]  # noqa: E741
    degree, order, sine = map(list, zip(*index, strict=True))
    return harmonics(radius, degree, order, [bool(part) for part in sine], np.ones(len(index)), centre, frame, kind)


def _body(terms: Terms) -> tuple[Floats, Points, float, bool]:
    """Axis, centre, half length along the axis of what the terms stand for; whether it is one of revolution."""
    paths = terms.kind == PATH
    places = [terms.centre[~paths]]
    for k in np.flatnonzero(paths):
        nodes = terms.nodes[terms.node_start[k] : terms.node_start[k + 1]]
        places.append(terms.centre[k] + nodes @ terms.frame[k].T)
    points = np.concatenate(places)
    axis = terms.frame[0][:, 2]
    middle = points.mean(axis=0)
    if not paths.any():
        along = (points - points[0]) @ axis
        beside = points - points[0] - along[:, None] * axis
        turned = np.linalg.norm(np.cross(terms.frame[:, :, 2], axis), axis=1)
        scale = float(terms.radius.max()) + float(np.abs(along).max())
        revolved = bool(turned.max() < 1e-9 and np.abs(beside).max() < 1e-9 * scale)
    else:
        revolved = False
    along = (points - middle) @ axis
    low, high = float(along.min()), float(along.max())
    return axis, middle + (low + high) / 2 * axis, (high - low) / 2, revolved


def _reach(terms: Terms, centre: Points) -> float:
    """Radius of a ball about `centre` that holds all the sources."""
    reach = float((np.linalg.norm(terms.centre - centre, axis=1) + terms.radius * (terms.kind != PATH)).max())
    if len(terms.nodes):
        reach = max(reach, float(np.linalg.norm(terms.nodes, axis=1).max()))
    return reach


def _middle(region: Region) -> Ball | None:
    """The ball about a workspace, which holds no sources: interior harmonics live there."""
    from magfem.fields.workspace_region import bounding_ball

    if isinstance(region, Intersection):
        return next((ball for one in region.regions if (ball := bounding_ball(one))), None)
    return bounding_ball(region)


# The file


def _box(region: Region) -> Box:
    """The file's workspace."""
    if isinstance(region, Box):
        return region
    if isinstance(region, Ball):
        half = region.radius / np.sqrt(3)
        low, high = np.array(region.centre) - half, np.array(region.centre) + half
        return Box(tuple(low.tolist()), tuple(high.tolist()))
    if isinstance(region, Intersection):
        boxes = [_box(one) for one in region.regions if isinstance(one, Ball | Box)]
        if boxes:
            return boxes[0]
    if isinstance(region, PlacedRegion) and isinstance(region.region, Shell | Ball):
        inner = _box(region.region)
        half = np.array(inner.high) - np.array(inner.low)
        centre = region.pose.apply(np.add(inner.high, inner.low) / 2)
        low, high = centre - half / 2, centre + half / 2
        return Box(tuple(low.tolist()), tuple(high.tolist()))
    if isinstance(region, Shell):
        reach = region.hull.radius + region.extent
        return Box((-reach,) * 3, (reach,) * 3)
    if isinstance(region, Everywhere):
        raise InputError("an MPEM file states a workspace: give a Ball or a Box")
    raise InputError(f"an MPEM file states a workspace, and none follows from this region ({region.describe()})")


def _text(name: str, coils: dict[str, list[_Source]], box: Box, header: list[str]) -> str:
    lines = [f"# {one_line(line)}" for line in header]
    lines += [f"System_Name: {json.dumps(one_line(name), ensure_ascii=False)}", "Workspace_Dimensions:"]
    lines += [f"  - [{_number(low)}, {_number(high)}]" for low, high in zip(box.low, box.high, strict=True)]
    lines += ["Coil_List:", *(f"  - {label}" for label in coils)]
    for label, sources in coils.items():
        lines += [f"{label}:", "  Source_List:", *(f"    - Src_{k}" for k in range(len(sources)))]
        for k, source in enumerate(sources):
            used, other = ("A_Coeff", "B_Coeff") if source.interior else ("B_Coeff", "A_Coeff")
            lines += [
                f"  Src_{k}:",
                f"    {other}: ~",
                f"    {used}: {_numbers(source.coefficients)}",
                f"    Source_Direction: {_numbers(source.direction)}",
                f"    Source_Position: {_numbers(source.position)}",
            ]
    return "\n".join(lines) + "\n"


def _numbers(values: Floats) -> str:
    return f"[{', '.join(map(_number, values.tolist()))}]"


def _number(value: float) -> str:
    """A float with all its bits, and always with a dot: to YAML 1.1, 1e-07 is a text."""
    text = repr(float(value))
    mantissa, exponent, power = text.partition("e")
    return text if "." in mantissa else f"{mantissa}.0{exponent}{power}"
