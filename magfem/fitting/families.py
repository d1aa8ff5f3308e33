"""Families of field models: which sources, where, for which device. Each is harmonic by construction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Region
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics, loops
from magfem.geometry import Magnets
from magfem.typing import ArrayLike, Booleans, Floats, Integers

MOST_LOOPS = 120
"""Loops on one wall: more would make a model slower than it is worth."""


@dataclass(frozen=True)
class Candidate:
    """A linear model before its fit: unit terms, and which free parameter each of their coefficients takes.

    terms: c coefficients.  parameter: (c,) index into the p free parameters; coefficients may share one.
    """

    family: str
    label: str
    terms: Terms
    parameter: Integers
    source: str = ""  # where the family comes from, when it is not ours
    window: Region | None = None  # the part of the device's region that the family is meant for

    @property
    def parameters(self) -> int:
        return int(self.parameter.max()) + 1

    def with_parameters(self, values: Floats) -> Terms:
        """The terms for parameter values (p,)."""
        return self.terms.with_coefficients(values[self.parameter])

    def columns(self, points: Floats) -> tuple[Floats, Floats]:
        """What each parameter alone gives at points (n, 3): B (p, n, 3) and gradients (p, n, 3, 3)."""
        jets = [self.with_parameters(unit).jet(points, 1) for unit in np.eye(self.parameters)]
        return np.array([B for B, _ in jets]), np.array([gradient for _, gradient in jets])


@dataclass(frozen=True)
class InFront:
    """The space in front of a device: beyond the plane z = `height` (m)."""

    height: float

    def contains(self, points: ArrayLike) -> Booleans:
        inside: Booleans = np.asarray(points, dtype=float)[..., 2] >= self.height
        return inside

    def describe(self) -> str:
        return f"in front: z ≥ {self.height * 1e3:.4g} mm"


def _independent(family: str, label: str, terms: Terms) -> Candidate:
    return Candidate(family, label, terms, np.arange(terms.coefficient.size))


def wall_and_face_loops(geometry: Magnets) -> Iterator[Candidate]:
    """Coaxial loops on a body of revolution: its bound currents in the places where they flow.

    Loops sit at Gauss–Legendre points along the walls (the currents of the remanence) and along the faces
    (those of the reaction to it); the fit finds their currents. The first candidate has two loops for each
    clearance along the wall (fewer for long ones), and each further one 1.4 times as many.
    """
    hull, inner = _revolved(geometry)
    if not geometry.axisymmetric:
        raise InputError(f"{geometry.name}: coaxial loops need axial magnetisation")
    outer = hull.diameter / 2
    radii = [outer] + ([inner] if inner > 0 else [])
    clearance, width = geometry.region.clearance, outer - inner
    density = min(2.0, 16 * clearance / max(hull.length, width))  # loops for each clearance along the wall
    while (along_wall := max(2, round(density * hull.length / clearance))) <= MOST_LOOPS:
        along_face = max(2, round(density * width / (1.8 * clearance)))
        if along_face > MOST_LOOPS:
            break
        z = _gauss(along_wall, -hull.length / 2, hull.length / 2)
        rho = _gauss(along_face, inner, outer)
        walls = [(radius, height) for radius in radii for height in z]
        faces = [(radius, side * hull.length / 2) for side in (-1, 1) for radius in rho]
        radius, height = np.array(walls + faces).T
        centre = np.column_stack([np.zeros((height.size, 2)), height])
        yield _independent(
            "wall_and_face_loops",
            f"{along_wall} loops on each wall, {along_face} on each face",
            loops(centre, radius, np.ones(height.size)),
        )
        density *= 1.4


def solid_harmonics(geometry: Magnets) -> Iterator[Candidate]:
    """Exterior solid harmonics about the centre, those alone that a uniformly magnetised body of revolution has.

    The body is its own mirror image in its centre, so degrees are odd; axial magnetisation gives orders 0,
    transverse magnetisation orders 1 in its own azimuth.
    """
    hull, _ = _revolved(geometry)
    x, y, z = geometry.bodies[0].material.magnetisation
    transverse, axial = np.hypot(x, y) > 1e-12, abs(z) > 1e-12
    frame = frame_about(np.array([0.0, 0.0, 1.0]), np.array([x, y, 0.0]) if transverse else None)
    for highest in (3, 5, 7, 9, 11, 13, 17, 21):
        degrees = range(1, highest + 1, 2)
        kinds = [(n, m) for n in degrees for m in (0, 1) if (axial if m == 0 else transverse)]
        yield _independent(
            "solid_harmonics",
            f"odd degrees up to {highest}",
            harmonics(
                hull.radius,
                [n for n, _ in kinds],
                [m for _, m in kinds],
                [False] * len(kinds),
                np.ones(len(kinds)),
                frame=frame,
            ),
        )


def axial_multipole(geometry: Magnets, poles: int = 6, window: Region | None = None) -> Candidate:
    """The dissertation's multipole of an axisymmetric source (2.7): ∂ᵏ/∂zᵏ(1/r), k = 1…P, about the centre."""
    direction = np.asarray(geometry.bodies[0].material.magnetisation)
    degrees = list(range(1, poles + 1))
    terms = harmonics(
        geometry.hull.radius,
        degrees,
        [0] * poles,
        [False] * poles,
        np.ones(poles),
        frame=frame_about(direction),
    )
    return Candidate(
        "axial_multipole",
        f"P = {poles} poles at the centre",
        terms,
        np.arange(poles),
        "dissertation, eqs. 2.7–2.9",
        window,
    )


def eight_source(geometry: Magnets, sets: int, orders: tuple[int, ...] = (1, 3, 5)) -> Candidate:
    """The dissertation's symmetric sets of eight axial multipoles (6.1–6.3), odd orders about the magnetisation.

    The eight sources of a set share their coefficients. The dissertation leaves the displacements open: here
    the sets stand at the middles of equal slices of the half length, at a quarter of the diameter from the axis.
    """
    hull, _ = _revolved(geometry)
    direction = np.asarray(geometry.bodies[0].material.magnetisation)
    aside = hull.diameter / 4 / np.sqrt(2)
    parts, parameter = [], []
    for index in range(sets):
        height = hull.length / 2 * (index + 0.5) / sets
        for sx in (-1, 1):
            for sy in (-1, 1):
                for sz in (-1, 1):
                    parts.append(
                        harmonics(
                            hull.radius,
                            list(orders),
                            [0] * len(orders),
                            [False] * len(orders),
                            np.ones(len(orders)),
                            centre=np.array([sx * aside, sy * aside, sz * height]),
                            frame=frame_about(direction),
                        )
                    )
                    parameter.append(index * len(orders) + np.arange(len(orders)))
    return Candidate(
        "eight_source",
        f"{sets} symmetric {'set' if sets == 1 else 'sets'} of 8, orders {', '.join(map(str, orders))}",
        concatenate(parts),
        np.concatenate(parameter),
        "dissertation, eqs. 6.1–6.3",
    )


FAMILIES = {"wall_and_face_loops": wall_and_face_loops, "solid_harmonics": solid_harmonics}
"""Families that recipes may name: each yields its candidates from few parameters to many."""


def family_of(geometry: Magnets) -> str:
    """The family that suits a device."""
    return "wall_and_face_loops" if geometry.axisymmetric else "solid_harmonics"


def dissertation_families(geometry: Magnets) -> list[Candidate]:
    """What the dissertation fits to such a device: shown beside our model, on the same data."""
    if geometry.axisymmetric:
        front = InFront(_revolved(geometry)[0].length / 2 + 2 * geometry.region.clearance)
        return [axial_multipole(geometry), axial_multipole(geometry, window=front)]
    return [eight_source(geometry, 1), eight_source(geometry, 3)]


def _gauss(count: int, low: float, high: float) -> Floats:
    """Gauss–Legendre points (count,) of an interval."""
    points: Floats = low + (high - low) * (np.polynomial.legendre.leggauss(count)[0] + 1) / 2
    return points


def _revolved(geometry: Magnets) -> tuple[CylinderHull, float]:
    """Hull and inner radius (m, zero without a bore) of a single body of revolution."""
    if not isinstance(geometry.hull, CylinderHull) or len(geometry.bodies) != 1:
        raise InputError(f"{geometry.name}: this family is made for a single body of revolution")
    return geometry.hull, getattr(geometry, "inner_diameter", 0.0) / 2
