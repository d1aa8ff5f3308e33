"""The dissertation's own orientation controller (2.2.3–2.2.7, Algorithm 1), kept as a baseline for `steering`.

Every step: the magnets' wrenches at the measured poses (2.11–2.16); the shape under them (2.2.1, `shooting`); a
Jacobian by finite differences, one boundary value problem for every current and joint, the wrenches still at the
measured poses; a PI controller on angle and axis of rotation (2.20); the truncated pseudo-inverse (2.21, 2.22). Two
properties that `steering` does not have come with the coordinates: the arc cosine's slope is infinite where a magnet
points along the global z, where its axis of rotation is lost; and 1 − k_d·k has no slope at the goal, so that near it
finite differences, or a model that is not the plant, give that row of the Jacobian wrong, in size and in sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from magfem.actuation.wrench import field_to_wrench
from magfem.errors import InputError
from magfem.rod.goals import Goal, GoalError, goal_error
from magfem.rod.rod import Rod
from magfem.rod.shooting import Shooting, ShotShape
from magfem.rod.steering import Controller
from magfem.typing import ArrayLike, Floats, Points, Vectors

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem

OUTCOMES = ("moving", "converged", "no shape")
"""How a step can end. no shape: the statics have not met their threshold, at the measured wrenches or for the Jacobian.

The published controller does not notice anything else: it runs on where a goal cannot be reached.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class PublishedSteering:
    """Where the published controller is.

    currents (c,) A, joints (j,) rad or m.  base_wrench: (6,) ξ of the last shape.  wrench: (m, 6) force and torque
    that it was found under.  summed: (2g,) the integrated errors.  error: of the last measurement, as `steering`
    measures it.  orientation_error: (2g,) eq. 2.20.  jacobian: (2g, c + j) eq. 2.19.  condition: its largest over its
    smallest singular value.  iterations: of Levenberg–Marquardt, all boundary value problems of the last step.
    """

    currents: Floats
    joints: Floats
    base_wrench: Floats
    wrench: Floats
    summed: Floats
    outcome: str = "moving"
    error: GoalError | None = None
    orientation_error: Floats | None = None
    jacobian: Floats | None = None
    condition: float = np.inf
    iterations: int = 0
    steps: int = 0

    @property
    def parameters(self) -> Floats:
        """(c + j,) currents, then joints."""
        return np.concatenate([self.currents, self.joints])


@dataclass(frozen=True, eq=False, kw_only=True)
class PublishedController:
    """The published controller; `begin` and `advance` as `steering.Controller` has them.

    rod, system: the model of the plant; all magnets' fields are taken at their centres.  goals: directions, at most one
    for a magnet.  gravity: (3,) m/s².  current_difference, joint_difference: dI and dθ of Algorithm 1, A, and rad or
    m.  proportional, integral: the PI controller's coefficients, per step; the dissertation has found its own by trial
    and does not state them.  reset: rad of an angle's error below which its integrated term is set to zero; an axis's
    is below 1 − cos `reset`.  current_limit, joint_limits: as `steering.Controller` has them; what exceeds them is
    clipped.  largest_condition: of eq. 2.22.  informed: whether guesses are informed, eq. 2.17.  tolerance: rad at
    which the goals count as reached.  flexible_steps, rigid_steps, threshold: of `shooting.Shooting`.

    Joints count in rad in the pseudo-inverse, currents in A: a least norm depends on the units, and the dissertation
    does not state them.
    """

    rod: Rod
    system: CoilSystem
    goals: Sequence[Goal]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    current_difference: float = 0.2
    joint_difference: float = float(np.radians(2.0))
    proportional: float = 0.8
    integral: float = 0.01
    reset: float = float(np.radians(1.0))
    current_limit: float | None = 8.0
    joint_limits: ArrayLike | None = None
    largest_condition: float = 1e5
    informed: bool = True
    tolerance: float = float(np.radians(0.05))
    flexible_steps: int = 16
    rigid_steps: int = 2
    threshold: float = 1e-6

    def __post_init__(self) -> None:
        if any(goal.direction is None or goal.position is not None for goal in self.goals):
            raise InputError("the published controller steers directions alone: give goals of directions")
        count = len(self.rod.magnets)
        wanted = [goal.magnet for goal in self.goals]
        if any(not 0 <= magnet < count for magnet in wanted) or len(set(wanted)) < len(wanted):
            raise InputError(f"the published controller takes one goal for a magnet, of {count}; got {wanted}")
        for name in ("current_difference", "joint_difference", "largest_condition", "tolerance"):
            if not getattr(self, name) > 0:
                raise InputError(f"published controller: {name} must be positive, got {getattr(self, name)!r}")
        if self.system.background is not None:
            raise InputError("the published controller maps currents alone to wrenches: its system has no background")
        _ = self.limits, self.statics

    @cached_property
    def limits(self) -> tuple[Floats, Floats]:
        """Lowest and highest of all parameters (c + j,)."""
        return Controller(
            rod=self.rod,
            system=self.system,
            goals=self.goals,
            current_limit=self.current_limit,
            joint_limits=self.joint_limits,
        ).limits

    @cached_property
    def statics(self) -> Shooting:
        """The rod as it is shot."""
        return Shooting(
            rod=self.rod,
            gravity=self.gravity,
            flexible_steps=self.flexible_steps,
            rigid_steps=self.rigid_steps,
            threshold=self.threshold,
        )

    @cached_property
    def wanted(self) -> tuple[Vectors, Floats]:
        """Axes (g, 3) and angles (g,) rad of the goals, as `axis_angle`; z itself is reached about y."""
        directions = np.array([np.asarray(goal.direction, float) for goal in self.goals])
        return axis_angle(directions, np.broadcast_to([0.0, 1.0, 0.0], directions.shape), keep_sign=True)

    def begin(self, currents: ArrayLike | None = None, joints: ArrayLike | None = None) -> PublishedSteering:
        """Steering that starts from currents and joints, zero by default; ξ is that of the rod under its weight."""
        amperes = np.zeros(len(self.system.coils)) if currents is None else np.array(currents, dtype=float)
        values = np.zeros(len(self.system.joints)) if joints is None else np.array(joints, dtype=float)
        none = np.zeros((len(self.rod.magnets), 6))
        shape = self.statics.solve(none[:, :3], none[:, 3:])
        return PublishedSteering(
            currents=amperes,
            joints=values,
            base_wrench=shape.base_wrench,
            wrench=none,
            summed=np.zeros(2 * len(self.goals)),
        )

    def advance(self, now: PublishedSteering, positions: Points, frames: Floats) -> PublishedSteering:
        """One step: from the magnets' measured centres (m, 3) m and frames (m, 3, 3) to new currents and joints."""
        miss = self.orientation_error(frames)
        now = replace(
            now,
            error=goal_error(self.goals, positions, frames),
            orientation_error=miss,
            steps=now.steps + 1,
            iterations=0,
            summed=np.where(np.abs(miss) < self._reset, 0.0, now.summed + miss),
        )
        assert now.error is not None
        if now.error.size <= self.tolerance:
            return replace(now, outcome="converged")
        wrench = self.current_to_wrench(positions, frames, now.joints) @ now.currents
        shape = self._shape(wrench, now.base_wrench, now.wrench, positions)
        now = replace(now, iterations=shape.iterations)
        if not shape.converged:
            return replace(now, outcome="no shape")
        now = replace(now, base_wrench=shape.base_wrench, wrench=wrench)
        found = self.orientation_jacobian(now, shape, positions, frames)
        if found is None:
            return replace(now, outcome="no shape")
        J, iterations = found
        inverse, condition = truncated_inverse(J, self.largest_condition)
        step = self.proportional * miss + self.integral * now.summed
        parameters = np.clip(now.parameters + inverse @ step, *self.limits)
        coils = len(now.currents)
        return replace(
            now,
            currents=parameters[:coils],
            joints=parameters[coils:],
            outcome="moving",
            jacobian=J,
            condition=condition,
            iterations=now.iterations + iterations,
        )

    def orientation_error(self, frames: Floats) -> Floats:
        """(2g,) 1 − k_d·k and φ_d − φ of every goal, eq. 2.20."""
        axes, angles = self._axes_and_angles(frames)
        wanted_axes, wanted_angles = self.wanted
        return np.stack([1 - np.sum(wanted_axes * axes, axis=1), wanted_angles - angles], axis=1).ravel()

    def orientation_jacobian(
        self, now: PublishedSteering, shape: ShotShape, positions: Points, frames: Floats
    ) -> tuple[Floats, int] | None:
        """Algorithm 1: (2g, c + j), eq. 2.19, and how many iterations it took; None where a problem was not solved.

        shape: under the wrenches `now.wrench`, found at the measured positions (m, 3) m and frames (m, 3, 3).
        """
        here = self._rows(shape)
        columns, iterations = [], 0
        map_here = self.current_to_wrench(positions, frames, now.joints)
        changes = [
            (map_here[:, :, j] * self.current_difference, self.current_difference) for j in range(len(now.currents))
        ]
        for j in range(len(now.joints)):
            moved = now.joints.copy()
            # at a joint's upper limit the difference is taken downwards
            h = (
                self.joint_difference
                if moved[j] + self.joint_difference <= self._highest_joints[j]
                else -self.joint_difference
            )
            moved[j] += h
            changes.append(((self.current_to_wrench(positions, frames, moved) - map_here) @ now.currents, h))
        for change, h in changes:
            other = self._shape(now.wrench + change, now.base_wrench, now.wrench, positions)
            iterations += other.iterations
            if not other.converged:
                return None
            columns.append((self._rows(other) - here) / h)
        return np.stack(columns, axis=1), iterations

    def current_to_wrench(self, positions: Points, frames: Floats, joints: Floats) -> Floats:
        """T = T_µ T_β, eqs. 2.12–2.16: (m, 6, c), force (N/A), then torque (N·m/A) of every magnet."""
        moments = np.einsum("mij,mj->mi", frames, self._own_moments)
        fields = self.system.unit_fields(positions, joints, outside="extrapolate")
        wrenches: Floats = field_to_wrench(moments) @ fields
        return wrenches

    def _shape(self, wrench: Floats, base_wrench: Floats, before: Floats, positions: Points) -> ShotShape:
        """The shape under `wrench` (m, 6), from ξ under `before`, informed or not."""
        guess = base_wrench
        if self.informed:
            guess = informed_guess(base_wrench, wrench - before, positions - self.rod.base.translation)
        return self.statics.solve(wrench[:, :3], wrench[:, 3:], guess)

    def _rows(self, shape: ShotShape) -> Floats:
        """(2g,) k_d·k and φ of the theoretical shape, whose differences are eq. 2.18."""
        axes, angles = self._axes_and_angles(shape.magnet_frames)
        return np.stack([np.sum(self.wanted[0] * axes, axis=1), angles], axis=1).ravel()

    def _axes_and_angles(self, frames: Floats) -> tuple[Vectors, Floats]:
        return axis_angle(frames[[goal.magnet for goal in self.goals], :, 2], self.wanted[0])

    @cached_property
    def _own_moments(self) -> Vectors:
        return np.array([one.moment_vector for one in self.rod.magnets])

    @cached_property
    def _highest_joints(self) -> Floats:
        return self.limits[1][len(self.system.coils) :]

    @cached_property
    def _reset(self) -> Floats:
        return np.tile([1 - np.cos(self.reset), self.reset], len(self.goals))


def axis_angle(tangents: Vectors, wanted_axes: Vectors, keep_sign: bool = False) -> tuple[Vectors, Floats]:
    """Axes k (n, 3) and angles φ (n,) rad that turn the global z to the tangents (n, 3), eq. 2.10.

    φ is an arc cosine. Of ±k, ±φ those are taken whose axis is nearer to the wanted one (n, 3), or with `keep_sign`
    those of positive φ. Along z any axis would do: the wanted one is taken.
    """
    x, y, z = np.moveaxis(tangents / np.linalg.norm(tangents, axis=-1, keepdims=True), -1, 0)
    angles = np.arccos(np.clip(z, -1.0, 1.0))
    across = np.hypot(x, y)
    found = across > 0
    flat = np.where(found, across, 1.0)
    axes = np.where(found[:, None], np.stack([-y / flat, x / flat, np.zeros_like(x)], axis=-1), wanted_axes)
    sign = np.where((np.sum(axes * wanted_axes, axis=-1) < 0) & (not keep_sign), -1.0, 1.0)
    return sign[:, None] * axes, sign * angles


def informed_guess(base_wrench: Floats, change: Floats, arms: Points) -> Floats:
    """ξ (6,) after the wrenches (m, 6), force and torque, change at `arms` (m, 3) m from the base, eq. 2.17."""
    force, torque = change[:, :3], change[:, 3:]
    guess: Floats = base_wrench + np.concatenate([force.sum(axis=0), (torque + np.cross(arms, force)).sum(axis=0)])
    return guess


def truncated_inverse(J: Floats, largest_condition: float) -> tuple[Floats, float]:
    """The pseudo-inverse without singular values below the largest over `largest_condition`, eq. 2.22; condition."""
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    kept = sigma * largest_condition >= sigma[0] if sigma[0] > 0 else np.zeros(sigma.size, dtype=bool)
    condition = float(sigma[0] / sigma[-1]) if sigma[-1] > 0 else np.inf
    inverse: Floats = Vt[kept].T / sigma[kept] @ U[:, kept].T
    return inverse, condition
