"""The verb `fit`: fields go one way, measured samples another."""

from __future__ import annotations

from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fitting.field_fit import fit_field
from magfem.fitting.measured_fit import fit_samples
from magfem.fitting.model import FieldModel
from magfem.fitting.recipe import Recipe
from magfem.samples import Samples
from magfem.threads import one_thread_for_algebra


def fit(source: Field | Samples, recipe: Recipe | None = None) -> FieldModel:
    """Fit a field model to a solution, to any Field of a device, or to measured samples (`measured_fit`).

    recipe: family, region, targets and seed; by default what suits the device. A source that is not a solution must
    bring its device as `source.geometry`, or the recipe must name one.
    The order is the smallest whose errors stay below half the targets on points of their own, with a
    condition number up to 1e7. Raises InputError for a source without a device, for a coil of several circuits of which
    the recipe names none, for a family of samples, for fewer parameters than any candidate has, and for a field that is
    not finite or vanishes.
    """
    if not isinstance(recipe, Recipe | None):
        raise InputError("fit takes a Recipe: magfem.fitting.load_recipe reads one from a file")
    with one_thread_for_algebra():
        return fit_samples(source, recipe) if isinstance(source, Samples) else fit_field(source, recipe or Recipe())
