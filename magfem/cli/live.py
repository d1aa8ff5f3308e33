"""`magfem localize --samples -`: poses while samples come, line by line."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from magfem.cli.localize import stated_rate, stated_setup, stated_windows
from magfem.cli.located import Located
from magfem.cli.pose_text import pose_line, time_text
from magfem.errors import InputError
from magfem.units import one_line

if TYPE_CHECKING:
    from magfem.localization.live_track import LiveTrack
    from magfem.samples.recording import Recording, Stream
    from magfem.samples.recording_csv import RecordingColumns

_INPUT = Path("standard input")
MOST_TOLD = 10
"""Lines left out in a row that are told one by one: a wire that garbles all of them would fill the terminal."""


def localize_live(options: Namespace, output: Path | None) -> int:
    """A pose for every complete window of the lines on standard input, printed at once; at the end all in a file.

    Lines that cannot be read, and windows that give no pose, are told on stderr and left out. Ctrl-C ends it as it
    ends every command, with the file written. Raises InputError for options and headers that say nonsense, and when
    the input ends before there is a pose.
    """
    import numpy as np

    from magfem.files import write_json
    from magfem.localization.poses_file import poses_to_dict
    from magfem.samples.recording import Stream

    stream, rate = Stream(stated_windows(options)), stated_rate(options)
    setup, near = stated_setup(options)
    setup.rotor.quadratures(np.array([[0.0, 0.0, 1.0]]))  # what is compiled on first use is ready before samples come
    live = _Live(options, stream, Located(setup, near), keep=output is not None)
    try:
        live.read(_lines(), rate)
    finally:
        if output and live.located.entries:
            data = poses_to_dict(live.located.entries, options.model, str(_INPUT), setup.sensors, live.located.left_out)
            write_json(output, {**data, "lines_left_out": live.lines_left_out})
    if not live.poses:
        reason = live.reason or f"fewer samples than a window of {stream.windows.length:g} s"
        raise InputError(f"the input ended without a pose: {reason} [{_INPUT}]")
    if not options.quiet:
        print(f"{live.poses} poses, {live.lines_left_out} lines left out", file=sys.stderr)
    return 0


class _Live:
    """The loop from lines to poses, and what it counts."""

    def __init__(self, options: Namespace, stream: Stream, located: Located, keep: bool) -> None:
        self.options, self.stream, self.located, self.keep = options, stream, located, keep
        self.track = self._new_track()
        self.poses = self.lines_left_out = 0
        self.reason = ""  # why a window gave no pose
        self._rate_checked = False
        self._in_a_row = 0  # lines left out since one could be read

    def read(self, lines: Iterator[tuple[int, str]], rate: float | None) -> None:
        """All lines, to the end of the input."""
        columns = _columns(self.options, lines, rate)
        if not self.options.quiet:
            step = self.stream.windows.step
            print(f"reading {_INPUT}: a pose every {step:g} s of samples", file=sys.stderr, flush=True)
        rows = restarts = 0
        for number, text in lines:
            if not text.strip():
                continue
            if self.options.columns and not rows:
                columns = columns.separated_as(text)
            rows += 1
            try:
                t, B, sensor = columns.line(number, text)
            except InputError as error:
                self._leave_out(str(error))
                continue
            try:
                self.located.setup.sensor(sensor)
                # With a rate every line counts, so that the clock goes on over those that cannot be read.
                complete = self.stream.add((rows - 1) / (rate or 1.0) if t is None else t, sensor, B)
            except InputError as error:
                self._leave_out(f"{error} [{_INPUT}: line {number}]")
                continue
            if self.stream.restarts > restarts:
                restarts = self.stream.restarts
                _complain(f"the time went back, windows begin anew [{_INPUT}: line {number}]")
                self.track = self._new_track()
            self._in_a_row = 0
            self._localize(complete)
        self._localize(self.stream.end())

    def _localize(self, complete: list[tuple[float, Recording]]) -> None:
        """Poses of complete windows, printed."""
        for start, piece in complete:
            if not self._rate_checked:
                self.located.setup.check_rate(piece)
                self._rate_checked = True
            missed = len(self.located.left_out)
            if self.track is None:
                found = self.located.add(piece, start, self.stream.windows.length)
            else:
                found = self.located.follow(piece, start, self.track)
            for entry in found:
                self.poses += 1
                self._print(json.dumps(entry, allow_nan=False), pose_line(entry))
            for one in self.located.left_out[missed:]:
                self.reason = one["reason"]
                _complain(f"no pose at t = {time_text(one['time'])} s: {self.reason}")
            if not self.keep:  # it may run for days
                self.located.entries.clear()
                self.located.left_out.clear()

    def _new_track(self) -> LiveTrack | None:
        from magfem.localization.live_track import LiveTrack

        if not self.options.track:
            return None
        near = self.located.near[0] if self.located.near else None
        return LiveTrack(self.located.setup, self.stream.windows, near)

    def _print(self, data: str, text: str) -> None:
        if self.options.json:
            print(data, flush=True)
        if not (self.options.json and self.options.quiet):
            print(text, file=sys.stderr if self.options.json else sys.stdout, flush=True)

    def _leave_out(self, why: str) -> None:
        self.lines_left_out += 1
        self._in_a_row += 1
        if self._in_a_row <= MOST_TOLD:
            _complain(f"line left out: {why}")
        elif self._in_a_row == MOST_TOLD + 1:
            _complain("more lines are left out untold, until one can be read")


def _lines() -> Iterator[tuple[int, str]]:
    """Lines as they come, with their numbers; what is no UTF-8 in them is replaced, as a wire may garble anything."""
    for number, line in enumerate(sys.stdin.buffer, 1):
        yield number, line.decode("utf-8", errors="replace").lstrip("\ufeff").rstrip("\r\n")


def _columns(options: Namespace, lines: Iterator[tuple[int, str]], rate: float | None) -> RecordingColumns:
    """The columns of --columns, or of the header on the first line that is neither blank nor a comment."""
    from magfem.samples import parse_columns
    from magfem.samples.recording_csv import recording_columns, stated_columns
    from magfem.samples.table import is_comment, parse_table

    mapping = parse_columns(options.column or [], recorded=True)
    if options.columns:
        columns = stated_columns(options.columns, mapping, rate)
        columns = replace(columns, table=replace(columns.table, path=_INPUT))
    else:
        number, text = next(((n, line) for n, line in lines if line.strip() and not is_comment(line)), (1, ""))
        columns = recording_columns(replace(parse_table(_INPUT, text), header_line=number), mapping, rate)
    if columns.t is None and columns.sensor is not None:
        raise InputError(f"live samples of several sensors need times: a column t, not a rate [{_INPUT}]")
    return columns


def _complain(text: str) -> None:
    print(f"magfem: {one_line(text)}", file=sys.stderr, flush=True)
