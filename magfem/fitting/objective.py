"""What a fit to a field minimises: the rows of its least squares, from columns and data."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from magfem.fields.norms import FLOOR
from magfem.fitting.candidate import Candidate
from magfem.fitting.sampling import LayeredData
from magfem.typing import Floats

Objective: TypeAlias = Literal["layers", "absolute", "relative"]

_GRADIENT_WEIGHT = 0.1  # relative errors of the gradient weigh a tenth of those of B, as the targets do


def rows(candidate: Candidate, data: LayeredData, objective: Objective) -> tuple[Floats, Floats]:
    """Matrix (n, p) and right-hand side (n,).

    layers: B and gradient, each layer against its own root mean square, so that far points count.  absolute: B alone,
    in T, as 2.8.  relative: B alone, every point against its own |B|, as 5.3.
    """
    if objective == "layers":
        columns = candidate.columns(data.flat, 1)
        parts = list(zip(columns, (data.B, data.gradient), (1.0, _GRADIENT_WEIGHT), strict=True))
    else:
        parts = [(candidate.columns(data.flat, 0)[0], data.B, 1.0)]
    matrix, target = [], []
    for column, values, weight in parts:
        scale = weight / _sizes(values, objective)
        matrix.append((column.reshape(-1, *values.shape) * scale).reshape(candidate.parameters, -1))
        target.append((values * scale).ravel())
    return np.concatenate(matrix, axis=1).T, np.concatenate(target)


def _sizes(values: Floats, objective: Objective) -> Floats:
    """What every value of B or gradient (l, p, …) is held against; broadcasts with them."""
    per_point = tuple(range(2, values.ndim))
    size = np.sqrt(np.sum(values**2, axis=per_point, keepdims=True))
    if objective == "layers":
        layers: Floats = np.sqrt(np.mean(size**2, axis=1, keepdims=True))
        return layers
    if objective == "relative":
        floored: Floats = np.maximum(size, FLOOR * size.max())
        return floored
    return np.ones_like(size)
