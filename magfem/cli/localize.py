"""`magfem localize`: where a magnet is that turns, from samples of its field."""

from __future__ import annotations

import math
import re
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from magfem.cli.console import show_result
from magfem.cli.located import Located
from magfem.cli.outputs import output_file
from magfem.cli.parser import CommandLine
from magfem.cli.pose_text import poses_text
from magfem.errors import InputError
from magfem.units import quantity, quoted

if TYPE_CHECKING:
    from magfem.localization.recorded import Setup
    from magfem.samples.recording import Windows

LIVE_WINDOW = 2.0  # s


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
        "--swing", action="store_true", help="the magnet may turn unevenly, swinging twice a turn: find it and undo it"
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
        "--track",
        action="store_true",
        help="a magnet that moves smoothly: every window is judged by the others; live, by those before it",
    )


def run(options: Namespace) -> int:
    """Read, localize, write; or all the time while samples come."""
    output = output_file(options.output, [".json"]) if options.output else None
    picture = output_file(options.picture, [".png"]) if options.picture else None
    if options.samples == "-":
        from magfem.cli.live import localize_live

        if options.picture:
            raise InputError("--picture is for samples in a file, not for live ones")
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
    located = Located(setup, near)
    if windows is None:
        first, last = float(recording.times[0]), float(recording.times[-1])
        located.add(recording, first, last - first, fatal=True)
    elif options.track:
        located.track(recording, windows)
        if picture:
            located.look_again(recording)
    else:
        pieces = windows.within(recording)
        for start, piece in pieces:
            located.add(piece, start, windows.length, fatal=len(pieces) == 1)
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
    files = [one for one in (options.output, options.picture) if one]
    show_result(options, poses_text(data, setup, recording, files), data)
    return 0


def stated_setup(options: Namespace) -> tuple[Setup, list[Any] | None]:
    """What turns and what sees it, and where it is about. Raises InputError for options that say nonsense."""
    from magfem.localization.recorded import Setup
    from magfem.localization.rotor import as_rotor
    from magfem.localization.sensor import Sensor
    from magfem.localization.sensors_card import read_sensors

    frequencies = tuple(_positive(text, "frequency", "--frequency") for text in options.frequency or [])
    if len(set(frequencies)) < len(frequencies):
        raise InputError("--frequency is given twice with the same value: every motor has its own")
    for name in ("drift", "swing"):
        if getattr(options, name) and len(frequencies) > 1:
            raise InputError(f"--{name} is for a single motor, and --frequency is given for several")
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
    return Setup(as_rotor(options.model, axis), frequencies, sensors, options.drift, options.swing), near or None


def stated_rate(options: Namespace) -> float | None:
    """--rate in Hz, or None."""
    return None if options.rate is None else _positive(options.rate, "frequency", "--rate")


def stated_windows(options: Namespace) -> Windows:
    """--window and --step, the live defaults where they are not given."""
    from magfem.samples.recording import Windows

    length = LIVE_WINDOW if options.window is None else _positive(options.window, "time", "--window")
    return Windows(length, length if options.step is None else _positive(options.step, "time", "--step"))


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
