"""Poses in words and tables, for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, table
from magfem.units import format_quantity

if TYPE_CHECKING:
    from magfem.localization.recorded import Setup
    from magfem.samples.recording import Recording

_MOST_ROWS = 40  # of poses on a terminal


def pose_line(entry: dict[str, Any]) -> str:
    """One pose in one line, for people."""
    x, y, z = (f"{1e3 * value:.2f}" for value in entry["position"])
    axis = ", ".join(f"{value:.3f}" for value in entry["axis"])
    text = (
        f"t = {time_text(entry['time'])} s: "
        f"position ({x}, {y}, {z}) mm ± {_millimetres(entry['position_deviation'])} mm, "
        f"axis ({axis}) ± {_degrees(entry['axis_deviation'])} deg, {entry['frequency']:.6g} Hz"
    )
    if entry.get("faulty"):
        text += ", does not fit the windows before"
    branches = len(entry["branches"])
    return f"{text}, one of {branches} branches" if entry["ambiguous"] and branches > 1 else text


def time_text(time: float) -> str:
    """s, to a millisecond at least: clocks may count from 1970."""
    return f"{time:.9g}" if abs(time) < 1e5 else f"{time:.3f}"


def poses_text(data: dict[str, Any], setup: Setup, recording: Recording, files: Sequence[str]) -> str:
    """All poses of a recording as a table, with the branches where there is one pose alone; `files`: what was written.

    data: what the file of poses holds.
    """
    entries = data["poses"]
    sensors = len(recording.sensors)
    rows = [
        ("samples", f"{len(recording.times)} of {sensors} sensor{'s' * (sensors > 1)}{_rate(recording)}"),
        ("moment", f"{format_quantity(setup.rotor.moment, 'moment')} across the axis"),
        ("seen from", "the sensor" if list(setup.sensors) == [""] else "the frame of the sensors' card"),
    ]
    poses: list[tuple[str, ...]] = [
        ("time", "frequency", "x (mm)", "y", "z", "±", "axis", "± (deg)", "phase", "field", "SNR")
    ]
    poses += [_row(entry) for entry in entries[:_MOST_ROWS]]
    text = f"{data['model']} turns\n{listing(rows)}\n\n{table(poses)}"
    if len(entries) > _MOST_ROWS:
        text += f"\n  and {len(entries) - _MOST_ROWS} more"
    if len(entries) == 1 and len(entries[0]["branches"]) > 1:
        branches: list[tuple[str, ...]] = [("branches", "x (mm)", "y", "z", "axis", "phase", "log likelihood less")]
        best = entries[0]["log_likelihood"]
        for number, one in enumerate(entries[0]["branches"], 1):
            less = "" if one["log_likelihood"] is None else f"{max(best - one['log_likelihood'], 0.0):.1f}"
            branches.append((str(number), *_position_cells(one), _axis_cell(one), _phase_cell(one), less))
        text += f"\n\n{table(branches)}"
    notes = [f"{words}{_count(entries, words)}" for words in dict.fromkeys(w for e in entries for w in e["warnings"])]
    notes += [f"no pose at t = {time_text(one['time'])} s: {one['reason']}" for one in data["left_out"]]
    if files:
        notes.append(f"all of it in {' and '.join(files)}")
    return text + "".join(f"\n  {note}" for note in notes)


def _row(entry: dict[str, Any]) -> tuple[str, ...]:
    snr = entry["signal_to_noise"]
    return (
        f"{time_text(entry['time'])} s",
        f"{entry['frequency']:.6g} Hz",
        *_position_cells(entry),
        _millimetres(entry["position_deviation"]),
        _axis_cell(entry),
        _degrees(entry["axis_deviation"]),
        _phase_cell(entry),
        format_quantity(float(f"{entry['strength']:.3g}"), "flux density"),
        "" if snr is None else f"{snr:.1f} dB",
    )


def _position_cells(one: dict[str, Any]) -> tuple[str, str, str]:
    x, y, z = (f"{1e3 * value:.3f}" for value in one["position"])
    return x, y, z


def _axis_cell(one: dict[str, Any]) -> str:
    return f"({', '.join(f'{value:.4f}' for value in one['axis'])})"


def _phase_cell(one: dict[str, Any]) -> str:
    return f"{math.degrees(one['phase']):.2f} deg"


def _millimetres(deviation: float | None) -> str:
    return "?" if deviation is None else f"{1e3 * deviation:.2g}"


def _degrees(deviation: float | None) -> str:
    """An axis that may as well point anywhere has no deviation."""
    return "?" if deviation is None or deviation > math.pi / 2 else f"{math.degrees(deviation):.2g}"


def _rate(recording: Recording) -> str:
    return f", {1 / recording.interval:.4g} Hz" if recording.interval else ""


def _count(entries: Sequence[dict[str, Any]], words: str) -> str:
    count = sum(words in entry["warnings"] for entry in entries)
    return f" ({count} of {len(entries)} poses)" if len(entries) > 1 else ""
