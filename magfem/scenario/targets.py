"""What is wanted: where every magnet shall point, step by step, or as some stable state of the plant has it."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from magfem.actuation import CoilSystem
from magfem.errors import ConvergenceError, InputError, MagfemError
from magfem.rod import Rod
from magfem.rod.goals import Goal
from magfem.typing import Vectors

log = logging.getLogger("magfem")

REACHED, UNREACHABLE = "reached", "unreachable"
_IN_PLANE = 1e-6  # of a direction's y: more is out of the plane
_TRIES = 100  # random states for every target asked for


@dataclass(frozen=True, eq=False)
class Target:
    """directions: (m, 3) unit vectors, where the magnets' axes shall point.  expected: "reached" or "unreachable"."""

    directions: Vectors
    expected: str = REACHED

    @property
    def goals(self) -> list[Goal]:
        """For the controller."""
        return [Goal(magnet=m, direction=tuple(one)) for m, one in enumerate(self.directions.tolist())]


@dataclass(frozen=True)
class RandomTargets:
    """Targets that stable states of the plant have: with random currents up to `current` A, joints up to `joint`."""

    count: int
    seed: int
    current: float
    joint: float = 0.0


def drawn(
    wanted: RandomTargets, rod: Rod, system: CoilSystem, gravity: tuple[float, float, float], planar: bool
) -> tuple[Target, ...]:
    """The random targets of a plant `rod`; with `planar` those that stay in the xz plane.

    Raises ConvergenceError when hardly any state is stable within the system's region.
    """
    rng = np.random.default_rng(wanted.seed)
    found: list[Target] = []
    for _ in range(_TRIES * wanted.count):
        if len(found) == wanted.count:
            log.info("scenario: %d random targets, each of a stable state", len(found))
            return tuple(found)
        currents = rng.uniform(-wanted.current, wanted.current, len(system.coils))
        joints = rng.uniform(-wanted.joint, wanted.joint, len(system.joints))
        try:
            state = rod.solve((system, currents, joints), gravity, strict=False)
        except InputError:
            raise
        except MagfemError:
            continue
        directions = state.magnet_frames[:, :, 2]
        if state.stable and not (planar and np.abs(directions[:, 1]).max() > _IN_PLANE):
            found.append(Target(directions))
    if len(found) < wanted.count:
        raise ConvergenceError(
            f"{_TRIES * wanted.count} random states gave only {len(found)} of the {wanted.count} targets wanted: take "
            "weaker currents or a stiffer rod"
        )
    return tuple(found)
