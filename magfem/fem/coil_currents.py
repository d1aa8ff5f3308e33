"""Where the current of a circuit flows, whatever carries it, and what follows by integrals over it.

Per ampere throughout. Sheets and faces are integrated in `sheet_currents`, filaments in `fields.filament`; coaxial
windings have closed forms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np

from magfem.fem.sheet_currents import FACES, SheetCurrents
from magfem.fields.filament import Filaments
from magfem.fields.thick_solenoid import thick_solenoid_jet, thick_solenoid_vector_potential
from magfem.typing import Floats, Jet, Points

_AROUND = 12  # places on a circle that stand for a turn, when what links it is not coaxial
_FEW = 1000  # patches
_GAUSS = 12  # places along each side of a winding's section


@dataclass(frozen=True)
class CoilCurrents:
    """The current of one circuit that carries 1 A.

    sheets: foils and layers of windings.  faces: surfaces of thick tracks, whose layer integral is B.
    within: sheets that carry the same current as both, on coarser patches: enough for integrals over the metal.
    filaments: centrelines of tracks.
    offset: (f, 3) m, from a filament to a place whose distance is the mean (geometric) one within its section.
    windings: (w, 6), inner radius, outer radius, length, centre on z (m), ampere-turns, radius of the wire (m).
    excess: H, what sheets without thickness store more than the metal that they stand for.
    """

    sheets: SheetCurrents = field(default_factory=SheetCurrents.none)
    faces: SheetCurrents = field(default_factory=SheetCurrents.none)
    within: SheetCurrents = field(default_factory=SheetCurrents.none)
    filaments: Filaments = field(default_factory=Filaments.none)
    offset: Floats = field(default_factory=lambda: np.empty((0, 3)))
    windings: Floats = field(default_factory=lambda: np.empty((0, 6)))
    excess: float = 0.0

    @classmethod
    def joined(cls, parts: Sequence[CoilCurrents]) -> CoilCurrents:
        """The current of parts in series."""
        wires = [part.filaments for part in parts]
        return cls(
            sheets=SheetCurrents.joined([part.sheets for part in parts]),
            faces=SheetCurrents.joined([part.faces for part in parts]),
            within=SheetCurrents.joined([part.within for part in parts]),
            filaments=Filaments(
                np.concatenate([wire.start for wire in wires]),
                np.concatenate([wire.end for wire in wires]),
                np.concatenate([wire.current for wire in wires]),
            ),
            offset=np.concatenate([part.offset for part in parts]),
            windings=np.concatenate([part.windings for part in parts]),
            excess=sum(part.excess for part in parts),
        )

    @property
    def cells(self) -> int:
        """Patches, filaments and windings."""
        return self.sheets.count + self.faces.count + self.filaments.current.size + len(self.windings)

    def jet(self, points: Points, order: int) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m, T/A."""
        jets = [
            self.sheets.jet(points, order) if self.sheets.count else None,
            self.faces.layer_jet(points, order, FACES) if self.faces.count else None,
            self.filaments.jet(points, order) if self.filaments.current.size else None,
            *(self._winding_jet(winding, points, order) for winding in self.windings),
        ]
        present = [jet for jet in jets if jet is not None]
        return tuple(reduce(add, parts) for parts in zip(*present, strict=True))

    def vector_potential(self, points: Points) -> Floats:
        """A (n, 3) T·m/A at `points` (n, 3) m, in the Coulomb gauge."""
        A = np.zeros_like(points, dtype=float)
        if self.within.count:
            A += self.within.vector_potential(points)
        if self.filaments.current.size:
            A += self.filaments.vector_potential(points)
        for inner, outer, length, centre, turns, _ in self.windings:
            shifted = points - np.array([0.0, 0.0, centre])
            A += thick_solenoid_vector_potential(shifted, inner, outer, length, turns)
        return A

    def elements(self) -> tuple[Floats, Floats]:
        """Current elements that integrate smooth fields over the metal: places (e, 3) m, strengths (e, 3) A·m."""
        rule = (6, 6) if self.within.count < _FEW else (2, 3)  # few patches are large ones
        parts = [_flat(self.within.elements(rule))] if self.within.count else []
        parts += [_winding_elements(winding) for winding in self.windings]
        if self.filaments.current.size:
            wire = self.filaments
            strengths = wire.current[:, None] * (wire.end - wire.start)
            parts.append((0.5 * (wire.start + wire.end) + self.offset, strengths))
        places, strengths_list = zip(*parts, strict=True)
        return np.concatenate(places), np.concatenate(strengths_list)

    @property
    def moment(self) -> Floats:
        """Dipole moment (3,) A·m²/A."""
        moment: Floats = (self.sheets if self.sheets.count else self.within).moment + self.filaments.moment
        for inner, outer, _, _, turns, _ in self.windings:
            moment[2] += turns * np.pi * (outer**2 + outer * inner + inner**2) / 3
        return moment

    @staticmethod
    def _winding_jet(winding: Floats, points: Points, order: int) -> Jet:
        inner, outer, length, centre, turns, _ = winding
        return thick_solenoid_jet(points - np.array([0.0, 0.0, centre]), inner, outer, length, turns, order)


def _flat(elements: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    places, strengths = elements
    return places.reshape(-1, 3), strengths.reshape(-1, 3)


def _winding_elements(winding: Floats) -> tuple[Floats, Floats]:
    """Places and strengths over a winding's section and round its turns."""
    inner, outer, length, centre, turns, _ = winding
    node, weight = np.polynomial.legendre.leggauss(_GAUSS)
    rho = 0.5 * (inner + outer) + 0.5 * (outer - inner) * node
    z = centre + 0.5 * length * node
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    share = turns * np.outer(weight, weight)[..., None] / 4
    r, height, phi = (grid.ravel() for grid in np.meshgrid(rho, z, angle, indexing="ij"))
    strength = (np.broadcast_to(share, (_GAUSS, _GAUSS, _AROUND)).ravel() * r) * 2 * np.pi / _AROUND
    places = np.stack([r * np.cos(phi), r * np.sin(phi), height], axis=-1)
    return places, strength[:, None] * np.stack([-np.sin(phi), np.cos(phi), 0 * phi], axis=-1)
