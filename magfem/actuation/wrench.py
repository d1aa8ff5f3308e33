"""Force and torque on magnets in a field: the field-to-wrench map and its derivatives, as functions on arrays.

A magnet that is small against the changes of the field is its dipole moment m. In the field B of others

    force = ∇(m·B),  f_i = m_j ∂B_j/∂x_i,        torque = m × B                      (dissertation, 2.13)

about the dipole, in the axes of the field. A wrench is (force, torque); the dissertation stacks torque first.
In air the gradient has five independent entries, ∂B_y/∂x = ∂B_x/∂y and so on (curl B = 0) and
∂B_z/∂z = −∂B_x/∂x − ∂B_y/∂y (div B = 0), which gives the matrix of 2.15.
"""

from __future__ import annotations

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.typing import Floats, Hessians, Tensors, Vectors

_FIVE = [0, 1, 2, 4, 5]  # of the gradient's nine, row by row


def dipole_wrench(moment: Vectors, B: Vectors, gradient: Tensors) -> tuple[Vectors, Vectors]:
    """Force (..., 3) N and torque (..., 3) N·m on dipoles (..., 3) A·m² in B (..., 3) T, gradient (..., 3, 3) T/m."""
    return np.einsum("...j,...ji->...i", moment, gradient), np.cross(moment, B)


def eight_numbers(B: Vectors, gradient: Tensors) -> Floats:
    """B (..., 3) and the independent entries of its gradient, (..., 8), in the order of `coil_system.ROWS`."""
    five = gradient.reshape(*gradient.shape[:-2], 9)[..., _FIVE]
    return np.concatenate([B, five], axis=-1)


def field_to_wrench(moment: Vectors) -> Floats:
    """The matrix (..., 6, 8) from the eight numbers of a field to the wrench on dipoles (..., 3) A·m² (2.14, 2.15)."""
    moment = np.asarray(moment, dtype=float)
    x, y, z = np.moveaxis(moment, -1, 0)
    matrix = np.zeros((*moment.shape[:-1], 6, 8))
    matrix[..., 0, 3], matrix[..., 0, 4], matrix[..., 0, 5] = x, y, z
    matrix[..., 1, 4], matrix[..., 1, 6], matrix[..., 1, 7] = x, y, z
    matrix[..., 2, 3], matrix[..., 2, 5], matrix[..., 2, 6], matrix[..., 2, 7] = -z, x, -z, y
    matrix[..., 3:, :3] = cross_matrix(moment)
    return matrix


def wrench_by_moment(B: Vectors, gradient: Tensors) -> Floats:
    """Derivative (..., 6, 3) of the wrench with respect to the moment, in the axes of the field."""
    return np.concatenate([np.swapaxes(gradient, -1, -2), -cross_matrix(B)], axis=-2)


def wrench_by_point(moment: Vectors, gradient: Tensors, hessian: Hessians) -> Floats:
    """Derivative (..., 6, 3) of the wrench with respect to the dipole's place, N/m and N."""
    force = np.einsum("...j,...jik->...ik", moment, hessian)
    return np.concatenate([force, cross_matrix(moment) @ gradient], axis=-2)


def wrench_by_rotation(moment: Vectors, B: Vectors, gradient: Tensors) -> Floats:
    """Derivative (..., 6, 3) of the wrench with respect to a rotation vector θ of the dipole, δm = θ × m."""
    return -wrench_by_moment(B, gradient) @ cross_matrix(moment)
