"""Poses of a turning dipole from one sensor, in closed form.

A dipole of moment m across its axis â turns right-handed about it. With p̂ the unit vector between it and the sensor,
M = 3 p̂p̂ᵀ − 1 and k = µ₀/(4π r³), the sensor sees

    b(t) = C cos ωt + S sin ωt,    C = k m M x̂,  S = k m M ŷ,   x̂, ŷ, â right-handed.

Let β be the angle between p̂ and the rotation plane, p̂ = cos β û + sin β â with û in the plane, and v̂ = â × û. Then

    M û = (3 cos²β − 1) û + 3 cos β sin β â    of length √(1 + 3 cos²β),
    M v̂ = −v̂                                  of length 1, and perpendicular to M û.

So the singular values of [C S] are s₁ = k m √(1 + 3 cos²β) and s₂ = k m, the left singular vectors are u₁ ∥ M û and
u₂ ∥ v̂, and

    r = (µ₀ m / 4π s₂)^(1/3),    cos²β = ((s₁/s₂)² − 1)/3.

p̂ lies in the plane of u₁ and n̂ = u₁ × u₂, turned from u₁ by β − γ, where γ = atan2(3 cos β sin β, 3 cos²β − 1) is the
angle of M û above the rotation plane. Both signs of that turn, and both of p̂, give the same s₁, s₂, u₁, u₂: four poses.
The axis, with its sense, follows from C × S = k² m² det(M) M⁻ᵀ â: it is the direction of M (C × S), as det M = 2 and M
is symmetric. It is the same for ±p̂.

Six numbers meet six unknowns, so for noise that is equal in all directions this is the maximum-likelihood estimate
wherever a dipole exists that gives exactly the measured C and S: for 1 ≤ s₁/s₂ ≤ 2. Noise can take the ratio beyond 2.
Then the nearest possible pair of singular values is the one for β = 0 with s₂ = (2 s₁ + s₂)/5, with the same singular
vectors (von Neumann's trace inequality), and that is the maximum-likelihood estimate; its branches ±β coincide there,
and its covariance means nothing. A ratio below 1 cannot be. At β = 90° the branches coincide as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.constants import MU_0
from magfem.cross_matrix import cross
from magfem.errors import InputError
from magfem.localization.real_numbers import real_numbers
from magfem.typing import ArrayLike, Booleans, Floats, Points, Vectors


@dataclass(frozen=True, eq=False)
class DipolePoses:
    """The four poses (±p̂, ±β) of every measurement.

    position: (..., 4, 3) m, the dipole seen from the sensor.  frame: (..., 4, 3, 3), columns: the direction of its
    moment across the axis at the time when the field is C, the second of the plane, the axis.  beta: (...) rad, 0 to
    π/2.  ratio: (...) s₁/s₂, at least 1.  clamped: (...) whether the ratio was above 2.
    """

    position: Points
    frame: Floats
    beta: Floats
    ratio: Floats
    clamped: Booleans

    @property
    def axis(self) -> Vectors:
        """(..., 4, 3) unit vectors, with the sense of rotation."""
        return self.frame[..., 2]


def dipole_poses(cosine: ArrayLike, sine: ArrayLike, moment: float) -> DipolePoses:
    """The poses of a dipole of `moment` (A·m², across its axis) from C and S (..., 3) T of one sensor, in its frame.

    Raises InputError where C and S are not finite, or parallel: then nothing turns; and for a moment that is none.
    """
    words = "the quadratures of a field must be finite numbers (..., 3) in T"
    C, S = real_numbers(cosine, words), real_numbers(sine, words)
    if C.shape[-1:] != (3,) or S.shape[-1:] != (3,) or not (np.isfinite(C).all() and np.isfinite(S).all()):
        raise InputError(words)
    try:
        C, S = np.broadcast_arrays(C, S)
    except ValueError:
        raise InputError(f"as many cosine as sine parts are needed, got {C.shape} and {S.shape}") from None
    size = real_numbers(moment, "a moment must be a positive number in A·m²")
    if size.ndim or not 0 < size < np.inf:
        raise InputError(f"a moment must be a positive number in A·m², got {moment!r}")
    # Singular values of a 3 × 2 matrix by the angle that makes its columns perpendicular: faster than a general SVD,
    # and exact to rounding as nothing cancels.
    cc, ss, cs = (np.einsum("...i,...i->...", a, b) for a, b in ((C, C), (S, S), (C, S)))
    angle = 0.5 * np.arctan2(2 * cs, cc - ss)
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    major, minor = c * C + s * S, c * S - s * C
    s1, s2 = np.linalg.norm(major, axis=-1), np.linalg.norm(minor, axis=-1)
    if not np.all(s2 > 1e-12 * s1):
        raise InputError("the field does not turn: its cosine and sine parts are parallel, or zero")
    ratio = s1 / s2
    clamped = ratio > 2.0
    s2 = np.where(clamped, (2 * s1 + s2) / 5, s2)
    u1, u2 = major / s1[..., None], minor / np.linalg.norm(minor, axis=-1)[..., None]
    n = cross(u1, u2)

    cos2 = np.clip((ratio**2 - 1) / 3, 0.0, 1.0)
    # Both as roots: an arc cosine would lose half of the digits near 0 and 90 degrees.
    cos, sin = np.sqrt(cos2), np.sqrt(np.clip((2 - ratio) * (2 + ratio), 0.0, 3.0) / 3)
    beta = np.arctan2(sin, cos)
    turn = beta - np.arctan2(3 * cos * sin, 3 * cos2 - 1)
    sign = np.array([1.0, 1.0, -1.0, -1.0])
    side = np.array([1.0, -1.0, 1.0, -1.0])
    towards = sign[:, None] * (
        np.cos(turn)[..., None, None] * u1[..., None, :]
        + side[:, None] * np.sin(turn)[..., None, None] * n[..., None, :]
    )
    r = np.cbrt(MU_0 * size / (4 * np.pi * s2))
    return DipolePoses(
        position=r[..., None, None] * towards,
        frame=_frames(towards, C[..., None, :], S[..., None, :]),
        beta=beta,
        ratio=ratio,
        clamped=clamped,
    )


def _frames(towards: Vectors, C: Vectors, S: Vectors) -> Floats:
    """Orientations (..., 3, 3) from directions p̂ (..., 3): M undone on C and S, and made orthonormal."""
    across = cross(C, S)
    axis = 3 * _along(towards, across) * towards - across
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    x = 1.5 * _along(towards, C) * towards - C
    y = 1.5 * _along(towards, S) * towards - S
    x = x + cross(y, axis)  # y × â = x for an exact pair; else the nearest orthonormal pair lies between both
    x -= _along(axis, x) * axis
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, cross(axis, x), axis], axis=-1)


def _along(a: Vectors, b: Vectors) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b)[..., None])
