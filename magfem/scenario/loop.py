"""The closed loop: see the plant, let the controller step, let the plant follow; target after target."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from time import perf_counter

import numpy as np

from magfem.actuation import CoilSystem
from magfem.errors import ConvergenceError
from magfem.rod.applied_field import DrivenField
from magfem.rod.state import RodState
from magfem.rod.steering import Controller, Steering
from magfem.scenario.plant import Plant
from magfem.scenario.run import Ending, Step
from magfem.scenario.scenario import STRAIGHT, Scenario
from magfem.scenario.sensing import in_plane
from magfem.scenario.targets import Target

log = logging.getLogger("magfem")

_IN_PLANE = 1e-4  # m that a planar scenario's rod may be off the plane


def close_loop(
    scenario: Scenario, system: CoilSystem, plant: Plant, targets: Sequence[Target]
) -> tuple[list[Step], list[Ending]]:
    """Steer the plant to one target after the other.

    Raises ConvergenceError when the plant has no stable shape without currents, and as `Rod.solve` does.
    """
    rng = np.random.default_rng(scenario.seed)
    steps: list[Step] = []
    endings: list[Ending] = []
    rest = plant.at(np.zeros(len(system.coils)), np.zeros(len(system.joints)))
    if rest is None:
        raise ConvergenceError("the rod has no stable shape within the system's region without currents")
    state: Steering | None = None
    shape = rest
    for number, target in enumerate(targets):
        controller = controller_for(scenario, system, target)
        if state is None or scenario.start == STRAIGHT:
            state, shape = controller.begin(), rest
            if not steps:
                _warm(controller, state, shape)
        else:
            state = controller.begin(state.currents, state.joints, guess=state.model)
        state, shape, ending = _pursue(scenario, controller, plant, state, shape, number, target, steps, rng)
        endings.append(ending)
        log.info("scenario: target %d of %d: %s", number + 1, len(targets), _words(ending))
        if ending.outcome == "lost branch":
            state = None  # where the model no longer follows the plant, the next target starts from currents of zero
    return steps, endings


def controller_for(scenario: Scenario, system: CoilSystem, target: Target) -> Controller:
    """The controller of a target, on the model's rod."""
    return Controller(
        rod=scenario.rod, system=system, goals=target.goals, gravity=scenario.gravity, **scenario.settings
    )


def _warm(controller: Controller, state: Steering, shape: RodState) -> None:
    """One step that nobody follows, so that no step that is timed compiles."""
    controller.advance(state, shape.magnet_positions, shape.magnet_frames)


def _pursue(
    scenario: Scenario,
    controller: Controller,
    plant: Plant,
    state: Steering,
    shape: RodState,
    number: int,
    target: Target,
    steps: list[Step],
    rng: np.random.Generator,
) -> tuple[Steering, RodState, Ending]:
    """Steer to one target and hold it there; steps are added to `steps`."""
    reached: int | None = None
    for k in range(scenario.most_steps + scenario.hold):
        positions, frames = scenario.sensing.see(shape, rng)
        if scenario.planar:
            positions, frames = in_plane(positions, frames)
        begin = perf_counter()
        after = controller.advance(state, positions, frames)
        seconds = perf_counter() - begin
        assert after.error is not None
        steps.append(
            Step(
                target=number,
                outcome=after.outcome,
                currents=state.currents,
                joints=state.joints,
                plant=shape.positions,
                model=state.model.positions,
                actual=shape.magnet_frames[:, :, 2],
                places=shape.magnet_positions,
                measured=frames[:, :, 2],
                predicted=state.model.magnet_frames[:, :, 2],
                error=after.error.size,
                condition=_condition(state.model) if scenario.planar else after.condition,
                seconds=seconds,
            )
        )
        if after.outcome == "converged" and reached is None:
            reached = k
        if after.outcome not in ("moving", "converged"):
            return after, shape, Ending(target=target, outcome=after.outcome, iterations=k, last=len(steps) - 1)
        if reached is not None and k == reached + scenario.hold:
            ending = Ending(target=target, outcome="converged", iterations=reached, last=len(steps) - 1)
            return after, shape, ending
        if reached is None and k == scenario.most_steps - 1:
            break
        follows = plant.at(after.currents, after.joints, shape)
        note = ""
        if follows is None:
            note = "the plant leaves the system's region, or has no stable shape near"
        elif scenario.planar and np.abs(follows.positions[:, 1]).max() > _IN_PLANE:
            note = "the plant buckles out of its plane"
        if follows is None or note:
            ending = Ending(target=target, outcome="lost branch", iterations=k, last=len(steps) - 1, note=note)
            return state, shape, ending
        state, shape = after, follows
    note = f"not reached within {scenario.most_steps} steps"
    ending = Ending(target=target, outcome="moving", iterations=scenario.most_steps, last=len(steps) - 1, note=note)
    return state, shape, ending


def _condition(model: RodState) -> float:
    """Of the turns about y by the currents: in the plane the controller's other rows are zero, and say nothing."""
    coils = len(model.loads.applied.currents) if isinstance(model.loads.applied, DrivenField) else 0
    sigma = np.linalg.svd(model.jacobian[:, 4, :coils], compute_uv=False)
    return float(sigma[0] / sigma[-1]) if sigma[-1] > 0 else np.inf


def _words(ending: Ending) -> str:
    note = f" ({ending.note})" if ending.note else ""
    return f"{ending.outcome} after {ending.iterations} steps{note}"
