"""`magfem validate`: exit codes, references of every kind, maps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import magpylib
import numpy as np
import pytest

import magfem
from magfem.cli import main
from magfem.fitting import Recipe
from magfem.fitting.recipe_file import load_recipe
from magfem.geometry import AXIAL, PermanentMagnet, RingMagnet
from magfem.samples import Samples, samples_text

GRADIENT = Path(__file__).parents[1] / "references" / "ibi_gradient_2Tpm_tdesign36.csv"
RING = RingMagnet(
    outer_diameter=4e-3,
    inner_diameter=1.5e-3,
    length=1e-3,
    material=PermanentMagnet(1.35, 1.0, AXIAL),
    clearance=0.5e-3,
    extent=6e-3,
)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of the rigid ring's closed form."""
    path = tmp_path_factory.mktemp("ring") / "ring.json"
    magfem.fit(magfem.exact(RING)).save(path)
    return path


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """magpylib's field of the same ring at 300 points, with noise of 0.1 mT, and two points far away."""
    rng = np.random.default_rng(4)
    points = np.concatenate([RING.region.layers(rng, 20, 15).reshape(-1, 3), [[0, 0, 0.1], [0.1, 0, 0]]])
    peer = magpylib.magnet.CylinderSegment(dimension=(0.75e-3, 2e-3, 1e-3, 0, 360), polarization=(0, 0, 1.35))
    path = tmp_path_factory.mktemp("samples") / "samples.csv"
    B = peer.getB(points)
    path.write_text(samples_text(Samples(points, B + rng.normal(scale=1e-4, size=B.shape))))
    return path


def validated(capsys: pytest.CaptureFixture[str], code: int, *words: str | Path) -> Any:
    """What `magfem validate` prints with --json when it ends with `code`."""
    assert main(["validate", *map(str, words), "--json", "-q"]) == code
    return json.loads(capsys.readouterr().out)


def refused(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """The one line that it prints for bad input."""
    assert main(["validate", *map(str, words), "-q"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1
    return err


def test_falsified_coefficient_ends_with_one(ring: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = json.loads(ring.read_text())
    assert validated(capsys, 0, ring, "--against", "exact")["passed"]
    content["terms"][0]["coefficients"][0] *= 1.01
    Path("false.json").write_text(json.dumps(content))
    result = validated(capsys, 1, "false.json", "--against", "exact")
    assert result["found"]["B"]["max"] > result["bound"]["B"] and not result["passed"]
    assert main(["validate", "false.json", "--against", "exact"]) == 1
    assert "the stated bound is EXCEEDED for B and gradient" in capsys.readouterr().out


def test_samples_are_judged_apart_from_their_noise(
    ring: Path, samples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = validated(capsys, 0, ring, "--against", samples, "--sigma", "0.1 mT")
    assert (result["points"], result["outside"]) == (300, 2)
    assert result["found"]["B"]["standardised"] == pytest.approx(1.0, abs=0.07)  # 900 components: ± 2.4 %
    assert result["found"]["gradient"] is None
    assert not validated(capsys, 1, ring, "--against", samples)["passed"]  # as if the field were known so well
    assert main(["validate", str(ring), "--against", str(samples), "--sigma", "0.1 mT"]) == 0
    out = capsys.readouterr().out
    assert "2 samples lie outside the model's region and are left out" in out
    assert "the stated bound is kept" in out and "not measured" in out


def test_columns_of_samples_are_mapped(ring: Path, samples: Path, here: Path, capsys: Any) -> None:
    Path("renamed.csv").write_text(samples.read_text().replace("x,y,z", "a,b,c", 1))
    mapped = [word for pair in ("x=a [m]", "y=b [m]", "z=c [m]") for word in ("--column", pair)]
    assert validated(capsys, 0, ring, "--against", "renamed.csv", "--sigma", "0.1 mT", *mapped)["points"] == 300


def test_models_without_a_device_ask_for_samples(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "comes from no device, so samples are needed to validate it: --against" in refused(capsys, "bigmag_air")
    assert main(["fit", str(GRADIENT), "-o", "field.json", "-q"]) == 0
    capsys.readouterr()
    assert "comes from measured samples, so samples are needed" in refused(capsys, "field.json")
    assert "does not carry its device's card" in refused(capsys, "field.json", "--against", "fem")
    result = validated(capsys, 0, "field.json", "--against", GRADIENT, "-o", "map.png")
    assert result["found"]["B"]["standardised"] > 2 and result["output"] == "map.png"  # its report: bias dominates
    assert Path("map.png").read_bytes().startswith(b"\x89PNG")


def test_options_of_samples_need_samples(ring: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for option in (("--sigma", "1 mT"), ("--column", "x=a"), ("--aligned",)):
        assert "is for samples" in refused(capsys, ring, "--against", "exact", *option)
    assert "ends in .png" in refused(capsys, ring, "--against", "exact", "-o", "map.html")
    Path("far.csv").write_text("x,y,z,Bx,By,Bz\n1,0,0,0,0,1e-9\n")
    assert "none of the 1 samples lies in the model's region" in refused(capsys, ring, "--against", "far.csv")


def test_one_circuit_of_a_coil_is_held_against_finite_elements(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The circuit is in the model; taken for the other one, or without it, the model does not pass."""
    stator = magfem.solve(magfem.load_geometry("stator_1.6x5.5"), resolution=0.5)
    magfem.fit(stator, Recipe(circuit="inner")).save("inner.json")
    content = json.loads(Path("inner.json").read_text())
    assert content["provenance"]["circuit"] == "inner" and content["unit"] == "T/A"
    result = validated(capsys, 0, "inner.json", "-o", "map.png")
    assert result["reference"] == "finite elements at twice the resolution (resolution 1), circuit inner"
    content["provenance"]["circuit"] = "outer"
    Path("outer.json").write_text(json.dumps(content))
    assert validated(capsys, 1, "outer.json")["found"]["B"]["max"] > 0.5
    del content["provenance"]["circuit"]
    Path("none.json").write_text(json.dumps(content))
    assert "does not say which circuit" in refused(capsys, "none.json")


def test_windowed_model_and_its_map(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("front.toml").write_text(
        'device = "ring_magnet_4x1.5x1"\n[region]\nclearance = "0.5 mm"\nextent = "7 mm"\nz = ["1 mm", "6 mm"]\n'
        'rho = ["0 mm", "6 mm"]\n'
    )
    recipe = load_recipe("front.toml")
    assert recipe.geometry is not None
    magfem.fit(magfem.solve(recipe.geometry), recipe).save("front.json")
    result = validated(capsys, 0, "front.json", "-o", "map.png")
    for places in result["worst_points"].values():
        assert all(1e-3 - 1e-9 <= one["point"][2] <= 6e-3 + 1e-9 for one in places)
    assert Path("map.png").read_bytes().startswith(b"\x89PNG")
