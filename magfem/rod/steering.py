"""Steering magnets of a rod in closed loop: currents and joints from measured poses, by the model's exact Jacobian.

The model follows the plant: it is solved at the currents and joints in use, from its last shape. Its Jacobian turns the
measured error into a step (`bounded_step`); the step is added to what is in use, which is integral action without an
integrator that could wind up: what a limit cuts off is not remembered. Every step says how things stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import InputError, MagfemError
from magfem.rod.bounded_step import bounded_step
from magfem.rod.goals import Goal, GoalError, goal_error
from magfem.rod.rod import Rod
from magfem.rod.state import RodState
from magfem.typing import ArrayLike, Floats, Points

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem

OUTCOMES = ("moving", "converged", "limit active", "singular", "stalled", "lost branch")
"""How a step can end; all but the first two are diagnoses of why the goals are not reached."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Steering:
    """Where steering is: what is in use, what the model thinks of it, and how far the goals are.

    currents (c,) A, joints (j,) rad or m.  model: the model's state at these.  error: of the last measurement.
    expected: (m, 6) shift and turn of every magnet that the last step should have made.  best: smallest error so far,
    rad, and `since` how many steps ago.  condition: of the last Jacobian.
    """

    currents: Floats
    joints: Floats
    model: RodState
    outcome: str = "moving"
    error: GoalError | None = None
    measured: tuple[Points, Floats] | None = None
    expected: Floats | None = None
    best: float = np.inf
    since: int = 0
    steps: int = 0
    condition: float = np.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller:
    """How to steer.

    rod, system: the model of the plant.  goals: what is wanted.  gravity: (3,) m/s².
    current_step, joint_step: the largest change in one step, A, and rad or m.  current_limit: A, by default the coils'
    own.  joint_limits: (j, 2), by default the joints' own; equal ones hold a joint still.
    gain: the share of an error that a step shall take away.  largest_error: rad of any row that one step works on.
    damping: of the pseudo-inverse, rad per A, while the error is above 0.1 rad; below it falls with the error.
    relaxation: the share of its currents that a step takes away where this costs no error (the null-space task).
    tolerance: rad at which the goals are reached.  patience: steps without progress after which steering is stuck.
    """

    rod: Rod
    system: CoilSystem
    goals: Sequence[Goal]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    current_step: float = 0.4
    joint_step: float = np.radians(2.0)
    current_limit: float | None = None
    joint_limits: ArrayLike | None = None
    gain: float = 0.5
    largest_error: float = 0.15
    damping: float = 0.02
    relaxation: float = 0.02
    largest_condition: float = 1e5
    tolerance: float = np.radians(0.05)
    patience: int = 60

    def __post_init__(self) -> None:
        if not self.goals:
            raise InputError("a controller needs at least one goal")
        for name in ("current_step", "joint_step", "gain", "largest_error", "tolerance"):
            if not getattr(self, name) > 0:
                raise InputError(f"controller: {name} must be positive, got {getattr(self, name)!r}")
        _ = self.limits

    @property
    def coils(self) -> int:
        """How many currents there are; joints follow them among the parameters."""
        return len(self.system.coils)

    @cached_property
    def limits(self) -> tuple[Floats, Floats]:
        """Lowest and highest of all parameters (c + j,)."""
        top = np.array([np.inf if one.current_limit is None else one.current_limit for one in self.system.coils])
        if self.current_limit is not None:
            top = np.minimum(top, self.current_limit)
        if not np.isfinite(top).all():
            raise InputError("controller: state current_limit (A), for not all coils have one")
        own = np.array([one.limits for one in self.system.joints], dtype=float).reshape(-1, 2)
        joints = own if self.joint_limits is None else np.asarray(self.joint_limits, dtype=float)
        if joints.shape != own.shape or np.any(joints[:, 0] > joints[:, 1]):
            raise InputError(f"controller: joint_limits must be {own.shape[0]} pairs, the lower first, got {joints!r}")
        return np.concatenate([-top, joints[:, 0]]), np.concatenate([top, joints[:, 1]])

    @cached_property
    def scale(self) -> Floats:
        """(c + j,) what one unit of a step is: an ampere, and as much of a joint as goes with it."""
        joints = np.full(len(self.system.joints), self.joint_step / self.current_step)
        return np.concatenate([np.ones(self.coils), joints])

    def begin(
        self, currents: ArrayLike | None = None, joints: ArrayLike | None = None, guess: RodState | None = None
    ) -> Steering:
        """Steering that starts from currents and joints, zero by default. Raises as `Rod.solve` does."""
        amperes = np.zeros(self.coils) if currents is None else np.array(currents, dtype=float)
        angles = np.zeros(len(self.system.joints)) if joints is None else np.array(joints, dtype=float)
        model = self.rod.solve((self.system, amperes, angles), self.gravity, guess=guess)
        return Steering(currents=amperes, joints=angles, model=model)

    def advance(self, now: Steering, positions: Points, frames: Floats) -> Steering:
        """One step: from the magnets' measured centres (m, 3) m and frames (m, 3, 3) to new currents and joints.

        Where a centreline was measured, a magnet's turn about its own axis is not known: give any, and goals of
        directions and positions alone.
        """
        error = goal_error(self.goals, positions, frames)
        size = error.size
        seen: dict[str, object] = {"error": error, "measured": (positions, frames), "steps": now.steps + 1}
        if size < (1 - 0.02) * now.best:
            seen |= {"best": size, "since": 0}
        else:
            seen |= {"since": now.since + 1}
        if size <= self.tolerance:
            return replace(now, outcome="converged", expected=None, **seen)
        if self._jumped(now, positions, frames):
            return replace(now, outcome="lost branch", expected=None, **seen)
        jacobian = now.model.jacobian
        J = np.einsum("rms,msp->rp", error.slope, jacobian) * self.scale
        parameters = np.concatenate([now.currents, now.joints])
        wanted = -self.gain * np.clip(error.vector, -self.largest_error, self.largest_error)
        low, high = self._room(parameters)
        step = bounded_step(
            J,
            wanted,
            low,
            high,
            self.damping * min(1.0, size / 0.1),
            -self.relaxation * np.where(np.arange(parameters.size) < self.coils, parameters, 0.0),
            self.largest_condition,
        )
        change = step.change * self.scale
        seen |= {"condition": step.condition}
        if seen["since"] == self.patience:
            at_limit = step.clamped & ((parameters <= self.limits[0] + 1e-9) | (parameters >= self.limits[1] - 1e-9))
            word = "limit active" if at_limit.any() else "singular" if step.rank < len(J) else "stalled"
            return replace(now, outcome=word, expected=None, **seen)
        there = self._followed(now, change)
        if there is None:
            return replace(now, outcome="lost branch", expected=None, **seen)
        parameters, model = there
        expected = jacobian @ (parameters - np.concatenate([now.currents, now.joints]))
        return replace(
            now,
            currents=parameters[: self.coils],
            joints=parameters[self.coils :],
            model=model,
            outcome="moving",
            expected=expected,
            **seen,
        )

    def _room(self, parameters: Floats) -> tuple[Floats, Floats]:
        """How far a step may go down and up, in units of `scale`."""
        low, high = self.limits
        rate = self.current_step
        return (
            np.minimum(np.maximum((low - parameters) / self.scale, -rate), 0.0),
            np.maximum(np.minimum((high - parameters) / self.scale, rate), 0.0),
        )

    def _followed(self, now: Steering, change: Floats) -> tuple[Floats, RodState] | None:
        """The model after as much of the change as it can follow stably; None when that is nothing."""
        parameters = np.concatenate([now.currents, now.joints])
        for part in (1.0, 0.3, 0.1):
            there = np.clip(parameters + part * change, *self.limits)
            field = (self.system, there[: self.coils], there[self.coils :])
            try:
                model = self.rod.solve(field, self.gravity, guess=now.model, strict=False)
            except MagfemError:
                continue
            if model.stable:
                return there, model
        return None

    def _jumped(self, now: Steering, positions: Points, frames: Floats) -> bool:
        """Whether the plant moved far more in one step than the model expected: it has snapped to another branch."""
        if now.expected is None or now.measured is None:
            return False
        relative = frames @ now.measured[1].transpose(0, 2, 1)
        turned = np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1))
        thought = np.linalg.norm(now.expected[:, 3:], axis=1)
        return bool(np.any(turned > np.maximum(np.radians(15.0), 8 * thought)))
