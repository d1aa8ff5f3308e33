"""Axial multipoles at complex heights: discs of current and charge about the axis, in or on an axisymmetric device."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from magfem.errors import InputError
from magfem.fields.region import Shell
from magfem.fields.term_kinds import OBLATE
from magfem.fields.terms import concatenate, harmonics
from magfem.fitting.candidate import Candidate, Displaceable, independent
from magfem.fitting.families.options import several
from magfem.fitting.families.tubes import gauss, the_cylinder
from magfem.geometry import Geometry
from magfem.typing import Floats


def oblate_discs(
    geometry: Geometry,
    region: Shell,
    discs: Sequence[int] | int = (1, 2, 3),
    degrees: Sequence[int] | int = (2, 3, 4, 6, 8),
) -> Iterator[Displaceable]:
    """Discs at Gauss–Legendre heights of the device, their common radius found by the fit.

    discs: how many, or several to try.  degrees: the highest, or several. Of each disc the imaginary parts of the
    degrees 0 … L − 1 and the real ones of 1 … L are free: 2 L numbers.
    """
    if not geometry.axisymmetric:
        raise InputError(f"{geometry.name}: oblate sources need a device of revolution about z")
    hull = the_cylinder(geometry)
    for count in several(discs):
        for top in several(degrees):

            def make(places: Floats, count: int = count, top: int = top) -> Candidate:
                radius = float(places[0])
                heights = gauss(count, -hull.length / 2, hull.length / 2)
                kinds = [(n, True) for n in range(top)] + [(n, False) for n in range(1, top + 1)]
                degree, imaginary = [n for n, _ in kinds], [part for _, part in kinds]
                zeros = [0] * len(kinds)
                parts = [
                    harmonics(radius, degree, zeros, imaginary, np.ones(len(kinds)), np.array([0, 0, z]), kind=OBLATE)
                    for z in heights
                ]
                label = (
                    f"{count} {'disc' if count == 1 else 'discs'} of radius {radius * 1e3:.4g} mm, degrees up to {top}"
                )
                return independent("oblate_discs", label, concatenate(parts))

            start = hull.diameter / 2 * np.array([[0.4], [0.7], [0.9]])
            bounds = hull.diameter / 2 * np.array([[0.05], [1.0]])
            label = f"{count} × {top}"
            yield Displaceable(label, 2 * top * count, make, start, bounds[0], bounds[1], ("radius",))
