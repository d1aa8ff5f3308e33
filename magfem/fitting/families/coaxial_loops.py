"""Coaxial loops where the currents flow: on the walls and faces of magnets, in the windows of windings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from magfem.errors import InputError
from magfem.fields.region import Shell
from magfem.fields.terms import loops
from magfem.fitting.candidate import Candidate, independent
from magfem.fitting.families.tubes import gauss, tubes_of
from magfem.geometry import Coil, Geometry
from magfem.geometry.circuit import CoaxialWinding

MOST_LOOPS = 120
"""Loops on one wall: more would make a model slower than it is worth."""

MOST_PARAMETERS = 200
"""Loops in all: fitting more takes minutes and no longer helps."""


def wall_and_face_loops(geometry: Geometry, region: Shell) -> Iterator[Candidate]:
    """Coaxial loops on rings and cylinders about z: their bound currents in the places where they flow.

    Loops sit at Gauss–Legendre points along the walls (the currents of the remanence) and along the faces
    (those of the reaction to it); the fit finds their currents. The first candidate has two loops for each
    clearance along the wall (fewer for long ones), and each further one 1.4 times as many.
    """
    tubes = tubes_of(geometry)
    if not (tubes and geometry.axisymmetric):
        raise InputError(f"{geometry.name}: coaxial loops need axial magnetisation of coaxial rings or cylinders")
    clearance = region.clearance
    longest = max(max(tube.length, tube.outer - tube.inner) for tube in tubes)
    density = min(2.0, 16 * clearance / longest)  # loops for each clearance along the wall
    while True:
        placed: list[tuple[float, float]] = []
        counts = []
        for tube in tubes:
            along_wall = max(2, round(density * tube.length / clearance))
            along_face = max(2, round(density * (tube.outer - tube.inner) / (1.8 * clearance)))
            counts.append((along_wall, along_face))
            z = tube.height + gauss(along_wall, -tube.length / 2, tube.length / 2)
            rho = gauss(along_face, tube.inner, tube.outer)
            radii = [tube.outer] + ([tube.inner] if tube.inner > 0 else [])
            placed += [(radius, height) for radius in radii for height in z]
            placed += [(radius, tube.height + side * tube.length / 2) for side in (-1, 1) for radius in rho]
        if max(max(count) for count in counts) > MOST_LOOPS or len(placed) > MOST_PARAMETERS:
            break
        radius, height = np.array(placed).T
        centre = np.column_stack([np.zeros((height.size, 2)), height])
        each = "" if len(tubes) == 1 else f" of each of {len(tubes)} magnets"
        along_wall, along_face = map(max, zip(*counts, strict=True))
        yield independent(
            "wall_and_face_loops",
            f"{along_wall} loops on each wall, {along_face} on each face{each}",
            loops(centre, radius, np.ones(height.size)),
        )
        density *= 1.4


def winding_loops(geometry: Geometry, region: Shell) -> Iterator[Candidate]:
    """Coaxial loops at Gauss–Legendre points of the windows of windings about z; the fit finds their currents.

    The first candidate has one loop for each clearance along the window, or two, and across it, and each further one
    1.2 times as many.
    """
    windings = windings_of(geometry)
    density, before = 1.0, 0
    while True:
        centres, radii = [], []
        for winding in windings:
            along = max(2, round(density * winding.length / region.clearance)) if winding.length else 1
            build = winding.outer_radius - winding.inner_radius
            across = max(2, round(density * build / (1.3 * region.clearance))) if build else 1
            z = winding.centre + gauss(along, -winding.length / 2, winding.length / 2)
            radius, height = np.meshgrid(gauss(across, winding.inner_radius, winding.outer_radius), z)
            radii.append(radius.ravel())
            centres.append(np.column_stack([np.zeros((height.size, 2)), height.ravel()]))
        placed = np.concatenate(radii)
        if placed.size > MOST_PARAMETERS or density > 40:
            return
        density *= 1.2
        if placed.size == before:
            continue
        before = placed.size
        each = "" if len(windings) == 1 else f" of each of {len(windings)} windings"
        yield independent(
            "winding_loops",
            f"{across} × {along} loops in the window{each}",
            loops(np.concatenate(centres), placed, np.ones(placed.size)),
        )


def windings_of(geometry: Geometry) -> list[CoaxialWinding]:
    """The windings about z that a coil is made of; InputError where there is anything else."""
    parts = [part for circuit in geometry.circuits for part in circuit.parts] if isinstance(geometry, Coil) else []
    windings = [part for part in parts if isinstance(part, CoaxialWinding)]
    if not windings or len(windings) != len(parts):
        raise InputError(f"{geometry.name}: loops in windows need a coil of windings about z")
    return windings
