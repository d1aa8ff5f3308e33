"""Exact field of a uniformly magnetised ball, with gradient and hessian.

Frame: centre at the origin; any direction of magnetisation. Outside, the Newtonian potential of the body is
that of its volume in the middle, U = a³/(3 r); inside U = (3 a² − r²)/6. With H_i = M_j ∂_i ∂_j U and
B = µ0 (H + M) that is a dipole outside and B = ⅔ µ0 M inside (Jackson, Classical Electrodynamics, §5.10).
Good to rounding everywhere.
"""

from __future__ import annotations

import numpy as np

from magfem.constants import MU_0
from magfem.typing import ArrayLike, Floats, Jet


def sphere_jet(points: ArrayLike, radius: float, magnetisation: ArrayLike, order: int = 1) -> Jet:
    """Field of a uniformly magnetised ball, with its derivatives, inside and outside.

    Parameters
    ----------
    points : (..., 3) m, frame of the ball.
    radius : m, > 0.
    magnetisation : (3,) A/m, any direction.
    order : 0 for B, 1 for B and gradient, 2 for B, gradient and hessian.

    Returns
    -------
    B (..., 3) T, gradient (..., 3, 3) T/m, hessian (..., 3, 3, 3) T/m², up to `order`.
    The surface belongs to the magnet.
    """
    m = MU_0 * np.asarray(magnetisation, dtype=float)
    x = np.asarray(points, dtype=float) / radius
    inside = np.einsum("...i,...i", x, x) <= 1
    x = np.where(inside[..., None], 1.0, x)  # any point outside: what it gives is not used
    r = np.sqrt(np.einsum("...i,...i", x, x))
    n = x / r[..., None]
    jet = [_second(n) @ m / (3 * r[..., None] ** 3)]
    if order > 0:
        jet.append(_third(n) @ m / (radius * r[..., None, None] ** 4))
    if order > 1:
        jet.append(_fourth(n) @ m / (radius**2 * r[..., None, None, None] ** 5))
    within = [2 / 3 * m, np.zeros(()), np.zeros(())]
    return tuple(
        np.where(inside.reshape(inside.shape + (1,) * rank), value, outside)
        for rank, (value, outside) in enumerate(zip(within, jet, strict=False), start=1)
    )


def _second(n: Floats) -> Floats:
    """r³ ∂_i∂_j (1/r) = 3 n_i n_j − δ_ij, along unit vectors `n` (..., 3)."""
    tensor: Floats = 3 * n[..., :, None] * n[..., None, :] - np.eye(3)
    return tensor


def _third(n: Floats) -> Floats:
    """r⁴/3 ∂_i∂_j∂_k (1/r) = n_i δ_jk + n_j δ_ik + n_k δ_ij − 5 n_i n_j n_k."""
    tensor: Floats = -5 * np.einsum("...i,...j,...k->...ijk", n, n, n)
    for axes in ("ijk", "jik", "kij"):
        tensor += np.einsum(f"...{axes[0]},{axes[1:]}->...ijk", n, np.eye(3))
    return tensor


def _fourth(n: Floats) -> Floats:
    """r⁵/3 ∂_i∂_j∂_k∂_l (1/r) = 35 n_i n_j n_k n_l − 5 (n_i n_j δ_kl + 5 more) + (δ_ij δ_kl + 2 more)."""
    tensor: Floats = 35 * np.einsum("...i,...j,...k,...l->...ijkl", n, n, n, n)
    for axes in ("ijkl", "ikjl", "iljk", "jkil", "jlik", "klij"):
        tensor -= 5 * np.einsum(f"...{axes[0]},...{axes[1]},{axes[2:]}->...ijkl", n, n, np.eye(3))
    for axes in ("ijkl", "ikjl", "iljk"):
        tensor += np.einsum(f"{axes[:2]},{axes[2:]}->ijkl", np.eye(3), np.eye(3))
    return tensor
