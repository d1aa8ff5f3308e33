"""Another way to the goals, when steering is stuck: rehearsed on the model from many starts.

Steering goes downhill; whether it arrives depends on the branch of shapes it is on. A plan lets go of all currents
first, where the rod has one shape, then ramps to other currents and joints, and steers from there: all of it on the
model, with the stiffness that was measured, until a start is found from which steering arrives.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magfem.errors import ConvergenceError, InputError, OutsideRegionError
from magfem.rod.rod import Rod
from magfem.rod.state import RodState
from magfem.rod.steering import Controller, Steering
from magfem.rod.stiffness_estimate import stiffened
from magfem.typing import Floats

STARTS = 24
"""Starts that are tried, by default."""

_RAMP = 12  # steps of a ramp on the model
_REHEARSAL = 200  # steps of steering on the model
_ROOM = 0.98  # of the current limits that a rehearsal may use: feedback needs some of its own


def plan(controller: Controller, now: Steering, seed: int = 0, starts: int = STARTS) -> Steering:
    """`now` with a route to where steering will arrive by the model; outcome "unreachable" when no start leads there.

    The first start are zero currents and joints; the others are random within half the limits, by `seed`.
    Raises InputError for less than one start, ConvergenceError when the model has no stable shape without currents.
    """
    if starts < 1:
        raise InputError(f"a plan needs at least one start, got {starts!r}")
    rng = np.random.default_rng([seed, now.plans])
    low, high = controller.limits
    rod = stiffened(controller.rod, now.stiffness.factor) if controller.adapt else now.model.rod
    rest = np.clip(np.zeros_like(low), low, high)
    at_rest = _model(controller, rod, rest, None)
    if at_rest is None:
        raise ConvergenceError("no plan can be rehearsed: the model has no stable shape without currents")
    rehearsal = replace(controller, rod=rod, adapt=False, room=_ROOM * controller.room)
    # What has led into this cannot lead out of it: after a first plan the start at rest was tried already.
    for k in range(int(now.plans > 0), starts + int(now.plans > 0)):
        start = rest if k == 0 else np.clip(0.5 * rng.uniform(low, high), low, high)
        model: RodState | None = at_rest
        for part in np.linspace(0, 1, _RAMP)[1:] if k else ():
            model = None if model is None else _model(controller, rod, rest + part * (start - rest), model)
        if model is None:
            continue
        if _arrives(rehearsal, model, start):
            route = (rest,) if k == 0 else (rest, start)
            return replace(now, outcome="moving", route=route, plans=now.plans + 1, expected=None)
    return replace(now, outcome="unreachable", plans=now.plans + 1, expected=None)


def _arrives(controller: Controller, model: RodState, parameters: Floats) -> bool:
    """Whether steering the model itself from there converges."""
    c = controller.coils
    trial = Steering(currents=parameters[:c], joints=parameters[c:], model=model)
    for _ in range(_REHEARSAL):
        trial = controller.advance(trial, trial.model.magnet_positions, trial.model.magnet_frames)
        if trial.outcome != "moving":
            break
    return trial.outcome == "converged"


def _model(controller: Controller, rod: Rod, parameters: Floats, guess: RodState | None) -> RodState | None:
    """The model's stable state at the parameters; None when there is none."""
    c = controller.coils
    field = (controller.system, parameters[:c], parameters[c:])
    try:
        state = rod.solve(field, controller.gravity, guess=guess, strict=False)
    except (ConvergenceError, OutsideRegionError):
        return None
    return state if state.stable else None
