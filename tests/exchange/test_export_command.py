"""`magfem export`, as a user meets it."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from exchange.exchanged_fields import KINDS
from references.mpem_formula import file_field
from scipy.io import loadmat
from vtkmodules.vtkIOXML import vtkXMLImageDataReader

import magfem
from magfem.cli import main
from magfem.cli.export import TARGETS
from magfem.cli.program import command_line
from magfem.exchange import c_header
from magfem.fields import Field, Shell
from magfem.fields.region_parts import bounding_box, region_points
from magfem.fields.terms_json import terms_to_list
from magfem.fields.workspace_region import Box
from magfem.typing import Floats

RING, ROTOR, SOLENOID = "ring_magnet_4x1.5x1", "rotor_1x3", "solenoid_24x48x60_front"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def coil(here: Path) -> Field:
    """A model per ampere, in coil.json: the rotor's file with a loop in it."""
    data = magfem.load_model("rotor_1x3").to_dict()
    data |= {"name": "Coil", "unit": "T/A", "terms": terms_to_list(KINDS["tilted loop"])}
    data |= {"parameter": [0], "covariance": [[0.0]]}
    Path("coil.json").write_text(json.dumps(data))
    return magfem.load_model("coil.json")


def output(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main(["export", *words, "--json", "-q"]) == 0
    return json.loads(capsys.readouterr().out)


def error_line(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["export", *words]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    return err


def source_of(path: str) -> Any:
    spec = importlib.util.spec_from_file_location("exported", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.source


@pytest.mark.parametrize("to", TARGETS)
def test_every_target_writes_its_file_and_says_so(here: Path, capsys: pytest.CaptureFixture[str], to: str) -> None:
    file = f"rotor{TARGETS[to].ending}"
    data = output(capsys, ROTOR, "--to", to, "-o", file)
    assert (data["output"], data["to"], data["unit"]) == (file, to, "T")
    assert {path.name for path in here.iterdir()} == {file, *data.get("beside", [])}
    assert main(["export", ROTOR, "--to", to, "-o", file]) == 0
    out, err = capsys.readouterr()
    assert file in out and out.count("\n") == 1 and "ampere" not in err


def test_c_takes_its_name_from_the_file_or_the_option(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ring = magfem.load_model(RING)
    assert output(capsys, RING, "--to", "c", "-o", "ring-4x1.5.h")["function"] == "ring_4x1_5_field"
    assert Path("ring-4x1.5.h").read_text() == c_header(ring, "ring_4x1_5")
    output(capsys, RING, "--to", "c", "-o", "ring.h", "--name", "magnet")
    assert Path("ring.h").read_text() == c_header(ring, "magnet")


def test_module_gives_a_source(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output(capsys, RING, "--to", "magpylib", "-o", "ring.py")
    point = [0.0, 0.0, 3e-3]
    assert np.array_equal(source_of("ring.py").getB(point), magfem.load_model(RING).B(point))


def test_grid_and_bounds(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bounds = "-3 mm, 3 mm, -3mm, 3mm, 1 mm, 4000 um"
    data = output(capsys, RING, "--to", "vti", "-o", "ring.vti", "--grid", "13", "--bounds", bounds)
    assert data["points"] == 13 * 13 * 7
    assert np.allclose(data["bounds"], [[-3e-3, -3e-3, 1e-3], [3e-3, 3e-3, 4e-3]])
    reader = vtkXMLImageDataReader()
    reader.SetFileName("ring.vti")
    reader.Update()
    assert reader.GetOutput().GetDimensions() == (13, 13, 7)


def test_samples_at_given_points(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The file is that of `magfem field`, and its numbers are the model's."""
    Path("p.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n2.1,0.7,1.9\n")
    assert output(capsys, RING, "--to", "samples", "-o", "s.csv", "--points", "p.csv", "--gradient")["points"] == 2
    assert main(["field", RING, "--points", "p.csv", "-o", "f.csv", "--gradient", "-q"]) == 0
    assert Path("s.csv").read_bytes() == Path("f.csv").read_bytes()


def test_samples_of_the_region_are_the_models(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output(capsys, RING, "--to", "samples", "-o", "s.csv")
    table = np.loadtxt("s.csv", delimiter=",", skiprows=1)
    assert table.shape == (2560, 6)
    assert np.array_equal(magfem.load_model(RING).B(table[:, :3]), table[:, 3:])


def test_a_coil_says_that_it_is_per_ampere(coil: Field, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "coil.json", "--to", "samples", "-o", "s.csv"]) == 0
    out, err = capsys.readouterr()
    assert "T/A" in out and "--current" in err
    assert output(capsys, "coil.json", "--to", "mat", "-o", "coil.mat")["unit"] == "T/A"
    assert loadmat("coil.mat")["unit"] == ["T/A"]


def test_current_makes_a_coil_a_field_in_tesla(coil: Field, capsys: pytest.CaptureFixture[str]) -> None:
    point = [0.0, 0.0, 6e-3]
    for to in TARGETS:
        words = (to, "-o", f"coil{TARGETS[to].ending}", "--current", "-0.5")
        assert output(capsys, "coil.json", "--to", *words)["unit"] == "T"
    assert np.allclose(source_of("coil.py").getB(point), -0.5 * coil.B(point), rtol=1e-14, atol=0)
    assert loadmat("coil.mat")["coefficient"] == -0.5 * 60.0
    assert loadmat("coil.mat")["name"] == ["Coil"]
    table = np.loadtxt("coil.csv", delimiter=",", skiprows=1)
    assert np.array_equal(table[:, 3:], -0.5 * coil.B(table[:, :3]))


def content(path: str) -> Any:
    return yaml.safe_load(Path(path).read_text(encoding="utf-8"))


def worst_of(found: Floats, true: Floats) -> float:
    """Largest relative error of vectors (n, 3)."""
    return float((np.linalg.norm(found - true, axis=1) / np.linalg.norm(true, axis=1)).max())


def test_calibration_of_a_model_of_harmonics_is_exact(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the formula of the format, all over the model's region."""
    data = output(capsys, "bigmag_iron", "--to", "mpem", "-o", "coil.yaml")
    assert data["exact"] and data["residual"] == {"max": 0, "rms": 0} and data["unit"] == "T/A"
    coil = magfem.load_model("bigmag_iron")
    points = region_points(coil.region, 500)
    assert worst_of(file_field(points, content("coil.yaml"), [3.0]), 3.0 * coil.B(points)) < 1e-12
    assert main(["export", "bigmag_iron", "--to", "mpem", "-o", "coil.yaml", "-q"]) == 0
    out, err = capsys.readouterr()
    assert "exact" in out and err == ""  # the format is per ampere: nothing to explain


def test_calibration_of_a_magnet_is_fitted_and_says_how_well(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In a box of the user's; the residual is that of the file, by the formula."""
    words = ("--to", "mpem", "-o", "ring.yaml", "--bounds", "-2 mm, 2 mm, -2 mm, 2 mm, 2.5 mm, 5 mm")
    data = output(capsys, RING, *words, "--tolerance", "1e-3")
    assert content("ring.yaml")["Workspace_Dimensions"] == [[-2e-3, 2e-3], [-2e-3, 2e-3], [2.5e-3, 5e-3]]
    points = Box((-2e-3, -2e-3, 2.5e-3), (2e-3, 2e-3, 5e-3)).random_points(np.random.default_rng(8), 3000)
    error = worst_of(file_field(points, content("ring.yaml"), []), magfem.load_model(RING).B(points))
    assert 0 < data["residual"]["rms"] < data["residual"]["max"] < 1e-3 and not data["exact"]
    assert data["residual"]["max"] / 10 < error < data["residual"]["max"]
    assert main(["export", RING, *words, "-q"]) == 0
    assert "relative error of B at most" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["bigmag", "octomag"])
def test_calibration_of_a_whole_system(here: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    data = output(capsys, name, "--to", "mpem", "-o", "system.yaml")
    system = magfem.load_system(name)
    assert data["exact"] and data["name"] == system.name and len(data["coils"]) == len(system.coils)
    currents = np.random.default_rng(9).uniform(-1, 1, len(system.coils))
    points = region_points(system.region, 500)
    assert output(capsys, "system.yaml", "--to", "mpem", "-o", "again.yaml")["name"] == system.name  # a path this time
    for file in ("system.yaml", "again.yaml"):
        assert worst_of(file_field(points, content(file), currents), system.B(points, currents)) < 1e-11


def test_other_programs_take_windows_of_coils(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The solenoid's model is per ampere and in a window: its grid fills that, its samples lie in it, in T at 2 A."""
    coil = magfem.load_model(SOLENOID)
    data = output(capsys, SOLENOID, "--to", "vti", "-o", "coil.vti", "--grid", "9")
    assert isinstance(coil.region, Shell) and coil.region.windowed
    assert np.allclose(data["bounds"], bounding_box(coil.region)) and data["unit"] == "T/A"
    output(capsys, SOLENOID, "--to", "samples", "-o", "coil.csv", "--current", "2")
    table = np.loadtxt("coil.csv", delimiter=",", skiprows=1)
    assert coil.region.contains(table[:, :3]).all()
    assert np.allclose(table[:, 3:], 2 * coil.B(table[:, :3]), rtol=1e-14, atol=0)


def test_calibration_of_a_coil_in_its_window(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Loops become multipoles all over the window, and the stated error is the file's, by the formula."""
    data = output(capsys, SOLENOID, "--to", "mpem", "-o", "coil.yaml")
    coil = magfem.load_model(SOLENOID)
    points = region_points(coil.region)
    error = worst_of(file_field(points, content("coil.yaml"), [1.0]), coil.B(points))
    assert error < data["residual"]["max"] < 0.01 and list(data["coils"]) == ["Coil_0"] and not data["exact"]


def test_mistakes_are_one_line_and_leave_nothing(coil: Field, capsys: pytest.CaptureFixture[str]) -> None:
    before = set(Path().iterdir())
    for words, expected in (
        ((RING, "--to", "c", "-o", "ring.txt"), "ends in .h"),
        ((RING, "--to", "c", "-o", "nowhere/ring.h"), "no folder"),
        ((RING, "--to", "c", "-o", "ring.h", "--name", "my ring"), "C name"),
        ((RING, "--to", "fortran", "-o", "ring.f"), "invalid choice"),
        ((RING, "--to", "c", "-o", "ring.h", "--grid", "9"), "--grid is for vti, not for c"),
        ((RING, "--to", "mat", "-o", "ring.mat", "--gradient"), "--gradient is for samples, not for mat"),
        ((RING, "--to", "mat", "-o", "ring.mat", "--points", "p.csv"), "--points is for vtu and samples, not for mat"),
        ((RING, "--to", "vti", "-o", "ring.vti", "--grid", "1"), "2 points or more"),
        ((RING, "--to", "vti", "-o", "ring.vti", "--bounds", "1 mm"), "six lengths"),
        ((RING, "--to", "vti", "-o", "ring.vti", "--bounds", "0,1,0,1,0,1"), "bare number"),
        ((RING, "--to", "vti", "-o", "ring.vti", "--bounds", "1 mm,0 mm,0 mm,1 mm,0 mm,1 mm"), "lowest first"),
        ((RING, "--to", "vtu", "-o", "ring.vtu", "--points", "p.csv"), "no such file"),
        ((RING, "--to", "c", "-o", "ring.h", "--current", "1"), "per ampere"),
        ((RING, "--to", "c", "-o", "ring.h", "--tolerance", "1"), "--tolerance is for mpem, not for c"),
        ((RING, "--to", "mat", "-o", "ring.mat", "--bounds", "1 mm"), "--bounds is for mpem and vti, not for mat"),
        ((RING, "--to", "mpem", "-o", "ring.yaml", "--tolerance", "0"), "positive number"),
        ((RING, "--to", "mpem", "-o", "ring.yaml", "--bounds", "1 mm,0 mm,0 mm,1 mm,0 mm,1 mm"), "above the lower one"),
        (("bigmag", "--to", "mpem", "-o", "bigmag.yaml", "--current", "1"), "this is a coil system"),
        (("bigmag", "--to", "c", "-o", "bigmag.h"), "unknown field model"),
        (("bigmaq", "--to", "mpem", "-o", "bigmag.yaml"), "unknown field model"),
        (("nowhere.yaml", "--to", "mpem", "-o", "bigmag.yaml"), "no such file"),
        (("coil.json", "--to", "c", "-o", "ring.h", "--current", "nan"), "number of A"),
        (("coil.json", "--to", "magpylib", "-o", "coil.py"), "--current"),
        (("ring_magnet", "--to", "c", "-o", "ring.h"), "unknown field model"),
    ):
        assert expected in error_line(capsys, *words), words
    assert set(Path().iterdir()) == before


def test_help_names_every_target(capsys: pytest.CaptureFixture[str]) -> None:
    text = command_line().commands["export"].format_help()
    for to, target in TARGETS.items():
        assert to in text and target.ending in text
