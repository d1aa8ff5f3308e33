"""The dissertation's families: axial multipoles at the centre, displaced along the axis, in symmetric sets of eight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from magfem.fields.region import Region, Shell
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics
from magfem.fitting.candidate import Candidate, Displaceable, independent
from magfem.fitting.families.options import several
from magfem.fitting.families.tubes import magnetisation_of, the_cylinder
from magfem.geometry import Geometry
from magfem.geometry.limits import InvalidValue
from magfem.typing import Floats

SPACING = 0.02
"""Least distance of displaced sources, in lengths of the device: nearer ones are one source of a higher order."""


_DEPTHS, _GAPS = (0.05, 0.15, 0.25, 0.4), (0.05, 0.15, 0.25, 0.4)
"""Of the first source and between sources, shares of how far they may go: where the search for places begins."""


def axial_multipole(
    geometry: Geometry, region: Shell, poles: int = 6, height: float = 0.0, window: Region | None = None
) -> Iterator[Candidate]:
    """The multipole of an axisymmetric source (2.7): ∂ᵏ/∂zᵏ(1/r), k = 1…P, about a point of the axis.

    poles: P.  height: of the point over the centre, m; the dissertation puts it on the coil's face.
    """
    at = "at the centre" if height == 0.0 else f"{height * 1e3:.4g} mm above the centre"
    terms = _axial(geometry, height, range(1, poles + 1))
    yield independent("axial_multipole", f"P = {poles} poles {at}", terms, "dissertation, eqs. 2.7–2.9", window)


def displaced_multipoles(
    geometry: Geometry,
    region: Shell,
    sources: Sequence[int] | int = (1, 2, 3),
    orders: Sequence[int] | int = (2, 3, 4, 5),
    shared: bool = False,
) -> Iterator[Displaceable]:
    """Axial multipoles displaced along the axis into the device and behind it (5.2), their places found by the fit.

    sources: M, or several to try.  orders: N, or several.  shared: one set of coefficients for all displacements, as
    5.2 is printed, instead of one for each. Sources keep a least distance of 0.02 device lengths: two that meet are
    one of a higher order, and their coefficients grow without limit.
    """
    hull = the_cylinder(geometry)
    size = max(hull.length, hull.diameter / 2)
    top, bottom = hull.length / 2 - 0.25 * region.clearance, -hull.length / 2 - 2 * size
    least = SPACING * size
    for count, order in product(several(sources), several(orders)):

        def make(places: Floats, count: int = count, order: int = order) -> Candidate:
            heights = top - np.cumsum(places)
            terms = concatenate([_axial(geometry, height, range(1, order + 1)) for height in heights])
            parameter = np.tile(np.arange(order), count) if shared else np.arange(order * count)
            shown = ", ".join(f"{height * 1e3:.4g}" for height in heights)
            return Candidate(
                "displaced_multipoles",
                f"M = {count} displaced, N = {order}{', shared coefficients' if shared else ''}, at z = {shown} mm",
                terms,
                parameter,
                "dissertation, eqs. 5.2–5.3",
            )

        # Places are the depth of the first source and the gaps between them, so that bounds keep them apart.
        reach = top - bottom
        lower = np.concatenate([[0.0], np.full(count - 1, least)])
        upper = np.full(count, reach)
        start = [[depth, *[gap] * (count - 1)] for depth in _DEPTHS for gap in (_GAPS if count > 1 else (0.0,))]
        yield Displaceable(
            f"M = {count}, N = {order}",
            order if shared else order * count,
            make,
            np.maximum(reach * np.array(start), lower),
            lower,
            upper,
            tuple(f"displacement {m + 1}" for m in range(count)),
        )


def eight_source(
    geometry: Geometry, region: Shell, sets: int = 3, orders: Sequence[int] | int = (1, 3, 5)
) -> Iterator[Candidate]:
    """Symmetric sets of eight axial multipoles (6.1–6.3), odd orders about the magnetisation.

    The eight sources of a set share their coefficients. The dissertation leaves the displacements open: here
    the sets stand at the middles of equal slices of the half length, at a quarter of the diameter from the axis.
    Orders must be odd: even ones of a symmetric set vanish.
    """
    orders = several(orders)
    if any(order % 2 == 0 for order in orders):
        raise InvalidValue(
            f"{geometry.name}: eight symmetric sources have odd orders only, got {', '.join(map(str, orders))}",
            "terms.orders",
        )
    hull = the_cylinder(geometry)
    frame = frame_about(magnetisation_of(geometry))
    aside = hull.diameter / 4 / np.sqrt(2)
    parts, parameter = [], []
    zeros, cosine = [0] * len(orders), [False] * len(orders)
    for index in range(sets):
        height = hull.length / 2 * (index + 0.5) / sets
        for signs in product((-1, 1), repeat=3):
            centre = np.array(signs) * (aside, aside, height)
            parts.append(harmonics(hull.radius, list(orders), zeros, cosine, np.ones(len(orders)), centre, frame))
            parameter.append(index * len(orders) + np.arange(len(orders)))
    yield Candidate(
        "eight_source",
        f"{sets} symmetric {'set' if sets == 1 else 'sets'} of 8, orders {', '.join(map(str, orders))}",
        concatenate(parts),
        np.concatenate(parameter),
        "dissertation, eqs. 6.1–6.3",
    )


def _axial(geometry: Geometry, height: float, degrees: range) -> Terms:
    """Axial multipoles about the magnetisation at a height on it, m."""
    direction = magnetisation_of(geometry)
    frame = frame_about(direction)
    zeros, cosine = [0] * len(degrees), [False] * len(degrees)
    centre = height * frame[:, 2]
    return harmonics(geometry.hull.radius, list(degrees), zeros, cosine, np.ones(len(degrees)), centre, frame)
