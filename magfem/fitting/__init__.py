"""Fitted field models: recipe, families, least squares, validation."""

from magfem.fitting.fit import fit
from magfem.fitting.from_recipe import model_from_recipe
from magfem.fitting.model import FieldModel, load_model
from magfem.fitting.recipe import Recipe
from magfem.fitting.recipe_file import load_recipe
from magfem.fitting.validation import Validation, validate

__all__ = ["FieldModel", "Recipe", "Validation", "fit", "load_model", "load_recipe", "model_from_recipe", "validate"]
