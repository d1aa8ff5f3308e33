"""Numbers as the report writes them: units, sensible digits, Unicode powers of ten."""

from __future__ import annotations

import math
from collections.abc import Sequence

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
NARROW = "\u202f"  # between number and unit, and between thousands; does not break
_MINUS = "−"


def number(value: float, digits: int = 3) -> str:
    """`0.0123`, `−4.57 × 10⁻⁷`: plain where short, a power of ten elsewhere."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else str(value)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -4 <= power < 4:
        return f"{float(f'{mantissa}e{power}'):.{max(digits - 1 - power, 0)}f}".replace("-", _MINUS)
    return f"{mantissa} × 10{str(power).translate(_SUPERSCRIPTS)}".replace("-", _MINUS)


def percent(relative: float, digits: int = 2) -> str:
    """A relative error: `0.011 %`, `4.6 × 10⁻⁵ %`."""
    return f"{number(100 * relative, digits)}{NARROW}%"


def bound(relative: float) -> str:
    """A relative error that must not be exceeded: two digits, rounded up."""
    if not 0 < relative < math.inf:
        return percent(relative)
    unit = 10.0 ** (math.floor(math.log10(relative)) - 1)
    return percent(math.ceil(relative / unit * (1 - 1e-12)) * unit)


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """An SI value with the prefix that reads best: `11.3 mA·m²`."""
    factor, prefix = _prefix(abs(value), digits)
    return f"{number(value / factor, digits)}{NARROW}{prefix}{unit}"


def size(value: float, digits: int = 4) -> str:
    """A length (m) in mm: `0.5 mm`."""
    return f"{1e3 * value:.{digits}g}{NARROW}mm".replace("-", _MINUS)


def millimetres(point: Sequence[float]) -> str:
    """A point (3,) m, to the micrometre: `(−1.081, 2.254, 0) mm`."""
    parts = (f"{round(1e3 * x, 3) + 0.0:.6g}".replace("-", _MINUS) for x in point)
    return f"({', '.join(parts)}){NARROW}mm"


def measured(value: float, uncertainty: float | None, unit: str) -> str:
    """A reading with the digits it was given with: `411 ± 0.5 µT`."""
    factor, prefix = _prefix(abs(value), 6)
    shown = f"{value / factor:.6g}"
    if uncertainty is not None:
        shown += f" ± {uncertainty / factor:.2g}"
    return f"{shown}{NARROW}{prefix}{unit}".replace("-", _MINUS)


def thousands(value: int) -> str:
    """`22 129`."""
    return f"{value:,}".replace(",", NARROW)


def rounded_down(factor: float) -> int:
    """A factor to one digit, never more than it is: 38512.7 becomes 30000."""
    unit = int(10 ** math.floor(math.log10(max(factor, 1))))
    return math.floor(factor / unit) * unit


def direction(vector: Sequence[float]) -> str:
    """`+z`, `−x`, or three components of a unit vector."""
    length = math.hypot(*vector)
    unit = [x / length for x in vector]
    for name, x in zip("xyz", unit, strict=True):
        if abs(x) > 1 - 1e-6:
            return ("+" if x > 0 else _MINUS) + name
    return "(" + ", ".join(f"{x:.3f}".replace("-", _MINUS) for x in unit) + ")"


def _prefix(size: float, digits: int) -> tuple[float, str]:
    """The prefix to write a size with: what would round up to 1000 µT is 1 mT."""
    rounded = size * (1 + 0.5 * 10.0**-digits)
    return next((pair for pair in _PREFIXES if rounded >= pair[0]), (1.0, ""))
