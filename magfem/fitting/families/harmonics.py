"""Exterior solid harmonics about a device's centre, as many as its symmetry leaves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from magfem.errors import InputError
from magfem.fields.region import Shell
from magfem.fields.terms import concatenate, frame_about, harmonics
from magfem.fitting.candidate import Candidate, independent
from magfem.fitting.families.tubes import magnetisation_of, single_part
from magfem.geometry import Geometry, MagneticSolids
from magfem.geometry.ball import Ball
from magfem.geometry.box import Box
from magfem.typing import Floats

MOST_PARAMETERS = 400
"""Harmonics about all bodies together."""

MOST_BODIES = 8
"""More leave too few harmonics to each: those about one centre are then nearer."""


def solid_harmonics(geometry: Geometry, region: Shell) -> Iterator[Candidate]:
    """Exterior solid harmonics about the centre of the ball around the device.

    A uniformly magnetised body of revolution, or a cuboid, is its own mirror image in its centre, so degrees are odd;
    of the body of revolution axial magnetisation gives orders 0, transverse magnetisation orders 1 in its own azimuth.
    A device of revolution about z gives orders 0. Other devices get all orders of all degrees.
    """
    part = single_part(geometry)
    if part is None or not (part.shape.revolved or isinstance(part.shape, Box)):
        if geometry.axisymmetric:
            yield from _zonal(geometry)
        else:
            yield from _all(geometry, 1, (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16))
        return
    if not part.shape.revolved:
        yield from _all(geometry, 2, (3, 5, 7, 9, 11, 13, 15, 17))
        return
    radius = part.shape.hull.radius
    x, y, z = magnetisation_of(geometry)
    transverse, axial = np.hypot(x, y) > 1e-12, abs(z) > 1e-12
    frame = frame_about(np.array([0.0, 0.0, 1.0]), np.array([x, y, 0.0]) if transverse else None)
    for highest in (1, 3, 5, 7, 9, 11, 13, 17, 21) if isinstance(part.shape, Ball) else (3, 5, 7, 9, 11, 13, 17, 21):
        degrees = range(1, highest + 1, 2)
        kinds = [(n, m, False) for n in degrees for m in (0, 1) if (axial if m == 0 else transverse)]
        yield _harmonics(f"odd degrees up to {highest}", radius, kinds, frame=frame)


def body_harmonics(geometry: Geometry, region: Shell) -> Iterator[Candidate]:
    """Exterior solid harmonics of all orders about the middle of the box around every part of a device of several.

    Unlike those about one centre they converge between the parts and close to them.
    """
    if not isinstance(geometry, MagneticSolids):
        raise InputError(f"{geometry.name}: harmonics about every body are for magnets made of parts")
    if 3 * len(geometry.parts) > MOST_PARAMETERS:
        raise InputError(
            f"{geometry.name}: harmonics about every body are for at most {MOST_PARAMETERS // 3} parts, "
            f"this has {len(geometry.parts)}; solid_harmonics are for more"
        )
    boxes = [(part.corners.min(axis=0), part.corners.max(axis=0)) for part in geometry.parts]
    for top in (1, 2, 3, 4, 5, 6, 7):
        kinds = all_orders(range(1, top + 1))
        if len(kinds) * len(geometry.parts) > MOST_PARAMETERS:
            return
        degrees, orders, sines = (list(column) for column in zip(*kinds, strict=True))
        terms = [
            harmonics(
                float(np.linalg.norm(high - low)) / 2, degrees, orders, sines, np.ones(len(kinds)), (low + high) / 2
            )
            for low, high in boxes
        ]
        yield independent(
            "body_harmonics", f"degrees up to {top} about each of {len(terms)} bodies", concatenate(terms)
        )


def _zonal(geometry: Geometry) -> Iterator[Candidate]:
    """Orders 0 alone: devices of revolution about z."""
    for highest in (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24):
        kinds = [(n, 0, False) for n in range(1, highest + 1)]
        yield _harmonics(f"order 0, degrees up to {highest}", geometry.hull.radius, kinds)


def _all(geometry: Geometry, step: int, highest: tuple[int, ...]) -> Iterator[Candidate]:
    """All orders of the degrees 1, 1 + step, … up to each of `highest`."""
    centre, radius = geometry.ball if isinstance(geometry, MagneticSolids) else (np.zeros(3), geometry.hull.radius)
    for top in highest:
        kinds = all_orders(range(1, top + 1, step))
        yield _harmonics(f"{'all' if step == 1 else 'odd'} degrees up to {top}", radius, kinds, centre)


def all_orders(degrees: range) -> list[tuple[int, int, bool]]:
    """Degree, order and whether it is the sine part, of all harmonics of some degrees."""
    return [(n, m, sine) for n in degrees for m in range(n + 1) for sine in (False, True) if m or not sine]


def _harmonics(
    label: str,
    radius: float,
    kinds: list[tuple[int, int, bool]],
    centre: Floats | None = None,
    frame: Floats | None = None,
) -> Candidate:
    degrees, orders, sines = (list(column) for column in zip(*kinds, strict=True))
    return independent(
        "solid_harmonics", label, harmonics(radius, degrees, orders, sines, np.ones(len(kinds)), centre, frame)
    )
