"""Bending the locked motor's tip: where the coil goes, how the tether is turned, what the tip does.

The moment lies across the motor. In a field along the tube it feels a torque about the vertical when it is horizontal:
the coil, which points down, is held ahead of the motor, where its field has a part along the tube, and the tether is
turned until the moment that localization gave, at the phase where the rotor was locked, is horizontal. How far the tip
bends is found with a rod: a flexible section, and the motor with its moment at the end of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.fields import Evaluated, Field
from magfem.rod import FlexibleSection, MagnetSection, Rod
from magfem.typing import Floats, Points, Vectors

_DOWN = Rotation.from_rotvec([np.pi, 0.0, 0.0])  # the coil's z axis points down
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Tip:
    """The bendable end of the tether.

    length, radius: m, and youngs_modulus: Pa, of its flexible part.  motor_length: m.  moment: A·m².
    """

    length: float
    radius: float
    youngs_modulus: float
    motor_length: float
    moment: float

    def bent(self, position: Points, axis: Vectors, moment_direction: Vectors, field: Field) -> Points:
        """(3,) m of its end, the motor's centre at `position` and its axis along `axis` while no field acts."""
        frame = _frame(axis, moment_direction)
        base = position - (self.length + 0.5 * self.motor_length) * axis
        rod = Rod(
            [
                FlexibleSection(length=self.length, radius=self.radius, youngs_modulus=self.youngs_modulus),
                MagnetSection(length=self.motor_length, moment=(self.moment, 0.0, 0.0)),
            ],
            RigidTransform.from_components(base, Rotation.from_matrix(frame)),
        )
        state = rod.solve(field, gravity=(0.0, 0.0, 0.0), outside="extrapolate")  # the tube's floor carries it
        return np.asarray(state.positions[-1])


@dataclass(frozen=True, eq=False)
class Coil:
    """An electromagnet that points down.

    field: T/A, its own frame, out of whose front +z points.  front: m, from its origin to its front face.  gap: m, from
    the tool's tip, where the sensors are, up to that face.  current: A.  ahead: m, before the motor.
    """

    field: Evaluated
    front: float
    gap: float
    current: float
    ahead: float

    def held(self, tool: Points) -> Field:
        """Its field in T with the tool at `tool` (3,) m."""
        place = tool + np.array([0.0, 0.0, self.gap + self.front])
        return (self.field * self.current).at(RigidTransform.from_components(place, _DOWN))

    def tool_for(self, position: Points, axis: Vectors, height: float) -> Points:
        """(3,) m, where the tool is held to steer a motor at `position`, `height` m above the network's plane."""
        level = axis * [1.0, 1.0, 0.0]
        over = position + self.ahead * level / np.linalg.norm(level)
        return np.array([over[0], over[1], height])


def wanted_moment(axis: Vectors, B: Vectors, side: float) -> Vectors:
    """(3,) across `axis`, the direction of the moment with the greatest torque about the vertical in a field B.

    side: +1 to bend to the left, −1 to the right. The torque m × B about the vertical is m · (B × ẑ).
    """
    pull = side * np.cross(B, _UP)
    across = pull - (pull @ axis) * axis
    return np.asarray(across / np.linalg.norm(across))


def tether_turn(axis: Vectors, now: Vectors, wanted: Vectors) -> float:
    """rad about `axis` that take the moment from `now` to `wanted`, both across it."""
    return float(np.arctan2(np.cross(now, wanted) @ axis, now @ wanted))


def turned(axis: Vectors, vector: Vectors, angle: float) -> Vectors:
    """`vector` (3,) turned by `angle` rad about `axis`."""
    return np.asarray(Rotation.from_rotvec(angle * axis).apply(vector))


def _frame(axis: Vectors, across: Vectors) -> Floats:
    x = across - (across @ axis) * axis
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
