"""Where a rod's magnets are and which way they point, from its centreline (dissertation, eq. 2.10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.rod.centreline import Centreline
from magfem.rod.moving_frame import smallest_turn
from magfem.typing import ArrayLike, Floats, Points, Vectors


@dataclass(frozen=True)
class MagnetPoses:
    """Poses of m magnets.

    positions: (m, 3) m.  directions: unit (m, 3), along the rod towards its tip.  rotations: of the magnets' frames, z
    along the direction; turns about it cannot be seen on a centreline, and are those of the reference.
    position_covariance: (m, 3, 3) m².  direction_covariance: (m, 3, 3) rad², of rank 2.
    """

    positions: Points
    directions: Vectors
    rotations: Rotation
    position_covariance: Floats
    direction_covariance: Floats


def magnet_poses(centreline: Centreline, arc_lengths: ArrayLike, reference: Rotation | None = None) -> MagnetPoses:
    """Poses of magnets whose middles are at arc lengths (m,) m.

    reference: m rotations, or one for all, such as a model's or the last ones; each is turned by the smallest rotation
    that takes its z to the measured direction. By default the identity: the smallest rotation from +z, the axis and
    angle of eq. 2.10, here without its arc-cosine, which loses half of the digits near zero. Of a magnet exactly
    against its reference every normal axis is as good, and one is chosen.
    """
    s = np.atleast_1d(np.asarray(arc_lengths, dtype=float))
    if s.ndim != 1:
        raise InputError(f"magnet poses: arc lengths must be one for every magnet, got an array of shape {s.shape}")
    direction = centreline.tangent(s)
    if reference is None:
        turned = Rotation.from_quat(smallest_turn(direction))
    else:
        if not reference.single and len(reference) not in (1, len(s)):
            raise InputError(f"magnet poses: {len(s)} magnets need one reference or {len(s)}, got {len(reference)}")
        axes = np.broadcast_to(reference.apply([0.0, 0.0, 1.0]), direction.shape)
        turned = Rotation.from_quat(smallest_turn(direction, axes)) * reference
    return MagnetPoses(
        centreline.position(s), direction, turned, centreline.position_covariance(s), centreline.tangent_covariance(s)
    )


def forward_difference(centreline: Centreline, arc_lengths: ArrayLike, step: float) -> Vectors:
    """Unit directions (m, 3) by eq. 2.10 as published, (P(s + δs) − P(s))/δs: a baseline to compare with.

    Its error is κ δs/2 in angle, to first order. step: δs, m; s + δs must lie on the rod.
    """
    if not step > 0:
        raise InputError(f"magnet poses: the step of a difference must be positive, got {step!r} m")
    s = np.asarray(arc_lengths, dtype=float)
    chord = centreline.position(s + step) - centreline.position(s)
    return np.asarray(chord / np.linalg.norm(chord, axis=-1, keepdims=True))
