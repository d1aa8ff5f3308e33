"""The folder of a simulated scenario: all of it or nothing, its pictures, its page in a browser."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from PIL import Image
from scenario.recipes import TWO_MAGNETS

from magfem.cli import main
from magfem.errors import InputError
from magfem.geometry.card import parse_table
from magfem.report import run_pictures
from magfem.report.run_folder import FILES, write_run
from magfem.scenario import simulate
from magfem.scenario.scenario_file import read_scenario


@pytest.fixture(scope="module")
def run():
    return simulate(read_scenario(parse_table(TWO_MAGNETS.encode(), "a.toml")))


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "out"
    write_run(run, path)
    return path


def test_it_holds_everything_that_was_promised(folder, run):
    assert {file.name for file in folder.iterdir()} == FILES - {"coil.json"}
    data = json.loads((folder / "summary.json").read_text())
    assert len(data["targets"]) == 2 and data["steps"] == len(run.steps)
    rows = list(csv.DictReader(io.StringIO((folder / "timeseries.csv").read_text())))
    assert len(rows) == len(run.steps) and rows[-1]["outcome"] == "converged"
    assert (folder / "scenario.toml").read_text() == TWO_MAGNETS
    assert sum(file.stat().st_size for file in folder.iterdir()) < 10e6


def test_pictures_show_something_and_the_animation_moves(folder):
    for file in folder.glob("*.png"):
        with Image.open(file) as picture:
            pixels = np.asarray(picture.convert("RGB"))
        assert pixels.shape[1] > 1000 and np.mean(np.any(pixels != 255, axis=-1)) > 0.01, file.name
    assert (folder / "animation.gif").stat().st_size < 5e6
    with Image.open(folder / "animation.gif") as moving:
        assert moving.n_frames > 20
        first = np.asarray(moving.convert("RGB"), dtype=int)
        moving.seek(moving.n_frames - 1)
        last = np.asarray(moving.convert("RGB"), dtype=int)
    assert np.mean(np.abs(last - first) > 40) > 1e-3


def test_the_page_opens_by_itself(folder, browser):
    browser.get(f"file://{folder / 'report.html'}")
    assert browser.execute_script("return document.images.length") == 7
    assert browser.execute_script("return [...document.images].every(one => one.complete && one.naturalWidth > 0)")
    assert (
        browser.execute_script(
            "return performance.getEntriesByType('resource').filter(r => !r.name.startsWith('data:')).length"
        )
        == 0
    )
    assert not browser.get_log("browser")
    rows = browser.execute_script(
        "return [...document.querySelectorAll('#target-table tbody tr')].map(r => r.innerText)"
    )
    assert len(rows) == 2 and all("converged" in row for row in rows)
    assert browser.execute_script("return document.documentElement.scrollWidth <= window.innerWidth")


def test_an_interruption_leaves_nothing(run, tmp_path, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(run_pictures, "currents_picture", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_run(run, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_foreign_files_are_left_alone(run, tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(InputError, match=r"thesis\.tex"):
        write_run(run, tmp_path, pictures=False)
    assert (tmp_path / "thesis.tex").read_text() == "mine"


def test_the_command_prints_the_summary_and_its_exit_code_tells_how_it_went(tmp_path, capsys):
    text = TWO_MAGNETS.replace("compare_forces = true", "plans = 0").replace(
        "[controller]", "[controller]\npatience = 20"
    )
    recipe = tmp_path / "a.toml"
    recipe.write_text(text)
    assert main(["simulate", str(recipe), "-o", str(tmp_path / "out"), "--no-pictures", "--json", "-q"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert data["passed"] and [one["outcome"] for one in data["targets"]] == ["converged", "converged"]
    recipe.write_text(text.replace('"6 A"', '"0.5 A"'))  # too weak for these angles
    assert main(["simulate", str(recipe), "-o", str(tmp_path / "out"), "--no-pictures", "-q"]) == 1
    assert "limit active, expected to be reached" in capsys.readouterr().out


def test_mistakes_end_with_exit_code_2_and_one_line(tmp_path, capsys):
    recipe = tmp_path / "a.toml"
    recipe.write_text(TWO_MAGNETS.replace('"bigmag"', '"bigmac"'))
    for words in (
        ["simulate", str(recipe), "-o", str(tmp_path / "out")],
        ["simulate", "steer_planar", "-o", str(tmp_path / "missing" / "out")],
        ["report", "steer_planar", "-o", str(tmp_path / "out.html")],
    ):
        assert main([*words, "-q"]) == 2
        error = capsys.readouterr().err
        assert error.startswith("magfem: error: ") and error.count("\n") == 1
    assert "magfem simulate" in error
    assert [file.name for file in tmp_path.iterdir()] == ["a.toml"]


def test_list_tells_scenarios_from_report_recipes(capsys):
    assert main(["list", "--json", "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"steer_planar", "steer_spatial", "steer_own_coils"} <= set(found["scenarios"])
    assert not set(found["scenarios"]) & set(found["reports"])
    assert "ring_magnet_4x1.5x1" in found["reports"]
