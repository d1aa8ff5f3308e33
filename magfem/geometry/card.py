"""Cards: TOML files read key by key, so that every complaint names the file and the key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from hashlib import sha256
from pathlib import Path

from magfem.errors import CardError, InputError
from magfem.geometry.limits import InvalidValue
from magfem.units import describe, one_line, quantity, quoted, shortened


@dataclass(frozen=True)
class CardOrigin:
    """Which file a device came from."""

    path: str  # as the user gave it, or `geometries/<name>.toml` for a card of the catalogue
    sha256: str  # of the file's bytes, hexadecimal
    text: str  # the whole card, so that models and solutions carry it with them


@dataclass(frozen=True)
class Table:
    """One table of a card. Reading a key either gives a value of the right type or raises CardError."""

    origin: CardOrigin
    values: Mapping[str, object]
    path: str = ""  # dotted; empty for the whole file

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def where(self, key: str = "") -> str:
        """File and dotted key, as error messages show them."""
        file, dotted = one_line(self.origin.path), self.dotted(key)
        return f"{file}: {shortened(dotted)}" if dotted else file

    def dotted(self, key: str) -> str:
        """The key as seen from the top of the file."""
        return ".".join(part for part in (self.path, key) if part)

    def error(self, message: str, key: str = "") -> CardError:
        """The error to raise about `key`."""
        return CardError(message, self.where(key))

    def only(self, *known: str) -> None:
        """Raise CardError when the table has a key that is not among `known`."""
        for key in self.values:
            if key not in known:
                close = get_close_matches(key, known, n=1)
                advice = f"did you mean {quoted(close[0])}?" if close else f"known: {', '.join(known)}"
                raise self.error(f"unknown key {quoted(key)}; {advice}", key)

    def value(self, key: str) -> object:
        """Whatever the table holds at `key`, which must be there."""
        if key not in self.values:
            raise self.error(f"missing key {quoted(key)}", key)
        return self.values[key]

    def text(self, key: str) -> str:
        """The text at `key`, not blank."""
        value = self.value(key)
        if not isinstance(value, str):
            raise self.error(f"{key} must be a text, got {describe(value)}", key)
        if not value.strip():
            raise self.error(f"{key} must not be blank", key)
        return value

    def number(self, key: str) -> float:
        """The bare number at `key`; finite or not is for the device to judge."""
        value = self.value(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"{key} must be a bare number, got {describe(value)}", key)
        try:
            return float(value)
        except OverflowError:
            raise self.error(f"{key} must be finite, got {describe(value)}", key) from None

    def quantity(self, key: str, dimension: str) -> float:
        """The SI value of the text with unit at `key`; `dimension` as in `magfem.units.quantity`."""
        value = self.value(key)
        try:
            return quantity(value, dimension)
        except InputError as error:
            raise self.error(str(error), key) from None

    def table(self, key: str) -> Table:
        """The table at `key`."""
        value = self.value(key)
        if not isinstance(value, dict):
            raise self.error(f"{key} must be a table, got {describe(value)}", key)
        return Table(self.origin, value, self.dotted(key))

    def tables(self, key: str) -> list[Table]:
        """The tables of the array `[[key]]`, each named `key[0]`, `key[1]`, … in messages."""
        value = self.value(key)
        if not isinstance(value, list):
            raise self.error(f"{key} must be a list of tables, [[{key}]], got {describe(value)}", key)
        for number, entry in enumerate(value):
            if not isinstance(entry, dict):
                raise self.error(f"{key} must be a list of tables, got {describe(entry)} in it", f"{key}[{number}]")
        return [Table(self.origin, entry, self.dotted(f"{key}[{number}]")) for number, entry in enumerate(value)]

    @contextmanager
    def locating(self) -> Iterator[None]:
        """Within it, a device refusing a value says where in this card the value stands."""
        try:
            yield
        except InvalidValue as error:
            raise self.error(str(error), error.key) from None


def read_table(file: Path, shown: str) -> Table:
    """Read a TOML file.

    Parameters
    ----------
    file : where it is.
    shown : how error messages and `CardOrigin.path` name it.

    Raises
    ------
    CardError : missing, a directory, unreadable, not UTF-8, not TOML (with the line).
    """
    name = one_line(shown)
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        raise CardError("no such file", name) from None
    except IsADirectoryError:
        raise CardError("expected a TOML file, got a directory", name) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise CardError(f"cannot be read: {reason or 'not a path'}", name) from None
    return parse_table(data, shown)


def parse_table(data: bytes, shown: str) -> Table:
    """Parse a TOML file's bytes; `shown` is how messages name the file. Raises CardError."""
    name = one_line(shown)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise CardError("not UTF-8 text", f"{name}: line {line}") from None
    try:
        values = tomllib.loads(text)
    except RecursionError:
        raise CardError("not valid TOML: nested too deeply", name) from None
    except ValueError as error:  # TOMLDecodeError, or Python's own limit on the digits of an integer
        reason, place = _toml_complaint(str(error), text)
        raise CardError(f"not valid TOML: {reason}", f"{name}{place}") from None
    return Table(CardOrigin(shown, sha256(data).hexdigest(), text), values)


def _toml_complaint(message: str, text: str) -> tuple[str, str]:
    """The reason that tomllib gives and the place, as the end of `where`."""
    reason, _, place = message.partition(" (at ")
    match = re.match(r"line (\d+)", place)
    if match:
        return shortened(reason), f": line {match[1]}"
    if place.startswith("end of document"):
        return shortened(reason), f": line {text.rstrip().count(chr(10)) + 1}"
    return shortened(reason), ""
