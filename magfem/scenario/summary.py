"""The summary of a run: plain data for `summary.json`."""

from __future__ import annotations

from typing import Any

import numpy as np

from magfem.scenario.angles import angles_of_rotation, axes_of_rotation, between, planar_angles
from magfem.scenario.own_coils import OwnCoils
from magfem.scenario.run import Ending, Run
from magfem.scenario.targets import RandomTargets
from magfem.typing import Floats, Vectors

FORMAT, VERSION = "magfem scenario", 1


def summary(run: Run) -> dict[str, Any]:
    """What `summary.json` holds; angles in deg, currents in A."""
    scenario, seconds = run.scenario, run.stacked("seconds")
    targets = scenario.targets
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": scenario.name,
        "source": scenario.source,
        "passed": bool(run.passed.all()),
        "converged": sum(one.outcome == "converged" for one in run.endings),
        "targets": [_target(run, number, ending) for number, ending in enumerate(run.endings)],
        "step_ms": {"median": 1e3 * float(np.median(seconds)), "worst": 1e3 * float(seconds.max())},
        "steps": len(run.steps),
        "missed_measurements": run.missed,
        "system": {
            "name": run.system.name,
            "coils": [one.name for one in run.system.coils],
            "joints": [one.name for one in run.system.joints],
            "own_coil": scenario.system.coil if isinstance(scenario.system, OwnCoils) else None,
        },
        "plant": {"stiffness": scenario.stiffness, "sensing": scenario.sensing.describe(), "planar": scenario.planar},
        "seeds": {
            "sensing": scenario.seed,
            "targets": targets.seed if isinstance(targets, RandomTargets) else None,
        },
        "largest": {
            "current_A": float(np.abs(run.stacked("currents")).max()),
            "current_step_A": float(_largest_change(run, "currents")),
            "joint_step": float(_largest_change(run, "joints")),
        },
        "without_force": _forces(run),
        "provenance": run.provenance,
    }


def told_angles(run: Run, directions: Vectors) -> Floats:
    """(...,) deg as the scenario tells angles: signed in the plane, from the z axis in space."""
    angles = planar_angles(directions) if run.scenario.planar else angles_of_rotation(directions)
    return np.degrees(angles)


def _target(run: Run, number: int, ending: Ending) -> dict[str, Any]:
    last = run.steps[ending.last]
    wanted, reached = ending.target.directions, last.actual
    own = [step for step in run.steps if step.target == number]
    conditions = [step.condition for step in own if np.isfinite(step.condition)]
    found: dict[str, Any] = {
        "wanted_deg": told_angles(run, wanted),
        "reached_deg": told_angles(run, reached),
        "iterations": ending.iterations,
        "outcome": ending.outcome,
        "note": ending.note,
        "plans": ending.plans,
        "planning_s": ending.planning_seconds,
        "stiffness": last.stiffness,
        "expected": ending.target.expected,
        "as_expected": ending.as_expected,
        "error_deg": np.degrees(between(reached, wanted)),
        "measured_error_deg": float(np.degrees(last.error)),
        "currents_A": last.currents,
        "joints": last.joints,
        "largest_current_A": float(max(np.abs(step.currents).max() for step in own)),
        "condition": max(conditions) if conditions else None,
    }
    if not run.scenario.planar:
        axes = axes_of_rotation(wanted), axes_of_rotation(reached)
        found |= {
            "wanted_axis": axes[0],
            "reached_axis": axes[1],
            "axis_error_deg": np.degrees(between(*axes)),
        }
    return found


def _largest_change(run: Run, name: str) -> float:
    """The largest change of currents or joints from one step to the next, but for those that switch all off."""
    change = np.abs(np.diff(run.stacked(name), axis=0))[~run.stacked("off")[1:]]
    return float(change.max(initial=0.0))


def _forces(run: Run) -> dict[str, Any] | None:
    """How far shapes without magnetic force are from those with it."""
    if run.torque_only is None:
        return None
    lines, axes = run.torque_only
    found = np.isfinite(lines[:, 0, 0])
    if not found.any():
        return {"steps": 0, "missing": len(found)}
    apart = np.linalg.norm(lines[found] - run.stacked("plant")[found], axis=-1)
    return {
        "steps": int(found.sum()),
        "missing": int((~found).sum()),
        "largest_shift_mm": 1e3 * float(apart.max()),
        "largest_turn_deg": float(np.degrees(between(axes[found], run.stacked("actual")[found]).max())),
    }
