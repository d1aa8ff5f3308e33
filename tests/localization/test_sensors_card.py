"""Cards of sensors: every key, back and forth, and faults in one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from magfem.errors import CardError, InputError
from magfem.localization.sensors_card import read_sensors, sensors_to_dict, write_sensors

CARD = """\
kind = "sensors"
source = "bench"

[[sensors]]
name = "left"
position = ["-10 mm", "0 mm", "2 cm"]
quaternion = [0, 0, 1, 1]
noise = "3 uT"
resolution = "0.1 uT"
saturation = "2 mT"

[[sensors]]
name = 2
matrix = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
noise = ["1 uT", "2 uT", "3 uT"]
gain = [[1.1, 0, 0], [0, 0.9, 0.05], [0, 0, 1]]
offset = ["5 uT", "0 T", "-1 mT"]

[[sensors]]
name = "plain"
"""


def test_a_card_says_where_sensors_are_and_how_they_read(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(CARD)
    sensors = read_sensors(path, "s.toml")
    assert list(sensors) == ["left", "2", "plain"]
    left, second, plain = sensors.values()
    # A quarter turn about z: the sensor's x axis is the frame's y.
    assert left.pose.apply([1.0, 0.0, 0.0]) == pytest.approx([-0.01, 1.0, 0.02], abs=1e-15)
    assert np.ravel(left.noise).tolist() == [3e-6] * 3  # type: ignore[arg-type]
    assert (left.resolution, left.saturation) == (1e-7, 2e-3)
    # Columns are the sensor's axes: its x is the frame's y, its z the frame's x.
    assert second.pose.apply([1.0, 0.0, 0.0]) == pytest.approx([0, 1, 0], abs=1e-15)
    assert second.pose.apply([0.0, 0.0, 1.0]) == pytest.approx([1, 0, 0], abs=1e-15)
    assert np.ravel(second.noise).tolist() == [1e-6, 2e-6, 3e-6]  # type: ignore[arg-type]
    assert second.readings(np.array([1.0, 1.0, 1.0])) == pytest.approx([1.1 + 5e-6, 0.95, 1 - 1e-3])
    assert plain.noise is None and plain.saturation == np.inf and plain.pose.as_matrix() == pytest.approx(np.eye(4))


def test_a_card_in_json_is_the_same_and_comes_back(tmp_path: Path) -> None:
    path, other = tmp_path / "s.toml", tmp_path / "s.json"
    path.write_text(CARD)
    sensors = read_sensors(path, "s.toml")
    other.write_text(json.dumps(sensors_to_dict(sensors)))
    again = read_sensors(other, "s.json")
    assert list(again) == list(sensors)
    for one, same in zip(sensors.values(), again.values(), strict=True):
        assert same.pose.as_matrix() == pytest.approx(one.pose.as_matrix(), abs=1e-15)
        assert (same.resolution, same.saturation) == (one.resolution, one.saturation)
        assert np.array_equal(same.readings(np.ones(3)), one.readings(np.ones(3)))
        assert (same.noise is None) == (one.noise is None) and np.array_equal(same.noise, one.noise)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["new.toml", "new.json"])
def test_a_card_that_is_written_reads_back(name: str, tmp_path: Path) -> None:
    path, other = tmp_path / "s.toml", tmp_path / name
    path.write_text(CARD)
    sensors = read_sensors(path, "s.toml")
    write_sensors(other, sensors, source='bench "A", µT, 2025')
    again = read_sensors(other, name)
    assert 'bench \\"A\\", µT' in other.read_text(encoding="utf-8")
    assert list(again) == list(sensors)
    for one, same in zip(sensors.values(), again.values(), strict=True):
        assert same.pose.as_matrix() == pytest.approx(one.pose.as_matrix(), abs=1e-15)
        assert (same.resolution, same.saturation) == (one.resolution, one.saturation)
        assert np.array_equal(same.gain, one.gain) and np.array_equal(same.offset, one.offset)
    with pytest.raises(InputError):
        write_sensors(tmp_path / "nowhere" / name, sensors)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "sensors"', 'kind = "coil_system"', 'is of kind "sensors", got "coil_system" [s.toml: kind]'),
        ('kind = "sensors"\n', "", 'missing key "kind"'),
        ('source = "bench"', 'sauce = "bench"', 'did you mean "source"?'),
        ("name = 2", 'name = "left"', 'there are two sensors "left" [s.toml: sensors[1].name]'),
        ("name = 2\n", "", 'missing key "name" [s.toml: sensors[1].name]'),
        ('"-10 mm"', "-10", "position: expected a length with its unit"),
        ("[0, 0, 1, 1]", "[0, 0, 1]", "quaternion must be four numbers, the scalar last"),
        ("[0, 0, 1, 1]", "[0, 0, 0, 0]", "quaternion must be finite and not all zero"),
        ("[0, 0, 1, 1]", "[0, 0, 1, 1]\nmatrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "quaternion or matrix, not both"),
        ("[[0, 0, 1], [1, 0, 0], [0, 1, 0]]", "[[0, 1, 0], [1, 0, 0], [0, 0, 1]]", "matrix must be a rotation"),
        ("[[0, 0, 1], [1, 0, 0], [0, 1, 0]]", "[[0, 0, 1], [1, 0, 0]]", "three rows of three numbers"),
        ('"3 uT"\nres', '"3 mm"\nres', "which is not a flux density [s.toml: sensors[0].noise]"),
        ('"3 uT"\nres', '"-3 uT"\nres', "noise must be one or three standard deviations"),
        ('["1 uT", "2 uT", "3 uT"]', '["1 uT", "2 uT"]', "noise must be three flux densities"),
        ('"2 mT"', '"0 mT"', "saturation must be a positive field"),
        ("[[1.1, 0, 0]", "[[0, 0, 0]", "gain cannot be undone"),
        ("offset", "offsets", 'did you mean "offset"?'),
    ],
)
def test_faults_name_the_key(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in CARD
    path = tmp_path / "s.toml"
    path.write_text(CARD.replace(old, new, 1))
    with pytest.raises(CardError) as caught:
        read_sensors(path, "s.toml")
    assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("s.json", "[1]", "expected an object with kind and sensors, got a list"),
        ("s.json", "{", "not valid JSON"),
        ("s.json", '{"kind": "sensors", "sensors": []}', "one or more tables"),
        ("s.toml", 'kind = "sensors"\nsensors = 3\n', "sensors must be a list of tables"),
    ],
)
def test_files_that_are_no_cards(name: str, text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_sensors(tmp_path / name, name)
    with pytest.raises(InputError, match=r"no such file|not found"):
        read_sensors(tmp_path / f"gone-{name}", name)
