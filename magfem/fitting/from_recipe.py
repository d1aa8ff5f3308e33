"""From a recipe to a model, all the way: published coefficients, measured samples, or a device that is solved first."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from magfem.errors import CardError, InputError
from magfem.fem import solve
from magfem.fitting.fit import fit
from magfem.fitting.model import FieldModel
from magfem.fitting.published import is_published, load_published
from magfem.fitting.recipe import Recipe, check_for_fields, check_places
from magfem.fitting.recipe_file import load_recipe
from magfem.fitting.scaling import scale_to, scaled
from magfem.geometry.catalogue import short_path
from magfem.geometry.limits import InvalidValue
from magfem.samples import SystemSamples, read_samples
from magfem.units import one_line


def model_from_recipe(
    recipe: Recipe | str | Path, dimension: int | None = None, resolution: float | None = None
) -> FieldModel:
    """The model that a recipe, or the recipe of a name or path, makes.

    dimension, resolution: of the solve, in place of the recipe's. Raises InputError, CardError, ConvergenceError …
    """
    file = ""
    if not isinstance(recipe, Recipe):
        if is_published(recipe):
            return load_published(recipe)
        file = short_path("fits", recipe, ".toml")
        recipe = load_recipe(recipe)
    recipe = replace(
        recipe,
        dimension=recipe.dimension if dimension is None else dimension,
        resolution=recipe.resolution if resolution is None else resolution,
    )
    if recipe.samples is None:
        with _locating(file):
            check_for_fields(recipe)
    model = _fitted(recipe)
    with _locating(file):
        check_places(recipe.measurements, model.region)  # that of samples without a device is only known now
    return scaled(model, scale_to(model, recipe.measurements)) if recipe.measurements else model


@contextmanager
def _locating(file: str) -> Iterator[None]:
    """Within it, what refuses a value of a recipe says where in its file, if it has one, the value stands."""
    try:
        yield
    except InvalidValue as error:
        raise CardError(str(error), f"{one_line(file)}: {error.key}") if file else error from None


def _fitted(recipe: Recipe) -> FieldModel:
    if recipe.samples is not None:
        file = recipe.samples
        samples = read_samples(file.path, file.columns, file.sigma)
        if isinstance(samples, SystemSamples):
            raise InputError(f"samples of a coil system make a system, not a model [{file.path}]")
        return fit(samples, recipe)
    if recipe.geometry is None:
        raise InputError("a recipe names a device, a file of samples, or both")
    return fit(solve(recipe.geometry, recipe.dimension, recipe.resolution), recipe)
