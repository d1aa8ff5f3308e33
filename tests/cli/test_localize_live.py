"""`magfem localize --samples -`: lines as they come, at once and slowly, garbled ones, and how it ends."""

from __future__ import annotations

import contextlib
import io
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli.turning_dipole import EARTH, Turning, write_dipole, write_samples

from magfem.cli import main

ROOT = Path(__file__).parents[2]
TRUE = Turning([0.02, 0.005, 0.03], [0.3, -0.2, 1.0])
T = np.arange(600) / 20.0
HEADER = "t,bx_uT,by_uT,bz_uT"
LIVE = ["localize", "--model", "dipole.json", "--samples", "-", "--near", "20 5 30 mm", "--noise", "0.3 uT"]

Feed = Callable[..., tuple[int, str, str]]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder with a dipole's model."""
    monkeypatch.chdir(tmp_path)
    write_dipole(Path("dipole.json"))
    return tmp_path


@pytest.fixture
def feed(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Feed:
    """Run the command on a whole input; its exit code, what it prints on stdout and on stderr."""

    def run(text: str | bytes, *words: str, model_only: bool = False) -> tuple[int, str, str]:
        data = text if isinstance(text, bytes) else text.encode()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        code = main([*(LIVE[:5] if model_only else LIVE), *words])
        read = capsys.readouterr()
        return code, read.out, read.err

    return run


def lines(t: Any = T, frequency: float = 0.5) -> list[str]:
    B = Turning(TRUE.position, TRUE.axis, TRUE.phase, frequency).field([0, 0, 0], np.asarray(t)) + EARTH
    return [f"{a!r},{x!r},{y!r},{z!r}" for a, (x, y, z) in zip(np.asarray(t).tolist(), (1e6 * B).tolist(), strict=True)]


def joined(rows: list[str], header: str = HEADER) -> str:
    return "\n".join([header, *rows] if header else rows) + "\n"


def objects(out: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in out.splitlines()]


def test_a_line_for_every_window(feed: Feed) -> None:
    """Half a minute is fifteen windows of two seconds, each the known pose; a phase that does not jump."""
    code, out, err = feed(joined(lines()), "--json", "-q", "--frequency", "0.5")
    poses = objects(out)
    assert code == 0 and err == ""
    assert [pose["time"] for pose in poses] == pytest.approx(np.arange(1, 30, 2))
    for pose in poses:
        assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
        assert pose["phase"] == pytest.approx(TRUE.phase, abs=1e-5)


def test_the_same_as_from_a_file(feed: Feed, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_samples(Path("s.csv"), T, TRUE.field([0, 0, 0], T))
    words = ["--window", "3", "--step", "1.5", "--json", "-q"]
    _, out, _ = feed(Path("s.csv").read_text(), *words, "-o", "live.json")
    assert main([*LIVE[:4], "s.csv", *LIVE[5:], *words]) == 0
    file = json.loads(capsys.readouterr().out)
    assert objects(out) == file["poses"]
    live = json.loads(Path("live.json").read_text())
    assert live["poses"] == file["poses"] and live["lines_left_out"] == 0
    assert (live["format"], live["version"]) == ("magfem-poses", 1)


def test_lines_for_people(feed: Feed) -> None:
    code, out, err = feed(joined(lines()))
    assert code == 0 and len(out.splitlines()) == 15
    assert out.startswith("t = 1 s: position (20.00, 5.00, 30.00) mm ±")
    assert "reading standard input: a pose every 2 s" in err and "15 poses, 0 lines left out" in err


def test_garbled_lines_are_told_and_left_out(feed: Feed) -> None:
    rows = lines()
    rows[10] = "0.5,1,2"
    rows[20] = "1.0,1,2,\xfe\xffgarbage"
    rows[30] = rows[29]
    rows[41] = '"'
    rows[50:50] = ["", HEADER, "   "]
    data = ("# a logger\n\n" + joined(rows)).encode("latin-1")
    code, out, err = feed(data, "--json", "-q", "-o", "poses.json")
    assert code == 0
    told = err.splitlines()
    assert len(told) == 5 and all(line.startswith("magfem: line left out: ") for line in told)
    places = [14, 24, 34, 45, 55]  # three lines stand before the samples
    assert all(f"[standard input: line {n}" in line for n, line in zip(places, told, strict=True))
    assert "expected 4 cells" in told[0] and "t must increase, got 1.45 s after 1.45 s" in told[2]
    assert json.loads(Path("poses.json").read_text())["lines_left_out"] == 5
    assert len(objects(out)) == 15
    assert all(pose["position"] == pytest.approx(TRUE.position, abs=1e-7) for pose in objects(out))


def test_a_wire_that_garbles_everything_does_not_fill_the_terminal(feed: Feed) -> None:
    rows = lines()
    rows[100:400] = ["?"] * 300
    code, out, err = feed(joined(rows), "-q", "-o", "poses.json")
    assert code == 0 and len(out.splitlines()) == 8  # the five seconds after the gap begin within a window
    told = err.splitlines()
    assert len([line for line in told if "line left out" in line]) == 10 and "left out untold" in told[10]
    assert json.loads(Path("poses.json").read_text())["lines_left_out"] == 300


CARD = """
kind = "sensors"
[[sensors]]
name = "left"
position = ["-10 mm", "0 mm", "0 mm"]
noise = "3 uT"
[[sensors]]
name = "right"
position = ["10 mm", "0 mm", "0 mm"]
noise = "3 uT"
"""


def moving(count: int, begin: float = 0.0) -> tuple[list[str], list[Turning]]:
    """Lines of two sensors that see a magnet on an arc about 30 mm away, in windows of 2 s, and where it was."""
    path = [
        Turning([0.01 * np.sin(k / 10), 0.008 * np.cos(k / 12), 0.028 + 1e-4 * k], [0.3, np.sin(k / 15), 1.0])
        for k in range(count)
    ]
    rng, rows = np.random.default_rng(1), []
    for k, one in enumerate(path):
        t = 2.0 * k + np.arange(40) / 20
        seen = [one.field(place, t) + 3e-6 * rng.normal(size=(40, 3)) for place in ([-0.01, 0, 0], [0.01, 0, 0])]
        for i in range(40):
            for name, B in zip(("left", "right"), seen, strict=True):
                rows.append(f"{begin + t[i]:.3f},{name}," + ",".join(f"{1e6 * b:.2f}" for b in B[i]))
    return rows, path


def test_a_live_track_is_nearer_than_its_windows(feed: Feed, here: Path) -> None:
    """Filtered by the windows before, with the process noise that they tell, no prior, and covariances that tell how
    near; a window that something else disturbed is named and moves nothing far; a clock set back begins anew.
    """
    Path("pair.toml").write_text(CARD)
    rows, path = moving(40)
    disturbed = 25
    for i in range(80 * disturbed, 80 * disturbed + 80):
        t, name, *B = rows[i].split(",")
        shaken = [f"{float(b) + 150 * np.sin(4 * float(t)):.2f}" for b in B]
        rows[i] = ",".join([t, name, *shaken])
    text = joined(rows, "t,sensor,bx_uT,by_uT,bz_uT")
    words = ["--sensors", "pair.toml", "--frequency", "0.5", "--json", "-q"]

    def off(out: str) -> Any:
        poses = objects(out)
        assert len(poses) == 40
        return np.array([pose["position"] for pose in poses]) - [one.position for one in path]

    _, alone, _ = feed(text, *words, model_only=True)
    code, out, err = feed(text, *words, "--track", model_only=True)
    assert code == 0 and err == ""
    poses = objects(out)
    assert [k for k, pose in enumerate(poses) if pose["faulty"]] == [disturbed]
    later = np.r_[8:disturbed, disturbed + 1 : 40]

    def size(errors: Any) -> float:
        return float(np.sqrt((errors[later] ** 2).sum(axis=1).mean()))

    assert size(off(out)) < 0.75 * size(off(alone)) and np.linalg.norm(off(out)[disturbed]) < 3e-3
    normalised = [
        off(out)[k] @ np.linalg.solve(np.array(poses[k]["covariance"])[:3, :3], off(out)[k]) / 3 for k in later
    ]
    assert 0.5 < np.mean(normalised) < 1.7
    axes = np.array([pose["axis"] for pose in poses])
    moments = np.array([pose["moment_direction"] for pose in poses])
    assert np.abs(np.einsum("ki,ki->k", axes, moments)).max() < 1e-9
    again = joined(rows[: 80 * 20] + moving(5, 1.0)[0], "t,sensor,bx_uT,by_uT,bz_uT")
    code, out, err = feed(again, *words, "--track", model_only=True)
    assert code == 0 and "the time went back" in err and len(objects(out)) == 24  # one window was not over


def test_with_a_rate_the_clock_goes_on_over_garbled_lines(feed: Feed) -> None:
    """Were they not counted, the rotation would seem to jump, and the position with it."""
    rows = [line.split(",", 1)[1] for line in lines()]
    rows[100:110] = ["?"] * 10
    code, out, err = feed(joined(rows, ""), "--columns", "bx_uT,by_uT,bz_uT", "--rate", "20", "--json", "-q")
    assert code == 0 and len(err.splitlines()) == 10 and len(objects(out)) == 15
    assert all(pose["position"] == pytest.approx(TRUE.position, abs=1e-7) for pose in objects(out))


def test_columns_without_a_header_in_any_delimiter(feed: Feed) -> None:
    rows = [line.replace(",", "\t") for line in lines(T[:41])]
    code, out, err = feed(joined(rows, ""), "--columns", HEADER, "--json", "-q")
    assert code == 0 and err == "" and objects(out)[0]["position"] == pytest.approx(TRUE.position, abs=1e-8)


def test_a_clock_set_back_begins_anew(feed: Feed) -> None:
    code, out, err = feed(joined([*lines(T[:90] + 1000.0), *lines(T[:90])]), "--json", "-q", "-o", "p.json")
    assert code == 0 and [pose["time"] for pose in objects(out)] == pytest.approx([1001.0, 1003.0, 1.0, 3.0])
    assert err == "magfem: the time went back, windows begin anew [standard input: line 92]\n"


def test_a_gap_and_a_window_without_a_pose(feed: Feed) -> None:
    """Ten seconds are missing; the first window after them has but three samples."""
    t = np.concatenate([T[:80], T[277:360]])
    code, out, err = feed(joined(lines(t)), "--json", "-q", "--frequency", "0.5")
    assert code == 0 and [pose["time"] for pose in objects(out)] == pytest.approx([1.0, 3.0, 15.0, 17.0])
    assert err == (
        "magfem: no pose at t = 13 s: 3 samples do not determine the static field, cosine and sine: 4 times are the "
        "least\n"
    )


def test_several_sensors_one_of_them_unknown(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("pair.toml").write_text(
        'kind = "sensors"\n[[sensors]]\nname = 1\nposition = ["-10 mm", "0 mm", "0 mm"]\nnoise = "1 uT"\n'
        '[[sensors]]\nname = 2\nposition = ["10 mm", "0 mm", "0 mm"]\nnoise = "1 uT"\n'
    )
    rows = []
    for name, x in (("1", -0.01), ("2", 0.01)):
        B = 1e6 * TRUE.field([x, 0, 0], T[:200])
        rows += [(t, name, *b) for t, b in zip(T[:200].tolist(), B.tolist(), strict=True)]
    text = [",".join(map(str, row)) for row in sorted(rows)]  # in the order of time, one after the other
    text.insert(100, "2.5,3,1,2,3")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(joined(text, "t,sensor,bx_uT,by_uT,bz_uT").encode())))
    code = main([*LIVE[:5], "--sensors", "pair.toml", "--json", "-q"])
    read = capsys.readouterr()
    assert code == 0 and 'there is no sensor "3": known are "1", "2" [standard input: line 102]' in read.err
    assert len(objects(read.out)) == 5
    assert all(pose["position"] == pytest.approx(TRUE.position, abs=1e-8) for pose in objects(read.out))
    assert all(not pose["ambiguous"] for pose in objects(read.out))


@pytest.mark.parametrize(
    ("text", "words", "fragment"),
    [
        ("", "", "column bx is missing"),
        ("t,by,bz\n", "", "column bx is missing: expected the header t,bx,by,bz"),
        ("# x\n\n1,2,3,4\n", "", "there is no header"),
        ("bx,by,bz\n", "", "column t is missing"),
        ("sensor,bx,by,bz\n", "--rate 20", "live samples of several sensors need times"),
        (joined(lines(T[:30])), "", "the input ended without a pose: fewer samples than a window of 2 s"),
        (HEADER + "\n", "", "the input ended without a pose"),
        (joined(lines()), "--frequency 10", "10 Hz is not below half the rate of the samples (20 Hz)"),
        (joined(lines()), "--window 0", "--window must be a positive number of s"),
        (joined(lines()), "--picture p.png", "--picture is for samples in a file"),
        (joined(lines()), "--track --step 1", "windows of a track must not overlap"),
        (joined(lines()), "--track --swing", "a track is that of a single magnet"),
        (joined(lines()), "-o nowhere/p.json", "there is no folder"),
    ],
)
def test_faults_end_it(text: str, words: str, fragment: str, feed: Feed, here: Path) -> None:
    before = sorted(here.iterdir())
    output = [] if "-o" in words else ["-o", "poses.json"]
    code, out, err = feed(text, *output, "-q", *words.split())
    assert code == 2 and out == "" and fragment in err and err.count("\n") == 1
    assert sorted(here.iterdir()) == before


class Process:
    """The command as a process of its own, fed line by line."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "magfem", *LIVE, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            # What runs in the background of a shell has Ctrl-C switched off, and so would its children.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        assert self.process.stdin and self.process.stdout and self.process.stderr
        self.stdin, self.stdout, self.stderr = self.process.stdin, self.process.stdout, self.process.stderr

    def write(self, *rows: str) -> None:
        self.stdin.write("".join(f"{row}\n" for row in rows).encode())
        self.stdin.flush()

    def line(self, seconds: float) -> str:
        """The next line on stdout; empty when there is none in this time."""
        with selectors.DefaultSelector() as selector:
            selector.register(self.stdout, selectors.EVENT_READ)
            return self.stdout.readline().decode() if selector.select(seconds) else ""

    def end(self) -> tuple[int, str]:
        self.stdin.close()
        code = self.process.wait(60)
        err = self.stderr.read().decode()
        self.stdout.close()
        self.stderr.close()
        return code, err


def test_poses_come_at_once_and_ctrl_c_keeps_them(here: Path) -> None:
    """Slowly fed: a pose is there as soon as the first sample beyond its window is, while the input stays open."""
    process = Process("--json", "-o", "poses.json")
    rows = lines()
    process.write(HEADER, *rows[:40])
    assert b"reading standard input" in process.stderr.readline()  # it has started
    assert process.line(0.3) == ""  # the window may still go on
    began = time.monotonic()
    process.write(rows[40])
    assert json.loads(process.line(10.0))["position"] == pytest.approx(TRUE.position, abs=1e-8)
    first = time.monotonic() - began
    for k in range(1, 6):
        began = time.monotonic()
        for row in rows[40 * k + 1 : 40 * k + 41]:
            process.write(row)
            time.sleep(0.002)
        assert json.loads(process.line(10.0))["time"] == pytest.approx(2 * k + 1)
    assert time.monotonic() - began < 2.0 and first < 10.0  # two seconds of samples take less
    process.process.send_signal(signal.SIGINT)
    code, err = process.end()
    assert code == 130 and err.splitlines()[-1] == "magfem: interrupted"
    assert len(json.loads(Path("poses.json").read_text())["poses"]) == 6


def test_it_keeps_up_with_an_hour_at_once(here: Path) -> None:
    """72 000 samples, 1800 windows: the rate it manages is far above any sensor's 20 to 1000 Hz."""
    t = np.arange(72_000) / 20.0
    data = joined(lines(t)).encode()
    process = Process("--json", "-q", "--frequency", "0.5")
    began = time.monotonic()
    out, err = process.process.communicate(data, timeout=120)
    seconds = time.monotonic() - began
    poses = objects(out.decode())
    assert process.process.returncode == 0 and err == b"" and len(poses) == 1800
    assert all(pose["position"] == pytest.approx(TRUE.position, abs=1e-7) for pose in poses)
    assert seconds < 60.0  # an hour of samples in less than a minute, busy machine and start included


def test_a_reader_that_goes_away_ends_it_quietly(here: Path) -> None:
    process = Process("-q", "-o", "poses.json")
    process.write(HEADER, *lines()[:41])
    assert process.line(30.0).startswith("t = 1 s")
    process.stdout.close()
    with contextlib.suppress(BrokenPipeError):
        process.write(*lines()[41:])
    assert process.process.wait(30) == 141
    process.stderr.close()
    with contextlib.suppress(BrokenPipeError):
        process.stdin.close()
    assert json.loads(Path("poses.json").read_text())["poses"]
