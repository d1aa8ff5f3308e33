"""A field model as a MATLAB file, with the function that evaluates it beside it.

The layout is documented where its readers look: in the help text of `magfem_field.m`.
"""

from __future__ import annotations

import io
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from magfem.fields.field import Field
from magfem.fields.term_kinds import NAMES
from magfem.files import write_bytes
from magfem.fitting.about import ascii_text, facts, terms_of

EVALUATOR = "magfem_field.m"
"""The function's file. One serves all models of a folder."""


def write_mat(field: Field, path: str | Path) -> tuple[Path, Path]:
    """Write the field's terms to `path` (MATLAB 5 format) and the evaluator beside it; the two files.

    field: a fitted model, or placed, scaled and summed ones. In MATLAB or Octave,
    `[B, G] = magfem_field(load('FILE.mat'), points)`. Raises InputError for a field that has no terms, or a place that
    cannot be written.
    """
    path = Path(path)
    content = io.BytesIO()
    savemat(content, mat_variables(field), oned_as="column")
    function = path.with_name(EVALUATOR)
    write_bytes(path, content.getvalue())
    write_bytes(function, files("magfem.exchange").joinpath(EVALUATOR).read_bytes())
    return path, function


def mat_variables(field: Field) -> dict[str, Any]:
    """The variables of the file; indices count from 1."""
    terms = terms_of(field, "a MATLAB file")
    about = facts(field)
    kind = np.empty((terms.kind.size, 1), dtype=object)
    kind[:, 0] = [NAMES[int(number)] for number in terms.kind]
    plain: dict[str, Any] = {
        "centre": terms.centre,
        "frame": np.moveaxis(terms.frame, 0, -1),
        "radius": terms.radius,
        "first": terms.start[:-1] + 1,
        "last": terms.start[1:],
        "coefficient": terms.coefficient,
        "degree": terms.degree,
        "order": terms.order,
        "sine": terms.sine,
        "first_node": terms.node_start[:-1] + 1,
        "last_node": terms.node_start[1:],
        "nodes": terms.nodes,
    }
    return {
        # Octave 7 counts bytes where the format counts letters, and cuts the end of texts beyond ASCII off.
        "name": ascii_text(about["name"]),
        "unit": field.unit,
        "region": ascii_text(about["region"]),
        "about": ascii_text("\n".join(f"{key}: {text}" for key, text in about.items())),
        "kind": kind,
        **{key: np.asarray(array, dtype=float) for key, array in plain.items()},
    }
