"""Closed forms of whole devices: the truth that solutions and models are held against."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.fields.uniform_cylinder import cylinder_jet, ring_jet
from magfem.geometry import CylinderMagnet, Geometry, RingMagnet, check_device
from magfem.typing import Floats, Jet, Points

log = logging.getLogger("magfem")


@dataclass(frozen=True, repr=False)
class ExactField(Evaluated):
    """The field of a uniformly magnetised ring or cylinder, everywhere, inside the magnet too, in T."""

    geometry: RingMagnet | CylinderMagnet

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
        geometry = self.geometry
        magnetisation = geometry.material.remanence_vector / MU_0
        if isinstance(geometry, RingMagnet):
            return ring_jet(
                points,
                geometry.inner_diameter / 2,
                geometry.outer_diameter / 2,
                geometry.length,
                magnetisation,
                order,
            )
        return cylinder_jet(points, geometry.diameter / 2, geometry.length, magnetisation, order)


def exact(geometry: Geometry) -> ExactField:
    """The closed-form field of a device whose magnetisation is uniform, remanence/µ₀.

    That is the device at recoil permeability 1, whatever its card says: a magnet with a higher one
    demagnetises itself (a few percent at 1.05), which only `solve` gives; a warning is logged then.
    Raises InputError when no closed form is known, or for what is no device.
    """
    check_device(geometry, "exact")
    if not isinstance(geometry, (RingMagnet, CylinderMagnet)):
        raise InputError(f"no closed form is known for a {geometry.kind}: solve it instead")
    if geometry.material.recoil_permeability != 1.0:
        log.warning(
            "the closed form of %s holds at recoil permeability 1, not at its %g",
            geometry.name,
            geometry.material.recoil_permeability,
        )
    return ExactField(geometry)
