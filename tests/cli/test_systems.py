"""Coil systems on the command line: fields at currents and joints, what show tells, mistakes as one sentence."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from references import inverse_distance

import magfem
from magfem.cli import main

PUBLISHED = json.loads((Path(__file__).parents[1] / "references" / "bigmag.json").read_text())


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with points."""
    monkeypatch.chdir(tmp_path)
    Path("p.csv").write_text("x,y,z\n0,0,0\n0.01,0.02,-0.01\n")
    return tmp_path


def output(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """What a command prints with --json."""
    assert main([*words, "--json", "-q"]) == 0
    return json.loads(capsys.readouterr().out)


def published(k: int, points: np.ndarray[Any, Any], angle: float) -> np.ndarray[Any, Any]:
    """B (n, 3) T/A of a published coil turned by `angle` about z."""
    coil = PUBLISHED["coils"][k]
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    R = turn @ coil["R0"]
    local = (points - turn @ coil["p0_m"]) @ R
    poles = enumerate(PUBLISHED["coil_types"][coil["type"]]["a"], start=1)
    total = sum(a * inverse_distance.gradient(inverse_distance.along(0, n), local) for n, a in poles)
    return np.asarray(total @ R.T)


def test_field_at_currents_and_joints_is_the_published_one(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--current", "0=2", "--current", "3=-5", "--joint", "gamma_top=30 deg"]
    data = output(capsys, "field", "bigmag", "--points", "p.csv", "-o", "f.csv", "--gradient", *words)
    assert data["unit"] == "T" and data["points"] == 2
    rows = np.array(list(csv.reader(Path("f.csv").read_text().splitlines()))[1:], dtype=float)
    expected = 2 * published(0, rows[:, :3], 0.0) - 5 * published(3, rows[:, :3], np.pi / 6)
    np.testing.assert_allclose(rows[:, 3:6], expected, rtol=1e-9)
    assert rows.shape == (2, 15)


def test_field_of_a_file_beside(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A saved system, an MPEM file at stated joints, and a card: the same field."""
    joints = ["--joint", "gamma_bottom=-0.7 rad", "--joint", "gamma_top=30 deg"]
    bigmag = magfem.load_system("bigmag")
    bigmag.save("saved.json")
    output(capsys, "export", "bigmag", "--to", "mpem", "-o", "turned.yaml", *joints)
    for target, coil, words in (("saved.json", "1", joints), ("turned.yaml", "Coil_1", [])):
        output(capsys, "field", target, "--points", "p.csv", "-o", f"{coil}.csv", "--current", f"{coil}=1.5", *words)
        found = np.loadtxt(f"{coil}.csv", delimiter=",", skiprows=1)
        np.testing.assert_allclose(found[:, 3:], 1.5 * published(1, found[:, :3], -0.7), rtol=1e-9)


def test_show_tells_of_coils_joints_and_reach(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = output(capsys, "show", "bigmag", "--joint", "gamma_top=90 deg")
    assert [coil["joint"] for coil in shown["coils"]] == ["gamma_" + one["hemisphere"] for one in PUBLISHED["coils"]]
    assert [joint["value"] for joint in shown["joints"]] == pytest.approx([0, np.pi / 2])
    x, _, z = PUBLISHED["coils"][2]["p0_m"]
    assert shown["coils"][2]["position"] == pytest.approx([0, x, z], abs=1e-12)
    strengths = [np.linalg.norm(published(k, np.zeros((1, 3)), 0.0)) for k in range(6)]
    assert shown["field_per_ampere"] == pytest.approx(strengths, rel=1e-9)
    assert 0 < shown["field_everywhere"] < shown["field_best"] < 8 * sum(strengths)
    assert Path("bigmag.png").read_bytes().startswith(b"\x89PNG")
    assert main(["show", "octomag", "-q", "-o", "o.png"]) == 0
    text = capsys.readouterr().out
    assert "Coil_7" in text and "no limit" in text and Path("o.png").exists()
    assert main(["show", "bigmag_extended", "-q"]) == 0
    text = capsys.readouterr().out
    assert "gamma_top" in text and "carries 2, 3, 5, 10, 11, 12, 13" in text and "in any direction" in text
    assert all(len(line) < 140 for line in text.splitlines() if not line.startswith("  source"))


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("field bigmag --points p.csv -o f.csv", 'needs --current NAME=A of "0", "1", "2"'),
        ("field bigmag --points p.csv -o f.csv --current 3", "a current is NAME=A; its coils are"),
        ("field bigmag --points p.csv -o f.csv --current 9=1", 'has no coil "9"; its coils are "0"'),
        ("field bigmag --points p.csv -o f.csv --current 0=9", 'coil "0" of BigMag, six mobile coils bears up to 8 A'),
        ("field bigmag --points p.csv -o f.csv --current 0=1 --joint gamma_top=3", "expected an angle with its unit"),
        ("field bigmag --points p.csv -o f.csv --current 0=1 --joint gamma_top", "--joint is NAME=VALUE"),
        ("field bigmag --points p.csv -o f.csv --current 0=1 --joint gamma=3deg", 'has no joint "gamma"; its joints'),
        ("field bigmag --points p.csv -o f.csv --current 0=1 --joint gamma_top=3deg --joint gamma_top=3deg", "twice"),
        ("field bigmag --points p.csv -o f.csv --current 0=1 --joint gamma_top=200deg", "moves from -180 deg"),
        ("field octomag --points p.csv -o f.csv --current Coil_1=1 --joint a=3deg", 'no joint "a"; it has none'),
        ("field bigmag_air --points p.csv -o f.csv --joint a=3deg", "--joint is for coil systems"),
        ("show loop_50 --joint a=3deg", "--joint is for coil systems"),
        ("show bigmag -o bigmag.gif", "expected a file that ends in .png"),
        ("export bigmag_air --to mpem -o a.yaml --joint a=3deg", "--joint is for coil systems"),
        ("export bigmag_air --to c -o a.h --joint a=3deg", "--joint is for mpem, not for c"),
        ("export bigmag --to mpem -o a.yaml --joint gamma_top=4rad", 'joint "gamma_top"'),
    ],
)
def test_mistakes_are_one_sentence(here: Path, capsys: pytest.CaptureFixture[str], words: str, complaint: str) -> None:
    assert main(words.split()) == 2
    error = capsys.readouterr().err
    assert complaint in error and "Traceback" not in error
    assert sorted(path.name for path in here.iterdir()) == ["p.csv"]
