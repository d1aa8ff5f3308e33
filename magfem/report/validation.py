"""A validation as one picture."""

from __future__ import annotations

import os
from pathlib import Path

from magfem.fields import Field
from magfem.files import write_bytes
from magfem.fitting import FieldModel, Validation
from magfem.fitting.sample_residuals import sample_residuals
from magfem.report.figures.residuals import residual_figure
from magfem.report.figures.style import Picture
from magfem.report.figures.validation import validation_figure
from magfem.samples import Samples


def validation_picture(model: FieldModel, reference: Field | Samples, found: Validation) -> Picture:
    """Maps of the relative errors against a field, or the residuals of samples."""
    if isinstance(reference, Samples):
        return residual_figure(model, sample_residuals(model, reference, found.aligned), found)
    return validation_figure(model, reference, found)


def write_validation(
    model: FieldModel, reference: Field | Samples, found: Validation, path: str | os.PathLike[str]
) -> None:
    """Write the picture of a validation as a PNG, whole or not at all."""
    write_bytes(Path(path), validation_picture(model, reference, found).png)
