"""What a scenario is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from magfem.rod import Rod
from magfem.scenario.own_coils import OwnCoils
from magfem.scenario.sensing import Sensing
from magfem.scenario.targets import RandomTargets, Target

STRAIGHT, PREVIOUS = "straight", "previous"


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario:
    """Everything that a closed loop needs.

    system: the name or path of a coil system, or coils that are solved and fitted first.  rod: the controller's model.
    planar: the rod, its targets and what is seen of it lie in the xz plane; joints stay at zero.  gravity: (3,) m/s².
    stiffness: the plant's elastic moduli over the model's.  settings: of `magfem.rod.steering.Controller`.
    targets: one after the other.  start: "straight", every target from currents of zero, or "previous".  hold: steps
    after a target is reached.  most_steps: after which a target counts as not reached.  plans: how many other ways are
    planned for one target at most.  seed: of the sensing's noise and of plans.  compare_forces: whether the shapes
    without magnetic force are found as well (Fig. 2.7).
    """

    name: str
    system: str | OwnCoils
    rod: Rod
    targets: tuple[Target, ...] | RandomTargets
    sensing: Sensing
    source: str = ""
    text: str = ""  # the recipe as it was read
    planar: bool = False
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    stiffness: float = 1.0
    settings: Mapping[str, Any] = field(default_factory=dict)
    start: str = PREVIOUS
    hold: int = 10
    most_steps: int = 400
    plans: int = 3
    seed: int = 0
    compare_forces: bool = False
