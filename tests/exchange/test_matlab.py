"""MATLAB files, loaded and evaluated by GNU Octave."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from exchange.exchanged_fields import FIELDS, KINDS, TermsField, points_of, worst
from exchange.octave import run_octave
from scipy.io import loadmat, savemat

import magfem
from magfem.errors import InputError
from magfem.exchange import write_mat
from magfem.fields import Everywhere


@pytest.fixture(scope="module")
def evaluated(octave: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which Octave has evaluated every field, all in one run."""
    folder = tmp_path_factory.mktemp("octave")
    script = []
    for number, (name, model) in enumerate(FIELDS.items()):
        write_mat(model, folder / f"model{number}.mat")
        savemat(folder / f"points{number}.mat", {"points": points_of(name)})
        script.append(f"model = load('model{number}.mat'); load('points{number}.mat');")
        script.append("[B, G] = magfem_field(model, points); alone = magfem_field(model, points(1, :));")
        script.append("empty = magfem_field(model, zeros(0, 3));")
        script.append(f"save('-v7', 'field{number}.mat', 'B', 'G', 'alone', 'empty');")
    run_octave(octave, "\n".join(script), folder)
    return folder


@pytest.mark.parametrize("name", FIELDS)
def test_octave_gives_the_field(evaluated: Path, name: str) -> None:
    found = loadmat(evaluated / f"field{list(FIELDS).index(name)}.mat")
    B, gradient = FIELDS[name].jet(points_of(name), 1, outside="extrapolate")
    assert found["G"].shape == (500, 3, 3) and found["empty"].shape == (0, 3)
    assert worst(found["B"], B) < 1e-10
    assert worst(found["alone"], B[:1]) < 1e-10
    if name == "uniform":
        assert np.abs(found["G"]).max() < 1e-14
    else:
        assert worst(found["G"], gradient) < 1e-10


def test_axis_and_disc_are_no_exceptions(octave: str, tmp_path: Path) -> None:
    """On axes, close to them, in the planes of sources, and above rims; more points than it takes at a time."""
    model = TermsField(KINDS["loops"] + KINDS["charge discs"])
    beside = [0.0, 1e-9, 1e-5, 2e-4, 1e-3, 2e-3, 3e-3]
    grid = np.stack(np.meshgrid(beside, [0.0], [-3e-3, 0.0, 1.1e-3, 9e-3]), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid] * 200)
    write_mat(model, tmp_path / "model.mat")
    savemat(tmp_path / "points.mat", {"points": points})
    script = "load('points.mat'); [B, G] = magfem_field(load('model.mat'), points); save('-v7', 'field.mat', 'B', 'G');"
    run_octave(octave, script, tmp_path)
    found = loadmat(tmp_path / "field.mat")
    B, gradient = model.jet(points, 1, outside="extrapolate")
    assert worst(found["B"], B) < 1e-10
    assert worst(found["G"], gradient) < 1e-10


def test_upper_side_of_an_oblate_disc(octave: str, tmp_path: Path) -> None:
    """Within the disc the field jumps; at height zero it is its upper side's."""
    model = TermsField(KINDS["oblate"].source(0), Everywhere())
    centre, frame = model.lowered.centre[0], model.lowered.frame[0]
    above, below = (centre + frame @ np.array([0.5e-3, 0, z]) for z in (1e-12, -1e-12))
    write_mat(model, tmp_path / "model.mat")
    savemat(tmp_path / "points.mat", {"points": np.stack([above, below])})
    run_octave(
        octave, "load('points.mat'); B = magfem_field(load('model.mat'), points); save('-v7', 'B.mat', 'B');", tmp_path
    )
    found, true = loadmat(tmp_path / "B.mat")["B"], model.B(np.stack([above, below]))
    assert worst(found, true) < 1e-9
    assert np.linalg.norm(true[0] - true[1]) > 0.1 * np.linalg.norm(true[0])


def test_octave_reads_what_the_model_is(octave: str, tmp_path: Path) -> None:
    ring = magfem.load_model("ring_magnet_4x1.5x1")
    _, evaluator = write_mat(ring, tmp_path / "ring.mat")
    assert evaluator == tmp_path / "magfem_field.m" and evaluator.exists()
    script = "model = load('ring.mat'); disp(model.name); disp(model.unit); disp(model.region); disp(model.about);"
    printed = run_octave(octave, script + " disp(numel(model.kind)); disp(model.kind{1});", tmp_path).splitlines()
    assert printed[:3] == [ring.name.replace("×", "x"), "T", ring.region.describe()]
    assert any(line.startswith("bound: ") for line in printed)
    assert printed[-2:] == [str(ring.lowered.kind.size), "loop"]


def test_wrong_points_are_named(octave: str, tmp_path: Path) -> None:
    write_mat(FIELDS["uniform"], tmp_path / "model.mat")
    script = "try; magfem_field(load('model.mat'), [1 2]); catch problem; disp(problem.message); end"
    assert "n x 3" in run_octave(octave, script, tmp_path)


def test_help_text_is_the_layout(octave: str, tmp_path: Path) -> None:
    """Every variable of the file is described in the help that `help magfem_field` shows."""
    path, _ = write_mat(FIELDS["everything"], tmp_path / "model.mat")
    shown = run_octave(octave, "disp(get_help_text('magfem_field'));", tmp_path)
    names = [name for name in loadmat(path) if not name.startswith("__")]
    assert len(names) > 12
    for name in names:
        assert f" {name}" in shown, name


def test_numbers_keep_every_bit(tmp_path: Path) -> None:
    ring = magfem.load_model("ring_magnet_4x1.5x1")
    path, _ = write_mat(ring, tmp_path / "ring.mat")
    content = loadmat(path)
    assert np.array_equal(content["coefficient"][:, 0], ring.lowered.coefficient)
    assert np.array_equal(content["centre"], ring.lowered.centre)


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write"):
        write_mat(FIELDS["uniform"], tmp_path / "nowhere" / "model.mat")
