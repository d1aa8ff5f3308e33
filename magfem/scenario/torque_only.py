"""The shape that a rod would have if its magnets felt torques alone, no force of the field (Fig. 2.7)."""

from __future__ import annotations

import numpy as np

from magfem.actuation import CoilSystem
from magfem.errors import MagfemError
from magfem.fields.field import Evaluated, Unit
from magfem.fields.region import Everywhere, Region
from magfem.rod import Rod
from magfem.rod.state import RodState
from magfem.typing import Floats, Jet, Points

_MOST, _SETTLED = 200, 1e-9  # rounds; m that the magnets still move


class UniformAboutMagnets(Evaluated):
    """A field that is the same all around every magnet, so that it has no gradient: torque, and no force.

    places: (m, 3) m.  B: (m, 3) T, of the nearest place.
    """

    unit: Unit = "T"
    region: Region = Everywhere()
    lowered = None

    def __init__(self, places: Points, B: Floats) -> None:
        self.places, self.values = places, B

    def evaluate(self, points: Points, order: int) -> Jet:
        nearest = np.argmin(np.sum((points[:, None] - self.places) ** 2, axis=-1), axis=1)
        zeros = tuple(np.zeros((len(points),) + (3,) * rank) for rank in range(2, order + 2))
        return (self.values[nearest], *zeros)


def without_force(
    rod: Rod,
    system: CoilSystem,
    currents: Floats,
    joints: Floats,
    gravity: tuple[float, float, float],
    guess: RodState,
) -> RodState | None:
    """The equilibrium of weight and magnetic torques near `guess`, whose rod may have other moduli.

    Torques m × B(p) without their forces have no potential: each round solves with the fields of the last round's
    places, until these stay. None when they do not settle, or leave the system's region.
    """
    state, share = guess, 1.0
    places, moved = guess.magnet_positions, np.inf
    for _ in range(_MOST):
        try:
            B = system.B(places, currents, joints)
            state = rod.solve(UniformAboutMagnets(places, B), gravity, guess=state, strict=False)
        except MagfemError:
            return None
        if not state.stable:
            return None
        change = state.magnet_positions - places
        now = float(np.abs(change).max())
        if now < _SETTLED:
            return state
        if now > 0.9 * moved:  # overshooting
            share = max(0.1, 0.7 * share)
        moved = now
        places = places + share * change
    return None
