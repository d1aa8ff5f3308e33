"""The closed loop: see the plant, let the controller step, let the plant follow; target after target."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from magfem.actuation import CoilSystem
from magfem.errors import ConvergenceError
from magfem.rod.planning import plan
from magfem.rod.state import RodState
from magfem.rod.steering import Controller, Steering
from magfem.scenario.plant import Plant
from magfem.scenario.run import Ending, Step
from magfem.scenario.scenario import STRAIGHT, Scenario
from magfem.scenario.sensing import Seen, in_plane
from magfem.scenario.targets import Target

log = logging.getLogger("magfem")

_HELD = 3.0  # of the tolerance: what noise may do to a target while it is held
_ATTEMPTS = 5  # to see the rod
_IN_PLANE = 1e-4  # m that a planar scenario's rod may be off the plane


@dataclass
class _Loop:
    """What goes on from step to step."""

    scenario: Scenario
    plant: Plant
    rest: RodState
    rng: np.random.Generator
    shape: RodState  # of the plant
    seen: Seen | None = None
    off: bool = True  # whether all currents were switched off just before
    missed: int = 0  # measurements that were taken again
    steps: list[Step] = field(default_factory=list)

    def see(self) -> Seen:
        """A measurement of the plant; pictures that show no rod are taken again. Raises ConvergenceError at last."""
        for attempt in range(_ATTEMPTS):
            try:
                self.seen = self.scenario.sensing.see(self.shape, self.rng, self.seen)
                break
            except ConvergenceError:
                self.missed += 1
                if attempt == _ATTEMPTS - 1:
                    raise
        assert self.seen is not None
        return in_plane(self.seen) if self.scenario.planar else self.seen

    def step(self, controller: Controller, now: Steering, number: int) -> Steering:
        """One step of the controller, kept with what it saw."""
        seen = self.see()
        begin = perf_counter()
        after = controller.advance(now, seen.positions, seen.frames)
        seconds = perf_counter() - begin
        assert after.error is not None
        self.steps.append(
            Step(
                target=number,
                outcome=after.outcome,
                off=self.off,
                currents=now.currents,
                joints=now.joints,
                plant=self.shape.positions,
                model=now.model.positions,
                actual=self.shape.magnet_frames[:, :, 2],
                places=self.shape.magnet_positions,
                measured=seen.frames[:, :, 2],
                predicted=now.model.magnet_frames[:, :, 2],
                error=after.error.size,
                condition=_planar_condition(now) if self.scenario.planar else after.condition,
                stiffness=now.in_use,
                seconds=seconds,
            )
        )
        self.off = False
        return after

    def follow(self, now: Steering) -> str:
        """Let the plant go to the currents and joints; words when it cannot, empty when it can."""
        found = self.plant.at(now.currents, now.joints, self.shape)
        if found is None:
            return "the plant leaves the system's region, or has no stable shape near"
        self.shape = found
        away = float(np.abs(found.positions[:, 1]).max())
        buckled = self.scenario.planar and away > _IN_PLANE and not now.route
        return "the plant buckles out of its plane" if buckled else ""

    def switch_off(self) -> None:
        """All currents to zero at once; the plant goes to rest."""
        self.shape, self.seen, self.off = self.rest, None, True


def close_loop(
    scenario: Scenario, system: CoilSystem, plant: Plant, targets: Sequence[Target]
) -> tuple[list[Step], list[Ending], int]:
    """Steer the plant to one target after the other; also how many measurements had to be taken again.

    Raises ConvergenceError when the plant has no stable shape without currents, and as `Rod.solve` does.
    """
    rest = plant.at(np.zeros(len(system.coils)), np.zeros(len(system.joints)))
    if rest is None:
        raise ConvergenceError("the rod has no stable shape within the system's region without currents")
    loop = _Loop(scenario, plant, rest, np.random.default_rng(scenario.seed), rest)
    endings: list[Ending] = []
    now: Steering | None = None
    for number, target in enumerate(targets):
        controller = controller_for(scenario, system, target)
        if now is None or scenario.start == STRAIGHT:
            loop.switch_off()
            now = controller.begin()
            if not loop.steps:  # a step that nobody follows, so that none that is timed compiles
                controller.advance(now, rest.magnet_positions, rest.magnet_frames)
        else:
            # Where the last target was missed, the plant may be on any branch: it goes by way of currents of zero.
            missed = endings[-1].outcome != "converged"
            route = (np.zeros(now.parameters.size),) if missed else ()
            now = replace(now, outcome="moving", best=np.inf, since=0, expected=None, route=route, plans=0)
        now, ending = _pursue(loop, controller, now, number, target)
        endings.append(ending)
        log.info("scenario: target %d of %d: %s", number + 1, len(targets), _words(ending))
    return loop.steps, endings, loop.missed


def controller_for(scenario: Scenario, system: CoilSystem, target: Target) -> Controller:
    """The controller of a target, on the model's rod; joints are held at zero where all happens in the plane."""
    return Controller(
        rod=scenario.rod,
        system=system,
        goals=target.goals,
        gravity=scenario.gravity,
        joint_limits=np.zeros((len(system.joints), 2)) if scenario.planar else None,
        **scenario.settings,
    )


def _pursue(loop: _Loop, controller: Controller, now: Steering, number: int, target: Target) -> tuple[Steering, Ending]:
    """Steer to one target and hold it there, by another way where one leads nowhere.

    Once a target was reached the loop goes on for `hold` steps, in which it answers to noise.
    """
    scenario = loop.scenario
    reached: int | None = None
    note, planning, k = "", 0.0, 0
    while True:
        after = loop.step(controller, now, number)
        k += 1
        if after.outcome == "converged" and reached is None:
            reached = k
        if reached is not None and k >= reached + scenario.hold:
            assert after.error is not None
            held = after.error.size <= _HELD * controller.tolerance
            note = "" if held else "reached, but not held"
            after = replace(after, outcome="converged" if held else "stalled")
            break
        if reached is None and k >= scenario.most_steps:
            note = f"not reached within {scenario.most_steps} steps"
            break
        trouble = "" if after.outcome not in ("moving", "converged") else loop.follow(after)
        if trouble:
            note, lost = trouble, loop.plant.at(after.currents, after.joints, loop.shape) is None
            after = replace(after, outcome="lost branch")
            if lost:
                loop.switch_off()
                after = replace(controller.begin(), stiffness=after.stiffness, plans=after.plans, outcome="lost branch")
        if after.outcome not in ("moving", "converged"):
            if after.plans >= scenario.plans:
                break
            log.info("scenario: target %d, step %d: %s, planning another way", number + 1, k, note or after.outcome)
            begin, reached = perf_counter(), None
            after = plan(controller, after, seed=scenario.seed)
            planning += perf_counter() - begin
            if after.outcome == "unreachable":
                break
        now = after
    last = len(loop.steps) - 1
    iterations = reached if reached is not None else k
    ending = Ending(
        target=target,
        outcome=after.outcome,
        iterations=iterations,
        last=last,
        note="" if after.outcome == "converged" else note,
        plans=after.plans,
        planning_seconds=planning,
    )
    return after, ending


def _planar_condition(now: Steering) -> float:
    """Of the turns about y by the currents: in the plane the controller's other rows are zero, and say nothing."""
    sigma = np.linalg.svd(now.model.jacobian[:, 4, : len(now.currents)], compute_uv=False)
    return float(sigma[0] / sigma[-1]) if sigma[-1] > 1e-300 * sigma[0] else np.inf


def _words(ending: Ending) -> str:
    note = f" ({ending.note})" if ending.note else ""
    return f"{ending.outcome} after {ending.iterations} steps{note}"
