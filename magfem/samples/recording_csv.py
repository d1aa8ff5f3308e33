"""Recordings from CSV: t,bx,by,bz in a file, or line by line as they come."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from magfem.errors import InputError
from magfem.samples.columns import Column, check_columns, find_column, missing
from magfem.samples.recording import Recording
from magfem.samples.table import Table, delimiter_of, is_comment, is_number, parse_table, read_text
from magfem.typing import Floats, Integers
from magfem.units import quoted

_HEADER = "the header t,bx,by,bz (s, T; or t_ms, bx_uT), or a column that stands for it, such as bx=raw_x_uT"
_AGREES = 0.01  # relative, how far a stated rate may be from that of the times


@dataclass(frozen=True)
class RecordingColumns:
    """Which columns of a table hold what. t is None where a rate says the times, sensor where there is one alone."""

    table: Table
    t: Column | None
    B: tuple[Column, Column, Column]
    sensor: int | None

    def readings(self, table: Table) -> tuple[Floats | None, Floats, list[str] | None]:
        """Times (n,) s, B (n, 3) T and names of sensors (n) of a table's rows. Raises InputError for a wrong cell."""
        used = [*self.B, self.t] if self.t else [*self.B]
        indices = [column.index for column in used if column.index is not None]
        cells = table.numbers(indices, gaps=indices[:3], empty=True)
        B = np.stack([column.in_si(cells[:, k]) for k, column in enumerate(self.B)], axis=1)
        times = self.t.in_si(cells[:, 3]) if self.t else None
        return times, B, None if self.sensor is None else table.words(self.sensor)

    def line(self, number: int, text: str) -> tuple[float | None, tuple[float, float, float], str]:
        """Time (s), B (T) and sensor of a single line that is not blank. Raises InputError that names the line."""
        times, B, sensors = self.readings(replace(self.table, lines=(text,), first_line=number))
        if not len(B):
            raise InputError(f"expected {len(self.table.header)} cells, got none [{self.table.path}: line {number}]")
        x, y, z = B[0].tolist()
        return None if times is None else float(times[0]), (x, y, z), "" if sensors is None else sensors[0]

    def separated_as(self, line: str) -> RecordingColumns:
        """The same columns, of rows whose cells are separated as in this one."""
        return replace(self, table=replace(self.table, delimiter=delimiter_of(line) or ","))


def recording_columns(
    table: Table, columns: Mapping[str, str] | None = None, rate: float | None = None
) -> RecordingColumns:
    """The columns of a recording under a table's header.

    columns: what stands for what, as in `read_samples`, for t, sensor, bx, by and bz.  rate: Hz, of the samples where
    there is no t. Raises InputError for a column that is missing, and times that neither of them tells.
    """
    mapping = check_columns(columns, recorded=True)
    if table.header and all(is_number(cell) for cell in table.header):
        raise InputError(
            f"there is no header: expected t,bx,by,bz or the like, got {quoted(','.join(table.header))} {_at(table)}"
        )
    field = [find_column(table, f"B{axis}", ("flux density",), mapping) for axis in "xyz"]
    x, y, z = (
        column if column else _raise(missing(table, f"b{axis}", _HEADER))
        for axis, column in zip("xyz", field, strict=True)
    )
    t = find_column(table, "t", ("time",), mapping)
    if t is None and rate is None:
        raise missing(table, "t", "times (t in s, or t_ms and so on), or the rate of the samples in Hz")
    return RecordingColumns(table, t, (x, y, z), _sensor_column(table, mapping.get("sensor")))


def read_recording(
    path: str | PathLike[str],
    columns: Mapping[str, str] | None = None,
    rate: float | None = None,
    header: str | None = None,
) -> Recording:
    """What three-axis sensors read over time, from a file.

    Parameters
    ----------
    path : a CSV file with the header `t,bx,by,bz` in s and T, and `sensor` with names or numbers where there are
        several. A unit in a header is understood (`t_ms`, `bx_uT`, `by [mT]`). An empty cell or `nan` in a column of B
        is a component that is missing; other columns are ignored.
    columns : what stands for what, such as `{"t": "clock_ms", "bx": "-raw_y_uT"}`, as in `read_samples`.
    rate : Hz; samples without t are 1/rate apart, for each sensor from t = 0 on.
    header : of a file without one.

    Raises
    ------
    InputError : in one sentence with file, line and column; also for times that do not increase.
    """
    path = Path(path)
    text = read_text(path)
    if header is None:
        table = parse_table(path, text)
        found = recording_columns(table, columns, rate)
    else:
        found = stated_columns(header, columns, rate)
        table = _headless(path, text, found)
    times, B, names = found.readings(table)
    if not len(B):
        raise InputError(f"there are no samples in it [{path}]")
    sensors = tuple(dict.fromkeys(names)) if names is not None else ("",)
    place = {name: k for k, name in enumerate(sensors)}
    index = np.array([place[name] for name in names or [""] * len(B)], dtype=np.int64)
    if times is None:
        assert rate is not None  # else recording_columns had complained
        times = _counted(index) / rate
    else:
        _check_increasing(table, times, index)
    order = np.argsort(times, kind="stable")
    recording = Recording(times[order], B[order], index[order], sensors, path.name)
    if found.t and rate is not None:
        check_rate(recording, rate, str(path))
    return recording


def stated_columns(
    header: str, columns: Mapping[str, str] | None = None, rate: float | None = None
) -> RecordingColumns:
    """The columns of a header that does not stand in the file, such as "t,bx,by,bz"."""
    return recording_columns(parse_table(Path("the columns stated"), header), columns, rate)


def check_rate(recording: Recording, rate: float, source: str) -> None:
    """Raise InputError when times say another rate (Hz) than the one stated."""
    if recording.interval and abs(recording.interval * rate - 1) > _AGREES:
        raise InputError(
            f"the rate is said to be {rate:g} Hz, and the times t are {recording.interval:g} s apart "
            f"({1 / recording.interval:g} Hz): leave the rate out [{source}]"
        )


def _headless(path: Path, text: str, columns: RecordingColumns) -> Table:
    """The table of a file that begins with its first row."""
    lines = text.split("\n")
    start = next((k for k, line in enumerate(lines) if line.strip() and not is_comment(line)), len(lines))
    table = columns.separated_as(lines[start] if start < len(lines) else "").table
    return replace(table, path=path, lines=lines[start:], first_line=start + 1)


def _sensor_column(table: Table, mapped: str | None) -> int | None:
    wanted = mapped if mapped is not None else "sensor"
    found = [k for k, cell in enumerate(table.header) if (cell if mapped else cell.lower()) == wanted]
    if len(found) > 1 or (mapped is not None and not found):
        raise InputError(f"there are {len(found) or 'no'} columns {quoted(wanted)} for sensor {_at(table)}")
    return found[0] if found else None


def _counted(index: Integers) -> Floats:
    """How many rows of the same sensor are before every row."""
    count = np.empty(len(index))
    for k in range(int(index.max()) + 1):
        own = index == k
        count[own] = np.arange(own.sum())
    return count


def _check_increasing(table: Table, times: Floats, index: Integers) -> None:
    for k in range(int(index.max()) + 1):
        rows = np.flatnonzero(index == k)
        wrong = np.flatnonzero(~(np.diff(times[rows]) > 0))
        if wrong.size:
            before, after = rows[wrong[0] : wrong[0] + 2]
            raise InputError(
                f"t must increase, got {times[after]:.12g} s after {times[before]:.12g} s "
                f"[{table.path}: line {table.line(int(after))}]"
            )


def _at(table: Table) -> str:
    return f"[{table.path}: line {table.header_line}]"


def _raise(error: InputError) -> Column:
    raise error
