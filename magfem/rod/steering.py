"""Steering magnets of a rod in closed loop: currents and joints from measured poses, by the model's exact Jacobian.

The model follows the plant: it is solved at the currents and joints in use, from its last shape. Its Jacobian turns the
measured error into a step (`bounded_step`); the step is added to what is in use, which is integral action without an
integrator that could wind up: what a limit cuts off is not remembered. Every step says how things stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import ConvergenceError, InputError, OutsideRegionError
from magfem.rod.bounded_step import Step, bounded_step
from magfem.rod.goals import Goal, GoalError, goal_error
from magfem.rod.rod import SNAP, Rod
from magfem.rod.sections import positive, three
from magfem.rod.state import RodState
from magfem.rod.stiffness_estimate import StiffnessEstimate, stiffened, updated
from magfem.typing import ArrayLike, Floats, Points

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem

OUTCOMES = ("moving", "converged", "limit active", "singular", "stalled", "lost branch", "unreachable")
"""How a step can end; all but the first two say why the goals are not reached.

limit active: no progress, with currents or joints at their limits.  singular: no progress, and the Jacobian has lost
directions.  stalled: no progress for another reason, such as noise.  lost branch: the plant has snapped, or the model
has no stable shape to go on to.  unreachable: no way was found on the model, whatever the start (`planning.plan`).
"""

_PROGRESS = 0.02  # of the error: less is no progress
_ANOTHER_SHAPE = 0.7  # rad between the model's axis and the plant's
_NOTICEABLE = 0.02  # of the stiffness: less is not worth a new model


@dataclass(frozen=True, eq=False, kw_only=True)
class Steering:
    """Where steering is: what is in use, what the model thinks of it, and how far the goals are.

    currents (c,) A, joints (j,) rad or m.  model: the model's state at these.  error: of the last measurement.
    expected: (m, 6) shift and turn of every magnet that the last step should have made.  best: smallest error so far,
    rad, and `since` how many steps ago.  condition: of the last Jacobian.  stiffness: what measurements say of the
    plant's, beside the model's; `in_use` is the factor that the model has.  route: parameters (c + j,) to go through
    before the goals are looked at.  plans: how many routes were planned so far.
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
    stiffness: StiffnessEstimate = field(default_factory=StiffnessEstimate)
    in_use: float = 1.0
    route: tuple[Floats, ...] = ()
    plans: int = 0

    @property
    def parameters(self) -> Floats:
        """(c + j,) currents, then joints."""
        return np.concatenate([self.currents, self.joints])


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller:
    """How to steer.

    rod, system: the model of the plant.  goals: what is wanted.  gravity: (3,) m/s².
    current_step, joint_step: the largest change in one step, A, and rad or m.  current_limit: A, by default the coils'
    own.  joint_limits: (j, 2), by default the joints' own; equal ones hold a joint still.
    gain: the share of an error that a step shall take away.  largest_error: rad of any row that one step works on.
    damping: of the pseudo-inverse, rad per A, while the error is above 0.1 rad; below it falls with the error.
    relaxation: the share of its currents that a step takes away where this costs no error by the model (the null-space
    task); it falls with the error as well, for what the model does not see of the plant would keep up an error.
    largest_condition: singular values below the largest over it are left out.  adapt: whether the model takes on the
    stiffness that the measurements show.  tolerance: rad at which the goals are reached.  patience: steps without
    progress after which steering is stuck.  room: the share of the current limits that is used.
    """

    rod: Rod
    system: CoilSystem
    goals: Sequence[Goal]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    current_step: float = 0.4
    joint_step: float = float(np.radians(2.0))
    current_limit: float | None = None
    joint_limits: ArrayLike | None = None
    gain: float = 0.5
    largest_error: float = 0.15
    damping: float = 0.02
    relaxation: float = 0.02
    largest_condition: float = 1e5
    adapt: bool = True
    tolerance: float = float(np.radians(0.05))
    patience: int = 60
    room: float = 1.0

    def __post_init__(self) -> None:
        goals = (self.goals,) if isinstance(self.goals, Goal) else tuple(self.goals)
        object.__setattr__(self, "goals", goals)
        if not goals or not all(isinstance(one, Goal) for one in goals):
            raise InputError("a controller needs at least one goal, each a magfem.rod.Goal")
        magnets = len(self.rod.magnets)
        wrong = [one.magnet for one in goals if not 0 <= one.magnet < magnets]
        if wrong:
            raise InputError(f"a goal is for magnet {wrong[0]}, and the rod has {magnets}, counted from 0")
        three("controller", "gravity", self.gravity)
        for name in ("current_step", "joint_step", "gain", "largest_error", "tolerance", "largest_condition"):
            positive("controller", name, getattr(self, name))
        for name in ("damping", "relaxation"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InputError(f"controller: {name} must not be negative, got {getattr(self, name)!r}")
        if not 0 < self.room <= 1:
            raise InputError(f"controller: room must lie above 0 and up to 1, got {self.room!r}")
        if self.current_limit is not None:
            positive("controller", "current_limit", self.current_limit)
        _ = self.limits

    @property
    def coils(self) -> int:
        """How many currents there are; joints follow them among the parameters."""
        return len(self.system.coils)

    @cached_property
    def limits(self) -> tuple[Floats, Floats]:
        """Lowest and highest of all parameters (c + j,)."""
        top: Floats = np.array(
            [np.inf if one.current_limit is None else one.current_limit for one in self.system.coils]
        )
        if self.current_limit is not None:
            top = np.minimum(top, self.current_limit)
        if not np.isfinite(top).all():
            raise InputError("controller: state current_limit (A), for not all coils have one")
        own = np.array([one.limits for one in self.system.joints], dtype=float).reshape(-1, 2)
        joints = own if self.joint_limits is None else np.asarray(self.joint_limits, dtype=float)
        if joints.shape != own.shape or not np.all(joints[:, 0] <= joints[:, 1]):
            raise InputError(f"controller: joint_limits must be {own.shape[0]} pairs, the lower first, got {joints!r}")
        joints = np.clip(joints, own[:, :1], own[:, 1:])  # never beyond what the joints themselves allow
        top = self.room * top
        return np.concatenate([-top, joints[:, 0]]), np.concatenate([top, joints[:, 1]])

    @cached_property
    def scale(self) -> Floats:
        """(c + j,) what one unit of a step is: an ampere, and as much of a joint as goes with it."""
        joints = np.full(len(self.system.joints), self.joint_step / self.current_step)
        return np.concatenate([np.ones(self.coils), joints])

    def begin(
        self, currents: ArrayLike | None = None, joints: ArrayLike | None = None, guess: RodState | None = None
    ) -> Steering:
        """Steering that starts from currents and joints, by default those nearest to zero within the limits.

        Raises as `Rod.solve` does, and InputError for values beyond the limits.
        """
        low, high = self.limits
        nearest = np.clip(np.zeros_like(low), low, high)
        amperes = nearest[: self.coils] if currents is None else self.system.checked_currents(currents)
        angles = nearest[self.coils :] if joints is None else self.system.checked_joints(joints)
        start = np.concatenate([amperes.ravel(), angles])
        if start.shape != low.shape or np.any((start < low - 1e-9) | (start > high + 1e-9)):
            raise InputError("controller: steering begins within the limits of currents and joints")
        model = self.rod.solve((self.system, amperes, angles), self.gravity, guess=guess)
        return Steering(currents=amperes, joints=angles, model=model)

    def advance(self, now: Steering, positions: Points, frames: Floats) -> Steering:
        """One step: from the magnets' measured centres (m, 3) m and frames (m, 3, 3) to new currents and joints.

        Where a centreline was measured, a magnet's turn about its own axis is not known: give any, and goals of
        directions and positions alone.
        """
        positions, frames = self._measured(positions, frames)
        before, error = now, goal_error(self.goals, positions, frames)
        now = replace(now, error=error, measured=(positions, frames), steps=now.steps + 1, expected=None)
        if now.route:
            return self._on_the_way(now)
        better = error.size < (1 - _PROGRESS) * now.best
        now = replace(now, best=error.size if better else now.best, since=0 if better else now.since + 1)
        if error.size <= self.tolerance:
            return replace(now, outcome="converged")
        if _jumped(before, positions, frames) or _elsewhere(now.model, frames):
            return replace(now, outcome="lost branch")
        if self.adapt:
            now = self._adapted(now, positions, frames)
        jacobian = now.model.jacobian
        J = np.einsum("rms,msp->rp", error.slope, jacobian) * self.scale
        step = self._step(now, error, J)
        now = replace(now, condition=step.condition)
        if now.since >= self.patience:
            low, high = self.limits
            at_limit = step.clamped & ((now.parameters <= low + 1e-9) | (now.parameters >= high - 1e-9))
            return replace(now, outcome=_why_stuck(bool(at_limit.any()), step.rank < len(J)))
        there = self._followed(now, step.change * self.scale)
        if there is None:
            return replace(now, outcome="lost branch")
        parameters, model = there
        return replace(
            now,
            currents=parameters[: self.coils],
            joints=parameters[self.coils :],
            model=model,
            outcome="moving",
            expected=jacobian @ (parameters - now.parameters),
        )

    def _measured(self, positions: Points, frames: Floats) -> tuple[Points, Floats]:
        """A measurement as arrays. Raises InputError for another number of magnets, and for what is not finite."""
        positions, frames = np.asarray(positions, dtype=float), np.asarray(frames, dtype=float)
        count = len(self.rod.magnets)
        if positions.shape != (count, 3) or frames.shape != (count, 3, 3):
            raise InputError(
                f"the rod has {count} magnets: measured positions are ({count}, 3) and frames ({count}, 3, 3), got "
                f"{positions.shape} and {frames.shape}"
            )
        if not (np.isfinite(positions).all() and np.isfinite(frames).all()):
            raise InputError("measured positions and frames must be finite numbers: leave out a step that saw nothing")
        return positions, frames

    def _step(self, now: Steering, error: GoalError, J: Floats) -> Step:
        """The step, in units of `scale`, that takes away `gain` of the error."""
        near = min(1.0, error.size / 0.1)
        low, high = self._room(now.parameters)
        wanted = -self.gain * np.clip(error.vector, -self.largest_error, self.largest_error)
        rest = np.concatenate([-self.relaxation * near * now.currents, np.zeros(len(now.joints))])
        return bounded_step(J, wanted, low, high, self.damping * near**0.75, rest, self.largest_condition)

    def _on_the_way(self, now: Steering) -> Steering:
        """One step along the route, as far as rates allow; the model goes along, or is solved anew where it cannot."""
        low, high = self._room(now.parameters)
        left = (now.route[0] - now.parameters) / self.scale
        there_already = np.abs(left) < 1e-12  # such as joints that are held still: they do not hold up the others
        shares = np.where(left < 0, low, high) / np.where(there_already, 1.0, left)
        part = float(np.min(np.where(there_already, 1.0, shares), initial=1.0))
        there = now.parameters + part * left * self.scale
        where = (self.system, there[: self.coils], there[self.coils :])
        rod, model = now.model.rod, now.model
        for guess in (now.model, None):
            try:
                model = rod.solve(where, self.gravity, guess=guess, strict=False)
            except (ConvergenceError, OutsideRegionError):
                continue
            if model.stable:
                break
        return replace(
            now,
            currents=there[: self.coils],
            joints=there[self.coils :],
            model=model,
            outcome="moving",
            best=np.inf,
            since=0,
            route=now.route[1:] if part == 1.0 else now.route,
        )

    def _adapted(self, now: Steering, positions: Points, frames: Floats) -> Steering:
        """With what the measurement says of the plant's stiffness; in the model when it differs by enough."""
        estimate = updated(now.stiffness, now.model, now.in_use, positions, frames[:, :, 2])
        factor = estimate.factor
        if abs(factor / now.in_use - 1) < _NOTICEABLE:
            return replace(now, stiffness=estimate)
        where = (self.system, now.currents, now.joints)
        try:
            model = stiffened(self.rod, factor).solve(where, self.gravity, guess=now.model, strict=False)
        except (ConvergenceError, OutsideRegionError):
            return replace(now, stiffness=estimate)
        if not model.stable:
            return replace(now, stiffness=estimate)
        return replace(now, stiffness=estimate, model=model, in_use=factor)

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
        parameters = now.parameters
        for part in (1.0, 0.3, 0.1):
            there = np.clip(parameters + part * change, *self.limits)
            where = (self.system, there[: self.coils], there[self.coils :])
            try:
                model = now.model.rod.solve(where, self.gravity, guess=now.model, strict=False)
            except (ConvergenceError, OutsideRegionError):
                continue
            if model.stable and not model.snapped:
                return there, model
        return None


def _elsewhere(model: RodState, frames: Floats) -> bool:
    """Whether the model's magnets point so far from the plant's that it must have another shape."""
    return bool(np.any(np.sum(model.magnet_frames[:, :, 2] * frames[:, :, 2], axis=1) < np.cos(_ANOTHER_SHAPE)))


def _why_stuck(at_limit: bool, singular: bool) -> str:
    return "limit active" if at_limit else "singular" if singular else "stalled"


def _jumped(before: Steering, positions: Points, frames: Floats) -> bool:
    """Whether the plant moved far more in one step than the model expected: it has snapped to another branch."""
    if before.expected is None or before.measured is None:
        return False
    traces = np.einsum("mij,mij->m", before.measured[1], frames)
    turned = np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))
    thought = np.linalg.norm(before.expected[:, 3:], axis=1)
    return bool(np.any(turned > np.maximum(SNAP, 8 * thought)))
