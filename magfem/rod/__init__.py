"""Rods that carry magnets: how their shapes are seen."""

from magfem.rod.centreline import Centreline
from magfem.rod.centreline_fit import fit_centreline

__all__ = ["Centreline", "fit_centreline"]
