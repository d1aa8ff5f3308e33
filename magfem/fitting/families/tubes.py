"""What families ask of a device: is it made of tubes about z, is it a single body at home at the origin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from magfem.errors import InputError
from magfem.fields.hull import CylinderHull
from magfem.geometry import Geometry, MagneticSolids, Magnets, Part, PermanentMagnet
from magfem.geometry.part import NOWHERE
from magfem.geometry.tube import Tube
from magfem.typing import Floats


class PlacedTube(NamedTuple):
    """One tube about z: radii, length and height of its middle, m."""

    outer: float
    inner: float
    length: float
    height: float


def tubes_of(geometry: Geometry) -> list[PlacedTube]:
    """The device's parts where all are tubes about z, those that touch and are magnetised alike joined; else none."""
    if not isinstance(geometry, MagneticSolids) or not all(isinstance(part.shape, Tube) for part in geometry.parts):
        return []
    tubes: list[tuple[PlacedTube, PermanentMagnet]] = []
    for part in sorted(geometry.parts, key=lambda part: part.position[2]):
        shape = part.shape
        assert isinstance(shape, Tube)
        tube = PlacedTube(shape.outer_diameter / 2, shape.inner_diameter / 2, shape.length, part.position[2])
        below, material = tubes[-1] if tubes else (None, None)
        if below and part.body.material == material and _touch(below, tube):
            length = below.length + tube.length
            tubes[-1] = (tube._replace(length=length, height=below.height + tube.length / 2), part.body.material)
        else:
            tubes.append((tube, part.body.material))
    return [tube for tube, _ in tubes]


def _touch(below: PlacedTube, above: PlacedTube) -> bool:
    """Whether two tubes of the same radii continue each other."""
    step = (below.length + above.length) / 2
    return (below.outer, below.inner) == (above.outer, above.inner) and bool(
        np.isclose(above.height - below.height, step, rtol=1e-9, atol=0.0)
    )


def single_part(geometry: Geometry) -> Part | None:
    """The device's one part, if it has one only and that is at home at the origin."""
    if isinstance(geometry, MagneticSolids) and len(geometry.parts) == 1:
        part = geometry.parts[0]
        return part if part.position == NOWHERE and part.rotation == NOWHERE else None
    return None


def cylinder_of(geometry: Geometry) -> CylinderHull | None:
    """The hull of a single ring or cylinder, or of an axisymmetric coil: what axial multipoles are made for."""
    part = single_part(geometry)
    if part is not None:
        return part.shape.hull if isinstance(part.shape, Tube) else None
    return geometry.hull if isinstance(geometry.hull, CylinderHull) and not isinstance(geometry, Magnets) else None


def the_cylinder(geometry: Geometry) -> CylinderHull:
    """`cylinder_of`, or InputError."""
    hull = cylinder_of(geometry)
    if hull is None:
        raise InputError(f"{geometry.name}: this family is made for a single ring or cylinder, or a coil about z")
    return hull


def magnetisation_of(geometry: Geometry) -> Floats:
    """The unit vector (3,) of a single magnet's magnetisation; z for a coil."""
    if isinstance(geometry, Magnets):
        return np.asarray(geometry.bodies[0].material.magnetisation, dtype=float)
    return np.array([0.0, 0.0, 1.0])


def gauss(count: int, low: float, high: float) -> Floats:
    """Gauss–Legendre points (count,) of an interval."""
    points: Floats = low + (high - low) * (np.polynomial.legendre.leggauss(count)[0] + 1) / 2
    return points
