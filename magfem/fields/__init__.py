"""Fields: the interface that everything downstream sees, regions, and the compiled terms behind models."""

from magfem.fields.dipole_field import DipoleField
from magfem.fields.field import Evaluated, Field, Placed, Scaled, Summed
from magfem.fields.region import Everywhere, Region, Shell
from magfem.fields.uniform_field import UniformField

__all__ = [
    "DipoleField",
    "Evaluated",
    "Everywhere",
    "Field",
    "Placed",
    "Region",
    "Scaled",
    "Shell",
    "Summed",
    "UniformField",
]
