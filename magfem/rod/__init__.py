"""Rods that carry magnets: their shapes in a field, how stable these are, how they are steered and seen."""

from magfem.rod.rod import Rod
from magfem.rod.sections import CrossSection, FlexibleSection, MagnetSection

__all__ = ["CrossSection", "FlexibleSection", "MagnetSection", "Rod"]
