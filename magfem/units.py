"""Quantities at the boundary: text such as "4 mm" becomes an SI number, an SI number becomes text."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING

from magfem.errors import InputError

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True)
class Dimension:
    """What a quantity measures, the SI unit magfem keeps it in and the unit people read it in."""

    noun: str  # "length", as sentences name it
    unit: str  # SI
    example: str
    symbol: str = ""  # people's unit; empty: the SI one
    scale: float = 1.0  # SI units in one of people's
    prefixes: bool = True  # whether people's unit takes m, µ, k, …
    only: tuple[str, ...] = ()  # pint's names of the units allowed; empty: all of this dimension


DIMENSIONS: dict[str, Dimension] = {
    "length": Dimension("length", "m", "4 mm"),
    "flux density": Dimension("flux density", "T", "1.35 T"),
    "flux density per current": Dimension("flux density per current", "T/A", "2 mT/A"),
    # To pint an angle is a bare number, and so are percent and m/m: the units are named instead.
    "angle": Dimension(
        "angle",
        "rad",
        "30 deg",
        symbol="deg",
        scale=math.pi / 180,
        prefixes=False,
        only=("radian", "milliradian", "microradian", "degree", "arcminute", "arcsecond", "turn"),
    ),
    "current": Dimension("current", "A", "2 A"),
    "current density": Dimension("current density", "A/m^2", "3 A/mm^2", symbol="A/m²"),
    "magnetisation": Dimension("magnetisation", "A/m", "1 MA/m"),
    "moment": Dimension("magnetic moment", "A*m^2", "10 mA m^2", symbol="A·m²"),
    "voltage": Dimension("voltage", "V", "12 V"),
    "conductivity": Dimension("conductivity", "S/m", "58 MS/m"),
    "resistivity": Dimension("resistivity", "ohm*m", "17.2 nohm*m", symbol="Ω·m"),
    "resistance": Dimension("resistance", "ohm", "0.9 ohm", symbol="Ω"),
    "inductance": Dimension("inductance", "H", "4 uH"),
    "power": Dimension("power", "W", "150 mW"),
    "temperature": Dimension("temperature", "K", "25 degC", prefixes=False),
    "time": Dimension("time", "s", "10 ms"),
    # To pint a revolution per minute is 0.105 Hz: only what is told in hertz is taken.
    "frequency": Dimension("frequency", "Hz", "20 Hz", only=("hertz", "millihertz", "kilohertz", "megahertz")),
    "speed": Dimension("speed", "m/s", "8 mm/s", symbol="m/s"),
    "mass": Dimension("mass", "kg", "2 g", symbol="g", scale=1e-3),
    "density": Dimension("density", "kg/m^3", "7500 kg/m^3", symbol="kg/m³", prefixes=False),
    "acceleration": Dimension("acceleration", "m/s^2", "9.81 m/s^2", symbol="m/s²", prefixes=False),
    "force": Dimension("force", "N", "5 mN"),
    "torque": Dimension("torque", "N*m", "1 mN m", symbol="N·m"),
    "pressure": Dimension("pressure", "Pa", "2 MPa"),
}

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf|infinity)(?![^\W\d_])"
_FACTOR = r"(?:[^\W\d_]+|°[CFcf]?)(?:(?:\^|\*\*)-?[0-9]|[²³])?"
# A number, then a unit made of products, quotients and small powers: pint itself would also do arithmetic.
_QUANTITY = re.compile(rf"({_NUMBER})\s*({_FACTOR}(?:\s*[*/·]\s*{_FACTOR}|\s+{_FACTOR})*)?", re.IGNORECASE)

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_LONGEST = 60  # characters of a user's text that an error repeats


def quantity(text: object, dimension: str) -> float:
    """The SI value of a text such as `"4 mm"`.

    Parameters
    ----------
    text : a number followed by a unit, the space between them optional; case counts ("MM" is not "mm").
    dimension : a key of `DIMENSIONS`: "length", "flux density", "angle", …

    Returns
    -------
    The value in the dimension's SI unit, correctly rounded: `quantity("4 mm", "length") == 0.004`.

    Raises
    ------
    InputError : not a text, no unit, an unknown unit, a unit of another dimension, not finite.
    """
    expected = DIMENSIONS[dimension]
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise _refusal(expected, describe(text))
    if not isinstance(text, str):
        raise _refusal(expected, f"the bare number {describe(text)}")
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        raise _refusal(expected, f"{quoted(text)}, which is not a number followed by a unit")
    number, unit = match.groups()
    if unit is None:
        raise _refusal(expected, f"the bare number {shortened(number)}")
    if not math.isfinite(float(number)):
        raise _refusal(expected, f"{quoted(text)}, which is not finite")
    try:
        value = _to_si(number, unit, expected)
    except InputError as error:
        raise _refusal(expected, f"{quoted(text)}, {error}{_case_hint(number, unit, expected)}") from None
    if not math.isfinite(value):
        raise _refusal(expected, f"{quoted(text)}, which is not finite")
    return value


def format_quantity(value: float, dimension: str) -> str:
    """An SI value as people write it: `"4 mm"`, `"1.35 T"`, `"30 deg"`; six significant digits.

    `value` is in the SI unit of `dimension`, a key of `DIMENSIONS`.
    """
    shown = DIMENSIONS[dimension]
    symbol = shown.symbol or shown.unit
    number = value / shown.scale
    if shown.prefixes and number != 0 and math.isfinite(number):
        size = abs(number) * (1 + 5e-7)  # what rounds up to 1000 µm is 1 mm
        factor, prefix = next((pair for pair in _PREFIXES if size >= pair[0]), _PREFIXES[-1])
        return f"{number / factor:.6g} {prefix}{symbol}"
    return f"{number:.6g} {symbol}"


def quoted(text: str) -> str:
    """A user's text in double quotes, shortened and on one line, for error messages."""
    return f'"{shortened(text)}"'


def shortened(text: str) -> str:
    """A user's text on one line, the end of a long one cut off."""
    return one_line(text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…")


def one_line(text: str) -> str:
    """A text with line breaks and all else that does not print escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def describe(value: object) -> str:
    """What a user wrote instead of what was expected, in the words of TOML and on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, int) and abs(value) >= 10**_LONGEST:
        return f"~1e{math.log10(abs(value)):.0f}"
    if isinstance(value, int | float):
        return f"{value:.12g}" if isinstance(value, float) else str(value)
    names: dict[type, str] = {list: "a list", tuple: "a list", dict: "a table"}
    return names.get(type(value), f"a {type(value).__name__}")


def _refusal(expected: Dimension, got: str) -> InputError:
    return InputError(
        f'expected {_article(expected.noun)} {expected.noun} with its unit, such as "{expected.example}", got {got}'
    )


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"


def _to_si(number: str, unit_text: str, expected: Dimension) -> float:
    """The SI value; raises InputError with the end of a sentence that begins with the text itself."""
    import pint

    units = _registry()
    try:
        unit = units.parse_units(unit_text.replace("·", "*"))
    except pint.UndefinedUnitError:
        raise InputError(f"and {quoted(unit_text)} is no known unit") from None
    except (pint.PintError, ValueError):
        raise InputError("whose unit cannot be read") from None
    target = units.parse_units(expected.unit)
    other = f"which is not {_article(expected.noun)} {expected.noun}"
    if unit.dimensionality != target.dimensionality or (expected.only and str(unit) not in expected.only):
        raise InputError(other)
    try:
        return float(units.Quantity(Decimal(number), unit).to(target).magnitude)
    except (pint.PintError, ArithmeticError):
        raise InputError(other) from None


def _case_hint(number: str, unit: str, expected: Dimension) -> str:
    """ "4 MM" was meant as "4 mm": say so when only the case of the letters stands in the way."""
    lower = unit.lower()
    if lower == unit:
        return ""
    try:
        _to_si(number, lower, expected)
    except InputError:
        return ""
    return f' (case counts: did you mean "{shortened(number)} {lower}"?)'


@cache
def _registry() -> pint.UnitRegistry[Decimal]:
    """Pint's units in decimal arithmetic: 1.1 mm is then exactly the float 0.0011."""
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)
