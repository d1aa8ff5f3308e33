"""Closed forms of whole devices: the truth that solutions and models are held against."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from magfem.errors import InputError
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.geometry import Geometry, MagneticSolids, check_device
from magfem.typing import Floats, Jet, Points

log = logging.getLogger("magfem")


@dataclass(frozen=True, repr=False)
class ExactField(Evaluated):
    """The field of uniformly magnetised solids, everywhere, inside the magnets too, in T."""

    geometry: MagneticSolids

    def __repr__(self) -> str:
        return f"<ExactField of {self.geometry.name!r}: the closed form at recoil permeability 1, everywhere>"

    @property
    def region(self) -> Region:
        return Everywhere()

    @property
    def unit(self) -> Unit:
        return "T"

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m²."""
        return self.geometry.moment

    def evaluate(self, points: Points, order: int) -> Jet:
        first, *others = self.geometry.parts
        total = first.jet(points, order)
        for part in others:
            total = tuple(one + more for one, more in zip(total, part.jet(points, order), strict=True))
        return total


def exact(geometry: Geometry) -> ExactField:
    """The closed-form field of magnets whose magnetisation is uniform in each body, remanence/µ₀.

    That is the device at recoil permeability 1, whatever its card says: a magnet with a higher one
    demagnetises itself (a few percent at 1.05), which only `solve` gives; a warning is logged then.
    Raises InputError when no closed form is known, or for what is no device.
    """
    check_device(geometry, "exact")
    if not isinstance(geometry, MagneticSolids):
        raise InputError(f"no closed form is known for a {geometry.kind}: solve it instead")
    highest = max(part.material.recoil_permeability for part in geometry.parts)
    if highest != 1.0:
        log.warning(
            "the closed form of %s holds at recoil permeability 1, not at its %g",
            geometry.name,
            highest,
        )
    return ExactField(geometry)
