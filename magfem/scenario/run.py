"""What a simulated scenario leaves: every step of the closed loop, and how every target ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from magfem.actuation import CoilSystem
from magfem.fitting import FieldModel
from magfem.rod import Rod
from magfem.scenario.angles import between
from magfem.scenario.scenario import Scenario
from magfem.scenario.targets import REACHED, UNREACHABLE, Target
from magfem.typing import Booleans, Floats, Integers, Points, Vectors


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """One step of the loop: what is in use, what came of it, what was seen, what the controller makes of it.

    off: whether all currents were switched off just before.  currents (c,) A, joints (j,) rad or m.
    plant, model: (n, 3) m, their centrelines.  actual, predicted: (m, 3) unit vectors, the axes of the plant's and of
    the model's magnets.  places: (m, 3) m of the plant's.  measured: (m, 3), the axes as seen.  error: rad, the largest
    that the controller sees.  condition: of the Jacobian.  stiffness: the factor of the moduli that the model has taken
    on.  seconds: that the controller took.
    """

    target: int
    outcome: str
    off: bool
    currents: Floats
    joints: Floats
    plant: Points
    model: Points
    actual: Vectors
    places: Points
    measured: Vectors
    predicted: Vectors
    error: float
    condition: float
    stiffness: float
    seconds: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Ending:
    """How a target ended.

    iterations: steps of the controller until the outcome.  note: words about a failure.  plans: other ways that were
    planned for it, which took `planning_seconds`.
    """

    target: Target
    outcome: str
    iterations: int
    last: int  # the step it ended with, counted over the whole run
    note: str = ""
    plans: int = 0
    planning_seconds: float = 0.0

    @property
    def as_expected(self) -> bool:
        """Whether it was reached, or recognised as unreachable where that was expected."""
        if self.target.expected == REACHED:
            return self.outcome == "converged"
        return self.outcome == UNREACHABLE


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """A scenario that was run.

    rod: of the plant.  missed: measurements that had to be taken again.  coil: the model that own coils were fitted
    with.  torque_only: centrelines (steps, n, 3) m and axes (steps, m, 3) if magnets felt torques alone; NaN where
    there is no such equilibrium.
    """

    scenario: Scenario
    system: CoilSystem
    rod: Rod
    steps: Sequence[Step]
    endings: Sequence[Ending]
    missed: int = 0
    coil: FieldModel | None = None
    torque_only: tuple[Points, Vectors] | None = None
    provenance: dict[str, Any] = field(default_factory=dict)

    def stacked(self, name: str) -> Any:
        """One of `Step`'s values for all steps, (steps, ...)."""
        return np.array([getattr(one, name) for one in self.steps])

    @property
    def target_of_step(self) -> Integers:
        """(steps,) which target each step works on."""
        found: Integers = self.stacked("target")
        return found

    @property
    def wanted(self) -> Vectors:
        """(steps, m, 3) where the magnets shall point."""
        directions = np.array([one.target.directions for one in self.endings])
        found: Vectors = directions[self.target_of_step]
        return found

    @property
    def true_error(self) -> Floats:
        """(steps, m) rad between the plant's magnets and what is wanted of them."""
        return between(self.stacked("actual"), self.wanted)

    @property
    def passed(self) -> Booleans:
        """(targets,) whether every target ended as expected."""
        return np.array([one.as_expected for one in self.endings])
