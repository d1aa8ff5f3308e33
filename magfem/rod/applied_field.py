"""The field that a rod stands in: any Field, or a coil system with its currents and joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from magfem.errors import InputError
from magfem.fields.field import Field
from magfem.fields.region import Everywhere, Region
from magfem.typing import ArrayLike, Floats, Jet, Points

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem

Driven: TypeAlias = "tuple[CoilSystem, ArrayLike] | tuple[CoilSystem, ArrayLike, ArrayLike | None]"
"""A coil system, its currents (c,) A and its joints (j,) rad or m."""


class AppliedField(Protocol):
    """What the rod asks of its surroundings."""

    @property
    def region(self) -> Region: ...
    def jets(self, points: Points) -> Jet:
        """B (n, 3), gradient (n, 3, 3) and hessian (n, 3, 3, 3) at `points` (n, 3) m, whatever the region."""


@dataclass(frozen=True)
class StaticField:
    """A Field in T that does not change."""

    field: Field

    @property
    def region(self) -> Region:
        """Where the field holds; everywhere when it does not say."""
        return getattr(self.field, "region", None) or Everywhere()

    def jets(self, points: Points) -> Jet:
        """As `AppliedField.jets`."""
        return self.field.jet(points, 2, outside="extrapolate")


class DrivenField:
    """A coil system at certain currents and joints; it remembers what every coil did at the last points."""

    def __init__(self, system: CoilSystem, currents: Floats, joints: Floats | None) -> None:
        self.system, self.currents, self.joints = system, currents, joints
        self.unit: Jet = ()
        self.points: Points | None = None

    @property
    def region(self) -> Region:
        """Where all coils' models hold, within the workspace, at these joints."""
        return self.system.region_at(self.joints)

    def jets(self, points: Points) -> Jet:
        """As `AppliedField.jets`."""
        self.unit = self.system.unit_jets(points, self.joints, 2)
        self.points = points
        total = [np.dot(self.currents, part.reshape(len(part), -1)).reshape(part.shape[1:]) for part in self.unit]
        background = self.system.background_jets(points, 2)
        if background is not None:
            total = [part + more for part, more in zip(total, background, strict=True)]
        return tuple(total)

    def coil_jets(self, points: Points) -> tuple[Floats, Floats]:
        """Per ampere of every coil B (c, n, 3) and gradient (c, n, 3, 3)."""
        self._at(points)
        return self.unit[0], self.unit[1]

    def joint_jets(self, points: Points) -> tuple[Floats, Floats]:
        """Per rad or m of every joint B (j, n, 3) and gradient (j, n, 3, 3)."""
        self._at(points)
        return self.system.joint_jets(points, self.currents, self.joints, self.unit)

    def _at(self, points: Points) -> None:
        if self.points is not points:
            self.jets(points)


def applied_field(field: Field | Driven | None) -> AppliedField | None:
    """`field` as the rod sees it. Raises InputError for what is no field in T, nor a system with its currents."""
    if field is None:
        return None
    if isinstance(field, tuple):
        if not 2 <= len(field) <= 3 or not hasattr(field[0], "unit_jets"):
            raise InputError(
                "a rod's field is a Field, or (system, currents, joints) of a coil system: magfem.load_system gives one"
            )
        system, currents = field[0], field[1]
        joints = field[2] if len(field) == 3 else None
        amperes = system.checked_currents(currents)
        if amperes.ndim != 1:
            raise InputError(f"a rod takes one set of currents, shape ({len(system.coils)},), got {amperes.shape}")
        return DrivenField(system, amperes, system.checked_joints(joints))
    check_field(field, "a rod's field is a Field in T, or (system, currents, joints)")
    return StaticField(field)


def check_field(field: object, expected: str) -> None:
    """Raise InputError, with what was `expected`, unless `field` has a jet and is in T, or does not say its unit."""
    if not callable(getattr(field, "jet", None)):
        raise InputError(
            f"{expected}, got {type(field).__name__}: magfem.load_model, system.at(currents) and "
            "magfem.fields.UniformField give fields"
        )
    if getattr(field, "unit", "T") != "T":
        raise InputError(f"{expected}, got one per ampere: multiply it by its current in A")
