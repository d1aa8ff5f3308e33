"""The plant: the rod as it is, which the controller's model only resembles."""

from __future__ import annotations

from dataclasses import dataclass, replace

from magfem.actuation import CoilSystem
from magfem.errors import MagfemError
from magfem.rod import FlexibleSection, Rod
from magfem.rod.state import RodState
from magfem.typing import Floats


def stiffer(rod: Rod, factor: float) -> Rod:
    """The rod with all its elastic moduli times `factor`."""
    return Rod(
        [
            replace(
                one,
                youngs_modulus=one.youngs_modulus * factor,
                shear_modulus=None if one.shear_modulus is None else one.shear_modulus * factor,
            )
            if isinstance(one, FlexibleSection)
            else one
            for one in rod.sections
        ],
        rod.base,
        rod.magnet_fields,
    )


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
        except MagfemError:
            return None
        return state if state.stable else None
