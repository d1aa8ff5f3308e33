"""Readings of three-axis sensors over time, and windows of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.typing import Booleans, Floats, Integers, Vectors

MOST_WINDOWS = 1_000_000
MOST_EVEN = 10_000_000  # readings of a sensor, gaps filled
UNEVEN = 0.25  # of an interval
_ROUNDING = 1e-5  # of a step, by which windows begin earlier: a sample at 0.3 s must not fall before 3 × 0.1 s


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """What sensors read, one reading a row, in the order of time. Sensors need not read at the same times.

    times: (n,) s; those of every single sensor increase.
    B: (n, 3) T, in the frame of the sensor that read it; NaN where a component is missing.
    sensor: (n,) which of `sensors` it was.
    sensors: their names; a single one may be without.
    source: where it comes from, a file's name or words.
    """

    times: Floats
    B: Vectors
    sensor: Integers
    sensors: tuple[str, ...]
    source: str = ""

    def __repr__(self) -> str:
        return f"Recording({len(self.times)} readings, {len(self.sensors)} sensors, {self.source!r})"

    @property
    def interval(self) -> float:
        """s, the median time from one reading to the next of the same sensor; zero when none has read twice."""
        steps = [np.diff(self.times[self.sensor == k]) for k in range(len(self.sensors))]
        return float(np.median(np.concatenate(steps))) if any(map(len, steps)) else 0.0

    def subset(self, which: Booleans | slice) -> Recording:
        """The readings of a mask (n,) or a slice."""
        return replace(self, times=self.times[which], B=self.B[which], sensor=self.sensor[which])

    def side_by_side(self) -> tuple[Floats, Vectors, tuple[str, ...]]:
        """Times (m,), readings (s, m, 3) T and names of the s sensors that read anything; NaN where one did not."""
        times, place = np.unique(self.times, return_inverse=True)
        B = np.full((len(self.sensors), len(times), 3), np.nan)
        B[self.sensor, place] = self.B
        read = ~np.isnan(B).all(axis=(1, 2))
        return times, B[read], tuple(name for name, one in zip(self.sensors, read, strict=True) if one)

    def evenly(self) -> tuple[Floats, Vectors, tuple[str, ...]]:
        """As `side_by_side`, at times (m,) that are `interval` apart throughout: NaN where a gap was.

        Raises InputError for readings that are not on such times, and for gaps too long to be filled.
        """
        times, B, names = self.side_by_side()
        interval = self.interval
        if not interval or np.ptp(times) / interval > MOST_EVEN:
            raise InputError(f"{len(times)} readings in {np.ptp(times):g} s cannot be laid out evenly")
        place = np.rint((times - times[0]) / interval).astype(np.int64)
        off = times - times[0] - place * interval
        if np.abs(off).max() > UNEVEN * interval or np.any(np.diff(place) == 0):
            worst = int(np.argmax(np.abs(off)))
            raise InputError(
                f"the readings are not even: that at t = {times[worst]:.9g} s is {abs(off[worst]):.2g} s off times "
                f"{interval:g} s apart, the same for all sensors"
            )
        filled = np.full((len(B), int(place[-1]) + 1, 3), np.nan)
        filled[:, place] = B
        return times[0] + interval * np.arange(filled.shape[1]), filled, names


@dataclass(frozen=True)
class Windows:
    """Windows [first + k step, first + k step + length) of time, k = 0, 1, …; all in s.

    Raises InputError for lengths and steps that are not positive.
    """

    length: float
    step: float

    def __post_init__(self) -> None:
        for name, value in (("length", self.length), ("step", self.step)):
            if not 0 < value < np.inf:
                raise InputError(f"the {name} of windows must be a positive time, got {value:g} s")

    def edges(self, k: int | Integers) -> tuple[Any, Any]:
        """Where windows k begin and end, s after the first; a hair earlier, so that rounding moves no reading."""
        start = k * self.step - _ROUNDING * self.step
        return start, start + self.length

    def within(self, recording: Recording) -> list[tuple[float, Recording]]:
        """Beginning and readings of every window that the recording fills to its end; those without any are left out.

        A reading stands for the time until the next: 40 of them at 20 Hz fill 2 s. Raises InputError for a recording
        shorter than a window, and for more windows than `MOST_WINDOWS`.
        """
        times = recording.times
        first, end = float(times[0]), float(times[-1]) + recording.interval
        count = np.floor((end - first - self.length) / self.step + _ROUNDING) + 1
        if count < 1:
            raise InputError(f"{end - first:g} s of samples are less than a window of {self.length:g} s")
        if count > MOST_WINDOWS:
            raise InputError(
                f"a window every {self.step:g} s makes {count:.0f} of them between t = {first:g} s and {end:g} s: "
                "at most a million are possible"
            )
        low, high = (np.searchsorted(times - first, edge) for edge in self.edges(np.arange(int(count))))
        filled = np.flatnonzero(high > low).tolist()
        return [(first + k * self.step, recording.subset(slice(int(low[k]), int(high[k])))) for k in filled]


class Stream:
    """Readings as they come; every `add` gives the windows that are complete now.

    A window is complete when every sensor that has read before has read beyond its end, or one has by a tenth of its
    length. Windows without readings do not appear. When the time goes back by more than a window, the clock was set
    anew, and so are the windows.
    """

    def __init__(self, windows: Windows) -> None:
        self.windows = windows
        self.restarts = 0
        self._clear()

    def _clear(self) -> None:
        self._rows: list[tuple[float, str, tuple[float, float, float]]] = []
        self._latest: dict[str, float] = {}
        self._steps: list[float] = []  # of the first readings, to know their interval
        self._first: float | None = None
        self._next = 0  # number of the window that ends next

    def add(self, time: float, sensor: str, B: tuple[float, float, float]) -> list[tuple[float, Recording]]:
        """Beginning and readings of every window that this reading completes.

        Raises InputError, and leaves the reading out, when its time is not after the sensor's last one, or so large
        that windows cannot be told apart.
        """
        if not math.ulp(time) < 1e-3 * self.windows.step:
            raise InputError(f"t = {time:g} s is no time that windows every {self.windows.step:g} s can be cut at")
        last = self._latest.get(sensor)
        newest = max(self._latest.values(), default=time)
        if time < newest - self.windows.length:
            self._clear()
            self.restarts += 1
        elif last is not None and time <= last:
            raise InputError(f"t must increase, got {time:.12g} s after {last:.12g} s")
        elif last is not None and len(self._steps) < 1000:
            self._steps.append(time - last)
        if self._first is None:
            self._first = time
        self._latest[sensor] = time
        self._rows.append((time, sensor, B))
        clock = max(min(self._latest.values()), max(self._latest.values()) - 0.1 * self.windows.length)
        return self._complete(clock)

    def end(self) -> list[tuple[float, Recording]]:
        """The windows that the readings so far fill to their end, now that no more come."""
        if not self._latest:
            return []
        interval = float(np.median(self._steps)) if self._steps else 0.0
        return self._complete(max(self._latest.values()) + interval)

    def _complete(self, clock: float) -> list[tuple[float, Recording]]:
        assert self._first is not None
        first, windows = self._first, self.windows
        passed, found = clock - first, []
        while windows.edges(self._next)[1] <= passed:
            low, high = windows.edges(self._next)
            if rows := [row for row in self._rows if low <= row[0] - first < high]:
                found.append((first + self._next * windows.step, recording_of(rows)))
            self._next += 1
            self._rows = [row for row in self._rows if row[0] - first >= windows.edges(self._next)[0]]
            # After a gap on to the first window that holds a reading, however many are empty before it.
            earliest = min((row[0] for row in self._rows), default=clock) - first
            self._next = max(self._next, math.floor((earliest - windows.length) / windows.step) + 1)
        return found


def recording_of(rows: list[tuple[float, str, tuple[float, float, float]]], source: str = "") -> Recording:
    """Readings (time s, sensor's name, B in T) in the order of time; the sensors in that of their names."""
    rows = sorted(rows, key=lambda row: row[0])
    names = sorted({name for _, name, _ in rows})
    index = {name: k for k, name in enumerate(names)}
    return Recording(
        np.array([time for time, _, _ in rows]),
        np.array([B for _, _, B in rows], dtype=float).reshape(-1, 3),
        np.array([index[name] for _, name, _ in rows], dtype=np.int64),
        tuple(names),
        source,
    )


def joined(pieces: Sequence[Recording]) -> Recording:
    """Recordings that follow each other, as one."""
    names = sorted({name for one in pieces for name in one.sensors})
    sensor = [np.array([names.index(name) for name in one.sensors], dtype=np.int64)[one.sensor] for one in pieces]
    return Recording(
        np.concatenate([one.times for one in pieces]),
        np.concatenate([one.B for one in pieces]),
        np.concatenate(sensor),
        tuple(names),
        pieces[0].source,
    )
