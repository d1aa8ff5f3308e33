"""Families for samples of no known device: harmonics about a centre, for sources outside or inside."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from magfem.errors import InputError
from magfem.fields.term_kinds import HARMONIC, INTERIOR
from magfem.fields.terms import Terms, concatenate, harmonics
from magfem.fitting.candidate import Candidate, independent
from magfem.fitting.families.harmonics import all_orders
from magfem.fitting.families.options import SYMMETRIES, several
from magfem.samples import Samples
from magfem.typing import ArrayLike, Floats


def interior_harmonics(
    samples: Samples,
    centre: ArrayLike | None = None,
    degrees: Sequence[int] | int = (1, 2, 3, 4, 5, 6, 8, 10),
    symmetry: str = "none",
) -> Iterator[Candidate]:
    """Interior solid harmonics: a workspace without sources, whose field comes from outside.

    centre: m, the middle of the samples by default.  degrees: the highest, or several to try.  symmetry: see
    `selected`.
    """
    middle = ball_about(samples)[0] if centre is None else np.asarray(centre, dtype=float)
    radius = float(np.linalg.norm(samples.points - middle, axis=1).max())
    for top in several(degrees):
        terms = selected(symmetry, range(1, top + 1), radius, middle, INTERIOR)
        yield independent("interior_harmonics", f"interior harmonics up to degree {top}", terms)


def exterior_harmonics(
    samples: Samples,
    centre: ArrayLike = (0.0, 0.0, 0.0),
    centres: Sequence[ArrayLike] | None = None,
    radius: float | None = None,
    degrees: Sequence[int] | int = (1, 2, 3, 4, 5, 6, 8, 10),
    symmetry: str = "none",
) -> Iterator[Candidate]:
    """Exterior solid harmonics: samples around a source about `centre` (m), or beside it; or several, about `centres`.

    radius: reference, m; by default that of the nearest sample.  degrees: the highest, or several to try.
    """
    places = np.array([centre] if centres is None else centres, dtype=float)
    distance = np.linalg.norm(samples.points[:, None] - places, axis=2)
    reference = float(distance[distance > 0].min()) if radius is None else radius
    about = "" if len(places) == 1 else f" about each of {len(places)} centres"
    for top in several(degrees):
        terms = [selected(symmetry, range(1, top + 1), reference, place, HARMONIC) for place in places]
        yield independent("exterior_harmonics", f"exterior harmonics up to degree {top}{about}", concatenate(terms))


def selected(symmetry: str, degrees: range, radius: float, centre: Floats, kind: int) -> Terms:
    """The harmonics that a symmetry leaves, all coefficients one.

    none: all.  axial: order 0, a field of revolution about z.  diametric: order 1 in the plane of x, what a body of
    revolution magnetised along x gives.  plane_x, plane_y, plane_z: potentials odd in that coordinate: currents and
    magnets whose field stands at right angles to the mirror plane.
    """
    if symmetry not in SYMMETRIES:
        raise InputError(f"unknown symmetry {symmetry!r}; known: {', '.join(SYMMETRIES)}")
    rules: dict[str, Callable[[int, int, bool], bool]] = {
        "none": lambda n, m, sine: True,
        "axial": lambda n, m, sine: m == 0,
        "diametric": lambda n, m, sine: m == 1 and not sine,
        "plane_x": lambda n, m, sine: (m % 2 == 1) != sine,
        "plane_y": lambda n, m, sine: sine,
        "plane_z": lambda n, m, sine: (n - m) % 2 == 1,
    }
    kinds = [one for one in all_orders(degrees) if rules[symmetry](*one)]
    if not kinds:
        raise InputError(f"the symmetry {symmetry!r} leaves no harmonic of degree {degrees[-1]} or less")
    degree, order, sine = (list(column) for column in zip(*kinds, strict=True))
    return harmonics(radius, degree, order, sine, np.ones(len(kinds)), centre, kind=kind)


def ball_about(samples: Samples) -> tuple[Floats, float]:
    """Centre (3,) and radius (m) of the sphere that the samples lie on, to 5 %; else of a ball about them all."""
    points = samples.points
    middle = samples.centre
    matrix = np.column_stack([2 * (points - middle), np.ones(len(points))])
    solution, _, rank, _ = np.linalg.lstsq(matrix, np.sum((points - middle) ** 2, axis=1), rcond=None)
    centre = middle + solution[:3]
    distance = np.linalg.norm(points - centre, axis=1)
    if rank == 4 and np.ptp(distance) < 0.05 * distance.mean():
        return centre, float(distance.max())
    return middle, float(np.linalg.norm(points - middle, axis=1).max())
