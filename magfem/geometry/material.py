"""Materials of bodies."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.geometry.card import Table
from magfem.geometry.grades import REFERENCE_TEMPERATURE, Grade, grade_named
from magfem.geometry.limits import InvalidValue, check_number
from magfem.typing import Floats
from magfem.units import describe, format_quantity, quoted

Direction = tuple[float, float, float]

AXIAL: Direction = (0.0, 0.0, 1.0)
DIAMETRIC: Direction = (1.0, 0.0, 0.0)
DIRECTIONS = {"axial": AXIAL, "diametric": DIAMETRIC}

STRONGEST_REMANENCE = 2.0  # T; the best sintered NdFeB reaches 1.5 T
WEAKEST_REMANENCE = 1e-6  # T; far below what a compass shows
LARGEST_RECOIL_PERMEABILITY = 10.0  # alnico, the softest in use, has at most 7

COLDEST, HOTTEST = 77.0, 800.0  # K; straight demagnetisation curves are known between these at best
STEEPEST = 0.01  # 1/K; ferrites, the most sensitive, lose 0.2 % of their remanence per kelvin

_SUBJECT = "permanent magnet"


@dataclass(frozen=True)
class PermanentMagnet:
    """A hard magnetic material: B = remanence·magnetisation + µ₀·recoil_permeability·H.

    The remanence is that at 20 °C; at another `temperature` it changes by `temperature_coefficient`, to
    `working_remanence`. `of_grade` takes these numbers from a grade's name.
    Raises InputError when a value is not finite or not physical.
    """

    remanence: float  # T, at 20 °C
    recoil_permeability: float = 1.05
    magnetisation: Direction = AXIAL  # any length but zero; kept as a unit vector
    temperature: float | None = None  # K; None: 20 °C
    temperature_coefficient: float | None = None  # 1/K, reversible, of the remanence
    grade: str = ""  # a name of `GRADES`; empty: none is stated

    def __post_init__(self) -> None:
        check_number(_SUBJECT, "material.remanence", self.remanence)
        check_number(_SUBJECT, "material.recoil_permeability", self.recoil_permeability)
        got = format_quantity(self.remanence, "flux density")
        if self.remanence <= 0:
            raise InvalidValue(
                f"{_SUBJECT}: remanence must be positive, got {got}; its sign belongs to magnetisation",
                "material.remanence",
            )
        if self.remanence < WEAKEST_REMANENCE:
            raise InvalidValue(
                f"{_SUBJECT}: remanence must be at least {format_quantity(WEAKEST_REMANENCE, 'flux density')}, "
                f"got {got}",
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
        if self.grade:
            self._check_grade()
        self._check_temperature()

    def _check_grade(self) -> None:
        grade = _grade(self.grade)
        if self.remanence != grade.remanence:
            raise InvalidValue(
                f"{_SUBJECT}: state grade or remanence, not both: {grade.name} has {grade.remanence:g} T, "
                f"got {format_quantity(self.remanence, 'flux density')}",
                "material.remanence",
            )
        if self.temperature is None:
            return
        check_number(_SUBJECT, "material.temperature", self.temperature)
        if self.temperature > grade.highest_temperature:
            raise InvalidValue(
                f"{_SUBJECT}: temperature must be at most {_celsius(grade.highest_temperature)} for {grade.name}: "
                f"it loses remanence for good above; got {_celsius(self.temperature)}",
                "material.temperature",
            )

    def _check_temperature(self) -> None:
        coefficient, temperature = self.temperature_coefficient, self.temperature
        if coefficient is not None:
            key = "material.temperature_coefficient"
            check_number(_SUBJECT, key, coefficient)
            if abs(coefficient) > STEEPEST:
                raise InvalidValue(
                    f"{_SUBJECT}: temperature_coefficient must lie within ±{STEEPEST * 100:g} %/K, "
                    f"got {coefficient * 100:g} %/K",
                    key,
                )
        if temperature is None:
            return
        key = "material.temperature"
        check_number(_SUBJECT, key, temperature)
        if not COLDEST <= temperature <= HOTTEST:
            raise InvalidValue(
                f"{_SUBJECT}: temperature must lie between {_celsius(COLDEST)} and {_celsius(HOTTEST)}, "
                f"got {_celsius(temperature)}",
                key,
            )
        if coefficient is None:
            raise InvalidValue(
                f"{_SUBJECT}: a temperature needs a grade or a temperature_coefficient, such as -0.12 %/K", key
            )
        if not self.working_remanence > 0:
            raise InvalidValue(
                f"{_SUBJECT}: no remanence is left at a temperature of {_celsius(temperature)} "
                f"with a temperature_coefficient of {coefficient * 100:g} %/K",
                key,
            )

    @classmethod
    def of_grade(
        cls,
        name: str,
        magnetisation: Direction = AXIAL,
        recoil_permeability: float | None = None,
        temperature: float | None = None,
    ) -> PermanentMagnet:
        """A magnet of a grade such as `N48`: see `magfem.geometry.grades`. Raises InvalidValue."""
        grade = _grade(name)
        return cls(
            remanence=grade.remanence,
            recoil_permeability=grade.family.recoil_permeability
            if recoil_permeability is None
            else recoil_permeability,
            magnetisation=magnetisation,
            temperature=temperature,
            temperature_coefficient=grade.family.temperature_coefficient,
            grade=grade.name,
        )

    @classmethod
    def from_card(cls, material: Table, magnetisation: Direction | None = None) -> PermanentMagnet:
        """Read the `[material]` table of a card.

        magnetisation: the direction where the device itself decides it (then the table must not state one).
        Raises CardError when a key is unknown, missing or of the wrong type, InputError for a bad value.
        """
        own = () if magnetisation else ("magnetisation",)
        material.only("grade", "remanence", "recoil_permeability", "temperature", "temperature_coefficient", *own)
        values: dict[str, Any] = {"magnetisation": magnetisation or read_direction(material)}
        if "recoil_permeability" in material:
            values["recoil_permeability"] = material.number("recoil_permeability")
        if "temperature" in material:
            values["temperature"] = material.quantity("temperature", "temperature")
        if "grade" not in material:
            if "temperature_coefficient" in material:
                values["temperature_coefficient"] = _read_coefficient(material)
            return cls(material.quantity("remanence", "flux density"), **values)
        for key in ("remanence", "temperature_coefficient"):
            if key in material:
                raise material.error(f"state grade or {key}, not both", key)
        return cls.of_grade(material.text("grade"), **values)

    def table(self, directed: bool = True) -> dict[str, Any]:
        """The [material] table that reads back to this; without the direction where `directed` is false."""
        table: dict[str, Any] = {"grade": self.grade} if self.grade else {"remanence": f"{self.remanence!r} T"}
        table["recoil_permeability"] = self.recoil_permeability
        if self.temperature is not None:
            table["temperature"] = f"{self.temperature!r} K"
        if self.temperature_coefficient is not None and not self.grade:
            table["temperature_coefficient"] = f"{self.temperature_coefficient!r} 1/K"
        if directed:
            table["magnetisation"] = list(self.magnetisation)
        return table

    @property
    def working_remanence(self) -> float:
        """Remanence at `temperature`, T."""
        if self.temperature is None:
            return self.remanence
        rise = self.temperature - REFERENCE_TEMPERATURE
        return self.remanence * (1 + (self.temperature_coefficient or 0.0) * rise)

    @property
    def remanence_vector(self) -> Floats:
        """Remanence at `temperature` times direction, (3,) T."""
        return self.working_remanence * np.array(self.magnetisation)


def _grade(name: str) -> Grade:
    try:
        return grade_named(name)
    except InputError as error:
        raise InvalidValue(f"{_SUBJECT}: {error}", "material.grade") from None


def _celsius(temperature: float) -> str:
    return f"{temperature - 273.15:.4g} °C"


_COEFFICIENT = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(%|1)\s*/\s*(?:K|°C|degC)")


def _read_coefficient(material: Table) -> float:
    """The change of remanence per kelvin, 1/K, of a text such as "-0.12 %/K"."""
    value = material.value("temperature_coefficient")
    match = _COEFFICIENT.fullmatch(value.strip()) if isinstance(value, str) else None
    if match is None:
        raise material.error(
            f'temperature_coefficient must be a text such as "-0.12 %/K", got {describe(value)}',
            "temperature_coefficient",
        )
    return float(Decimal(match[1]) / 100) if match[2] == "%" else float(match[1])


def read_direction(material: Table) -> Direction:
    """The unit vector at `magnetisation`: a word of DIRECTIONS or three numbers. Raises CardError, InvalidValue."""
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
