"""Published coefficients as models: conversion, the committed models, and recipes that are wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from references import inverse_distance

import magfem
from magfem.cli.program import main
from magfem.errors import CardError, InputError
from magfem.fitting.published import is_published, load_published, published_axial_multipole

ROOT = Path(__file__).parents[2]
PUBLISHED = json.loads((ROOT / "tests" / "references" / "bigmag.json").read_text())


@pytest.mark.parametrize("pole", range(1, 7))
def test_every_pole_is_a_derivative_of_one_over_r(pole):
    """B = ∇ ∂^k/∂z^k (1/r), differentiated by rule."""
    points = np.random.default_rng(pole).uniform(0.5, 1.5, (50, 3)) * [1, -1, 1]
    found = published_axial_multipole([0.0] * (pole - 1) + [1.0], radius=0.5).jet(points, 0)[0]
    expected = inverse_distance.gradient(inverse_distance.along(2, pole), points).astype(float)
    size = np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(found / size, expected / size, atol=1e-12)


@pytest.mark.parametrize("kind", ["air", "iron"])
def test_on_the_axis_each_pole_is_a_power(kind):
    """B_z = Σ a_k (−1)^{k+1} (k+1)! / z^{k+2}: the published closed form."""
    model, z = magfem.load_model(f"bigmag_{kind}"), np.linspace(0.046, 0.140, 20)
    a, factorials = PUBLISHED["coil_types"][kind]["a"], [2, 6, 24, 120]
    expected = sum(
        (-1) ** (k + 1) * f * ak / z ** (k + 2) for k, (ak, f) in enumerate(zip(a, factorials, strict=True), 1)
    )
    np.testing.assert_allclose(model.B(np.stack([0 * z, 0 * z, z], axis=-1))[:, 2], expected, rtol=1e-13)


@pytest.mark.parametrize("kind", ["air", "iron"])
def test_committed_model_is_what_its_recipe_makes(kind, tmp_path):
    recipe, made = ROOT / "fits" / f"bigmag_{kind}.toml", tmp_path / "made.json"
    assert main(["fit", str(recipe), "-o", str(made)]) == 0
    ours, committed = (json.loads(path.read_text()) for path in (made, ROOT / "fits" / f"bigmag_{kind}.json"))
    for data in (ours, committed):
        data["provenance"].pop("versions")
        data["provenance"]["recipe"].pop("path")
    assert ours == committed
    a = load_published(recipe).lowered.coefficient
    np.testing.assert_array_equal(a, published_axial_multipole(PUBLISHED["coil_types"][kind]["a"]).coefficient)


def test_command_line_says_that_nothing_was_fitted(tmp_path, capsys):
    assert main(["fit", "bigmag_air", "-o", str(tmp_path / "air.json")]) == 0
    shown = capsys.readouterr().out
    assert "as published" in shown and "its ground" in shown
    assert is_published("bigmag_air") and not is_published("rotor_1x3")


RECIPE = """
published = "axial_multipole"
name = "one pole"
source = "nobody"
coefficients = [1e-7]
[region]
centre = ["0 mm", "0 mm", "50 mm"]
radius = "40 mm"
[bound]
B = 0.1
gradient = 0.2
ground = "none"
"""


def test_smallest_recipe(tmp_path):
    (tmp_path / "one.toml").write_text(RECIPE)
    model = load_published(tmp_path / "one.toml")
    model.save(tmp_path / "one.json")
    again = magfem.load_model(tmp_path / "one.json")
    assert (again.unit, again.region, again.report) == ("T/A", model.region, model.report)
    np.testing.assert_allclose(again.B([0, 0, 0.05]), [0, 0, 2e-7 / 0.05**3], rtol=1e-13, atol=1e-25)
    for one in (model, again):
        assert one.covariance is None and json.loads((tmp_path / "one.json").read_text())["covariance"] is None
        with pytest.raises(InputError, match='no covariance is known of the coefficients of "one pole"'):
            one.deviation([0, 0, 0.05])


def test_committed_models_claim_no_certainty(tmp_path):
    """Nobody published how well these coefficients are known, so that a deviation of 0 T would be made up."""
    for name in ("bigmag_air", "bigmag_iron"):
        model = magfem.load_model(name)
        with pytest.raises(InputError, match="no covariance is known"):
            model.deviation(model.region.centre)
        for target in ("c", "mat", "mpem", "vtu"):
            file = {"c": "h", "mpem": "yaml"}.get(target, target)
            assert main(["export", name, "--to", target, "-o", str(tmp_path / f"{name}.{file}")]) == 0
        assert main(["report", name, "-o", str(tmp_path / f"{name}.html")]) == 0


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('"axial_multipole"', '"octopus"', r'"axial_multipole", got "octopus" \[.*: published\]'),
        ("[1e-7]", "[]", "list of numbers a_k"),
        ("[1e-7]", '["1e-7"]', "list of numbers a_k"),
        ("[1e-7]", "[inf]", "finite, 80 at most"),
        ("[1e-7]", str([1.0] * 81), "finite, 80 at most"),
        ('"40 mm"', '"0 mm"', r"radius must be positive \[.*: region.radius\]"),
        ('["0 mm", "0 mm", "50 mm"]', '["0 mm"]', "centre must be three lengths"),
        ("B = 0.1", "B = 0", r"relative error above 0 \[.*: bound.B\]"),
        ('ground = "none"', "", 'missing key "ground"'),
        ('source = "nobody"', 'sauce = "nobody"', 'unknown key "sauce"; did you mean "source"'),
    ],
)
def test_broken_recipes_say_where(tmp_path, old, new, complaint):
    (tmp_path / "one.toml").write_text(RECIPE.replace(old, new))
    with pytest.raises(CardError, match=complaint):
        load_published(tmp_path / "one.toml")


def test_unknown_name_is_refused():
    with pytest.raises(InputError, match="unknown fit recipe"):
        load_published("bigmag_wood")
