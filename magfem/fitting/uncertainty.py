"""How far the noise of the data moves a model's field: the covariance of its parameters carried to points.

B(x) = Σ J_p(x) a_p is linear in the parameters a, so that cov B(x) = J(x) C J(x)ᵀ exactly, and so is the gradient.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import as_points, promised_points
from magfem.typing import ArrayLike, Floats, Outside
from magfem.units import quoted

if TYPE_CHECKING:
    from magfem.fitting.model import FieldModel

_BLOCK = 4096  # points worked on at a time: every parameter takes twelve numbers of each


def predictive_deviation(model: FieldModel, points: ArrayLike, outside: Outside = "raise") -> tuple[Floats, Floats]:
    """Standard deviations of B (..., 3) and of the gradient (..., 3, 3) at `points` (..., 3) m.

    Raises InputError for a model whose covariance is not known, and as `jet` does.
    """
    if model.covariance is None:
        raise InputError(
            f"no covariance is known of the coefficients of {quoted(model.name)}, so there are no deviations: "
            "its report states a bound instead"
        )
    array = as_points(points)
    flat = array.reshape(-1, 3)
    promised = promised_points(flat, model.region, outside)
    root = _root(model.covariance)
    share = np.ones(model.parameter.size) if model.share is None else model.share
    units = [
        model.lowered.with_coefficients(np.where(model.parameter == p, share, 0.0)).without_zeros()
        for p in range(len(model.covariance))
    ]
    B, gradient = np.empty((len(flat), 3)), np.empty((len(flat), 3, 3))
    for begin in range(0, len(flat), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        jets = [unit.jet(flat[block], 1) for unit in units]
        for result, columns in zip((B, gradient), zip(*jets, strict=True), strict=True):
            result[block] = np.sqrt(np.sum(np.tensordot(root.T, np.array(columns), axes=1) ** 2, axis=0))
    B[~promised], gradient[~promised] = np.nan, np.nan
    return B.reshape(array.shape), gradient.reshape(*array.shape, 3)


def _root(covariance: Floats) -> Floats:
    """A matrix (p, p) whose product with its own transpose is the covariance; its rounding is set to zero."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root: Floats = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root
