"""The plane through the origin that directions keep to, by least absolute deviations (eq. 6.7)."""

from __future__ import annotations

import numpy as np

from magfem.typing import ArrayLike, Floats, Vectors

_MOST_STEPS = 200


def least_absolute_normal(directions: ArrayLike) -> Vectors:
    """Unit normal (..., 3) with the least sum of |normal · direction| over unit vectors (..., n, 3), up to its sign.

    Zero vectors do not count. Within a cell of the sphere where no product changes its sign the sum is the length of a
    vector times the cosine of an angle, which bulges upwards: minima lie at corners, where the normal is perpendicular
    to two of the directions. So this goes from corner to corner along great circles, taking the least value on each
    circle, which sorting the places of its zeros gives exactly, until neither circle through a corner has anything
    less: a minimum, found without tolerances of an iteration. The start is the plane of least squares. There may be
    other local minima, as for the minimiser that the dissertation uses (Matlab's fmincon, from a start it does not
    state).
    """
    given = np.asarray(directions, dtype=float)
    flat = given.reshape(-1, *given.shape[-2:])
    normal = np.linalg.eigh(np.swapaxes(flat, -1, -2) @ flat)[1][..., 0]
    counts = (flat != 0).any(axis=-1)
    products = np.where(counts, np.abs(np.einsum("mni,mi->mn", flat, normal)), np.inf)
    pivot = products.argmin(axis=-1)
    least = np.where(counts, products, 0.0).sum(axis=-1)
    running = np.flatnonzero(counts.any(axis=-1))
    for step in range(_MOST_STEPS):
        if not running.size:
            break
        circle = np.take_along_axis(flat[running], pivot[running, None, None], axis=1)[:, 0]
        value, corner, found = _least_on_circle(flat[running], circle)
        better = value < least[running] * (1 - 1e-12)
        if step == 0:  # the least squares' plane is no corner, so that the first circle may hold nothing less
            better |= np.isfinite(value)
        running, value, corner, found = running[better], value[better], corner[better], found[better]
        normal[running], least[running], pivot[running] = found, value, corner
    return normal.reshape(*given.shape[:-2], 3)


def perpendicular_pair(vectors: Vectors) -> tuple[Vectors, Vectors]:
    """Unit vectors (..., 3) that make right-handed frames with unit `vectors` (..., 3): first × second = vector."""
    helper = np.eye(3)[np.abs(vectors).argmin(axis=-1)]
    first = np.cross(helper, vectors)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(vectors, first)


def _least_on_circle(directions: Vectors, circle: Vectors) -> tuple[Floats, Floats, Vectors]:
    """Least sum on the great circle perpendicular to `circle` (m, 3): value, which direction is zero there, normal.

    On the circle u cos t + v sin t each product is a cos t + c sin t with one zero in [0, π); between zeros the sum
    of absolute values is A cos t + C sin t, and A, C change by one term at each.
    """
    u, v = perpendicular_pair(circle)
    a, c = np.einsum("mni,mi->mn", directions, u), np.einsum("mni,mi->mn", directions, v)
    zero = np.arctan2(-a, c) % np.pi
    sign = np.where(a != 0, np.sign(a), np.sign(c))  # just after t = 0
    order = zero.argsort(axis=-1)
    t, signed_a, signed_c, size = (
        np.take_along_axis(part, order, axis=-1) for part in (zero, sign * a, sign * c, np.hypot(a, c))
    )
    cosines = signed_a.sum(axis=-1, keepdims=True) - 2 * signed_a.cumsum(axis=-1)
    sines = signed_c.sum(axis=-1, keepdims=True) - 2 * signed_c.cumsum(axis=-1)
    sums = np.where(size > 1e-12, cosines * np.cos(t) + sines * np.sin(t), np.inf)  # not the circle's own, nor zeros
    best = sums.argmin(axis=-1)[:, None]
    where = np.take_along_axis(t, best, axis=-1)
    normal = u * np.cos(where) + v * np.sin(where)
    return np.take_along_axis(sums, best, axis=-1)[:, 0], np.take_along_axis(order, best, axis=-1)[:, 0], normal
