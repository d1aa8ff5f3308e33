"""The metals that coils are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from magfem.geometry.card import Table
from magfem.geometry.limits import InvalidValue, check_number
from magfem.units import format_quantity, quoted

ROOM = 293.15  # K, where resistivities are listed

_SUBJECT = "conductor"


class Metal(NamedTuple):
    """Resistivity at 20 °C (Ω·m) and its relative change per kelvin."""

    resistivity: float
    temperature_coefficient: float


METALS = {
    "copper": Metal(1 / 58e6, 3.93e-3),  # IEC 60028: the international annealed copper standard
    "aluminium": Metal(2.8264e-8, 4.03e-3),  # IEC 60889, hard-drawn wire
    "silver": Metal(1.587e-8, 3.8e-3),  # CRC Handbook of Chemistry and Physics
    "gold": Metal(2.214e-8, 3.4e-3),  # the same
}


@dataclass(frozen=True)
class Conductor:
    """A metal at a temperature. Raises InputError when a value is not finite or not physical."""

    material: str = "copper"
    temperature: float = ROOM  # K
    stated_resistivity: float | None = None  # Ω·m at `temperature`; None: the material's
    current_density_limit: float | None = None  # A/m²; None: none chosen

    def __post_init__(self) -> None:
        if self.material not in METALS:
            names = ", ".join(map(quoted, METALS))
            raise InvalidValue(
                f"{_SUBJECT}: material must be {names}, got {quoted(str(self.material))}", "conductor.material"
            )
        check_number(_SUBJECT, "conductor.temperature", self.temperature)
        if not 200 <= self.temperature <= 600:
            raise InvalidValue(
                f"{_SUBJECT}: temperature must lie between 200 K and 600 K, "
                f"got {format_quantity(self.temperature, 'temperature')}",
                "conductor.temperature",
            )
        for key, field in (("resistivity", "stated_resistivity"), ("current_density_limit",) * 2):
            value = getattr(self, field)
            if value is None:
                continue
            check_number(_SUBJECT, f"conductor.{key}", value)
            if value <= 0:
                raise InvalidValue(f"{_SUBJECT}: {key} must be positive, got {value:g}", f"conductor.{key}")

    @classmethod
    def from_card(cls, card: Table) -> Conductor:
        """Read the [conductor] table of a whole card; a card without one means copper at 20 °C. Raises CardError."""
        if "conductor" not in card:
            return cls()
        table = card.table("conductor")
        table.only("material", "temperature", "resistivity", "current_density_limit")
        values: dict[str, Any] = {}
        if "material" in table:
            values["material"] = table.text("material")
        for key, field, dimension in (
            ("temperature", "temperature", "temperature"),
            ("resistivity", "stated_resistivity", "resistivity"),
            ("current_density_limit", "current_density_limit", "current density"),
        ):
            if key in table:
                values[field] = table.quantity(key, dimension)
        return cls(**values)

    def table(self) -> dict[str, Any]:
        """The [conductor] table that reads back to this."""
        table: dict[str, Any] = {"material": self.material, "temperature": f"{self.temperature!r} K"}
        if self.stated_resistivity is not None:
            table["resistivity"] = f"{self.stated_resistivity!r} ohm*m"
        if self.current_density_limit is not None:
            table["current_density_limit"] = f"{self.current_density_limit!r} A/m^2"
        return table

    @property
    def resistivity(self) -> float:
        """Ω·m at the conductor's temperature."""
        if self.stated_resistivity is not None:
            return self.stated_resistivity
        metal = METALS[self.material]
        return metal.resistivity * (1 + metal.temperature_coefficient * (self.temperature - ROOM))
