"""Model files and recipes: what is saved comes back to the bit, what is broken is one sentence."""

from __future__ import annotations

import copy
import json
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import magfem
from magfem.errors import CardError, InputError, OutsideRegionError
from magfem.fields.terms import concatenate, harmonics, loops
from magfem.fields.terms_json import terms_from_list, terms_to_list
from magfem.fitting import Recipe, load_model, load_recipe


@pytest.fixture(scope="session")
def sound(skew_model) -> dict:
    """A whole model file, as JSON sees it."""
    return json.loads(json.dumps(skew_model.to_dict(), default=lambda array: array.tolist()))


# Round trips


@pytest.mark.parametrize("name", ["ring", "rotor", "skew", "ring_solution"])
def test_saved_model_comes_back_to_the_bit(name, request, tmp_path):
    model = request.getfixturevalue(f"{name}_model")
    file, twice = tmp_path / "model.json", tmp_path / "twice.json"
    model.save(file)
    again = load_model(file)
    points = model.region.layers(np.random.default_rng(1), 8, 20)
    for ours, theirs in zip(model.jet(points, 2), again.jet(points, 2), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(again.covariance, model.covariance)
    np.testing.assert_array_equal(again.moment, model.moment)
    assert (again.name, again.unit, again.region) == (model.name, model.unit, model.region)
    assert again.report == json.loads(json.dumps(model.report)) and again.provenance == model.provenance
    again.save(twice)
    assert twice.read_bytes() == file.read_bytes()


def test_loaded_model_keeps_its_region(skew_model, tmp_path):
    skew_model.save(tmp_path / "model.json")
    with pytest.raises(OutsideRegionError):
        load_model(tmp_path / "model.json").B([0, 0, 1.0])


def test_file_has_the_keys_others_read(sound):
    assert sound["format"] == "magfem-model" and sound["version"] == 1 and sound["unit"] == "T"
    assert {"kind", "centre", "direction", "coefficients"} <= set(sound["terms"][0])
    assert {"training", "heldout", "bound", "condition", "worst", "fem"} <= set(sound["report"])
    assert set(sound["report"]["bound"]) == {"B", "gradient"}
    assert {"device", "solver", "versions", "date"} <= set(sound["provenance"])


def test_card_in_the_file_gives_the_device_back(ring_solution_model, skew_model, skew, tmp_path):
    for model, device in ((ring_solution_model, magfem.load_geometry("ring_magnet_4x1.5x1")), (skew_model, skew)):
        card = tmp_path / "card.toml"
        card.write_text(model.provenance["device"]["card"]["text"], encoding="utf-8")
        assert magfem.load_geometry(card) == device


def test_any_terms_come_back_to_the_bit():
    rng = np.random.default_rng(2)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame[:, 1] = np.cross(frame[:, 2], frame[:, 0])
    terms = concatenate(
        [
            loops(rng.normal(size=(3, 3)), rng.uniform(1, 2, 3), rng.normal(size=3), frame),
            harmonics(0.1, [1, 2, 5], [0, 2, 5], [0, 1, 0], rng.normal(size=3), rng.normal(size=3), frame),
        ]
    )
    again = terms_from_list(json.loads(json.dumps(terms_to_list(terms))))
    for key, value in ((field.name, getattr(terms, field.name)) for field in fields(terms)):
        np.testing.assert_array_equal(getattr(again, key), value)


def test_terms_without_azimuth_are_read():
    """Where the first axis does not matter it may be left out."""
    loop = {"kind": "loop", "centre": [0, 0, 0], "direction": [0, 3, 4], "radius": 1, "coefficients": [2]}
    axis = np.array([0, 0.6, 0.8])
    B = terms_from_list([loop]).jet(axis[None], 0)[0][0]
    np.testing.assert_allclose(B, 4e-7 * np.pi / (2 * np.sqrt(2) ** 3) * 2 * axis, rtol=1e-9, atol=1e-20)


# Broken files

DELETE = object()


def broken(sound: dict, path: str, value: object) -> str:
    """The file's text with `value` at the dotted `path`."""
    data = copy.deepcopy(sound)
    *parents, last = path.split(".")
    place = data
    for key in parents:
        place = place[int(key) if key.isdigit() else key]
    if value is DELETE:
        del place[last]
    else:
        place[int(last) if last.isdigit() else last] = value
    return json.dumps(data)


FAULTS = [
    ("format", "something-else", "format"),
    ("format", DELETE, "format"),
    ("version", 2, "version"),
    ("version", DELETE, "version"),
    *((key, DELETE, f"missing key '{key}'") for key in ("name", "unit", "terms", "parameter", "covariance")),
    *((key, DELETE, f"missing key '{key}'") for key in ("region", "report", "provenance")),
    ("name", 7, "a text"),
    ("unit", "mT", '"T" or "T/A"'),
    ("unit", ["T"], '"T" or "T/A"'),
    ("terms", [], "at least one term"),
    ("terms", {"0": 1}, "at least one term"),
    ("terms", [7], "terms"),
    ("terms.0.kind", "spiral", "spiral"),
    ("terms.0.kind", DELETE, "missing key 'kind'"),
    ("terms.0.centre", [0, 0], "three numbers"),
    ("terms.0.centre", [0, 0, float("nan")], "finite numbers"),
    ("terms.0.centre", "origin", "finite numbers"),
    ("terms.0.direction", [0, 0, 0], "three numbers"),
    ("terms.0.direction", [0, 0, 2], "length one"),
    ("terms.0.azimuth", [0, 0, 1], "perpendicular"),
    ("terms.0.azimuth", [1, 0], "three numbers"),
    ("terms.0.radius", 0, "positive radius"),
    ("terms.0.radius", -1e-3, "positive radius"),
    ("terms.0.radius", float("inf"), "finite"),
    ("terms.0.radius", [1], "one number"),
    ("terms.0.radius", True, "finite number"),
    ("terms.0.coefficients", [1.0], "one length"),
    ("terms.0.coefficients", 1.0, "list of coefficients"),
    ("terms.0.coefficients.0", float("nan"), "finite"),
    ("terms.0.coefficients.0", "1", "finite"),
    ("terms.0.coefficients.0", [1, 2], "finite"),
    ("terms.0.degrees", [1], "one length"),
    ("terms.0.degrees", 1, "terms"),
    ("terms.0.degrees.0", 0, "no monopole"),
    ("terms.0.degrees.0", 10**9, "degrees from 1 to"),
    ("terms.0.degrees.0", 1.5, "whole numbers"),
    ("terms.0.degrees.0", "1", "whole numbers"),
    ("terms.0.orders.0", -1, "orders between"),
    ("terms.0.orders.0", 2, "orders between"),
    ("terms.0.parts.0", "tan", '"cos" or "sin"'),
    ("terms.0.parts.0", ["cos"], "terms"),
    ("parameter", [0], "one index"),
    ("parameter.0", 0.5, "one index"),
    ("parameter.0", -1, "one index"),
    ("parameter.0", "0", "one index"),
    ("covariance", [[1.0]], "one row and one column"),
    ("covariance", [1.0], "one row and one column"),
    ("covariance.0", [1.0], "lists of one length"),
    ("covariance.0.0", float("nan"), "finite"),
    ("covariance.0.0", None, "finite"),
    ("region", [1], "region"),
    ("region", {"kind": "everywhere"}, "shell"),
    ("region.kind", "cube", "unknown region kind 'cube'"),
    ("region.clearance", "2 mm", "region"),
    ("region.clearance", float("nan"), "clearance"),
    ("region.clearance", 1.0, "clearance"),
    ("region.extent", DELETE, "missing key 'extent'"),
    ("region.hull.kind", "cone", "unknown hull kind 'cone'"),
    ("region.hull.diameter", -1.0, "hull"),
    ("region.hull.diameter", DELETE, "region"),
    ("region.hull.diameter", [1], "region"),
    ("report", [], "a table"),
    ("report.bound", DELETE, "missing key 'bound'"),
    ("report.bound.B", DELETE, "missing key 'B'"),
    ("report.bound.B", float("nan"), "finite"),
    ("report.bound.gradient", "small", "finite"),
    ("report.bound.gradient", -1.0, "relative errors"),
    ("provenance", None, "a table"),
]


@pytest.mark.parametrize(("path", "value", "message"), FAULTS, ids=[f"{p}-{m}" for p, _, m in FAULTS])
def test_broken_model_is_one_sentence_that_names_file_and_key(sound, tmp_path, path, value, message):
    file = tmp_path / "broken.json"
    file.write_text(broken(sound, path, value), encoding="utf-8")
    with pytest.raises(CardError, match=re.escape(message)) as caught:
        load_model(file)
    text = str(caught.value)
    assert len(text.splitlines()) == 1 and len(text) < 300 + len(str(file))
    assert f"[{file}: {path.split('.')[0]}" in text


@pytest.mark.parametrize("content", ["null", "[]", "7", '"magfem-model"', "{}", '{"format": "magfem-model"}'])
def test_json_that_is_no_model_is_refused(tmp_path, content):
    file = tmp_path / "broken.json"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(CardError, match=r"broken\.json: (format|version)\]"):
        load_model(file)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.999])
def test_truncated_file_is_refused_with_its_line(sound, tmp_path, share):
    text = json.dumps(sound, indent=1)
    file = tmp_path / "broken.json"
    file.write_text(text[: int(share * len(text))], encoding="utf-8")
    with pytest.raises(InputError, match=r"not valid JSON \(line \d+: .*broken\.json\]") as caught:
        load_model(file)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_refused(tmp_path):
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    for file, message in (("absent.json", "not found"), ("binary.json", "cannot be read"), (".", "cannot be read")):
        with pytest.raises(InputError, match=message):
            load_model(tmp_path / file)
    with pytest.raises(InputError, match='unknown field model "no_such_model"'):
        load_model("no_such_model")


# Recipes


def recipe(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "recipe.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_whole_recipe_is_read(tmp_path):
    text = """
        device = "ring_magnet_4x1.5x1"
        family = "wall_and_face_loops"
        seed = 5
        [target]
        B = 1e-3
        gradient = 2e-2
        [solve]
        dimension = 3
        resolution = 0.5
    """
    device = magfem.load_geometry("ring_magnet_4x1.5x1")
    expected = Recipe(
        device, "wall_and_face_loops", target_B=1e-3, target_gradient=2e-2, seed=5, dimension=3, resolution=0.5
    )
    assert load_recipe(recipe(tmp_path, text)) == expected


def test_short_recipe_takes_what_suits_the_device(tmp_path):
    found = load_recipe(recipe(tmp_path, 'device = "rotor_1x3"'))
    assert found == Recipe(geometry=magfem.load_geometry("rotor_1x3"))
    assert found.targets == {"B": 5e-5, "gradient": 5e-4}


def test_device_may_be_a_card_beside_the_recipe(tmp_path, monkeypatch):
    card = magfem.load_geometry("rotor_1x3").origin.text
    (tmp_path / "mine.toml").write_text(card, encoding="utf-8")
    monkeypatch.chdir("/")
    assert load_recipe(recipe(tmp_path, 'device = "mine.toml"')).geometry == magfem.load_geometry("rotor_1x3")


@pytest.mark.parametrize("name", ["ring_magnet_4x1.5x1", "rotor_1x3"])
def test_catalogue_recipes_are_read(name):
    found = load_recipe(name)
    assert found.geometry == magfem.load_geometry(name)
    assert found.targets["B"] <= 5e-4 and found.targets["gradient"] <= 5e-3


HEAD = 'device = "rotor_1x3"\n'


@pytest.mark.parametrize(
    ("text", "message", "key"),
    [
        ("", 'a recipe names a "device", a [samples] file, or both', ""),
        ("device = 3", "device must be a text", "device"),
        ('device = ""', "must not be blank", "device"),
        (HEAD + "sed = 3", 'did you mean "seed"', "sed"),
        (HEAD + 'family = "loops"', "unknown family; known: search, wall_and_face_loops", "family"),
        (HEAD + "family = 3", "family must be a text", "family"),
        (HEAD + 'seed = "0"', "seed must be a bare number", "seed"),
        (HEAD + "seed = -1", "seed must be a whole number", "seed"),
        (HEAD + "seed = 1.5", "seed must be a whole number", "seed"),
        (HEAD + "seed = nan", "seed must be a whole number", "seed"),
        (HEAD + "seed = inf", "seed must be a whole number", "seed"),
        (HEAD + "target = 1e-3", "target must be a table", "target"),
        (HEAD + "[target]\nB = 0.0", "between 0 and 1", "target.B"),
        (HEAD + "[target]\nB = 1.0", "between 0 and 1", "target.B"),
        (HEAD + "[target]\ngradient = nan", "between 0 and 1", "target.gradient"),
        (HEAD + '[target]\nB = "5e-4"', "must be a bare number", "target.B"),
        (HEAD + "[target]\nforce = 0.1", "unknown key", "target.force"),
        (HEAD + "[solve]\ndimension = 4", "dimension must be 2 or 3", "solve.dimension"),
        (HEAD + "[solve]\ndimension = 2.5", "dimension must be 2 or 3", "solve.dimension"),
        (HEAD + "[solve]\ndimension = nan", "dimension must be 2 or 3", "solve.dimension"),
        (HEAD + "[solve]\nresolution = 0", "resolution must be positive", "solve.resolution"),
        (HEAD + "[solve]\nresolution = nan", "resolution must be positive", "solve.resolution"),
        (HEAD + "[solve]\ntolerance = 1e-3", "unknown key", "solve.tolerance"),
        (HEAD + "[target\nB = 1", "not valid TOML", "line 2"),
    ],
)
def test_broken_recipe_is_one_sentence_that_names_file_and_key(tmp_path, text, message, key):
    file = recipe(tmp_path, text)
    with pytest.raises(CardError, match=re.escape(message)) as caught:
        load_recipe(file)
    assert len(str(caught.value).splitlines()) == 1
    assert str(caught.value).endswith(f"[{file}: {key}]" if key else f"[{file}]")


def test_recipe_of_an_unknown_device_or_name_is_refused(tmp_path):
    with pytest.raises(InputError, match='unknown device card "rotor_1x4"; the nearest is "rotor_1x3"'):
        load_recipe(recipe(tmp_path, 'device = "rotor_1x4"'))
    with pytest.raises(InputError, match="no such file"):
        load_recipe(recipe(tmp_path, 'device = "absent.toml"'))
    with pytest.raises(InputError, match="unknown fit recipe"):
        load_recipe("no_such_recipe")
    with pytest.raises(CardError, match="no such file"):
        load_recipe(tmp_path / "absent.toml")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"family": "loops"}, "unknown family"),
        ({"target_B": 0.0}, "target_B must be a relative error"),
        ({"target_B": float("nan")}, "target_B must be a relative error"),
        ({"target_gradient": 1.0}, "target_gradient must be a relative error"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"seed": 0.5}, "seed must be a whole number"),
        ({"dimension": 4}, "dimension must be 2 or 3"),
        ({"resolution": -1.0}, "resolution must be positive"),
    ],
)
def test_recipe_made_in_python_is_checked_too(values, message):
    with pytest.raises(InputError, match=message):
        Recipe(**values)
