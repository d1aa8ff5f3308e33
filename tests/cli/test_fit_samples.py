"""`magfem fit` on measured samples: files, mapped columns, devices, recipes, and faults in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import magpylib
import numpy as np
import pytest

import magfem
from magfem.cli import main
from magfem.geometry import DiscMagnet

NOISE = 10e-6
DISC = "disc_magnet_8x2"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with samples of a quadrupole, of a disc and of a system."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    points = rng.uniform(-10e-3, 10e-3, (80, 3))
    field = points @ np.diag([2.0, -1.0, -1.0]) + NOISE * rng.normal(size=points.shape)
    rows = np.hstack([points, field])
    np.savetxt("field.csv", rows, delimiter=",", header="x,y,z,Bx,By,Bz", comments="")
    above = np.column_stack([rng.uniform(-10e-3, 10e-3, (150, 2)), rng.uniform(3e-3, 12e-3, 150)])
    magnet = magpylib.magnet.Cylinder(dimension=(8e-3, 2e-3), polarization=(0, 0, 1.1))
    seen = magnet.getB(above) + NOISE * rng.normal(size=above.shape)
    # Seen from the magnet: the stage moves the other way, in millimetres.
    scan = np.hstack([-1e3 * above[:, :1], 1e3 * above[:, 1:], 1e3 * seen])
    np.savetxt("scan.csv", scan, delimiter=",", header="stage_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT", comments="")
    Path("system.csv").write_text("px,py,pz,i0,bx,by\n0,0,0,1,0,0\n")
    return tmp_path


def output(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """What a command prints with --json."""
    assert main([*words, "--json", "-q"]) == 0
    return json.loads(capsys.readouterr().out)


def test_samples_become_a_model_of_their_name(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fit", "field.csv", "--sigma", "10 uT", "-q"]) == 0
    text = capsys.readouterr().out
    assert "interior harmonics up to degree 2" in text and "residual" in text
    model = magfem.load_model(here / "field.json")
    middle = model.region.layers(np.random.default_rng(0), 1, 10)[0]
    assert np.abs(model.gradient(middle) - np.diag([2.0, -1.0, -1.0])).max() < 5e-3


def test_json_says_what_was_found(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = output(capsys, "fit", "field.csv", "--sigma", "10 uT", "-o", "mine.json")
    report = found["report"]
    assert Path("mine.json").is_file() and report["objective"] == "sigma"
    assert report["uncertainty"]["noise"] == pytest.approx(NOISE)
    assert report["uncertainty"]["standardised_residual"] == pytest.approx(1.0, abs=0.15)
    assert found["provenance"]["samples"]["points"] == 80
    assert found["region"]["kind"] in ("ball", "box")


def test_without_a_deviation_the_residual_says_the_noise(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = output(capsys, "fit", "field.csv")["report"]
    assert report["objective"] == "absolute"
    assert report["uncertainty"]["noise"] == pytest.approx(NOISE, rel=0.2)


def test_samples_of_a_device_take_its_family(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Mapped columns, and strengths of the faces that are those of the magnet."""
    words = ["fit", "scan.csv", "--device", DISC, "--column", "x=-stage_mm", "--sigma", "10 uT", "-o", "disc.json"]
    report = output(capsys, *words, "--family", "charged_faces")["report"]
    assert report["family"] == "charged_faces"
    assert report["uncertainty"]["standardised_residual"] == pytest.approx(1.0, abs=0.15)
    device = magfem.load_geometry(DISC)
    assert isinstance(device, DiscMagnet)
    moment = 1.1 / (4e-7 * np.pi) * device.volume
    assert magfem.load_model("disc.json").moment == pytest.approx([0, 0, moment], rel=2e-3, abs=2e-3 * moment)


def test_a_mapping_the_wrong_way_is_no_model(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["fit", "scan.csv", "--device", DISC, "--column", "x=stage_mm", "--sigma", "10 uT"]
    assert main([*words, "--family", "charged_faces", "-q"]) == 3
    assert "describes these samples: of held-out ones" in capsys.readouterr().err


def test_a_recipe_of_samples_reads_beside_itself(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = here / "bench"
    folder.mkdir()
    Path("scan.csv").rename(folder / "scan.csv")
    (folder / "disc.toml").write_text(
        f'device = "{DISC}"\nname = "scanned disc"\nfamily = "charged_faces"\n'
        '[samples]\nfile = "scan.csv"\nsigma = "10 uT"\ncolumns = { x = "-stage_mm" }\n'
        '[free]\ncentre_x = "1 mm"\nheight = ["-1 mm", "1 mm"]\n'
    )
    found = output(capsys, "fit", "bench/disc.toml", "-o", "disc.json")
    assert found["name"] == "scanned disc"
    free = found["report"]["measurement"]["free"]
    assert set(free) == {"centre_x", "centre_z"}
    assert all(abs(one["value"]) < 4 * one["deviation"] for one in free.values())


def test_degenerate_parameters_have_no_deviation(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("gain.toml").write_text(
        f'device = "{DISC}"\nfamily = "charged_faces"\n[samples]\nfile = "scan.csv"\nsigma = "10 uT"\n'
        'columns = { x = "-stage_mm" }\n[free]\ngain = true\n'
    )
    found = output(capsys, "fit", "gain.toml")["report"]["measurement"]
    assert found["degenerate"] == ["gain"] and found["free"]["gain"]["deviation"] is None


@pytest.mark.parametrize(
    ("words", "fragment"),
    [
        ("fit gone.csv", "gone.csv"),
        ("fit field.csv --sigma 3", "flux density"),
        ("fit field.csv --sigma 1mm", "not a flux density"),
        ("fit field.csv --sigma 0uT", "positive"),
        ("fit field.csv --column q=x", 'no column "q"'),
        ("fit field.csv --column x=depth", 'no column "depth"'),
        ("fit field.csv --column x", "expected NAME=COLUMN"),
        ("fit field.csv --device nothing", 'unknown device card "nothing"'),
        ("fit field.csv --family splines", "unknown family"),
        ("fit field.csv --family axial_multipole", "needs a device"),
        ("fit field.csv -o model.txt", ".json"),
        ("fit scan.csv", "column x is missing"),
        ("fit system.csv", "column Bz is missing"),
        (f"fit {DISC} --sigma 1uT", "--sigma is for samples"),
        (f"fit {DISC} --column x=y", "--column is for samples"),
        (f"fit {DISC} --device {DISC}", "--device is for samples"),
    ],
)
def test_faults_are_one_line(words: str, fragment: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(here.iterdir())
    assert main([*words.split(), "-q"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.strip().splitlines()
    assert fragment in line and "Traceback" not in line
    assert sorted(here.iterdir()) == before
