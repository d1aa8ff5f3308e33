"""Coils on the command line."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import magfem
from magfem.cli import main
from magfem.fem.coil_solution import CoilSolution

LOOP, SPIRAL, STATOR, RING = "loop_50", "planar_coil_12mm", "stator_1.6x5.5", "ring_magnet_4x1.5x1"
POINTS = "x,y,z\n0,0,0.003\n0.002,0.001,0.02\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with points."""
    monkeypatch.chdir(tmp_path)
    Path("p.csv").write_text(POINTS)
    return tmp_path


@pytest.fixture(scope="module")
def loop() -> CoilSolution:
    solution = magfem.solve(magfem.load_geometry(LOOP))
    assert isinstance(solution, CoilSolution)
    return solution


def output(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """What a command prints with --json."""
    assert main([*words, "--json", "-q"]) == 0
    return json.loads(capsys.readouterr().out)


def text(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main([*words, "-q"]) == 0
    return capsys.readouterr().out


def table(path: str) -> tuple[list[str], np.ndarray[Any, Any]]:
    header, *rows = csv.reader(Path(path).read_text().splitlines())
    return header, np.array(rows, dtype=float)


def test_show_tells_of_wire_and_resistance(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = output(capsys, "show", SPIRAL)
    geometry = magfem.load_geometry(SPIRAL)
    assert shown["volume"] == geometry.volume
    one = shown["circuits"]["coil"]
    assert one["turns"] == 24
    assert one["length"] * 100e-6 * 9e-6 == pytest.approx(geometry.volume, rel=1e-12, abs=0)
    assert one["resistance_estimate"] == pytest.approx(10.2, rel=0.01)
    assert Path(f"{SPIRAL}.png").read_bytes().startswith(b"\x89PNG")
    lines = text(capsys, "show", SPIRAL)
    for fragment in ("24 turns", "leads 5.", "`magfem solve` finds the true resistance", "cylinder, diameter 12 mm"):
        assert fragment in lines


def test_show_counts_the_bodies_of_an_assembly(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = output(capsys, "show", "halbach_array_5")
    assert len(shown["bodies"]) == 5
    assert shown["hull"]["kind"] == "box"
    assert sum(body["volume"] for body in shown["bodies"]) == pytest.approx(shown["volume"], rel=1e-12, abs=0)


def test_mesh_is_the_surface_of_the_conductors(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import meshio

    result = output(capsys, "mesh", SPIRAL, "-o", "coil.vtu", "--resolution", "0.5")
    assert result["circuits"] == {"coil": result["cells"]}
    mesh = meshio.read("coil.vtu")
    (cells,) = mesh.cells
    assert cells.type.startswith("quad") and len(cells.data) == result["cells"]
    lead = mesh.cell_data["lead"][0].astype(bool)
    assert 0 < lead.sum() < len(lead)
    corners = mesh.points[cells.data[~lead][:, :4]]
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
    )  # two faces and two walls of a straightened track
    length = magfem.load_geometry(SPIRAL).volume / (100e-6 * 9e-6)
    assert area.sum() == pytest.approx(2 * length * (100e-6 + 9e-6), rel=0.02)


def test_solve_prints_the_numbers_of_the_loop(
    loop: CoilSolution, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = output(capsys, "solve", LOOP, "-o", "solution")
    assert result == json.loads(Path("solution/summary.json").read_text())
    assert result["quantities"]["inductance"] == loop.inductance.tolist()
    lines = text(capsys, "solve", LOOP)
    for fragment in ("conduction       winding", "resistance", "inductance", "power at 1 A", "current density"):
        assert fragment in lines
    assert "below 1e-12" in lines or "model's error" in lines


def test_solve_bounds_the_resistance_of_foil(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = text(capsys, "solve", SPIRAL, "--resolution", "0.5", "--conduction", "filament")
    for fragment in ("conduction       filament", "relative, between its bounds", "leads ", "times the mean"):
        assert fragment in lines


def test_field_at_a_current_is_the_field_per_ampere_times_it(
    loop: CoilSolution, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["field", LOOP, "--points", "p.csv", "-o", "f.csv", "--gradient"]
    assert main(words) == 0
    assert "1 A in every circuit; --current gives it in T" in capsys.readouterr().err
    header, per_ampere = table("f.csv")
    assert header[:6] == ["x", "y", "z", "Bx", "By", "Bz"] and len(header) == 15
    np.testing.assert_array_equal(per_ampere[:, 3:6], loop.B(per_ampere[:, :3]))
    for current in ("-2.5", "coil=-2.5"):
        assert output(capsys, *words, f"--current={current}")["unit"] == "T"
        np.testing.assert_allclose(table("f.csv")[1][:, 3:], -2.5 * per_ampere[:, 3:], rtol=1e-12)


@pytest.mark.parametrize(
    ("words", "fragment"),
    [
        (f"solve {SPIRAL} --dimension 2", "can be solved in dimension 2: use 3"),
        (f"solve {SPIRAL} --conduction wire", "invalid choice: 'wire'"),
        (f"solve {SPIRAL} --resolution 9", "resolution must lie between 0.5 and 4 for coils, got 9"),
        (f"solve {RING} --conduction sheet", "conduction is a choice for coils"),
        (f"mesh {SPIRAL} -o coil.su2", "do not hold quad cells"),
        (f"field {LOOP} --points p.csv -o f.csv --current lots", 'must be a number of A, or NAME=A, got "lots"'),
        (f"field {LOOP} --points p.csv -o f.csv --current nan", "must be a number of A"),
        (f"field {LOOP} --points p.csv -o f.csv --current a=1", 'has no circuit "a"; it has "coil"'),
        (f"field {LOOP} --points p.csv -o f.csv --current 1 --current coil=2", "not both"),
        (f"field {LOOP} --points p.csv -o f.csv --current a=1 --current a=2", 'is given twice for "a"'),
        (f"field {RING} --points p.csv -o f.csv --current 1", "--current is for coils"),
        ("report measured.toml -o r.html", "measurements are compared for magnets only"),
    ],
)
def test_bad_input_is_one_line(words: str, fragment: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("recipe.toml").write_text(f'device = "{SPIRAL}"\n')
    Path("measured.toml").write_text(
        f'device = "{SPIRAL}"\n[[measurement]]\nposition = ["0 mm", "0 mm", "1 mm"]\ndirection = [0, 0, 1]\n'
        'value = "2 mT"\nsource = "a bench"\n'
    )
    assert main(words.split()) == 2
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if " s  " not in line]
    assert out == "" and len(lines) == 1 and lines[0].startswith("magfem: error: ")
    assert fragment in lines[0]
    assert {path.name for path in here.iterdir()} == {"p.csv", "recipe.toml", "measured.toml"}


def test_one_value_for_two_circuits_is_refused_with_their_names(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    stator = magfem.load_geometry(STATOR)

    def unsolved(geometry: Any, *_: object) -> CoilSolution:
        circuits: Any = geometry.circuits
        return CoilSolution(geometry, circuits, {"B": 0.0, "gradient": 0.0}, {}, {"resolution": 1.0})

    monkeypatch.setattr("magfem.fem.solve", unsolved)
    assert main(["field", STATOR, "--points", "p.csv", "-o", "f.csv", "--current", "1"]) == 2
    assert '2 circuits: --current NAME=A of "inner", "outer"' in capsys.readouterr().err
    assert stator.name
