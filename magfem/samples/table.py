"""Tables of numbers as text: a header, then rows of cells. Read fast, and carefully where a cell is at fault."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from magfem.errors import InputError
from magfem.typing import Floats
from magfem.units import quoted

DELIMITERS = (",", ";", "\t")

_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")


@dataclass(frozen=True)
class Table:
    """Rows of cells under a header.

    path: the file, as errors name it.  header: the columns' names.  header_line: its line, from 1.
    lines: what follows the header, from line `first_line` of the file.  delimiter: None stands for white space.
    """

    path: Path
    header: tuple[str, ...]
    header_line: int
    lines: Sequence[str]
    first_line: int
    delimiter: str | None

    def numbers(self, columns: Sequence[int], gaps: Collection[int] = (), empty: bool = False) -> Floats:
        """The cells (n, len(columns)) of the columns with these indices; blank lines do not count.

        gaps: the columns in which `nan` may stand, for what was not measured.  empty: whether an empty cell there says
        the same. Raises InputError that names file, line and column for a cell that is no finite number, and for a row
        that is not as wide as the header.
        """
        values = self._fast(columns) if len(self.lines) > 1 else None  # one line alone is read as fast carefully
        if values is None or not _allowed(values, columns, gaps):
            values = self._careful(columns, gaps, empty)
        return values

    def words(self, column: int) -> list[str]:
        """The cells (n) of a column as they are, without the space around them; blank lines do not count."""
        return [row[column].strip() for _, row in self._rows()]

    def line(self, row: int) -> int:
        """The line of the file, from 1, on which row number `row`, from 0, ends."""
        return next(line for number, (line, _) in enumerate(self._rows()) if number == row)

    def _fast(self, columns: Sequence[int]) -> Floats | None:
        """All cells at once; None when anything is out of the ordinary, for the careful way to judge."""
        lines = [line for line in self.lines if line and not line.isspace()]
        width = len(self.header)
        if not lines:
            return np.empty((0, len(columns)))
        if self.delimiter is not None:
            ordinary = not any('"' in line for line in lines)
            if not ordinary or {line.count(self.delimiter) for line in lines} != {width - 1}:
                return None
        try:  # without usecols NumPy sees to it that all rows are as wide
            wanted = None if self.delimiter is None else columns
            values = np.loadtxt(lines, delimiter=self.delimiter, usecols=wanted, comments=None, ndmin=2)
        except ValueError:
            return None
        if wanted is None:
            return values[:, list(columns)] if values.shape[1] == width else None
        return values

    def _careful(self, columns: Sequence[int], gaps: Collection[int], empty: bool) -> Floats:
        """Cell by cell, to name the one at fault."""
        nothing = ("nan", "") if empty else ("nan",)
        values = [
            [self._number(line, index, row[index], nothing if index in gaps else ()) for index in columns]
            for line, row in self._rows()
        ]
        return np.array(values, dtype=float).reshape(-1, len(columns))

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """The rows that are not blank, each as wide as the header, with the line on which they end."""
        width = len(self.header)
        for line, row in self._all_rows():
            if len(row) == width:
                yield line, row
            elif any(cell.strip() for cell in row):
                hint = ": decimal commas are not read, write 1.5" if len(row) == 2 * width else ""
                raise InputError(
                    f"expected {width} cells as in the header, got {len(row)}{hint} [{self.path}: line {line}]"
                )

    def _all_rows(self) -> Iterator[tuple[int, list[str]]]:
        if self.delimiter is None:
            yield from ((self.first_line + k, line.split()) for k, line in enumerate(self.lines))
            return
        rows = csv.reader(io.StringIO("\n".join(self.lines), newline=""), delimiter=self.delimiter, strict=True)
        try:
            for row in rows:
                yield self.first_line + rows.line_num - 1, row
        except csv.Error as error:
            line = self.first_line + rows.line_num - 1
            raise InputError(f"not valid CSV: {error} [{self.path}: line {line}]") from None

    def _number(self, line: int, column: int, cell: str, nothing: Collection[str]) -> float:
        try:
            value = math.nan if "_" in cell else float(cell)  # Python takes 1_000 for a number
        except ValueError:
            value = math.nan
        if math.isfinite(value) or cell.strip().lower() in nothing:
            return value
        if _DECIMAL_COMMA.fullmatch(cell.strip()):
            expected = "expected a number with a decimal point"
        else:
            expected = "expected a finite number" + (", or nan where nothing was measured" if nothing else "")
        where = f"[{self.path}: line {line}, column {self.header[column]}]"
        raise InputError(f"{expected}, got {quoted(cell)} {where}")


def read_text(path: Path) -> str:
    """A file's text; InputError says why there is none. Line ends become `\\n`."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"no such file [{path}]") from None
    except IsADirectoryError:
        raise InputError(f"expected a CSV file, got a directory [{path}]") from None
    except UnicodeDecodeError:
        raise InputError(f"not UTF-8 text [{path}]") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error} [{path}]") from None
    if "\0" in text:
        raise InputError(f"expected a text file, got a binary one [{path}]")
    return text


def parse_table(path: Path, text: str) -> Table:
    """The table of a CSV file's text.

    Blank lines before the header are skipped, and comments there, which begin with # or %. Cells are separated by
    commas, semicolons or tabs: by what the header has most of.
    """
    lines = text.split("\n")
    start = next((k for k, line in enumerate(lines) if line.strip() and not is_comment(line)), len(lines))
    line = lines[start] if start < len(lines) else ""
    delimiter = delimiter_of(line) or ","
    try:
        header = next(csv.reader([line], delimiter=delimiter, strict=True), [])
    except csv.Error as error:
        raise InputError(f"not valid CSV: {error} [{path}: line {start + 1}]") from None
    names = tuple(cell.strip() for cell in header) if line else ()
    header_line = start + 1 if line else 1
    return Table(path, names, header_line, lines[start + 1 :], start + 2, delimiter)


def is_comment(line: str) -> bool:
    """Whether a line before the header is a comment."""
    return line.lstrip().startswith(("#", "%"))


def delimiter_of(line: str) -> str | None:
    """What separates the cells of a line: the one of `DELIMITERS` that it has most of; None when it has none."""
    bare = re.sub('"[^"]*"', "", line)
    best = max(DELIMITERS, key=bare.count)
    return best if best in bare else None


def is_number(cell: str) -> bool:
    """Whether a cell is a number, finite or not."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def table_text(header: Sequence[str], values: Sequence[Floats]) -> str:
    """CSV of arrays (n, …) side by side under a header; every bit is kept."""
    rows = np.hstack([array.reshape(len(array), math.prod(array.shape[1:])) for array in values])
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join([",".join(header), *lines, ""])


def _allowed(values: Floats, columns: Sequence[int], gaps: Collection[int]) -> bool:
    """Whether all values are finite, or NaN where a gap is allowed."""
    gap = np.array([index in gaps for index in columns], dtype=bool)
    return bool((np.isfinite(values) | (gap & np.isnan(values))).all())
