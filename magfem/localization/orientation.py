"""A rotor's orientation, its axis and its phase."""

from __future__ import annotations

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.typing import ArrayLike, Floats, Vectors


def upright_frame(axis: ArrayLike) -> Floats:
    """(..., 3, 3) the shortest turn that takes +z to `axis` (..., 3); half a turn about x for −z.

    Its first column is where the moment points at phase zero.
    """
    x, y, z = np.moveaxis(np.asarray(axis, dtype=float) / np.linalg.norm(axis, axis=-1, keepdims=True), -1, 0)
    level = x * x + y * y
    down = (z < 0) & (level == 0)
    # 1/(1 + z), which near −z keeps its digits as (1 − z)/(x² + y²).
    w = np.where(z > 0, 1 / np.maximum(1 + z, 1.0), (1 - z) / np.where(level > 0, level, 1.0))
    upright = np.stack([1 - x * x * w, -x * y * w, x, -x * y * w, 1 - y * y * w, y, -x, -y, z], axis=-1)
    upside_down = np.broadcast_to([1.0, 0, 0, 0, -1, 0, 0, 0, -1], upright.shape)
    frame = np.where(down[..., None], upside_down, upright)
    return np.asarray(frame.reshape(*np.shape(x), 3, 3))


def orientation(axis: ArrayLike, phase: ArrayLike) -> Floats:
    """(..., 3, 3) columns: the rotor's x axis (its moment across the axis), y axis, and axis."""
    angle = np.asarray(phase, dtype=float)
    frame = upright_frame(axis)
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    x, y, z = frame[..., 0], frame[..., 1], frame[..., 2]
    return np.stack(np.broadcast_arrays(c * x + s * y, c * y - s * x, z), axis=-1)


def phase_of(frame: Floats) -> Floats:
    """(...) rad, in (−π, π], the phase of an orientation (..., 3, 3)."""
    upright = upright_frame(frame[..., 2])
    across = np.einsum("...ia,...i->...a", upright[..., :2], frame[..., 0])
    return np.asarray(np.arctan2(across[..., 1], across[..., 0]))


def rotation_matrix(vector: Vectors) -> Floats:
    """(..., 3, 3) of rotation vectors (..., 3) rad, by Rodrigues' formula."""
    angle = np.sqrt(np.einsum("...i,...i->...", vector, vector))[..., None, None]
    K = cross_matrix(vector)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (K @ K))


def small_turn(vector: Vectors) -> Floats:
    """(..., 3, 3) rotations of small rotation vectors (..., 3) rad, by Cayley's map.

    Exactly rotations, by 2 atan(½ |v|) about v: that of the vector itself up to its third power, without a sine.
    """
    K = cross_matrix(vector)
    square = np.einsum("...i,...i->...", vector, vector)[..., None, None]
    return np.asarray(np.eye(3) + (K + 0.5 * (K @ K)) / (1 + 0.25 * square))
