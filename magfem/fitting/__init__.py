"""Fitted field models: recipe, families, least squares, validation."""

from magfem.fitting.fit import fit
from magfem.fitting.model import FieldModel, load_model
from magfem.fitting.recipe import Recipe, load_recipe
from magfem.fitting.validation import Validation, validate

__all__ = ["FieldModel", "Recipe", "Validation", "fit", "load_model", "load_recipe", "validate"]
