"""What a coil system does to magnets: wrenches, and their exact derivatives with respect to all they depend on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.actuation.wrench import (
    dipole_wrench,
    eight_numbers,
    field_to_wrench,
    wrench_by_moment,
    wrench_by_point,
    wrench_by_rotation,
)
from magfem.errors import InputError
from magfem.typing import ArrayLike, Floats, Outside, Points, Vectors

if TYPE_CHECKING:
    from magfem.actuation.coil_system import CoilSystem


@dataclass(frozen=True)
class WrenchMap:
    """Wrenches on magnets (...), six rows each: force N, torque N·m, about the magnet, in the system's axes.

    wrench: (..., 6) at the currents.  background: (..., 6), the part that is there whatever the currents.
    by_current: (..., 6, c) per A; wrench = background + by_current @ currents.  by_joint: (..., 6, j) per rad or m.
    by_point: (..., 6, 3) per m.  by_rotation: (..., 6, 3) per rad, of a rotation vector about the system's axes.
    by_moment: (..., 6, 3) per A·m², of the moment in the magnet's own frame.
    """

    wrench: Floats
    background: Floats
    by_current: Floats
    by_joint: Floats
    by_point: Floats
    by_rotation: Floats
    by_moment: Floats

    @property
    def force(self) -> Vectors:
        """(..., 3) N."""
        return self.wrench[..., :3]

    @property
    def torque(self) -> Vectors:
        """(..., 3) N·m."""
        return self.wrench[..., 3:]


def magnets(moment: ArrayLike, pose: RigidTransform) -> tuple[Vectors, Points, Floats]:
    """Moments (..., 3) in the system's axes, places (..., 3) and rotations (..., 3, 3) of magnets at a pose or poses.

    Raises InputError for what is no moment or no pose, or where the two do not go together.
    """
    if not isinstance(pose, RigidTransform):
        raise InputError(f"a magnet's pose is a scipy.spatial.transform.RigidTransform, got {type(pose).__name__}")
    try:
        own = np.asarray(moment, dtype=float)
    except (TypeError, ValueError):
        own = np.empty(0)
    if own.ndim == 0 or own.shape[-1] != 3 or not np.isfinite(own).all():
        raise InputError("a magnet's moment is three finite numbers in A·m², (..., 3), in its own frame")
    rotations, places = pose.rotation.as_matrix(), pose.translation
    try:
        turned = (rotations @ own[..., None])[..., 0]
    except ValueError:
        raise InputError(
            f"moments {own.shape} do not go with poses {places.shape[:-1]}: give one, or one each"
        ) from None
    lead = turned.shape[:-1]
    return turned, np.broadcast_to(places, (*lead, 3)), np.broadcast_to(rotations, (*lead, 3, 3))


def wrench_map(
    system: CoilSystem,
    moment: ArrayLike,
    pose: RigidTransform,
    currents: ArrayLike,
    joints: ArrayLike | None = None,
    outside: Outside = "raise",
) -> WrenchMap:
    """Wrenches on magnets of `moment` (..., 3) A·m² at `pose`, from currents (c,) A, with all their derivatives."""
    own, places, rotations = magnets(moment, pose)
    amperes, values = system.checked_currents(currents), system.checked_joints(joints)
    if amperes.ndim != 1:
        raise InputError(f"a wrench map has one current for each coil, got currents {amperes.shape}")
    B, gradient, hessian = system.jet(places, amperes, joints, 2, outside)  # with its checks
    lead = places.shape[:-1]
    points = np.ascontiguousarray(places.reshape(-1, 3))
    jets = system.unit_jets(points, values, 2)
    matrix = field_to_wrench(own)
    unit = np.moveaxis(eight_numbers(*jets[:2]), 0, -1).reshape(*lead, 8, -1)
    background = np.zeros((*lead, 8))
    if (around := system.background_jets(points, 1)) is not None:
        background = eight_numbers(*around).reshape(*lead, 8)
    moved = eight_numbers(*system.joint_jets(points, amperes, values, jets))
    by_moment = wrench_by_moment(B, gradient)
    found = WrenchMap(
        wrench=np.concatenate(dipole_wrench(own, B, gradient), axis=-1),
        background=(matrix @ background[..., None])[..., 0],
        by_current=matrix @ unit,
        by_joint=matrix @ np.moveaxis(moved, 0, -1).reshape(*lead, 8, -1),
        by_point=wrench_by_point(own, gradient, hessian),
        by_rotation=wrench_by_rotation(own, B, gradient),
        by_moment=by_moment @ rotations,
    )
    lost = np.isnan(found.wrench).any(axis=-1)  # outside="nan"
    for part in (found.background, found.by_current, found.by_joint):
        part[lost] = np.nan
    return found
