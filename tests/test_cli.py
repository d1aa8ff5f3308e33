"""The command line, as a user meets it: results, exit codes, one line for every error, nothing half-written."""

from __future__ import annotations

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import magfem
from magfem.cli import main, points
from magfem.cli.program import command_line

CHECKOUT = Path(__file__).parents[1]
RING = "ring_magnet_4x1.5x1"
POINTS = "x,y,z\n0,0,0.003\n0.0021,0.0007,0.0019\n-0.001,0.003,-0.002\n"


def start(*words: str | Path, cwd: Path, program: tuple[str, ...] = ("-m", "magfem")) -> subprocess.Popen[str]:
    """`magfem …` in a process of its own, in which a warning is an error and Ctrl-C works."""
    path = os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, *program, *map(str, words)],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": path, "PYTHONWARNINGS": "error"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def run(*words: str | Path, cwd: Path, code: int = 0) -> tuple[str, str]:
    """stdout and stderr of `magfem …`, which must end with `code`."""
    process = start(*words, cwd=cwd)
    out, err = process.communicate(timeout=300)
    assert process.returncode == code, f"{words}: {process.returncode}\n{out}\n{err}"
    return out, err


def run_json(*words: str | Path, cwd: Path, code: int = 0) -> Any:
    """What `magfem … --json` prints, which must be one JSON value and nothing else."""
    return json.loads(run(*words, "--json", cwd=cwd, code=code)[0])


def error_line(capsys: pytest.CaptureFixture[str], *words: str | Path, code: int = 2) -> str:
    """The one line that a failing command prints, run in this process."""
    assert main([str(word) for word in words]) == code
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if " s  " not in line]  # without progress
    assert out == "" and len(lines) == 1, f"{words}: {out}\n{err}"
    assert lines[0].startswith("magfem: error: ")
    return lines[0]


@pytest.fixture(scope="session")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A model of the ring made by `magfem fit`, and what was printed."""
    folder = tmp_path_factory.mktemp("fit")
    out, _ = run("fit", RING, "-o", "ring.json", cwd=folder)
    return folder / "ring.json", out


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


# --- every command does its work ---------------------------------------------------------------------------


def test_list_names_everything_in_the_catalogue(tmp_path: Path) -> None:
    names = run_json("list", cwd=tmp_path)
    assert set(names) == {"cards", "systems", "models", "recipes", "reports", "scenarios"}
    assert names["cards"] == sorted(path.stem for path in (CHECKOUT / "geometries").glob("*.toml"))
    assert names["systems"] == sorted(path.stem for path in (CHECKOUT / "geometries" / "systems").glob("*.toml"))
    out, err = run("list", cwd=tmp_path)
    assert "Ring magnet N48" in out and err == ""


def test_show_prints_derived_numbers_and_draws(tmp_path: Path) -> None:
    shown = run_json("show", RING, cwd=tmp_path)
    geometry = magfem.load_geometry(RING)
    assert shown["volume"] == geometry.volume
    assert shown["area"] == geometry.area
    assert shown["moment"] == geometry.moment.tolist()
    assert shown["dimension"] == 2
    assert shown["picture"] == f"{RING}.png"
    assert (tmp_path / f"{RING}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("file", "dimension"), [("ring.msh", "3"), ("half.vtu", "2")])
def test_mesh_file_keeps_cells_and_bodies(tmp_path: Path, file: str, dimension: str) -> None:
    import meshio

    words = ("mesh", RING, "-o", file, "--dimension", dimension, "--resolution", "0.5")
    result = run_json(*words, cwd=tmp_path)
    mesh = meshio.read(tmp_path / file, file_format="gmsh" if file.endswith(".msh") else None)
    (cells,) = mesh.cells
    assert len(cells.data) == result["cells"] > result["bodies"]["magnet"] > 0
    assert np.count_nonzero(mesh.cell_data["body"][0] == 0) == result["bodies"]["magnet"]


def test_solve_keeps_what_it_prints(tmp_path: Path) -> None:
    printed = run_json("solve", RING, "-o", "solution", cwd=tmp_path)
    assert printed == json.loads((tmp_path / "solution" / "summary.json").read_text())
    assert (tmp_path / "solution" / "solution.vtu").is_file()
    assert printed["error"]["B"] < 1e-4
    assert main(["solve", RING, "-q", "-o", str(tmp_path / "solution")]) == 0  # a former result may go


def test_solve_without_output_leaves_no_files(tmp_path: Path) -> None:
    out, err = run("solve", RING, "--resolution", "0.5", cwd=tmp_path)
    assert "stated error" in out and "peak memory" in out
    assert " s  mesh: " in err and "stated error" in err
    assert list(tmp_path.iterdir()) == []


def test_fit_prints_its_errors_next_to_the_dissertation(fitted: tuple[Path, str]) -> None:
    path, out = fitted
    report = json.loads(path.read_text())["report"]
    for text in ("stated bound", "this model", "dissertation", report["label"], report["comparison"][0]["label"]):
        assert text in out
    assert f"{report['bound']['gradient']:.1e} in the gradient" in out


def test_fit_takes_a_recipe_of_the_users_own(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(f'device = "{RING}"\n[target]\nB = 0.05\ngradient = 0.5\n')
    result = run_json("fit", "mine.toml", "--resolution", "0.5", cwd=tmp_path)
    assert result["output"] == "mine.json"
    assert result["report"]["target"] == {"B": 0.05, "gradient": 0.5}
    assert result["provenance"]["solver"]["resolution"] == 0.5
    assert magfem.load_model(tmp_path / "mine.json").moment.tolist() == result["moment"]


def test_validate_keeps_the_bound_or_returns_one(fitted: tuple[Path, str], tmp_path: Path) -> None:
    model, _ = fitted
    result = run_json("validate", model, cwd=tmp_path)
    assert result["passed"]
    assert result["reference"] == "finite elements at twice the resolution (dimension 2, resolution 2)"
    content = json.loads(model.read_text())
    content["report"]["bound"]["B"] = 1e-9
    (tmp_path / "boast.json").write_text(json.dumps(content))
    assert not run_json("validate", "boast.json", cwd=tmp_path, code=1)["passed"]
    out, _ = run("validate", "boast.json", cwd=tmp_path, code=1)
    assert "EXCEEDED" in out


def test_validate_against_the_closed_form_needs_recoil_one(
    fitted: tuple[Path, str], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = error_line(capsys, "validate", fitted[0], "--against", "exact")
    assert "closed form holds for recoil permeability 1, this device has 1.05" in line
    card = (CHECKOUT / "geometries" / f"{RING}.toml").read_text()
    Path("one.toml").write_text(card.replace("recoil_permeability = 1.05", "recoil_permeability = 1.0"))
    assert main(["fit", "./one.toml", "-q"]) == 0
    assert main(["validate", "one.json", "--against", "exact"]) == 0
    assert "the stated bound is kept" in capsys.readouterr().out


def test_validate_against_itself_finds_nothing(fitted: tuple[Path, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", str(fitted[0]), "--against", str(fitted[0]), "--json", "-q"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["found"]["B"]["max"] == 0.0 and err == ""


def test_field_keeps_every_bit(fitted: tuple[Path, str], tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(POINTS)
    run("field", fitted[0], "--points", "p.csv", "-o", "f.csv", "--gradient", cwd=tmp_path)
    header, *rows = csv.reader((tmp_path / "f.csv").read_text().splitlines())
    components = [f"dB{i}_d{j}" for i in "xyz" for j in "xyz"]
    assert header == ["x", "y", "z", "Bx", "By", "Bz", *components]
    values = np.array(rows, dtype=float)
    points = np.array([row.split(",") for row in POINTS.split()[1:]], dtype=float)
    B, gradient = magfem.load_model(fitted[0]).jet(points)
    assert np.array_equal(values, np.hstack([points, B, gradient.reshape(-1, 9)]))


def test_field_of_a_card_is_its_solution(fitted: tuple[Path, str], tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("\ufeffname, z_mm, x_um, y_cm\n\na,3,0,0\nb,1.9,2100,0.07\n", encoding="utf-8")
    card = CHECKOUT / "geometries" / f"{RING}.toml"
    result = run_json("field", card, "--points", "p.csv", "-o", "f.csv", cwd=tmp_path)
    assert result == {"output": "f.csv", "points": 2, "unit": "T", "gradient": False}
    values = np.loadtxt(tmp_path / "f.csv", delimiter=",", skiprows=1)
    assert values[:, :3] == pytest.approx(np.array([[0, 0, 3e-3], [2.1e-3, 0.7e-3, 1.9e-3]]))
    expected = magfem.load_model(fitted[0]).B(values[:, :3])
    assert np.allclose(values[:, 3:], expected, rtol=0, atol=2e-4 * np.abs(expected).max())


def test_field_outside_the_region(fitted: tuple[Path, str], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("p.csv").write_text("x,y,z\n0,0,0.1\n")
    words = ["field", str(fitted[0]), "--points", "p.csv", "-o", "f.csv"]
    assert "outside the field's region" in error_line(capsys, *words)
    assert not Path("f.csv").exists()
    assert main([*words, "--outside", "nan"]) == 0
    assert Path("f.csv").read_text() == "x,y,z,Bx,By,Bz\n0.0,0.0,0.1,nan,nan,nan\n"
    assert main([*words, "--outside", "extrapolate"]) == 0
    assert "nan" not in Path("f.csv").read_text()


def test_field_at_no_points_is_a_header(fitted: tuple[Path, str], here: Path) -> None:
    Path("p.csv").write_text("x,y,z\n")
    assert main(["field", str(fitted[0]), "--points", "p.csv", "-o", "f.csv", "--gradient"]) == 0
    assert len(Path("f.csv").read_text().splitlines()) == 1


def test_report_is_one_page(fitted: tuple[Path, str], tmp_path: Path) -> None:
    assert run_json("report", fitted[0], "-o", "r.html", cwd=tmp_path) == {"output": ["r.html"]}
    assert (tmp_path / "r.html").read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html>")


def test_two_processes_at_once_make_equal_models(fitted: tuple[Path, str], tmp_path: Path) -> None:
    both = [start("fit", RING, "-o", name, cwd=tmp_path) for name in ("a.json", "b.json")]
    for process in both:
        _, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
    models = [json.loads(path.read_text()) for path in (tmp_path / "a.json", tmp_path / "b.json", fitted[0])]
    for model in models:
        del model["provenance"]["solution"]["stats"], model["provenance"]["date"]  # time and memory differ
    assert models[0] == models[1] == models[2]


# --- help --------------------------------------------------------------------------------------------------


def test_every_example_in_the_help_is_understood() -> None:
    commands = command_line()
    for name, parser in commands.commands.items():
        examples = [line for line in (parser.epilog or "").splitlines() if line.startswith("  magfem")]
        assert 2 <= len(examples) <= 4, name
        for example in examples:
            assert commands.parse(shlex.split(example)[1:]).run is parser.get_default("run"), example
    for line in (commands.parser.epilog or "").splitlines():
        if line.startswith("  magfem"):
            commands.parse(shlex.split(line)[1:])


@pytest.mark.parametrize("words", [["--help"], ["solve", "--help"], ["--version"]])
def test_help_and_version_are_results(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert "magfem" in out and err == ""


def test_no_command_at_all_gets_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    out, err = capsys.readouterr()
    assert out == "" and "from card to report" in err


# --- bad input: one line, exit code 2 ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "fragment"),
    [
        ("sovle x", 'unknown command "sovle"; the nearest is "solve"'),
        ("solve", "the following arguments are required: CARD"),
        ("solve ring_magnet", f'unknown device card "ring_magnet"; the nearest is "{RING}"'),
        ("solve missing.toml", "no such file [missing.toml]"),
        (f"solve {RING} --dimension 4", "invalid choice: 4"),
        (f"solve {RING} --resolution fine", "invalid float value: 'fine'"),
        (f"solve {RING} --resolution nan", "resolution must lie between"),
        (f"solve {RING} --tolerance 2", "tolerance must be a relative error between 0 and 1"),
        (f"solve {RING} --speed 2", "unrecognized arguments: --speed"),
        (f"solve {RING} -o file", "expected a folder to write, got a file [file]"),
        (f"solve {RING} -o no/where", "there is no folder"),
        (f"solve {RING} -o .", "the current folder cannot be replaced"),
        (
            f"solve {RING} -o full",
            "this folder holds other files (precious.txt): choose another or an empty one [full]",
        ),
        (f"mesh {RING} -o ring.stl", "files that end in .stl do not hold tetra cells; formats that do: .msh, .vtu"),
        (f"mesh {RING} -o ring.vtu --resolution 1e9", "resolution must lie between"),
        (
            "mesh rotor_1x3 -o ring.vtu --dimension 2",
            "only bodies of revolution with axial magnetisation can be solved in dimension 2: use 3",
        ),
        (f"fit {RING} -o full", "expected a file to write, got a directory [full]"),
        (f"fit {RING} -o no/where.json", "there is no folder no [no/where.json]"),
        (f"fit {RING} -o ring.html", "expected a file that ends in .json [ring.html]"),
        ("fit wrong.toml", 'unknown key "familly"'),
        ("validate missing.json", "not found [missing.json]"),
        ("validate broken.json", "not valid JSON"),
        ("validate other.json", "this is not a field model"),
        (f"field {RING} --points missing.csv -o f.csv", "no such file [missing.csv]"),
        (f"field {RING} --points full -o f.csv", "expected a CSV file, got a directory [full]"),
        (f"report {RING} -o report.txt", "expected a file that ends in .html"),
        (f"show {RING} -o full", "expected a file to write, got a directory"),
    ],
)
def test_bad_input_is_one_line(words: str, fragment: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "full").mkdir()
    files = {
        "full/precious.txt": "",
        "file": "",
        "broken.json": "{",
        "other.json": "{}",
        "wrong.toml": f'device = "{RING}"\nfamilly = "loops"\n',
    }
    for name, content in files.items():
        (here / name).write_text(content)
    assert fragment in error_line(capsys, *shlex.split(words))
    left = {str(path.relative_to(here)) for path in here.rglob("*") if path.is_file()}
    assert left == set(files)


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        (
            b"",
            "column x is missing: expected the header x,y,z (m) or x_mm,y_mm,z_mm, got an empty file [p.csv: line 1]",
        ),
        (
            b"x,y\n1,2\n",
            'column z is missing: expected the header x,y,z (m) or x_mm,y_mm,z_mm, got "x,y" [p.csv: line 1]',
        ),
        (b"x y z\n1 2 3\n", 'got "x y z" [p.csv: line 1]'),
        (b"x,y,z,x_mm\n1,2,3,4\n", 'column x is there 2 times: "x", "x_mm" [p.csv: line 1]'),
        (b"x_kg,y,z\n1,2,3\n", 'column "x_kg" does not end in a unit of length such as mm [p.csv: line 1]'),
        (b"x,y,z\n1,2,3\n1,two,3\n", 'expected a finite number, got "two" [p.csv: line 3, column y]'),
        (b"x,y,z_mm\n1,2,\n", 'expected a finite number, got "" [p.csv: line 2, column z_mm]'),
        (b"x,y,z\n1,2,nan\n", 'expected a finite number, got "nan" [p.csv: line 2, column z]'),
        (b"x,y,z\n1,2,-inf\n", 'expected a finite number, got "-inf" [p.csv: line 2, column z]'),
        (b"x,y,z\n\n1,2\n", "expected 3 cells as in the header, got 2 [p.csv: line 3]"),
        (b'x,y,z\n1,2,"3\n', "not valid CSV: unexpected end of data [p.csv: line 2]"),
        (b"x,y,z\n1,2,\xff\n", "not UTF-8 text [p.csv]"),
    ],
)
def test_malformed_points_name_file_line_and_column(
    content: bytes, fragment: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("p.csv").write_bytes(content)
    assert fragment in error_line(capsys, "field", RING, "--points", "p.csv", "-o", "f.csv")
    assert not Path("f.csv").exists()


def test_points_that_may_not_be_read_are_bad_input(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root may read everything: the refusal is played by the call itself."""

    def refused(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied", "p.csv")

    monkeypatch.setattr(points.Path, "read_text", refused)
    line = error_line(capsys, "field", RING, "--points", "p.csv", "-o", "f.csv")
    assert "cannot be read: Permission denied [p.csv]" in line


def test_bad_input_from_a_shell(tmp_path: Path) -> None:
    out, err = run("solve", "rotor", cwd=tmp_path, code=2)
    assert out == "" and err.count("\n") == 1 and 'the nearest is "rotor_1x3"' in err


# --- failures and interruptions ----------------------------------------------------------------------------


def test_a_tolerance_out_of_reach_is_three(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules["magfem.fem.solve_magnets"].RESOLUTIONS, 2, (0.2, 1.0))
    assert "out of reach" in error_line(capsys, "solve", RING, "--tolerance", "1e-12", code=3)


@pytest.mark.parametrize(
    ("error", "code", "fragment"),
    [
        (MemoryError(), 3, "out of memory: lower the resolution"),
        (ZeroDivisionError("a\nb"), 3, "ZeroDivisionError: a\\nb: this is a bug in magfem"),
        (OSError(28, "No space left on device", "x.vtu"), 2, "No space left on device [x.vtu]"),
        (ModuleNotFoundError("no", name="h5py"), 2, "the Python package h5py is missing: pip install h5py"),
    ],
)
def test_failures_are_one_line(
    error: Exception, code: int, fragment: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("magfem.fem.solve", fail)
    assert fragment in error_line(capsys, "solve", RING, code=code)
    assert main(["solve", RING, "--debug"]) == code
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(("error", "code"), [(OSError(30, "Read-only file system"), 2), (KeyboardInterrupt(), 130)])
def test_an_interrupted_write_leaves_what_was_there(
    error: BaseException,
    code: int,
    fitted: tuple[Path, str],
    here: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        raise error

    Path("p.csv").write_text(POINTS)
    Path("f.csv").write_text("before")
    monkeypatch.setattr("os.replace", fail)
    assert main(["field", str(fitted[0]), "--points", "p.csv", "-o", "f.csv"]) == code
    assert capsys.readouterr().err.count("\n") == 1
    assert Path("f.csv").read_text() == "before"
    assert {path.name for path in here.iterdir()} == {"p.csv", "f.csv"}


def test_a_killed_write_leaves_what_was_there(fitted: tuple[Path, str], tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(POINTS)
    (tmp_path / "f.csv").write_text("before")
    killed_while_writing = (
        "import os, sys, magfem.cli; os.chmod = lambda *_: os.kill(os.getpid(), 9); magfem.cli.main(sys.argv[1:])"
    )
    words = ("field", fitted[0], "--points", "p.csv", "-o", "f.csv")
    process = start(*words, cwd=tmp_path, program=("-c", killed_while_writing))
    process.communicate(timeout=300)
    assert process.returncode == -signal.SIGKILL
    assert (tmp_path / "f.csv").read_text() == "before"


def test_ctrl_c_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    process = start("solve", RING, "--dimension", "3", "--resolution", "2", "-o", "solution", cwd=tmp_path)
    assert process.stderr is not None
    assert "mesh: " in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)
    assert process.returncode in (130, -signal.SIGINT)  # a shell calls both 130
    assert out == "" and err.splitlines()[-1] == "magfem: interrupted" and "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_a_closed_pipe_is_no_error(tmp_path: Path) -> None:
    process = start("list", cwd=tmp_path)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.wait(timeout=300) == 141
    assert process.stderr.read() == ""
    process.stderr.close()
