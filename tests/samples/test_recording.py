"""Recordings: their files, and windows of them, whole or as readings come. The numbers stand in each test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magfem.errors import InputError
from magfem.samples import parse_columns
from magfem.samples.recording import Recording, Stream, Windows, recording_of
from magfem.samples.recording_csv import read_recording, stated_columns

NAN = float("nan")


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path("s.csv")


@pytest.mark.parametrize(
    "text",
    [
        "t,bx,by,bz\n0,1e-6,-2e-6,3e-6\n0.05,4e-6,5e-6,6e-6\n",
        "t_ms,bx_uT,by_uT,bz_nT\n0,1,-2,3000\n50,4,5,6000\n",
        "# logger 7\ntime;Bz [uT];BY (nT);bx_mT;note\n0;3;-2000;0.001;first\n0.05;6;5000;0.004;\n",
    ],
)
def test_units_orders_and_delimiters(text: str, file: Path) -> None:
    file.write_text(text)
    found = read_recording(file)
    assert found.times == pytest.approx([0, 0.05], rel=1e-15)
    assert pytest.approx(1e-6 * np.array([[1, -2, 3], [4, 5, 6]]), rel=1e-14) == found.B
    assert found.sensors == ("",) and found.interval == pytest.approx(0.05) and found.source == "s.csv"


def test_missing_components_are_nan_or_empty(file: Path) -> None:
    file.write_text("t,bx,by,bz\n0,1,,3\n1,nan,5,6\n2, ,,NaN\n\n4,7,8,9\n")
    B = read_recording(file).B
    assert np.array_equal(B, [[1, NAN, 3], [NAN, 5, 6], [NAN] * 3, [7, 8, 9]], equal_nan=True)


def test_a_rate_stands_for_times(file: Path) -> None:
    file.write_text("sensor,bx,by,bz\nb,1,2,3\na,4,5,6\nb,7,8,9\na,1,1,1\n")
    times, B, names = read_recording(file, rate=20.0).side_by_side()
    assert times == pytest.approx([0, 0.05]) and names == ("b", "a")
    assert B.tolist() == [[[1, 2, 3], [7, 8, 9]], [[4, 5, 6], [1, 1, 1]]]
    file.write_text("t,bx,by,bz\n0,1,2,3\n0.05,1,2,3\n0.1,1,2,3\n")
    assert read_recording(file, rate=20.0).interval == pytest.approx(0.05)  # both say the same
    with pytest.raises(InputError, match=r"said to be 25 Hz, and the times t are 0\.05 s apart \(20 Hz\)"):
        read_recording(file, rate=25.0)


def test_sensors_that_read_at_times_of_their_own(file: Path) -> None:
    """One after the other in the file, and not at the same times: nothing is made up where a sensor did not read."""
    file.write_text("sensor,t,bx,by,bz\n1,0,1,1,1\n1,2,2,2,2\n2,1,3,3,3\n2,2,4,4,4\n3,5,,,\n")
    times, B, names = read_recording(file).side_by_side()
    assert times.tolist() == [0, 1, 2, 5] and names == ("1", "2")
    assert np.array_equal(B[:, :, 0], [[1, NAN, 2, NAN], [NAN, 3, 4, NAN]], equal_nan=True)


def test_columns_by_other_names_and_files_without_header(file: Path) -> None:
    file.write_text("clock_ms,A,B,C,which\n10,1,2,3,x\n20,1,2,3,x\n")
    columns = parse_columns(["t=clock_ms", "bx=-B [mT]", "by=A [mT]", "bz=C [mT]", "sensor=which"], recorded=True)
    found = read_recording(file, columns)
    assert found.times == pytest.approx([0.01, 0.02]) and found.sensors == ("x",)
    assert found.B[0] == pytest.approx([-2e-3, 1e-3, 3e-3])
    file.write_text("# no names\n10,1,2,3\n20,1,2,3\n")
    assert read_recording(file, header="t_ms,bx_mT,by_mT,bz_mT").B[1] == pytest.approx([1e-3, 2e-3, 3e-3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,by,bz\n0,1,2\n", "column bx is missing: expected the header t,bx,by,bz"),
        ("bx,by,bz\n0,1,2\n", "column t is missing: expected times (t in s, or t_ms and so on), or the rate"),
        ("0,1,2,3\n", "there is no header"),
        ("", "column bx is missing"),
        ("t,bx,by,bz\n", "there are no samples in it [s.csv]"),
        ("t_mm,bx,by,bz\n0,1,2,3\n", 'column "t_mm" does not end in a unit of time such as ms'),
        ("t,bx_mT/A,by,bz\n0,1,2,3\n", 'column "bx_mT/A" does not end in a unit of flux density'),
        ("t,bx,by,bz\n0,1,2,3\n,1,2,3\n", 'expected a finite number, got "" [s.csv: line 3, column t]'),
        ("t,bx,by,bz\n0,1,2,3\n1,inf,2,3\n", 'got "inf" [s.csv: line 3, column bx]'),
        ("t,bx,by,bz\n0,1,2,3\n1,two,2,3\n", 'or nan where nothing was measured, got "two" [s.csv: line 3, column bx]'),
        ("t,bx,by,bz\n0,1,2\n", "expected 4 cells as in the header, got 3 [s.csv: line 2]"),
        ("t,bx,by,bz\n0,1,2,3\n1,1,2,3\n1,1,2,3\n", "t must increase, got 1 s after 1 s [s.csv: line 4]"),
        (
            "t,sensor,bx,by,bz\n0,a,1,2,3\n1,a,1,2,3\n0,b,1,2,3\n-1,b,1,2,3\n",
            "t must increase, got -1 s after 0 s [s.csv: line 5]",
        ),
        ("t,t_ms,bx,by,bz\n0,0,1,2,3\n", "column t is there 2 times"),
    ],
)
def test_faults_in_one_sentence(text: str, message: str, file: Path) -> None:
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read_recording(file)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_mappings_of_recordings_are_their_own() -> None:
    for recorded, text in ((True, "x=stage_mm"), (True, "sigma==3 uT"), (False, "t=clock_ms"), (False, "sensor=a")):
        with pytest.raises(InputError, match="have no column"):
            parse_columns([text], recorded)
    with pytest.raises(InputError, match="column t cannot be a constant"):
        stated_columns("t,bx,by,bz", {"t": "=3 s"})


def test_lines_one_by_one_are_read_as_files_are() -> None:
    columns = stated_columns("t_ms,bx_uT,by_uT,bz_uT,sensor")
    found = columns.line(7, "1500,1,,3,left\r\n")
    assert found[0] == 1.5 and found[2] == "left"
    assert np.array_equal(found[1], [1 / 1e6, NAN, 3 / 1e6], equal_nan=True)
    assert columns.separated_as("1;2").line(8, "1500;1;2;3;left")[1][1] == 2 / 1e6
    faults = ("1500,1,2,left", "got 4"), ("1500,1,2,x,left", 'got "x"'), ('"1', "not valid CSV"), (" ", "got none")
    for text, message in faults:
        with pytest.raises(InputError, match=message) as caught:
            columns.line(9, text)
        assert "line 9" in str(caught.value)


def steady(rate: float, n: int) -> Recording:
    return Recording(np.arange(n) / rate, np.ones((n, 3)), np.zeros(n, dtype=np.int64), ("",))


def test_laid_out_evenly(file: Path) -> None:
    """Times that logging rounds are those that were meant; a gap is filled with nothing."""
    file.write_text("t,bx,by,bz\n0.301,1,1,1\n0.4,2,2,2\n0.499,3,3,3\n0.8,4,4,4\n0.9,5,5,5\n")
    times, B, names = read_recording(file).evenly()
    assert names == ("",) and len(times) == 7 and np.diff(times) == pytest.approx(0.1, rel=0.02)
    assert np.array_equal(B[0, :, 0], [1, 2, 3, NAN, NAN, 4, 5], equal_nan=True)
    file.write_text("t,bx,by,bz\n0,1,1,1\n0.1,2,2,2\n0.2,3,3,3\n0.24,4,4,4\n0.34,4,4,4\n")
    with pytest.raises(InputError, match=r"not even: that at t = 0\.24 s is 0\.04 s off times 0\.1 s apart"):
        read_recording(file).evenly()
    file.write_text("t,bx,by,bz\n0,1,1,1\n")
    with pytest.raises(InputError, match="cannot be laid out evenly"):
        read_recording(file).evenly()


def test_windows_are_as_long_as_they_say() -> None:
    """600 samples at 20 Hz are 30 s: 15 windows of 2 s with 40 samples each, 29 of them every second."""
    found = Windows(2.0, 2.0).within(steady(20.0, 600))
    assert [len(one.times) for _, one in found] == [40] * 15
    assert [start for start, _ in found] == pytest.approx(np.arange(15) * 2.0)
    assert len(Windows(2.0, 1.0).within(steady(20.0, 600))) == 29
    assert [len(one.times) for _, one in Windows(0.3, 0.1).within(steady(10.0, 10))] == [3] * 8  # 3 · 0.1 > 0.3
    assert len(Windows(30.0, 30.0).within(steady(20.0, 600))) == 1
    with pytest.raises(InputError, match=r"30 s of samples are less than a window of 30\.5 s"):
        Windows(30.5, 30.5).within(steady(20.0, 600))
    with pytest.raises(InputError, match="at most a million"):
        Windows(1e-6, 1e-6).within(steady(20.0, 600))
    for length, step in ((0.0, 1.0), (1.0, -1.0), (NAN, 1.0), (float("inf"), 1.0)):
        with pytest.raises(InputError, match="must be a positive time"):
            Windows(length, step)


def streamed(recording: Recording, windows: Windows) -> list[tuple[float, Recording]]:
    stream = Stream(windows)
    found = []
    for t, k, (x, y, z) in zip(recording.times, recording.sensor, recording.B.tolist(), strict=True):
        found += stream.add(float(t), recording.sensors[k], (x, y, z))
    return found + stream.end()


@given(
    rate=st.sampled_from([3.0, 10.0, 20.0, 1000 / 7]),
    length=st.floats(0.2, 4.0),
    ratio=st.sampled_from([0.1, 0.25, 0.5, 1.0, 1.7]),
    gap=st.floats(0.0, 9.0),
    start=st.sampled_from([0.0, -3.3, 1.7e9]),
    sensors=st.integers(1, 3),
)
def test_a_stream_gives_the_windows_of_the_file(
    rate: float, length: float, ratio: float, gap: float, start: float, sensors: int
) -> None:
    windows = Windows(length, ratio * length)
    once = np.arange(60) / rate + start
    once[30:] += gap
    times = np.repeat(once, sensors)
    B = np.arange(len(times) * 3).reshape(-1, 3) * 1e-6
    names = ("a", "b", "c")[:sensors]
    recording = Recording(times, B, np.tile(np.arange(sensors), 60), names)
    try:
        whole = windows.within(recording)
    except InputError:
        whole = []
    found = streamed(recording, windows)
    assert [start for start, _ in found] == pytest.approx([start for start, _ in whole], rel=1e-12)
    for (_, one), (_, other) in zip(found, whole, strict=True):
        assert np.array_equal(one.times, other.times) and np.array_equal(one.B, other.B)


def test_a_window_is_given_when_the_first_reading_beyond_it_comes() -> None:
    stream = Stream(Windows(1.0, 1.0))
    assert not any(stream.add(k / 10, "", (0.0, 0.0, 0.0)) for k in range(10))
    ((start, one),) = stream.add(1.0, "", (0.0, 0.0, 0.0))
    assert start == 0.0 and len(one.times) == 10
    assert stream.end() == []


def test_a_silent_sensor_does_not_hold_up_the_others() -> None:
    stream = Stream(Windows(1.0, 1.0))
    stream.add(0.0, "dead", (0.0, 0.0, 0.0))
    given = [k for k in range(30) if stream.add(k / 10, "live", (0.0, 0.0, 0.0))]
    assert given == [11, 21]  # a tenth of the window late
    assert [name for _, one in stream.end() for name in one.sensors] == ["live"]


def test_a_clock_set_back_begins_anew_and_a_stray_time_does_no_harm() -> None:
    stream = Stream(Windows(1.0, 1.0))
    for k in range(15):
        stream.add(100 + k / 10, "", (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match=r"t must increase, got 101\.3 s after 101\.4 s"):
        stream.add(101.3, "", (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="is no time"):
        stream.add(1e300, "", (0.0, 0.0, 0.0))
    assert stream.restarts == 0
    found = [start for k in range(15) for start, _ in stream.add(k / 10, "", (0.0, 0.0, 0.0))]
    assert stream.restarts == 1 and found == [0.0]
    stream.add(1e8, "", (0.0, 0.0, 0.0))  # within what windows can be cut at, and yet at once
    found = [start for k in range(15) for start, _ in stream.add(2 + k / 10, "", (0.0, 0.0, 0.0))]
    assert stream.restarts == 2 and found == [2.0]


def test_readings_in_the_order_of_time() -> None:
    found = recording_of([(2.0, "b", (1, 1, 1)), (1.0, "a", (2, 2, 2))])
    assert found.times.tolist() == [1, 2] and found.B[:, 0].tolist() == [2, 1]
    assert found.sensors == ("a", "b") and found.sensor.tolist() == [0, 1] and found.interval == 0.0
    assert repr(found) == "Recording(2 readings, 2 sensors, '')"
