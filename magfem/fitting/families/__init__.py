"""Families of field models: which sources, where, for which device. Each is harmonic by construction.

A family is a generator of candidates, from few parameters to many: `family(geometry, region, **options)`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from magfem.errors import InputError
from magfem.fields.region import Shell
from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.families.charged_faces import charged_faces
from magfem.fitting.families.closed_paths import closed_paths
from magfem.fitting.families.coaxial_loops import wall_and_face_loops, winding_loops
from magfem.fitting.families.free import exterior_harmonics, interior_harmonics
from magfem.fitting.families.harmonics import solid_harmonics
from magfem.fitting.families.multipoles import axial_multipole, displaced_multipoles, eight_source
from magfem.fitting.families.oblate import oblate_discs
from magfem.fitting.families.tubes import cylinder_of, tubes_of
from magfem.geometry import Coil, Geometry
from magfem.geometry.circuit import CoaxialWinding
from magfem.samples import Samples

Member: TypeAlias = Candidate | Displaceable

FAMILIES: dict[str, Callable[..., Iterator[Member]]] = {
    "wall_and_face_loops": wall_and_face_loops,
    "winding_loops": winding_loops,
    "closed_paths": closed_paths,
    "solid_harmonics": solid_harmonics,
    "oblate_discs": oblate_discs,
    "charged_faces": charged_faces,
    "axial_multipole": axial_multipole,
    "displaced_multipoles": displaced_multipoles,
    "eight_source": eight_source,
}
"""Families that recipes may name: each yields its candidates from few parameters to many."""


SAMPLE_FAMILIES: dict[str, Callable[..., Iterator[Candidate]]] = {
    "interior_harmonics": interior_harmonics,
    "exterior_harmonics": exterior_harmonics,
}
"""Families for samples of no known device."""


def sample_members(family: str, samples: Samples, options: Mapping[str, Any]) -> Iterator[Candidate]:
    """The candidates of a family of `SAMPLE_FAMILIES`. Raises InputError for options that it does not have."""
    check_options(family, options)
    return SAMPLE_FAMILIES[family](samples, **options)


def members(family: str, geometry: Geometry, region: Shell, options: Mapping[str, Any]) -> Iterator[Member]:
    """The candidates of a family. Raises InputError for options that it does not have."""
    check_options(family, options)
    return FAMILIES[family](geometry, region, **options)


def check_options(family: str, options: Mapping[str, Any]) -> None:
    """Raise InputError for options that a family does not have."""
    make = FAMILIES[family] if family in FAMILIES else SAMPLE_FAMILIES[family]
    given = ("geometry", "region", "window", "samples")
    known = [name for name in inspect.signature(make).parameters if name not in given]
    for name in options:
        if name not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise InputError(f"the family {family} has no option {name!r}; {has}")


def family_of(geometry: Geometry) -> str:
    """The family that suits a device."""
    if isinstance(geometry, Coil):
        parts = [part for circuit in geometry.circuits for part in circuit.parts]
        return "winding_loops" if all(isinstance(part, CoaxialWinding) for part in parts) else "closed_paths"
    return "wall_and_face_loops" if geometry.axisymmetric and tubes_of(geometry) else "solid_harmonics"


def suitable_families(geometry: Geometry) -> list[str]:
    """All families of our own that describe a device, the one that suits it best first."""
    first = family_of(geometry)
    others = ["solid_harmonics"]
    if geometry.axisymmetric and cylinder_of(geometry):
        others = ["oblate_discs", "solid_harmonics"]
    if geometry.axisymmetric and tubes_of(geometry):
        others.insert(1, "charged_faces")
    return [first, *(name for name in others if name != first)]


def dissertation_families(geometry: Geometry, region: Shell) -> list[Candidate]:
    """What the dissertation fits to such a device: shown beside our model, on the same data."""
    hull = cylinder_of(geometry)
    if hull is None or isinstance(geometry, Coil):
        return []
    if geometry.axisymmetric:
        front = replace(region, z=(hull.length / 2 + 2 * region.clearance, math.inf))
        return [*axial_multipole(geometry, region), *axial_multipole(geometry, region, window=front)]
    return [*eight_source(geometry, region, 1), *eight_source(geometry, region, 3)]
