"""Magnetic charge on the faces of axial magnets: pairs of opposite discs, what a rigid cylinder is from outside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from magfem.errors import InputError
from magfem.fields.region import Shell
from magfem.fields.terms import Terms, charge_discs, concatenate
from magfem.fitting.candidate import Candidate
from magfem.fitting.families.options import several
from magfem.fitting.families.tubes import tubes_of
from magfem.geometry import Geometry


def charged_faces(
    geometry: Geometry, region: Shell, rings: Sequence[int] | int = (1, 2, 3, 4, 6)
) -> Iterator[Candidate]:
    """Opposite discs on the two faces of every tube: at both rims, then at 2, 3, … further radii between them.

    A rigid magnet is met exactly by the first candidate; the reaction of a recoil permeability above 1 spreads charge
    over faces and walls, which the further discs follow only as far as the faces go.

    rings: how many radial steps from rim to rim, or several to try.
    """
    tubes = tubes_of(geometry)
    if not (tubes and geometry.axisymmetric):
        raise InputError(f"{geometry.name}: charged faces need axial magnetisation of coaxial rings or cylinders")
    for count in several(rings):
        parts: list[Terms] = []
        parameter: list[int] = []
        for tube in tubes:
            radii = np.linspace(tube.inner, tube.outer, count + 1)
            for radius in radii[radii > 0]:
                centres = np.array([[0, 0, tube.height + tube.length / 2], [0, 0, tube.height - tube.length / 2]])
                parameter += [len(parts)] * 2
                parts.append(charge_discs(centres, radius, np.array([1.0, -1.0])))
        yield Candidate(
            "charged_faces", f"{len(parts)} pairs of charged discs", concatenate(parts), np.array(parameter)
        )
