"""Materials of bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.geometry.card import Table
from magfem.geometry.limits import InvalidValue, check_number
from magfem.typing import Floats
from magfem.units import describe, format_quantity, quoted

Direction = tuple[float, float, float]

AXIAL: Direction = (0.0, 0.0, 1.0)
DIAMETRIC: Direction = (1.0, 0.0, 0.0)
DIRECTIONS = {"axial": AXIAL, "diametric": DIAMETRIC}

STRONGEST_REMANENCE = 2.0  # T; the best sintered NdFeB reaches 1.5 T
LARGEST_RECOIL_PERMEABILITY = 10.0  # alnico, the softest in use, has at most 7

_SUBJECT = "permanent magnet"


@dataclass(frozen=True)
class PermanentMagnet:
    """A hard magnetic material: B = remanence·magnetisation + µ₀·recoil_permeability·H.

    Raises InputError when a value is not finite or not physical.
    """

    remanence: float  # T
    recoil_permeability: float = 1.05
    magnetisation: Direction = AXIAL  # any length but zero; kept as a unit vector

    def __post_init__(self) -> None:
        check_number(_SUBJECT, "material.remanence", self.remanence)
        check_number(_SUBJECT, "material.recoil_permeability", self.recoil_permeability)
        got = format_quantity(self.remanence, "flux density")
        if self.remanence <= 0:
            raise InvalidValue(
                f"{_SUBJECT}: remanence must be positive, got {got}; its sign belongs to magnetisation",
                "material.remanence",
            )
        if self.remanence > STRONGEST_REMANENCE:
            raise InvalidValue(
                f"{_SUBJECT}: remanence must be at most {STRONGEST_REMANENCE:g} T, got {got}; "
                "no permanent magnet has more",
                "material.remanence",
            )
        if not 1.0 <= self.recoil_permeability <= LARGEST_RECOIL_PERMEABILITY:
            raise InvalidValue(
                f"{_SUBJECT}: recoil_permeability must lie between 1 and {LARGEST_RECOIL_PERMEABILITY:g}, "
                f"got {self.recoil_permeability:g}",
                "material.recoil_permeability",
            )
        object.__setattr__(self, "magnetisation", _unit_vector(self.magnetisation))

    @classmethod
    def from_card(cls, material: Table) -> PermanentMagnet:
        """Read the `[material]` table of a card.

        Raises CardError when a key is unknown, missing or of the wrong type, InputError for a bad value.
        """
        material.only("remanence", "recoil_permeability", "magnetisation")
        remanence = material.quantity("remanence", "flux density")
        magnetisation = _read_direction(material)
        if "recoil_permeability" not in material:
            return cls(remanence, magnetisation=magnetisation)
        return cls(remanence, material.number("recoil_permeability"), magnetisation)

    def table(self) -> dict[str, Any]:
        """The [material] table that reads back to this."""
        return {
            "remanence": f"{self.remanence!r} T",
            "recoil_permeability": self.recoil_permeability,
            "magnetisation": list(self.magnetisation),
        }

    @property
    def remanence_vector(self) -> Floats:
        """Remanence times direction, (3,) T."""
        return self.remanence * np.array(self.magnetisation)


def _read_direction(material: Table) -> Direction:
    value = material.value("magnetisation")
    if not isinstance(value, str):
        return _unit_vector(value)
    if value not in DIRECTIONS:
        names = ", ".join(map(quoted, DIRECTIONS))
        raise material.error(
            f"magnetisation must be {names} or a direction such as [0, 1, 1], got {quoted(value)}",
            "magnetisation",
        )
    return DIRECTIONS[value]


def _unit_vector(value: object) -> Direction:
    """Three numbers scaled to length one; raises InvalidValue for anything else."""
    key = "material.magnetisation"
    if not isinstance(value, list | tuple | np.ndarray) or len(value) != 3:
        count = f" of {len(value)}" if isinstance(value, list | tuple) else ""
        raise InvalidValue(
            f"{_SUBJECT}: magnetisation must be three numbers such as [0, 1, 1], got {describe(value)}{count}",
            key,
        )
    for component in value:
        check_number(_SUBJECT, key, component)
    largest = max(abs(float(component)) for component in value)
    if largest == 0:
        raise InvalidValue(f"{_SUBJECT}: magnetisation must not be the zero vector", key)
    x, y, z = (float(component) / largest for component in value)  # squares neither overflow nor vanish
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length
