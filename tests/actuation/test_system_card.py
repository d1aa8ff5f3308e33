"""System cards: poses in all their ways, models by name and by file, and complaints that say where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import magfem
from magfem.errors import CardError, InputError
from magfem.fields.workspace_region import Ball, Box

HEAD = """
kind = "coil_system"
name = "bench"
source = "this test"
"""


def load(tmp_path, text):
    (tmp_path / "system.toml").write_text(HEAD + text)
    return magfem.load_system(tmp_path / "system.toml")


def coil(lines="", model="bigmag_air", name="a"):
    return f'[[coils]]\nname = "{name}"\nmodel = "{model}"\n{lines}\n'


@pytest.mark.parametrize(
    ("lines", "rotation"),
    [
        ("", Rotation.identity()),
        ('rotation = [{ z = "180 deg" }, { y = "-34 deg" }]', Rotation.from_euler("ZY", [180, -34], degrees=True)),
        (
            'rotation = [{ z = "0.3 rad" }, { x = "20 deg" }, { z = "-70 deg" }]',
            Rotation.from_euler("ZXZ", [np.degrees(0.3), 20, -70], degrees=True),
        ),
        ("quaternion = [0.0, 2.0, 0, 2]", Rotation.from_euler("y", 90, degrees=True)),
    ],
)
def test_turns_are_intrinsic_and_in_order(tmp_path, lines, rotation):
    """SciPy's capital letters: about the axes as they then lie."""
    system = load(tmp_path, coil('position = ["10 mm", "0 mm", "-2 cm"]\n' + lines))
    pose = system.coils[0].pose
    np.testing.assert_allclose(pose.translation, [0.01, 0, -0.02], rtol=1e-15)
    np.testing.assert_allclose(pose.rotation.as_matrix(), rotation.as_matrix(), atol=1e-14)


def test_direction_is_the_coils_axis(tmp_path):
    system = load(tmp_path, coil("direction = [3, 0, 4]"))
    np.testing.assert_allclose(system.coils[0].pose.rotation.as_matrix()[:, 2], [0.6, 0, 0.8], atol=1e-15)
    own = magfem.load_model("bigmag_air")
    place = 0.05 * np.array([0.6, 0, 0.8])
    expected = own.B([0, 0, 0.05])[2] * np.array([0.6, 0, 0.8])
    np.testing.assert_allclose(system.B(place, [1.0]), expected, rtol=1e-12, atol=1e-18)


def test_placed_coil_is_the_placed_model(tmp_path):
    """The field of the card is that of `Field.at` with the same pose."""
    text = coil('position = ["1 mm", "2 mm", "3 mm"]\nrotation = [{ x = "25 deg" }, { z = "40 deg" }]')
    system = load(tmp_path, text)
    placed = magfem.load_model("bigmag_air").at(system.coils[0].pose)
    points = system.coils[0].pose.apply(
        np.random.default_rng(1).uniform([-0.02, -0.02, 0.05], [0.02, 0.02, 0.1], (9, 3))
    )
    for ours, theirs in zip(system.jet(points, [2.0]), (placed * 2.0).jet(points, 1), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-15 * np.abs(theirs).max())


def test_models_and_limits_beside_the_card(tmp_path):
    magfem.load_model("bigmag_iron").save(tmp_path / "mine.json")
    text = 'current_limit = "5 A"\n' + coil(model="mine.json") + coil('current_limit = "500 mA"', name="b")
    system = load(tmp_path, text)
    assert [one.current_limit for one in system.coils] == [5.0, 0.5]
    np.testing.assert_array_equal(
        system.coils[0].terms.coefficient, magfem.load_model("bigmag_iron").lowered.coefficient
    )


def test_workspaces(tmp_path):
    ball = load(tmp_path, '[workspace]\nradius = "5 mm"\ncentre = ["0 mm", "0 mm", "80 mm"]\n' + coil())
    assert ball.workspace == Ball((0.0, 0.0, 0.08), 0.005) and ball.region == ball.workspace
    box = load(tmp_path, '[workspace]\nsize = ["2 mm", "4 mm", "6 mm"]\n' + coil())
    assert box.workspace == Box((-0.001, -0.002, -0.003), (0.001, 0.002, 0.003))
    free = load(tmp_path, coil())
    assert free.region.contains([0, 0, 0.08]) and not free.region.contains([0, 0, 0.02])


def test_calibration_beside_the_card(tmp_path):
    octomag = Path(__file__).parents[2] / "geometries" / "systems" / "OctoMag_Calibration.yaml"
    (tmp_path / "cal.yaml").write_bytes(octomag.read_bytes())
    text = 'calibration = "cal.yaml"\ncurrent_limit = "20 A"\n[workspace]\nradius = "9 mm"\n'
    system = load(tmp_path, text)
    assert system.name == "bench" and len(system.coils) == 8 and system.workspace == Ball((0.0, 0.0, 0.0), 0.009)
    assert {one.current_limit for one in system.coils} == {20.0}
    with pytest.raises(CardError, match=r"no such file \[.*none.yaml\]"):
        load(tmp_path, 'calibration = "none.yaml"')


def test_catalogue_holds_both_systems():
    assert len(magfem.load_system("bigmag").coils) == 6 and len(magfem.load_system("octomag").coils) == 8
    with pytest.raises(InputError, match=r'unknown coil system "bigmac"; the nearest is "bigmag"'):
        magfem.load_system("bigmac")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r'missing key "coils" \[.*system.toml: coils\]'),
        ("coils = 3", "coils must be a list of tables"),
        ("coils = []", "coils must be one or more tables"),
        ("coils = [1]", r"coils must be a list of tables, got 1 in it \[.*: coils\[0\]\]"),
        (coil() + coil(), '"a" is given twice'),
        (coil("colour = 1"), r'unknown key "colour".*coils\[0\]\.colour\]'),
        ('[[coils]]\nmodel = "bigmag_air"', r'missing key "name" \[.*: coils\[0\]\.name\]'),
        (coil(model="bigmag_wood"), r'unknown field model "bigmag_wood"; the nearest.*: coils\[0\]\.model\]'),
        (coil(model="none.json"), "field model not found"),
        (coil(model="rotor_1x3"), r"a field in T, and a system's coils are fields per ampere.*\.model\]"),
        (coil('position = ["1 mm", "2 mm"]'), r"position must be three lengths.*coils\[0\]\.position\]"),
        (coil("position = [1, 2, 3]"), "expected a length with its unit"),
        (coil("direction = [0, 0, 0]"), "not all zero"),
        (coil("direction = [0, 0, 1]\nquaternion = [0, 0, 0, 1]"), "state one of rotation, quaternion, direction"),
        (coil("quaternion = [0, 0, 1]"), "four numbers, the scalar last"),
        (coil("quaternion = [0, 0, 0, 0]"), "not all zero"),
        (coil('rotation = { z = "1 deg" }'), "rotation must be a list of turns"),
        (coil('rotation = [{ w = "1 deg" }]'), "names one axis, x, y or z"),
        (coil('rotation = [{ z = "1 deg", y = "2 deg" }]'), "names one axis"),
        (coil("rotation = [{ z = 1 }]"), r"rotation about z: expected an angle with its unit.*\.rotation\]"),
        (coil('current_limit = "-1 A"'), "current_limit must be positive"),
        ('[workspace]\nradius = "0 mm"\n' + coil(), r"radius must be positive \[.*: workspace.radius\]"),
        ('[workspace]\nsize = ["1 mm", "-1 mm", "1 mm"]\n' + coil(), "size must be positive"),
        ('[workspace]\nradius = "1 mm"\nsize = ["1 mm", "1 mm", "1 mm"]\n' + coil(), "a radius .* or a size"),
        ("[workspace]\n" + coil(), "a radius .* or a size"),
        ('calibration = "cal.yaml"\n' + coil(), "either a calibration or coils"),
    ],
)
def test_broken_cards_say_where(tmp_path, text, complaint):
    with pytest.raises(CardError, match=complaint) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_cards_of_other_kinds_are_refused(tmp_path):
    (tmp_path / "system.toml").write_text('kind = "ring_magnet"')
    with pytest.raises(CardError, match='a system card is of kind "coil_system", got "ring_magnet"'):
        magfem.load_system(tmp_path / "system.toml")


def test_direction_is_refused_where_the_turn_about_it_matters(tmp_path):
    rotor = magfem.load_model("rotor_1x3").to_dict() | {"unit": "T/A"}
    magfem.fitting.model.write_json(tmp_path / "diametric.json", rotor)
    with pytest.raises(CardError, match=r"not one of revolution about z.*state rotation or quaternion"):
        load(tmp_path, coil("direction = [1, 0, 0]", model="diametric.json"))
    assert len(load(tmp_path, coil("quaternion = [1, 0, 0, 0]", model="diametric.json")).coils) == 1
