"""How magnets' directions are told: angle of rotation from the global z axis, and the axis they are turned about.

Source: dissertation, eq. 2.10, without its arc cosine.
"""

from __future__ import annotations

import numpy as np

from magfem.typing import Floats, Vectors


def planar_angles(directions: Vectors) -> Floats:
    """(...,) rad from +z towards +x, −π … π, of unit vectors (..., 3) in the xz plane: turns about the y axis."""
    angles: Floats = np.arctan2(directions[..., 0], directions[..., 2])
    return angles


def angles_of_rotation(directions: Vectors) -> Floats:
    """(...,) rad between unit vectors (..., 3) and +z, 0 … π."""
    angles: Floats = np.arctan2(np.hypot(directions[..., 0], directions[..., 1]), directions[..., 2])
    return angles


def axes_of_rotation(directions: Vectors) -> Vectors:
    """(..., 3) horizontal unit vectors ẑ × d, about which +z turns into d; y where d is vertical."""
    flat = np.stack([-directions[..., 1], directions[..., 0], np.zeros(directions.shape[:-1])], axis=-1)
    size = np.linalg.norm(flat, axis=-1, keepdims=True)
    axes: Vectors = np.where(size > 1e-12, flat / np.maximum(size, 1e-12), [0.0, 1.0, 0.0])
    return axes


def turned_from_z(axis: Vectors, angle: Floats) -> Vectors:
    """(..., 3) +z turned by `angle` (...,) rad about a horizontal unit vector `axis` (..., 3)."""
    across = np.stack([axis[..., 1], -axis[..., 0], np.zeros(axis.shape[:-1])], axis=-1)
    sine, cosine = np.sin(angle)[..., None], np.cos(angle)[..., None]
    directions: Vectors = cosine * np.array([0.0, 0.0, 1.0]) + sine * across
    return directions


def between(one: Vectors, other: Vectors) -> Floats:
    """(...,) rad between unit vectors (..., 3); exact near 0 and π."""
    apart: Floats = np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), np.sum(one * other, axis=-1))
    return apart
