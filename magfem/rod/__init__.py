"""Rods that carry magnets: their shapes in a field, how stable these are, how they are steered and seen."""

from magfem.rod.goals import Goal
from magfem.rod.magnet_card import magnet_section
from magfem.rod.rod import Rod
from magfem.rod.sections import CrossSection, FlexibleSection, MagnetSection

__all__ = ["CrossSection", "FlexibleSection", "Goal", "MagnetSection", "Rod", "magnet_section"]
