"""`magfem localize` on files of samples that the formula of a dipole makes: poses, windows, sensors, faults."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli.turning_dipole import EARTH, Array, Turning, write_dipole, write_samples

from magfem.cli import main

TRUE = Turning([0.02, 0.005, 0.03], [0.3, -0.2, 1.0])
T = np.arange(600) / 20.0
NOISE = 0.3e-6
FILE = ["localize", "--model", "dipole.json", "--samples", "s.csv"]
KNOWN = ["--noise", "0.3 uT"]  # without any noise, rounding decides between branches that are equal


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder with a dipole's model and samples of it at the origin, half a minute at 20 Hz."""
    monkeypatch.chdir(tmp_path)
    write_dipole(Path("dipole.json"))
    write_samples(Path("s.csv"), T, TRUE.field([0, 0, 0], T) + EARTH)
    return tmp_path


def noisy(B: Array, seed: int = 1) -> Array:
    return B + NOISE * np.random.default_rng(seed).normal(size=B.shape)


def found(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """What the command prints with --json."""
    code = main([*words, "--json", "-q"])
    read = capsys.readouterr()
    assert code == 0, read.err
    return json.loads(read.out)


def angle(a: Any, b: Any) -> float:
    """deg, between two directions."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))))


@pytest.mark.parametrize("frequency", [["--frequency", "0.5"], ["--frequency", "500 mHz"], []])
def test_the_pose_of_the_formula(frequency: list[str], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = found(capsys, *FILE, *KNOWN, "-o", "poses.json", *frequency)
    assert json.loads(Path("poses.json").read_text()) == data
    assert (data["format"], data["version"], data["samples"]) == ("magfem-poses", 1, "s.csv")
    (pose,) = data["poses"]
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
    assert angle(pose["axis"], TRUE.unit) < 1e-5
    assert pose["phase"] == pytest.approx(TRUE.phase, abs=1e-6)
    assert pose["frequency"] == pytest.approx(0.5, abs=1e-8)
    assert pose["time"] == pytest.approx(T.mean())
    assert angle(pose["moment_direction"], TRUE.moments(np.array([T.mean()]))[0]) < 1e-4
    assert np.shape(pose["covariance"]) == (6, 6)
    # One sensor: the mirrored place is as likely, and both signs of beta; told, and the same axis at the mirrored one.
    assert len(pose["branches"]) == 4 and pose["ambiguous"] and "another branch" in pose["warnings"][0]
    assert any(np.allclose(one["position"], np.negative(TRUE.position), atol=1e-8) for one in pose["branches"])
    assert all(set(one) >= {"position", "axis", "covariance", "log_likelihood"} for one in pose["branches"])


def test_deviations_are_those_of_the_noise(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Twenty recordings: errors over the covariance stated, six numbers each, are on average one."""
    ratios = []
    for seed in range(20):
        write_samples(Path("s.csv"), T, noisy(TRUE.field([0, 0, 0], T), seed))
        (pose,) = found(capsys, *FILE, "--frequency", "0.5", "--near", "20 5 30 mm", "--noise", "0.3 uT")["poses"]
        error = np.subtract(pose["position"], TRUE.position)
        ratios.append(error @ np.linalg.solve(np.array(pose["covariance"])[:3, :3], error) / 3)
    assert 0.6 < np.mean(ratios) < 1.5  # chi-squared of 60 degrees of freedom: 99.8 % within


def test_near_chooses_the_branch(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mirror = np.negative(TRUE.position)
    for text in ("-20 -5 -30 mm", "-20mm, -5mm, -3cm", "-20 mm -5 mm -30 mm"):
        (pose,) = found(capsys, *FILE, "--near", text)["poses"]
        assert pose["position"] == pytest.approx(mirror, abs=1e-8)


def test_windows_follow_a_magnet_that_moves(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It crosses the sensor's own plane, where branches without a prior change over; a gap leaves windows out."""
    steps = [Turning([0.02, 0.01, z], [1.0, 0.2, 0.5]) for z in np.linspace(0.014, -0.014, 15)]
    B = np.concatenate([one.field([0, 0, 0], T[40 * k : 40 * k + 40]) for k, one in enumerate(steps)])
    keep = (T < 12) | (T >= 15.8)
    write_samples(Path("s.csv"), T[keep], noisy(B)[keep])
    words = ["--window", "2", "--frequency", "0.5", "--near", "20 10 14 mm"]
    data = found(capsys, *FILE, *words)
    assert [pose["time"] for pose in data["poses"]] == pytest.approx([*range(1, 13, 2), *range(17, 31, 2)])
    assert len(data["left_out"]) == 1 and data["left_out"][0]["time"] == pytest.approx(15.0)  # four samples of it
    for pose in data["poses"]:
        one = steps[round((pose["time"] - 1) / 2)]
        off = np.linalg.norm(np.subtract(pose["position"], one.position))
        assert off < 3 * pose["position_deviation"] < 5e-3
        assert pose["window"] == pytest.approx([pose["time"] - 1, pose["time"] + 1])
    assert len(found(capsys, *FILE, *words, "--step", "500 ms")["poses"]) > 40


def test_missing_samples_and_a_rate(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A third of all cells empty or nan: nothing is made up for them."""
    rng = np.random.default_rng(3)
    rows = [[f"{1e6 * value:.12g}" for value in row] for row in TRUE.field([0, 0, 0], T) + EARTH]
    for row in rows:
        for k in np.flatnonzero(rng.random(3) < 0.33):
            row[k] = "nan" if rng.random() < 0.5 else ""
    Path("s.csv").write_text("\n".join(["bx_uT,by_uT,bz_uT", *(",".join(row) for row in rows)]) + "\n")
    (pose,) = found(capsys, *FILE, "--rate", "20")["poses"]
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-7)


def test_columns_by_other_names(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The sensor's own axes are turned: x is read on its b, backwards on its a is y."""
    B = TRUE.field([0, 0, 0], T)
    write_samples(Path("s.csv"), 1e3 * T, np.column_stack([-B[:, 1], B[:, 0], B[:, 2]]), "clock [ms],a,b,bz_uT")
    words = ["--column", "t=clock [ms]", "--column", "bx=b [uT]", "--column", "by=-a [uT]"]
    (pose,) = found(capsys, *FILE, *words)["poses"]
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
    text = Path("s.csv").read_text().split("\n", 1)[1]
    Path("s.csv").write_text(text)
    (pose,) = found(capsys, *FILE, "--columns", "t_ms,by_uT,bx_uT,bz_uT", "--column", "by=-by_uT")["poses"]
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)


# A sensor turned by 90 degrees about z, another one as the frame lies.
CARD = """\
kind = "sensors"
[[sensors]]
name = "left"
position = ["-10 mm", "0 mm", "0 mm"]
quaternion = [0, 0, 1, 1]
noise = "0.3 uT"
[[sensors]]
name = "right"
position = ["10 mm", "0 mm", "0 mm"]
noise = "0.3 uT"
"""
PLACES = {"left": [-0.01, 0, 0], "right": [0.01, 0, 0]}


def read_by(name: str, B: Array) -> Array:
    """A field in the axes of a sensor of the card: the left one's x is the frame's y, its y the frame's −x."""
    return B[:, [1, 0, 2]] * [1, -1, 1] if name == "left" else B


def write_pair(motors: list[Turning], late: float = 0.0, noise: bool = True) -> None:
    """Samples of both sensors, the right one `late` seconds after the left one."""
    rows = []
    for seed, (name, place) in enumerate(PLACES.items()):
        t = T + (late if name == "right" else 0.0)
        B = read_by(name, np.sum([one.field(place, t) for one in motors], axis=0) + EARTH)
        B = noisy(B, seed) if noise else B
        rows += [f"{a!r},{name}," + ",".join(map(repr, b)) for a, b in zip(t.tolist(), (1e6 * B).tolist(), strict=True)]
    Path("s.csv").write_text("\n".join(["t,sensor,bx_uT,by_uT,bz_uT", *rows]) + "\n")
    Path("pair.toml").write_text(CARD)


@pytest.mark.parametrize("late", [0.0, 0.025])
def test_two_sensors_need_no_prior(late: float, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In the frame of the card, and with an unknown frequency also when they read alternately: 40 Hz in all, but
    neither of them can tell 0.5 from 19.5 Hz by itself."""
    below = Turning([0.004, 0.012, -0.02], [0.3, -0.2, 1.0])
    write_pair([below], late)
    (pose,) = found(capsys, *FILE, "--sensors", "pair.toml")["poses"]
    assert pose["sensors"] == ["left", "right"] and not pose["ambiguous"] and pose["warnings"] == []
    assert pose["position"] == pytest.approx(below.position, abs=0.1e-3)
    assert angle(pose["axis"], below.unit) < 0.5
    assert pose["frequency"] == pytest.approx(0.5, abs=1e-3)


def test_a_card_of_one_sensor_states_where_it_is(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("one.toml").write_text(CARD[: CARD.rindex("[[sensors]]")])
    B = read_by("left", TRUE.field(PLACES["left"], T))
    write_samples(Path("s.csv"), T, B)
    (pose,) = found(capsys, *FILE, "--sensors", "one.toml", "--near", "20 5 30 mm")["poses"]
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
    assert angle(pose["axis"], TRUE.unit) < 1e-5


def test_several_motors_have_a_pose_each(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motors = [
        Turning([0.004, 0.012, 0.02], [0.3, -0.2, 1.0], 0.4, 0.5),
        Turning([-0.01, 0.0, 0.025], [1.0, 0.2, 0.3], -1.0, 1.25),
    ]
    write_pair(motors, noise=False)
    words = ["--sensors", "pair.toml", "--frequency", "0.5", "--frequency", "1.25", "--window", "8"]
    data = found(capsys, *FILE, *words)
    assert [pose["frequency"] for pose in data["poses"]] == [0.5, 1.25] * 3
    for pose, true in zip(data["poses"], motors * 3, strict=True):
        assert pose["position"] == pytest.approx(true.position, abs=1e-7)
        assert pose["phase"] == pytest.approx(true.phase, abs=1e-5)


def test_times_since_1970_keep_their_milliseconds(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    true = Turning([0.02, 0.005, 0.03], [0.3, -0.2, 1.0])
    t = np.arange(40) / 20.0
    write_samples(Path("s.csv"), t + 1732561234.5, true.field([0, 0, 0], t))
    assert main([*FILE, "--near", "20 5 30 mm", "--frequency", "0.5"]) == 0
    assert "1732561235.475 s" in capsys.readouterr().out


def test_a_track_is_nearer_than_its_windows(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A magnet on an arc at 30 mm, 3 µT of noise: the smoothed windows are nearer to it than each alone, their
    deviations tell how near, and a gap leaves windows out without losing the way.
    """
    middles = np.arange(1, 60, 2.0)
    path = [
        Turning([0.01 * np.sin(t / 20), 0.008 * np.cos(t / 25), 0.028 + 5e-5 * t], [0.3, np.sin(t / 30), 1.0])
        for t in middles
    ]
    t = np.arange(1200) / 20.0
    keep = (t < 24) | (t >= 28)
    rows = []
    for seed, (name, place) in enumerate(PLACES.items()):
        B = np.concatenate([one.field(place, t[40 * k : 40 * k + 40]) for k, one in enumerate(path)])
        B = read_by(name, B) + 3e-6 * np.random.default_rng(seed).normal(size=B.shape)
        rows += [
            f"{a!r},{name}," + ",".join(map(repr, b)) for a, b in zip(t[keep].tolist(), B[keep].tolist(), strict=True)
        ]
    Path("s.csv").write_text("\n".join(["t,sensor,bx,by,bz", *rows]) + "\n")
    Path("pair.toml").write_text(CARD.replace("0.3 uT", "3 uT"))
    words = ["--sensors", "pair.toml", "--frequency", "0.5", "--window", "2"]
    alone = found(capsys, *FILE, *words)["poses"]
    data = found(capsys, *FILE, *words, "--track", "--picture", "p.png", "-o", "track.json")
    assert [one["time"] for one in data["left_out"]] == pytest.approx([25.0, 27.0])
    assert Path("p.png").exists() and json.loads(Path("track.json").read_text()) == data

    def off(poses: Any) -> Array:
        truth = [path[round((pose["time"] - 1) / 2)].position for pose in poses]
        return np.array([pose["position"] for pose in poses]) - truth

    smoothed = data["poses"]
    assert len(smoothed) == 28
    near = np.sqrt((off(smoothed) ** 2).sum(axis=1).mean())
    assert near < 1.5e-3 and near < 0.6 * np.sqrt((off(alone) ** 2).sum(axis=1).mean())
    normalised = [
        e @ np.linalg.solve(np.array(pose["covariance"])[:3, :3], e) / 3
        for e, pose in zip(off(smoothed), smoothed, strict=True)
    ]
    assert 0.4 < np.mean(normalised) < 2.0
    for pose in smoothed:
        one = path[round((pose["time"] - 1) / 2)]
        C = np.array(pose["covariance"])
        assert np.linalg.eigvalsh(C)[0] > 0 and np.trace(C[3:5, 3:5]) == pytest.approx(pose["axis_deviation"] ** 2)
        assert angle(pose["axis"], one.unit) < 5 * np.degrees(pose["axis_deviation"])
        jump = pose["phase"] - one.phase
        assert abs(np.angle(np.exp(1j * jump))) < 6 * np.sqrt(C[5, 5]) < 0.8
        assert pose["branches"][0]["position"] == pose["position"] and not pose["ambiguous"]
        assert abs(np.dot(pose["moment_direction"], pose["axis"])) < 1e-9


def test_the_rotation_axis_in_the_models_frame(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The dipole lies along x of its model: about y or z it turns alike, about x not at all."""
    for axis in ("y", "z", "0, 1, -1"):
        (pose,) = found(capsys, *FILE, *KNOWN, "--rotation-axis", axis)["poses"]
        assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
    assert main([*FILE, "--rotation-axis", "x"]) == 2
    assert "moment lies along the rotation axis" in capsys.readouterr().err


def test_a_motor_that_swings(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.05 rad to and fro twice a turn, as if time went unevenly."""
    later = T + 0.05 * np.cos(4 * np.pi * 0.5 * T) / (2 * np.pi * 0.5)
    write_samples(Path("s.csv"), T, TRUE.field([0, 0, 0], later) + EARTH)
    (pose,) = found(capsys, *FILE, *KNOWN, "--swing", "--frequency", "0.5")["poses"]
    assert pose["swing"] == pytest.approx(0.05, rel=1e-6)
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
    (even,) = found(capsys, *FILE, *KNOWN, "--frequency", "0.5")["poses"]
    assert np.linalg.norm(np.subtract(even["position"], TRUE.position)) > 1e-4


@pytest.mark.parametrize("stated", [[], ["--frequency", "0.51"]])
def test_a_frequency_that_drifts(stated: list[str], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.5 Hz at time zero, 1 mHz/s more: almost half a turn over the recording."""
    later = T + 0.5 * 1e-3 / 0.5 * T**2  # the time at which the steady one has turned as far
    write_samples(Path("s.csv"), T, TRUE.field([0, 0, 0], later) + EARTH)
    (pose,) = found(capsys, *FILE, *KNOWN, "--drift", *stated)["poses"]
    assert pose["drift"] == pytest.approx(1e-3, rel=1e-6) and pose["frequency"] == pytest.approx(0.5, abs=1e-8)
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-8)
    assert pose["phase"] == pytest.approx(TRUE.phase, abs=1e-6)
    (steady,) = found(capsys, *FILE, *KNOWN)["poses"]
    assert np.linalg.norm(np.subtract(steady["position"], TRUE.position)) > 1e-4


def test_saturated_readings_are_not_believed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    B = TRUE.field([0, 0, 0], T) + EARTH
    full = 43e-6
    assert 0.1 < (np.abs(B) >= full).any(axis=1).mean() < 0.5
    write_samples(Path("s.csv"), T, np.clip(B, -full, full))
    (pose,) = found(capsys, *FILE, "--saturation", "43 uT", "--frequency", "0.5")["poses"]
    assert pose["position"] == pytest.approx(TRUE.position, abs=1e-7)
    (pose,) = found(capsys, *FILE, "--frequency", "0.5")["poses"]
    assert np.linalg.norm(np.subtract(pose["position"], TRUE.position)) > 1e-4


def test_text_for_people(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*FILE, *KNOWN, "-q", "-o", "p.json"]) == 0
    text = capsys.readouterr().out
    for words in ("600 of 1 sensor, 20 Hz", "2.6 mA·m² across the axis", "20.000  5.000  30.000", "branches", "p.json"):
        assert words in text
    assert main([*FILE, "--json", "-o", "p.json"]) == 0
    read = capsys.readouterr()
    assert json.loads(read.out)["poses"] and "branches" in read.err


def test_a_picture(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*FILE, "--window", "10", "--picture", "p.png", "-q"]) == 0
    assert Path("p.png").read_bytes().startswith(b"\x89PNG") and Path("p.png").stat().st_size > 40_000


@pytest.mark.parametrize(
    ("words", "fragment"),
    [
        ("--samples gone.csv", "no such file [gone.csv]"),
        ("--samples .", "expected a CSV file, got a directory"),
        ("--model gone.json", "gone.json"),
        ("--model no_such_rotor", "no_such_rotor"),
        ("--model solenoid_24x48x60", "must be in T"),
        ("--rate 0", "--rate must be a positive number of Hz"),
        ("--rate 25", "rate is said to be 25 Hz"),
        ("--frequency fast", "--frequency: expected a frequency with its unit"),
        ("--frequency -1", "--frequency must be a positive number of Hz"),
        ("--frequency '30 rpm'", "--frequency"),
        ("--frequency 10", "10 Hz is not below half the rate of the samples (20 Hz)"),
        ("--frequency 12.5", "12.5 Hz is not below half the rate"),
        ("--frequency 0.5 --frequency 0.5", "given twice"),
        ("--frequency 0.5 --frequency 0.501", "cannot tell the frequencies 0.5, 0.501 Hz from each other"),
        ("--frequency 0.5 --frequency 1 --drift", "--drift is for a single motor"),
        ("--near '20 5 30'", "--near"),
        ("--near '20 5 mm'", "--near"),
        ("--near '20 mm'", "--near must be three lengths"),
        ("--near '20 5 30 mT'", "which is not a length"),
        ("--near '1 2 3 mm' --near '1 2 3 mm'", "--near is given 2 times, and there are 1 motors"),
        ("--rotation-axis up", "--rotation-axis must be x, y, z or three numbers"),
        ("--rotation-axis '0 0 0'", "not all zero"),
        ("--noise 3", "--noise: expected a flux density with its unit"),
        ("--noise '-3 uT'", "noise must be"),
        ("--noise '3 mm'", "which is not a flux density"),
        ("--saturation '0 T'", "saturation must be a positive field"),
        ("--window 0", "--window must be a positive number of s"),
        ("--window 31", "30 s of samples are less than a window of 31 s"),
        ("--window 0.15 --frequency 0.5", "no window gives a pose"),
        ("--step 1", "--step is for windows"),
        ("--track", "--track is for windows"),
        ("--track --window 2 --frequency 0.5 --frequency 1", "a track is that of a single magnet"),
        ("--track --window 12", "a track needs three windows"),
        ("--window 2 --step -1", "--step must be a positive number of s"),
        ("--sensors gone.toml", "no such file"),
        ("--sensors pair.toml", "a column sensor is needed"),
        ("--sensors pair.toml --noise '1 uT'", "--noise is for a single sensor"),
        ("--column x=t", "recordings have no column"),
        ("--column bx=nothing", 'there is no column "nothing"'),
        ("--columns t,bx,by", "column bz is missing"),
        ("-o poses.txt", "ends in .json"),
        ("-o nowhere/poses.json", "there is no folder"),
        ("--picture p.jpg", "ends in .png"),
    ],
)
def test_faults_in_one_line(words: str, fragment: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import shlex

    Path("pair.toml").write_text(CARD)
    before = sorted(here.iterdir())
    assert main([*FILE, "-o", "poses.json", *shlex.split(words)]) == 2
    read = capsys.readouterr()
    assert fragment in read.err and read.err.count("\n") == 1 and not read.out
    assert sorted(here.iterdir()) == before


@pytest.mark.parametrize(
    ("text", "words", "fragment"),
    [
        ("t,by,bz\n0,1,2\n", "", "column bx is missing"),
        ("t,bx,by,bz\n0,1,1,1\n0,1,1,1\n", "", "t must increase, got 0 s after 0 s [s.csv: line 3]"),
        ("t,bx,by,bz\n0,1,1,1\n1,1,1,1\n2,1,1,1\n", "--frequency 0.2", "3 samples do not determine"),
        ("t,bx,by,bz\n0,1,1,1\n", "", "1 sample does not determine"),
        ("t,bx,by,bz\n0,,,\n1,,,\n", "", "all 2 samples are missing"),
        ("t,bx,by,bz,sensor\n0,1,1,1,a\n1,1,1,1,b\n", "", 'of a sensor "a": where it stands must be stated'),
        ("t,bx,by,bz,sensor\n0,1,1,1,a\n", "--sensors pair.toml", 'there is no sensor "a": known are "left", "right"'),
    ],
)
def test_faults_of_samples(
    text: str, words: str, fragment: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("pair.toml").write_text(CARD)
    Path("s.csv").write_text(text)
    assert main([*FILE, "-o", "poses.json", *words.split()]) == 2
    read = capsys.readouterr()
    assert fragment in read.err and read.err.count("\n") == 1 and not Path("poses.json").exists()
