"""Fields: the interface that everything downstream sees, regions, and the compiled terms behind models."""

from magfem.fields.field import Evaluated, Field, Placed, Scaled, Summed
from magfem.fields.region import Everywhere, Region, Shell

__all__ = ["Evaluated", "Everywhere", "Field", "Placed", "Region", "Scaled", "Shell", "Summed"]
