"""System files: everything comes back, what is wrong is one sentence with file and key; the command line end to end."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from actuation.calibration_bench import BACKGROUND, GRID, NOISE, octomag_samples, saturating, unit_fields
from references.mpem_formula import file_field

import magfem
from magfem.actuation import calibrate
from magfem.cli import main
from magfem.errors import CardError, InputError
from magfem.fields.region import Everywhere, Intersection
from magfem.files import write_text
from magfem.samples import samples_text


@pytest.fixture(scope="module")
def system():
    return calibrate(octomag_samples(1, per=3, sigma=NOISE), degrees=3, name="Bench").system


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_round_trip_is_exact(system, here):
    system.save("system.json")
    again = magfem.load_system("system.json")
    again.save("again.json")
    assert Path("system.json").read_bytes() == Path("again.json").read_bytes()
    points, currents = GRID[::7], np.arange(8) - 3.0
    for order in (0, 2):
        jets = (loaded.jet(points, currents, order=order) for loaded in (again, system))
        for one, other in zip(*jets, strict=True):
            np.testing.assert_array_equal(one, other)
    assert again.name == "Bench" and again.workspace == system.workspace
    assert again.report == system.report and again.provenance == system.provenance
    assert [coil.name for coil in again.coils] == [coil.name for coil in system.coils]


@pytest.mark.parametrize("name", ["bigmag", "octomag"])
def test_systems_of_the_catalogue_with_poses_and_limits(name, here):
    """Poses are kept up to the rounding of their quaternions."""
    original = magfem.load_system(name)
    original = replace(
        original, coils=tuple(replace(coil, current_limit=5.0 + k) for k, coil in enumerate(original.coils))
    )
    original.save("system.json")
    again = magfem.load_system("system.json")
    points, currents = np.zeros((1, 3)), np.linspace(-4, 4, len(original.coils))
    expected = original.B(points, currents)
    np.testing.assert_allclose(again.B(points, currents), expected, atol=1e-14 * np.abs(expected).max() * 1e3)
    assert [coil.current_limit for coil in again.coils] == [coil.current_limit for coil in original.coils]
    assert again.region.contains(points).all() and again.source == original.source


def edited(system, change):
    """A file with one thing changed; `change` takes the content and may return other content."""
    system.save("system.json")
    data = json.loads(Path("system.json").read_text())
    changed = change(data)
    data = data if changed is None else changed
    write_text(Path("wrong.json"), json.dumps(data))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda d: [], r'"format" must be "magfem-system" \[wrong.json: format\]'),
        (lambda d: d.update(format="magfem-model"), r'"format" must be "magfem-system"'),
        (lambda d: d.update(version=2), r"version 2 of the format is not known, expected 1 \[wrong.json: version\]"),
        (lambda d: d.pop("workspace") and None, r"missing key 'workspace'"),
        (lambda d: d.update(colour=1), r'expected the keys format, .*, got "colour"'),
        (lambda d: d.update(name=3), r"expected a text \[wrong.json: name\]"),
        (lambda d: d.update(coils={}), r"expected a list of tables \[wrong.json: coils\]"),
        (lambda d: d["coils"].append(3), r"expected a table for every coil \[wrong.json: coils\[8\]\]"),
        (lambda d: d["coils"][2].pop("terms") and None, r"missing key 'terms' \[wrong.json: coils\[2\]\]"),
        (lambda d: d["coils"][2].update(turns=3), r'got "turns" \[wrong.json: coils\[2\]\]'),
        (lambda d: d["coils"][2].update(current_limit=-1), r"current_limit must be positive"),
        (lambda d: d["coils"][2].update(current_limit="1 A"), r"expected .*numbers?.* \[wrong.json: coils\[2\]\]"),
        (lambda d: d["coils"][1].update(name="Coil_0"), r'"Coil_0" is given twice \[wrong.json: coils\]'),
        (lambda d: d["coils"][0].update(pose={"position": [0, 0, 0]}), r"missing key 'quaternion'"),
        (
            lambda d: d["coils"][0].update(pose={"position": [0, 0, 0], "quaternion": [0, 0, 0, 2]}),
            r"quaternion of length one",
        ),
        (lambda d: d["coils"][0]["terms"][0].update(degrees=[0] * 15), r"harmonics have degrees from 1"),
        (lambda d: d.update(background=[]), r"expected a list of at least one term \[wrong.json: background\]"),
        (lambda d: d.update(workspace={"kind": "cone"}), r"unknown region kind .*\[wrong.json: workspace\]"),
        (lambda d: d.update(report=None), r"expected a table \[wrong.json: report\]"),
    ],
)
def test_wrong_files_are_one_sentence_with_file_and_key(system, here, change, complaint):
    edited(system, change)
    with pytest.raises(CardError, match=complaint) as caught:
        magfem.load_system("wrong.json")
    assert "\n" not in str(caught.value)


def test_files_that_are_no_systems(system, here):
    with pytest.raises(InputError, match="not found"):
        magfem.load_system("none.json")
    write_text(Path("broken.json"), "{")
    with pytest.raises(InputError, match="not valid JSON"):
        magfem.load_system("broken.json")
    with pytest.raises(InputError, match="cannot write"):
        system.save(here / "no" / "folder.json")


def test_a_failed_save_leaves_the_old_file(system, here):
    Path("system.json").write_text("old")
    with pytest.raises(ValueError):
        replace(system, report={"bad": float("nan")}).save("system.json")
    with pytest.raises(InputError, match="cannot be written"):
        replace(system, workspace=Intersection((Everywhere(),))).save("system.json")
    assert Path("system.json").read_text() == "old" and [one.name for one in here.iterdir()] == ["system.json"]


# The command line


def run(capsys, *words):
    assert main([*words, "--json", "-q"]) == 0
    return json.loads(capsys.readouterr().out)


def test_from_measurements_to_an_mpem_file(here, capsys):
    """CSV in, system out, exported, and evaluated by the formula: the truth the CSV was made of."""
    samples = octomag_samples(2, per=4)
    write_text(Path("bench.csv"), samples_text(samples))
    found = run(capsys, "fit", "bench.csv", "-o", "system.json", "--sigma", "50 uT")
    assert found["output"] == "system.json" and found["report"]["saturation"]["saturates"] == []
    assert found["report"]["objective"] == "sigma"
    exported = run(capsys, "export", "system.json", "--to", "mpem", "-o", "system.yaml")
    assert exported["exact"] and exported["sources"] > 8
    content = yaml.safe_load(Path("system.yaml").read_text())
    currents = np.array([1.0, -2.0, 3.0, 0.0, 5.0, -1.0, 2.0, -3.0])
    points = GRID[::5]
    B = file_field(points, content, currents)
    np.testing.assert_allclose(B, unit_fields(points) @ currents + BACKGROUND, atol=1.5 * NOISE)
    ours = magfem.load_system("system.json").B(points, currents)
    np.testing.assert_allclose(B, ours, atol=1e-12 * np.abs(B).max())


def test_what_people_read(here, capsys):
    write_text(Path("bench.csv"), samples_text(octomag_samples(3, per=4, response=saturating(6, 0.04))))
    assert main(["fit", "bench.csv", "-q"]) == 0
    text = capsys.readouterr().out
    assert Path("bench.json").exists()
    for words in ("saturation    Coil_6", "background", "linearity", "field at the centre per A", "Coil_7", "held out"):
        assert words in text
    assert all(len(line) < 140 for line in text.splitlines())


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["fit", "bench.csv", "--device", "loop_50"], '--device is for single devices, and "bench.csv" is of a coil'),
        (["fit", "bench.csv", "--resolution", "2"], "--resolution is for single devices"),
        (["fit", "bench.csv", "-o", "system.yaml"], "expected a file that ends in .json"),
        (["export", "system.json", "--to", "c", "-o", "s.h"], "this is not a field model"),
        (
            ["export", "system.json", "--to", "mpem", "-o", "s.yaml", "--current", "2"],
            "--current is for one coil's model",
        ),
    ],
)
def test_options_that_do_not_go_with_systems(system, here, capsys, words, complaint):
    write_text(Path("bench.csv"), samples_text(octomag_samples(4, per=1)))
    system.save("system.json")
    assert main(words) == 2
    error = capsys.readouterr().err
    assert complaint in error and "Traceback" not in error
    assert not Path("bench.json").exists() and not Path("s.yaml").exists()
