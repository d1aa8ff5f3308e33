"""Recipes of scenarios: what they become, and one sentence with file and key for what is wrong in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenario.recipes import TWO_MAGNETS, with_cameras

from magfem.errors import CardError, InputError
from magfem.geometry.card import parse_table
from magfem.geometry.catalogue import names
from magfem.scenario import load_scenario
from magfem.scenario.scenario_file import KIND, read_scenario
from magfem.scenario.sensing import Cameras


def read(text):
    return read_scenario(parse_table(text.encode(), "a.toml"))


def test_a_recipe_becomes_a_scenario_in_si():
    found = read(TWO_MAGNETS)
    assert found.planar and found.compare_forces and found.stiffness == 1.15 and found.hold == 3
    assert found.settings == {"current_limit": 6.0, "current_step": 0.3}
    first, inner, _, outer = found.rod.sections
    assert (first.length, first.radius, first.youngs_modulus, first.density) == (25e-3, 1.5e-3, 5.5e6, 1040.0)
    assert inner.moment_vector.tolist() == [0, 0, -0.021] and outer.mass == pytest.approx(1.47e-4)
    np.testing.assert_allclose(found.rod.base.rotation.apply([0, 0, 1]), [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(found.rod.base.translation, [-0.03, 0, 0])
    angle = np.radians([80, 60])
    np.testing.assert_allclose(found.targets[0].directions, np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1))


def test_a_magnet_of_a_card_has_its_moment_volume_and_length_and_may_be_reversed():
    """N45's remanence of 1.32 to 1.38 T, 2.5 × 4 mm: moment = remanence · volume / µ₀."""
    rod = load_scenario("steer_planar").rod
    inner, outer = rod.magnets
    volume = np.pi / 4 * 2.5e-3**2 * 4e-3
    assert 1.32 < outer.moment_vector[2] * 4e-7 * np.pi / volume < 1.38
    np.testing.assert_allclose(inner.moment_vector, -outer.moment_vector, atol=1e-18)
    assert outer.length == pytest.approx(4e-3) and outer.mass == pytest.approx(7500 * volume)


def test_targets_in_space_are_turns_of_z_about_horizontal_axes():
    text = TWO_MAGNETS.replace("planar = true\n", "")
    turns = '[{ axis = [0, 2, 0], angle = "30 deg" }, { axis = [1, 0, 0], angle = "90 deg" }]'
    text = text[: text.index("[[targets]]")] + f"[[targets]]\nmagnets = {turns}\n"
    np.testing.assert_allclose(read(text).targets[0].directions, [[0.5, 0, np.sqrt(0.75)], [0, -1, 0]], atol=1e-15)


def test_every_scenario_of_the_catalogue_can_be_read():
    found = []
    for name in names("reports", ".toml"):
        try:
            found.append(load_scenario(name).name)
        except CardError as error:
            assert f'of kind "{KIND}"' in str(error)  # a report recipe
    assert len(found) == len(set(found)) >= 5


def test_the_recipe_of_the_documentation_is_one():
    page = (Path(__file__).parents[2] / "docs" / "steering.md").read_text(encoding="utf-8")
    recipe = page.split("```toml\n")[1].split("```")[0]
    assert read(recipe).rod.magnets[0].length == pytest.approx(4e-3)


def test_cameras_are_read():
    sensing = read(with_cameras()).sensing
    assert isinstance(sensing, Cameras) and sensing.noise == 0.3 and sensing.points == 100
    np.testing.assert_allclose(sensing.cameras[0].centre, [0.12, -0.3, 0])


@pytest.mark.parametrize(
    ("old", "new", "where", "words"),
    [
        ('"scenario"', '"report"', "kind", 'a scenario is of kind "scenario"'),
        ("hold = 3", "hold = -1", "hold", "whole number from 0"),
        ("hold = 3", "holt = 3", "holt", 'did you mean "hold"?'),
        ("planar = true", 'planar = "yes"', "planar", "must be true or false"),
        ('"25 mm"', "25", "rod.sections[0].length", 'expected a length with its unit, such as "4 mm"'),
        ('material = "rubber"', 'material = "steel"', "rod.sections[0].material", "there: rubber"),
        ('"-21 mA m^2"', '"21 mT"', "rod.sections[1].moment", "magnetic moment"),
        ('moment = "-21 mA m^2"', 'magnet = "solenoid_20x30x30"', "rod.sections[1]", "unknown key"),
        ("stiffness = 1.15", "stiffness = 0", "plant.stiffness", "positive factor"),
        ('"6 A"', '"6 V"', "controller.current_limit", "expected a current"),
        ("[controller]", "[controller]\npatience = -1", "controller.patience", "not negative"),
        ('["80 deg", "60 deg"]', '["80 deg"]', "targets[0].angles", "a list of 2"),
        ('["80 deg", "60 deg"]', '["80 deg", 60]', "targets[0].angles", "bare number"),
        ("[plant]", '[random]\ncount = 2\ncurrent = "1 A"\n[plant]', "random", "not both"),
        ("[plant]", '[sensing]\nkind = "sonar"\n[plant]', "sensing.kind", '"exact" or "cameras"'),
        ("hold = 3", 'gravity = ["0 m/s^2", "0 m/s^2", "9.81 m"]', "gravity", "acceleration"),
        ("hold = 3", 'start = "bent"', "start", '"straight" or "previous"'),
        ("direction = [1, 0, 0]", "direction = [0, 0, 0]", "rod.direction", "not all zero"),
    ],
)
def test_what_is_wrong_is_one_sentence_with_file_and_key(old, new, where, words):
    assert old in TWO_MAGNETS
    with pytest.raises(CardError) as caught:
        read(TWO_MAGNETS.replace(old, new, 1))
    assert caught.value.where.startswith(f"a.toml: {where}"), caught.value
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_rod_without_magnets_cannot_be_steered():
    text = TWO_MAGNETS
    for moment in ("-21", "21"):
        block = f'[[rod.sections]]\nmoment = "{moment} mA m^2"\nlength = "4 mm"\nmass = "0.147 g"\n'
        assert block in text
        text = text.replace(block, "")
    with pytest.raises(CardError, match="at least one magnet"):
        read(text)


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(InputError, match="steer_planar"):
        load_scenario("steer_planer")
