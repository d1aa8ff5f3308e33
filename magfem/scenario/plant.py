"""The plant: the rod as it is, which the controller's model only resembles."""

from __future__ import annotations

from dataclasses import dataclass

from magfem.actuation import CoilSystem
from magfem.errors import ConvergenceError, OutsideRegionError
from magfem.rod import Rod
from magfem.rod.state import RodState
from magfem.typing import Floats


@dataclass(frozen=True, eq=False)
class Plant:
    """rod: as it really is.  gravity: (3,) m/s²."""

    rod: Rod
    system: CoilSystem
    gravity: tuple[float, float, float]

    def at(self, currents: Floats, joints: Floats, before: RodState | None = None) -> RodState | None:
        """The stable state that follows `before`; None when there is none within the system's region."""
        try:
            state = self.rod.solve((self.system, currents, joints), self.gravity, guess=before, strict=False)
        except (ConvergenceError, OutsideRegionError):
            return None
        return state if state.stable else None
