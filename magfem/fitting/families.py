"""Families of field models: which sources, where, for which device. Each is harmonic by construction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Region
from magfem.fields.terms import Terms, concatenate, frame_about, harmonics, loops
from magfem.geometry import MagneticSolids, Magnets, Part, PermanentMagnet
from magfem.geometry.ball import Ball
from magfem.geometry.box import Box
from magfem.geometry.part import NOWHERE
from magfem.geometry.tube import Tube
from magfem.typing import ArrayLike, Booleans, Floats, Integers

MOST_LOOPS = 120
"""Loops on one wall: more would make a model slower than it is worth."""

MOST_PARAMETERS = 200
"""Loops in all: fitting more takes minutes and no longer helps."""


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
    """Coaxial loops on rings and cylinders about z: their bound currents in the places where they flow.

    Loops sit at Gauss–Legendre points along the walls (the currents of the remanence) and along the faces
    (those of the reaction to it); the fit finds their currents. The first candidate has two loops for each
    clearance along the wall (fewer for long ones), and each further one 1.4 times as many.
    """
    tubes = _tubes(geometry)
    if not (tubes and geometry.axisymmetric):
        raise InputError(f"{geometry.name}: coaxial loops need axial magnetisation of coaxial rings or cylinders")
    clearance = geometry.region.clearance
    longest = max(max(tube.length, tube.outer - tube.inner) for tube in tubes)
    density = min(2.0, 16 * clearance / longest)  # loops for each clearance along the wall
    while True:
        placed: list[tuple[float, float]] = []
        counts = []
        for tube in tubes:
            along_wall = max(2, round(density * tube.length / clearance))
            along_face = max(2, round(density * (tube.outer - tube.inner) / (1.8 * clearance)))
            counts.append((along_wall, along_face))
            z = tube.height + _gauss(along_wall, -tube.length / 2, tube.length / 2)
            rho = _gauss(along_face, tube.inner, tube.outer)
            radii = [tube.outer] + ([tube.inner] if tube.inner > 0 else [])
            placed += [(radius, height) for radius in radii for height in z]
            placed += [(radius, tube.height + side * tube.length / 2) for side in (-1, 1) for radius in rho]
        if max(max(count) for count in counts) > MOST_LOOPS or len(placed) > MOST_PARAMETERS:
            break
        radius, height = np.array(placed).T
        centre = np.column_stack([np.zeros((height.size, 2)), height])
        each = "" if len(tubes) == 1 else f" of each of {len(tubes)} magnets"
        along_wall, along_face = map(max, zip(*counts, strict=True))
        yield _independent(
            "wall_and_face_loops",
            f"{along_wall} loops on each wall, {along_face} on each face{each}",
            loops(centre, radius, np.ones(height.size)),
        )
        density *= 1.4


def solid_harmonics(geometry: Magnets) -> Iterator[Candidate]:
    """Exterior solid harmonics about the centre of the ball around the device.

    A uniformly magnetised body of revolution, or a cuboid, is its own mirror image in its centre, so degrees are odd;
    of the body of revolution axial magnetisation gives orders 0, transverse magnetisation orders 1 in its own azimuth.
    Other devices get all orders of all degrees.
    """
    part = _single(geometry)
    if part is None or not (part.shape.revolved or isinstance(part.shape, Box)):
        yield from _all_harmonics(geometry, 1, (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16))
        return
    if not part.shape.revolved:
        yield from _all_harmonics(geometry, 2, (3, 5, 7, 9, 11, 13, 15, 17))
        return
    radius = part.shape.hull.radius
    x, y, z = geometry.bodies[0].material.magnetisation
    transverse, axial = np.hypot(x, y) > 1e-12, abs(z) > 1e-12
    frame = frame_about(np.array([0.0, 0.0, 1.0]), np.array([x, y, 0.0]) if transverse else None)
    for highest in (1, 3, 5, 7, 9, 11, 13, 17, 21) if isinstance(part.shape, Ball) else (3, 5, 7, 9, 11, 13, 17, 21):
        degrees = range(1, highest + 1, 2)
        kinds = [(n, m) for n in degrees for m in (0, 1) if (axial if m == 0 else transverse)]
        yield _independent(
            "solid_harmonics",
            f"odd degrees up to {highest}",
            harmonics(
                radius,
                [n for n, _ in kinds],
                [m for _, m in kinds],
                [False] * len(kinds),
                np.ones(len(kinds)),
                frame=frame,
            ),
        )


def _all_harmonics(geometry: Magnets, step: int, highest: tuple[int, ...]) -> Iterator[Candidate]:
    """All orders of the degrees 1, 1 + step, … up to each of `highest`."""
    centre, radius = geometry.ball if isinstance(geometry, MagneticSolids) else (np.zeros(3), geometry.hull.radius)
    for top in highest:
        kinds = [(n, m, sine) for n in range(1, top + 1, step) for m in range(n + 1) for sine in (False, True)]
        kinds = [kind for kind in kinds if kind[1] or not kind[2]]
        degrees, orders, sines = (list(column) for column in zip(*kinds, strict=True))
        yield _independent(
            "solid_harmonics",
            f"{'all' if step == 1 else 'odd'} degrees up to {top}",
            harmonics(radius, degrees, orders, sines, np.ones(len(kinds)), centre=centre),
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
    hull = _cylinder(geometry)
    if hull is None:
        raise InputError(f"{geometry.name}: this family is made for a single ring or cylinder")
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
    return "wall_and_face_loops" if geometry.axisymmetric and _tubes(geometry) else "solid_harmonics"


def dissertation_families(geometry: Magnets) -> list[Candidate]:
    """What the dissertation fits to such a device: shown beside our model, on the same data."""
    hull = _cylinder(geometry)
    if hull is None:
        return []
    if geometry.axisymmetric:
        front = InFront(hull.length / 2 + 2 * geometry.region.clearance)
        return [axial_multipole(geometry), axial_multipole(geometry, window=front)]
    return [eight_source(geometry, 1), eight_source(geometry, 3)]


def _gauss(count: int, low: float, high: float) -> Floats:
    """Gauss–Legendre points (count,) of an interval."""
    points: Floats = low + (high - low) * (np.polynomial.legendre.leggauss(count)[0] + 1) / 2
    return points


class _Tube(NamedTuple):
    """One tube about z: radii, length and height of its middle, m."""

    outer: float
    inner: float
    length: float
    height: float


def _tubes(geometry: Magnets) -> list[_Tube]:
    """The device's parts where all are tubes about z, those that touch and are magnetised alike joined; else none."""
    if not isinstance(geometry, MagneticSolids) or not all(isinstance(part.shape, Tube) for part in geometry.parts):
        return []
    tubes: list[tuple[_Tube, PermanentMagnet]] = []
    for part in sorted(geometry.parts, key=lambda part: part.position[2]):
        shape = part.shape
        assert isinstance(shape, Tube)
        tube = _Tube(shape.outer_diameter / 2, shape.inner_diameter / 2, shape.length, part.position[2])
        below, material = tubes[-1] if tubes else (None, None)
        if below and part.body.material == material and _touch(below, tube):
            length = below.length + tube.length
            tubes[-1] = (tube._replace(length=length, height=below.height + tube.length / 2), part.body.material)
        else:
            tubes.append((tube, part.body.material))
    return [tube for tube, _ in tubes]


def _touch(below: _Tube, above: _Tube) -> bool:
    """Whether two tubes of the same radii continue each other."""
    step = (below.length + above.length) / 2
    return (below.outer, below.inner) == (above.outer, above.inner) and bool(
        np.isclose(above.height - below.height, step, rtol=1e-9, atol=0.0)
    )


def _single(geometry: Magnets) -> Part | None:
    """The device's one part, if it has one only and that is at home at the origin."""
    if isinstance(geometry, MagneticSolids) and len(geometry.parts) == 1:
        part = geometry.parts[0]
        return part if part.position == NOWHERE and part.rotation == NOWHERE else None
    return None


def _cylinder(geometry: Magnets) -> CylinderHull | None:
    """The hull of a single ring or cylinder: what the dissertation's families are made for."""
    part = _single(geometry)
    return part.shape.hull if part and isinstance(part.shape, Tube) else None
