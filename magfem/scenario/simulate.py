"""`simulate`: a scenario, run."""

from __future__ import annotations

import logging
import os
from datetime import UTC, datetime

import numpy as np

from magfem.actuation import load_system
from magfem.rod.stiffness_estimate import stiffened
from magfem.scenario.loop import close_loop
from magfem.scenario.own_coils import OwnCoils
from magfem.scenario.plant import Plant
from magfem.scenario.run import Run, Step
from magfem.scenario.scenario import Scenario
from magfem.scenario.scenario_file import load_scenario
from magfem.scenario.targets import RandomTargets, drawn
from magfem.scenario.torque_only import without_force
from magfem.threads import one_thread_for_algebra
from magfem.typing import Points, Vectors
from magfem.version import __version__

log = logging.getLogger("magfem")


def simulate(scenario: Scenario | str | os.PathLike[str]) -> Run:
    """Run a scenario, or that of a name in `reports/` or of a path.

    Raises InputError, CardError, ConvergenceError … for what cannot be run; a target that is not reached is no error,
    but told by the run.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    system, coil = scenario.system.built() if isinstance(scenario.system, OwnCoils) else (None, None)
    if system is None:
        assert isinstance(scenario.system, str)
        system = load_system(scenario.system)
    with one_thread_for_algebra():
        rod = stiffened(scenario.rod, scenario.stiffness)
        targets = scenario.targets
        if isinstance(targets, RandomTargets):
            targets = drawn(targets, rod, system, scenario.gravity, scenario.planar)
        log.info("scenario: steering %d magnets by %d coils", len(rod.magnets), len(system.coils))
        plant = Plant(rod, system, scenario.gravity)
        steps, endings, missed = close_loop(scenario, system, plant, targets)
        torque_only = None
        if scenario.compare_forces:
            log.info("scenario: the same currents without magnetic force")
            torque_only = _without_forces(plant, steps)
    return Run(
        scenario=scenario,
        system=system,
        rod=rod,
        steps=steps,
        endings=endings,
        missed=missed,
        coil=coil,
        torque_only=torque_only,
        provenance={
            "magfem": __version__,
            "numpy": np.__version__,
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
        },
    )


def _without_forces(plant: Plant, steps: list[Step]) -> tuple[Points, Vectors]:
    """Centrelines (steps, n, 3) m and the magnets' axes (steps, m, 3) without magnetic force; NaN where none is."""
    count, nodes, magnets = len(steps), len(steps[0].plant), len(steps[0].actual)
    lines, axes = np.full((count, nodes, 3), np.nan), np.full((count, magnets, 3), np.nan)
    near = None
    for k, step in enumerate(steps):
        if near is None or not step.currents.any():
            near = plant.at(0 * step.currents, step.joints)
            assert near is not None  # the loop began with it
        found = without_force(plant.rod, plant.system, step.currents, step.joints, plant.gravity, near)
        if found is not None:
            lines[k], axes[k], near = found.positions, found.magnet_frames[:, :, 2], found
    return lines, axes
