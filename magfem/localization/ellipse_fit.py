"""The principal semi-axes of an ellipse by conic least squares, as the published localization fits them."""

from __future__ import annotations

import numpy as np

from magfem.typing import ArrayLike, Vectors


def principal_axes(points: ArrayLike) -> tuple[Vectors, Vectors]:
    """Major and minor semi-axis (..., 2) of the ellipse through `points` (..., n, 2), as vectors from its centre.

    The conic a x² + b x y + c y² + d x + e y = 1 with the least sum of squared algebraic residuals, after the mean is
    taken off, as the function of the File Exchange that the dissertation names ([273] of ch. 6, `fit_ellipse`) does.
    Algebraic residuals make a conic fitted to noisy points too small and, where it is flat, too round or too flat:
    that bias is part of what is reproduced here.

    Points that are NaN do not count. NaN where the conic is no ellipse, or where fewer than five points fix it. The
    sign of each axis is arbitrary.
    """
    given = np.asarray(points, dtype=float)
    present = np.isfinite(given).all(axis=-1)
    count = present.sum(axis=-1)
    with np.errstate(all="ignore"):  # what is no ellipse comes out as NaN
        flat = np.where(present[..., None], given, 0.0)
        mean = flat.sum(axis=-2) / count[..., None]
        flat = np.where(present[..., None], flat - mean[..., None, :], 0.0)
        size = np.sqrt((flat**2).sum(axis=(-2, -1)) / count)
        x, y = np.moveaxis(np.where(present[..., None], flat / size[..., None, None], 0.0), -1, 0)
        columns = np.stack([x**2, x * y, y**2, x, y], axis=-1)
        normal = np.swapaxes(columns, -1, -2) @ columns
        fixed = (count >= 5) & (size > 0)
        normal = np.where(fixed[..., None, None], normal, np.eye(5))
        a, b, c, d, e = np.moveaxis(
            (np.linalg.pinv(normal, hermitian=True) @ columns.sum(axis=-2)[..., None])[..., 0], -1, 0
        )
        form = np.stack([np.stack([a, b / 2], axis=-1), np.stack([b / 2, c], axis=-1)], axis=-2)
        linear = np.stack([d, e], axis=-1)
        values, directions = np.linalg.eigh(form)
        along = np.einsum("...ij,...i->...j", directions, linear)
        level = 1 + (along**2 / (4 * values)).sum(axis=-1)  # of the quadratic form about the ellipse's centre
        lengths = size[..., None] * np.sqrt(level[..., None] / values)
        lengths = np.where(fixed[..., None] & np.isfinite(lengths).all(axis=-1, keepdims=True), lengths, np.nan)
    order = np.argsort(-lengths, axis=-1)
    axes = np.take_along_axis(directions * lengths[..., None, :], order[..., None, :], axis=-1)
    return axes[..., 0], axes[..., 1]
