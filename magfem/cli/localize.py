"""`magfem localize`: where a magnet is that turns, from samples of its field."""

from __future__ import annotations

import math
import re
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import listing, show_result, table
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.errors import ConvergenceError, InputError
from magfem.units import format_quantity, quantity, quoted

if TYPE_CHECKING:
    from magfem.localization import Pose
    from magfem.localization.recorded import Setup
    from magfem.samples.recording import Recording, Windows

LIVE_WINDOW = 2.0  # s
_MOST_ROWS = 40  # of poses on a terminal


def add(commands: CommandLine) -> None:
    """Add the command."""
    parser = commands.add(
        "localize",
        run,
        "where a magnet is that turns, from samples of its field",
        "Reads what one three-axis sensor or several saw of a magnet that turns about an axis across its moment, and\n"
        "writes where it is: position, axis, phase, covariance, and all branches that explain the samples. The file\n"
        "has the columns t,bx,by,bz in s and T (or t_ms, bx_uT and so on), in the sensor's frame, and sensor where\n"
        "there are several. Empty cells and nan are samples that are missing. Poses are in the sensor's frame, or in\n"
        "that of the card of sensors. With --samples - lines are read as they come, and every window that is\n"
        "complete gives a pose at once, until the input ends or Ctrl-C; a line that cannot be read is told and left\n"
        "out. A single sensor cannot tell where the magnet is from its mirror image: --near says which.",
        [
            "magfem localize --model rotor_1x3 --samples samples.csv -o poses.json",
            "magfem localize --model rotor_1x3 --samples s.csv --frequency 0.5 --near '20 5 30 mm' --window 2",
            "magfem localize --model rotor_1x3 --samples s.csv --sensors array.toml --frequency 0.5 --frequency 0.8",
            "magfem localize --model rotor_1x3 --samples s.csv --sensors array.toml --window 2 --track -o track.json",
            "logger | magfem localize --model rotor_1x3 --samples - --columns t_ms,bx_uT,by_uT,bz_uT --json",
        ],
    )
    parser.add_argument("--model", metavar="MODEL", required=True, help="field model of the magnet: a name or a path")
    parser.add_argument("--samples", metavar="S.csv", required=True, help="samples; - for lines on standard input")
    parser.add_argument("-o", "--output", metavar="POSES.json", help="the poses")
    parser.add_argument("--picture", metavar="FILE.png", help="signal, spectrum and poses; not of live samples")
    reading = parser.add_argument_group("samples")
    reading.add_argument("--rate", metavar="HZ", help="of the samples, where there is no column t")
    reading.add_argument("--columns", metavar="NAMES", help="the header, where there is none: t,bx,by,bz")
    reading.add_argument("--column", metavar="NAME=COLUMN", action="append", help="what stands for t, bx, by, ...")
    turning = parser.add_argument_group("the magnet")
    turning.add_argument(
        "--frequency", metavar="HZ", action="append", help="of its rotation, once for every motor (default: found)"
    )
    turning.add_argument(
        "--drift", action="store_true", help="the frequency changes steadily, from near the stated one"
    )
    turning.add_argument(
        "--rotation-axis", metavar="AXIS", help="in the model's frame: x, y, z or '0 1 1' (default: z)"
    )
    turning.add_argument(
        "--near",
        metavar="POSITION",
        action="append",
        help="where it is about at the start, such as '20 5 30 mm'; for every motor",
    )
    seen = parser.add_argument_group("sensors")
    seen.add_argument(
        "--sensors", metavar="SENSORS.toml", help="card of several sensors: where they are, how they read"
    )
    seen.add_argument("--noise", metavar="QUANTITY", help="standard deviation of a sample, such as '3 uT'")
    seen.add_argument("--resolution", metavar="QUANTITY", help="step of the readings, such as '0.1 uT'")
    seen.add_argument("--saturation", metavar="QUANTITY", help="readings at or beyond it are not believed")
    windows = parser.add_argument_group("windows")
    windows.add_argument(
        "--window", metavar="SECONDS", help=f"length of samples for a pose (default: all of them; {LIVE_WINDOW:g} live)"
    )
    windows.add_argument("--step", metavar="SECONDS", help="from one window to the next (default: the window)")
    windows.add_argument(
        "--track", action="store_true", help="all windows as one track of a magnet that moves smoothly"
    )


def run(options: Namespace) -> int:
    """Read, localize, write; or all the time while samples come."""
    output = output_file(options.output, [".json"]) if options.output else None
    picture = output_file(options.picture, [".png"]) if options.picture else None
    if options.samples == "-":
        from magfem.cli.live import localize_live

        for option in ("picture", "track"):
            if getattr(options, option):
                raise InputError(f"--{option} is for samples in a file, not for live ones")
        return localize_live(options, output)
    for option in ("step", "track"):
        if getattr(options, option) and not options.window:
            raise InputError(f"--{option} is for windows: state --window as well")
    from magfem.files import write_bytes, write_json
    from magfem.localization.poses_file import poses_to_dict
    from magfem.samples import parse_columns
    from magfem.samples.recording_csv import read_recording

    rate = stated_rate(options)
    windows = stated_windows(options) if options.window else None
    recording = read_recording(
        options.samples, parse_columns(options.column or [], recorded=True), rate, options.columns
    )
    setup, near = stated_setup(options)
    for name in recording.sensors:
        setup.sensor(name)
    setup.check_rate(recording)
    first, last = float(recording.times[0]), float(recording.times[-1])
    if windows is None:
        pieces, length = [(first, recording)], last - first
    else:
        pieces, length = windows.within(recording), windows.length
    located = Located(setup, near)
    if options.track:
        assert windows is not None  # refused above
        located.track(recording, windows)
        if picture:
            located.last = Located(setup, [located.entries[-1]["position"]]).poses(pieces[-1][1])[0]
    else:
        for start, piece in pieces:
            located.add(piece, start, length, fatal=len(pieces) == 1)
        if not located.entries:
            raise InputError(f"no window gives a pose: {located.left_out[0]['reason']} [{options.samples}]")
    data = poses_to_dict(located.entries, options.model, recording.source, setup.sensors, located.left_out)
    drawn = None
    if picture:
        from magfem.report.localization_pictures import localization_picture

        drawn = localization_picture(recording, setup, located.entries, located.last).png
    if output:
        write_json(output, data)
    if picture and drawn is not None:
        write_bytes(picture, drawn)
    show_result(options, _text(data, setup, recording, [one for one in (options.output, options.picture) if one]), data)
    return 0


class Located:
    """Poses of one window after the other, as plain data; what gave none with the reason.

    With a prior, every window takes the branch nearest to the pose before it.
    """

    def __init__(self, setup: Setup, near: Sequence[Any] | None) -> None:
        self.setup, self.near = setup, near
        self.entries: list[dict[str, Any]] = []
        self.left_out: list[dict[str, Any]] = []
        self.last: tuple[Pose, ...] = ()

    def add(self, piece: Recording, start: float, length: float, fatal: bool = False) -> list[dict[str, Any]]:
        """The poses of a window, one for every motor; none when it gives none, or the error itself if `fatal`."""
        from magfem.localization.poses_file import pose_to_dict

        time = start + length / 2
        try:
            poses, names = self.poses(piece)
        except (InputError, ConvergenceError) as error:
            if fatal:
                raise
            self.left_out.append({"time": time, "reason": str(error)})
            return []
        found = [pose_to_dict(pose, time, (start, start + length), names) for pose in poses]
        self.entries += found
        self.last = poses
        if self.near is not None:
            self.near = poses
        return found

    def poses(self, piece: Recording) -> tuple[tuple[Pose, ...], tuple[str, ...]]:
        """The poses of a window, and the names of the sensors that took part. Raises InputError, ConvergenceError."""
        from magfem.localization.recorded import localize_recording

        return localize_recording(piece, self.setup, self.near)

    def track(self, recording: Recording, windows: Windows) -> None:
        """All windows of a recording as one track. Raises InputError, ConvergenceError."""
        from magfem.localization.poses_file import track_to_dicts
        from magfem.localization.recorded import track_recording

        length = windows.length
        near = self.near[0] if self.near else None
        found, starts, missed, names = track_recording(recording, self.setup, length, windows.step, near)
        self.entries = track_to_dicts(found, starts, length, names)
        self.left_out = [{"time": start + length / 2, "reason": "too few samples"} for start in missed.tolist()]


def stated_setup(options: Namespace) -> tuple[Setup, list[Any] | None]:
    """What turns and what sees it, and where it is about. Raises InputError for options that say nonsense."""
    from magfem.localization.recorded import Setup
    from magfem.localization.rotor import as_rotor
    from magfem.localization.sensor import Sensor
    from magfem.localization.sensors_card import read_sensors

    frequencies = tuple(_positive(text, "frequency", "--frequency") for text in options.frequency or [])
    if len(set(frequencies)) < len(frequencies):
        raise InputError("--frequency is given twice with the same value: every motor has its own")
    if options.drift and len(frequencies) > 1:
        raise InputError("--drift is for a single motor, and --frequency is given for several")
    near = [_position(text) for text in options.near or []]
    if near and len(near) != max(1, len(frequencies)):
        raise InputError(f"--near is given {len(near)} times, and there are {max(1, len(frequencies))} motors")
    qualities = {
        key: _field(getattr(options, key), f"--{key}")
        for key in ("noise", "resolution", "saturation")
        if getattr(options, key) is not None
    }
    if options.sensors:
        if qualities:
            raise InputError(f"--{next(iter(qualities))} is for a single sensor: the card of sensors says it of each")
        sensors = read_sensors(Path(options.sensors), options.sensors)
    else:
        sensors = {"": Sensor(**qualities)}
    axis = _axis(options.rotation_axis) if options.rotation_axis else (0.0, 0.0, 1.0)
    return Setup(as_rotor(options.model, axis), frequencies, sensors, options.drift), near or None


def stated_rate(options: Namespace) -> float | None:
    """--rate in Hz, or None."""
    return None if options.rate is None else _positive(options.rate, "frequency", "--rate")


def stated_windows(options: Namespace) -> Windows:
    """--window and --step, the live defaults where they are not given."""
    from magfem.samples.recording import Windows

    length = LIVE_WINDOW if options.window is None else _positive(options.window, "time", "--window")
    return Windows(length, length if options.step is None else _positive(options.step, "time", "--step"))


def pose_line(entry: dict[str, Any]) -> str:
    """One pose in one line, for people."""
    x, y, z = (f"{1e3 * value:.2f}" for value in entry["position"])
    axis = ", ".join(f"{value:.3f}" for value in entry["axis"])
    text = (
        f"t = {entry['time']:.6g} s: position ({x}, {y}, {z}) mm ± {_millimetres(entry['position_deviation'])} mm, "
        f"axis ({axis}) ± {_degrees(entry['axis_deviation'])} deg, {entry['frequency']:.6g} Hz"
    )
    others = len(entry["branches"]) - 1
    return f"{text}, one of {others + 1} branches" if entry["ambiguous"] and others else text


def _text(data: dict[str, Any], setup: Setup, recording: Recording, files: Sequence[str]) -> str:
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
    notes += [f"no pose at t = {one['time']:.6g} s: {one['reason']}" for one in data["left_out"]]
    if files:
        notes.append(f"all of it in {' and '.join(files)}")
    return text + "".join(f"\n  {note}" for note in notes)


def _row(entry: dict[str, Any]) -> tuple[str, ...]:
    snr = entry["signal_to_noise"]
    return (
        f"{entry['time']:.6g} s",
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


def _positive(text: str, dimension: str, option: str) -> float:
    """A positive number in SI, with its unit or without."""
    try:
        value = float(text)
    except ValueError:
        try:
            value = quantity(text, dimension)
        except InputError as error:
            raise InputError(f"{option}: {error}") from None
    if not (math.isfinite(value) and value > 0):
        unit = {"frequency": "Hz", "time": "s"}[dimension]
        raise InputError(f"{option} must be a positive number of {unit}, got {quoted(text)}")
    return value


def _field(text: str, option: str) -> float:
    try:
        return quantity(text, "flux density")
    except InputError as error:
        raise InputError(f"{option}: {error}") from None


def _position(text: str) -> tuple[float, float, float]:
    """Three lengths (m), each with its unit, or one unit for all."""
    words = [word for word in re.split(r"[,\s]+", text.strip()) if word]
    if len(words) == 4:
        words = [f"{word} {words[3]}" for word in words[:3]]
    elif len(words) == 6:
        words = [f"{number} {unit}" for number, unit in zip(words[::2], words[1::2], strict=True)]
    if len(words) != 3:
        raise InputError(f"--near must be three lengths, such as '20 5 30 mm' or '20mm, 5mm, 3cm', got {quoted(text)}")
    try:
        x, y, z = (quantity(word, "length") for word in words)
    except InputError as error:
        raise InputError(f"--near: {error}") from None
    return x, y, z


def _axis(text: str) -> tuple[float, float, float]:
    """Three numbers, or the name of an axis."""
    named = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    words = [word for word in re.split(r"[,\s]+", named.get(text.strip().lower(), text).strip()) if word]
    try:
        x, y, z = map(float, words)
    except ValueError:
        raise InputError(
            f"--rotation-axis must be x, y, z or three numbers such as '0 1 1', got {quoted(text)}"
        ) from None
    return x, y, z
