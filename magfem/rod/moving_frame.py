"""Frames carried along a curve without turning about its tangent."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.typing import Floats, Points, Vectors


def smallest_turn(directions: Vectors, start: Vectors | None = None) -> Floats:
    """Quaternions (..., 4), scalar last, of the smallest rotations that turn `start` (+z) to unit vectors (..., 3).

    start: (..., 3) unit vectors. Half-angle form, exact for small angles where an arc-cosine loses half its digits.
    Of opposite vectors every normal axis would do: the one normal to the coordinate axis least along `start` is taken.
    """
    start = np.broadcast_to(np.array([0.0, 0.0, 1.0]) if start is None else start, directions.shape)
    middle = start + directions
    opposite = np.sum(middle**2, axis=-1) < 1e-24
    least = np.eye(3)[np.argmin(np.abs(start), axis=-1)]
    middle = np.where(opposite[..., None], np.cross(start, np.cross(least, start)), middle)
    middle = middle / np.linalg.norm(middle, axis=-1, keepdims=True)
    return np.concatenate([np.cross(start, middle), np.sum(start * middle, axis=-1)[..., None]], axis=-1)


def rotation_minimising(points: Points, tangents: Vectors, base: Rotation | None = None) -> Floats:
    """(n, 3, 3) frames, columns d1, d2, t, at n successive points (n, 3) of a curve with unit tangents (n, 3).

    base: the first frame; its z must be the first tangent. Each step is two reflections (Wang, Jüttler, Zheng and
    Liu, Computation of rotation minimizing frames, ACM Trans. Graph. 27, 2008): error of fourth order in the step.
    The steps' rotations are multiplied by a parallel scan, log2(n) products of arrays.
    """
    if base is None:
        base = Rotation.from_quat(smallest_turn(tangents[0]))
    elif np.linalg.norm(base.apply([0.0, 0.0, 1.0]) - tangents[0]) > 1e-6:
        raise InputError("centreline: the z axis of the base frame must be the curve's tangent at the base")
    chord = np.diff(points, axis=0)
    # Reflect in the chord's mid-plane; then in the plane that takes the reflected tangent to the next one.
    first = chord / np.linalg.norm(chord, axis=-1, keepdims=True)
    mirrored = tangents[:-1] - 2 * np.sum(first * tangents[:-1], axis=-1, keepdims=True) * first
    second = tangents[1:] - mirrored
    second /= np.linalg.norm(second, axis=-1, keepdims=True)
    steps = np.concatenate([np.cross(first, second), np.sum(first * second, axis=-1)[:, None]], axis=-1)
    turned = Rotation.from_quat(np.concatenate([[[0.0, 0.0, 0.0, 1.0]], steps]))
    width = 1
    while width < len(points):
        turned = Rotation.concatenate([turned[:width], turned[width:] * turned[:-width]])
        width *= 2
    return np.asarray((turned * base).as_matrix())
