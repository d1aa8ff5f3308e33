"""Families of field models: which sources, where, for which device. Each is harmonic by construction.

A family is a generator of candidates, from few parameters to many: `family(geometry, region, **options)`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from magfem.fields.region import Shell
from magfem.fitting.candidate import Candidate, Displaceable
from magfem.fitting.families.charged_faces import charged_faces
from magfem.fitting.families.closed_paths import closed_paths
from magfem.fitting.families.coaxial_loops import wall_and_face_loops, winding_loops
from magfem.fitting.families.free import exterior_harmonics, interior_harmonics
from magfem.fitting.families.harmonics import MOST_BODIES, body_harmonics, solid_harmonics
from magfem.fitting.families.multipoles import axial_multipole, displaced_multipoles, eight_source
from magfem.fitting.families.oblate import oblate_discs
from magfem.fitting.families.options import OPTIONS, shown
from magfem.fitting.families.tubes import cylinder_of, tubes_of
from magfem.geometry import Coil, Geometry, MagneticSolids
from magfem.geometry.circuit import CoaxialWinding
from magfem.geometry.limits import InvalidValue
from magfem.samples import Samples

Member: TypeAlias = Candidate | Displaceable

FAMILIES: dict[str, Callable[..., Iterator[Member]]] = {
    "wall_and_face_loops": wall_and_face_loops,
    "winding_loops": winding_loops,
    "closed_paths": closed_paths,
    "solid_harmonics": solid_harmonics,
    "body_harmonics": body_harmonics,
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
    """The candidates of a family of `SAMPLE_FAMILIES`. Raises InvalidValue as `check_options` does."""
    check_options(family, options)
    return SAMPLE_FAMILIES[family](samples, **options)


def members(family: str, geometry: Geometry, region: Shell, options: Mapping[str, Any]) -> Iterator[Member]:
    """The candidates of a family. Raises InvalidValue as `check_options` does."""
    check_options(family, options)
    return FAMILIES[family](geometry, region, **options)


def check_options(family: str, options: Mapping[str, Any]) -> None:
    """Raise InvalidValue, with the key of recipe files, for options that a family does not have or that cannot be."""
    make = FAMILIES.get(family) or SAMPLE_FAMILIES.get(family)
    parameters = inspect.signature(make).parameters if make else {}
    known = [name for name in parameters if name not in ("geometry", "region", "window", "samples")]
    for name, value in options.items():
        key = f"terms.{name}"
        if name not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise InvalidValue(f"the family {family} has no option {name!r}; {has}", key)
        if value is None and parameters[name].default is None:
            continue
        if not OPTIONS[name].holds(value):
            raise InvalidValue(f"{OPTIONS[name].sentence}, got {shown(value)}", key)


def family_of(geometry: Geometry) -> str:
    """The family that suits a device."""
    if isinstance(geometry, Coil):
        parts = [part for circuit in geometry.circuits for part in circuit.parts]
        return "winding_loops" if all(isinstance(part, CoaxialWinding) for part in parts) else "closed_paths"
    if geometry.axisymmetric and tubes_of(geometry):
        return "wall_and_face_loops"
    few = isinstance(geometry, MagneticSolids) and 1 < len(geometry.parts) <= MOST_BODIES
    return "body_harmonics" if few and not geometry.axisymmetric else "solid_harmonics"


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
