"""Reading MPEM files: against mag_manip itself, against the formula, and in all the shapes that the format has."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from references import mag_manip
from references.mpem_formula import file_field

import magfem
from magfem.errors import CardError, InputError, OutsideRegionError
from magfem.fields.workspace_region import Box

ROOT = Path(__file__).parents[2]
OCTOMAG = ROOT / "geometries" / "systems" / "OctoMag_Calibration.yaml"
RECORDED = json.loads((ROOT / "tests" / "references" / "mag_manip_octomag.json").read_text())

HEAD = """
System_Name: bench
Workspace_Dimensions: [[-0.1, 0.1], [-0.2, 0.2], [-0.3, 0.3]]
"""

SOURCE = """
  Source_List: [s]
  s:
    A_Coeff: {A}
    B_Coeff: {B}
    Source_Position: {position}
    Source_Direction: {direction}
"""


def coil(name="C", A="~", B="[1.0e-7, 2.0e-8]", position="[0.01, 0.02, -0.4]", direction="[0, 0.5, 2]"):
    return f"{name}:{SOURCE.format(A=A, B=B, position=position, direction=direction)}"


def system(tmp_path, text):
    file = tmp_path / "system.yaml"
    file.write_text(text)
    return magfem.load_system(file)


def one(tmp_path, **values):
    return system(tmp_path, f"{HEAD}Coil_List: [C]\n{coil(**values)}")


@pytest.fixture(scope="module")
def octomag():
    return magfem.load_system("octomag")


def test_octomag_at_the_origin(octomag):
    """The published number, 1 A in all eight coils."""
    np.testing.assert_allclose(octomag.B([0, 0, 0], np.ones(8)), [1.3638e-4, 1.1892e-4, 3.73329e-3], atol=5e-9)


def test_octomag_as_mag_manip_has_it(octomag):
    """Field and gradient that mag_manip 3.0.0 gave, at ten points and unequal currents."""
    points, currents = np.array(RECORDED["points"]), np.array(RECORDED["currents"])
    B, gradient = octomag.jet(points, currents)
    five = gradient.reshape(-1, 9)[:, [0, 1, 2, 4, 5]]
    # Sources 300 km away nearly cancel others: 1e-10 is what their positions leave of the digits.
    np.testing.assert_allclose(B, RECORDED["B"], rtol=1e-9, atol=1e-10 * np.abs(B).max())
    np.testing.assert_allclose(five, RECORDED["five"], rtol=1e-9, atol=1e-10 * np.abs(five).max())


def test_octomag_in_mag_manip_now(octomag):
    points = octomag.workspace.random_points(np.random.default_rng(1), 50)
    theirs = mag_manip.evaluate(OCTOMAG, points, np.ones(8))
    ours = octomag.unit_fields(points)
    assert theirs.coils == 8
    scale = np.abs(ours).max(axis=(0, 2))[:, None]
    np.testing.assert_allclose(ours / scale, theirs.rows / scale, atol=1e-10)


def test_octomag_by_the_formula(octomag):
    content = yaml.safe_load(OCTOMAG.read_text())
    rng = np.random.default_rng(2)
    points, currents = octomag.workspace.random_points(rng, 200), rng.uniform(-10, 10, 8)
    expected = file_field(points, content, currents)
    np.testing.assert_allclose(octomag.B(points, currents), expected, atol=1e-10 * np.abs(expected).max())


def test_octomag_keeps_its_notice():
    assert "Licensed under the Apache License, Version 2.0" in OCTOMAG.read_text()
    assert "Apache-2.0" in magfem.load_system("octomag").source


def test_system_takes_name_order_and_workspace_from_the_file():
    plain = magfem.load_system(OCTOMAG)
    assert plain.name == "OctoMag_Calibration_Order_1"
    assert [coil.name for coil in plain.coils] == [f"Coil_{k}" for k in range(8)]
    assert plain.workspace == Box((-0.01, -0.01, -0.01), (0.01, 0.01, 0.01))
    with pytest.raises(OutsideRegionError):
        plain.B([0.011, 0, 0], np.ones(8))


# The shapes of the format


def test_interior_and_exterior_coefficients_of_every_degree(tmp_path):
    """Against the formula, up to degree 6, both kinds in one source."""
    rng = np.random.default_rng(3)
    A, B = rng.normal(size=6).tolist(), (1e-3 * 0.3 ** np.arange(6) * rng.normal(size=6)).tolist()
    text = f"{HEAD}Coil_List: [C]\n{coil(A=A, B=B)}"
    points = system(tmp_path, text).workspace.random_points(rng, 100)
    expected = file_field(points, yaml.safe_load(text), [1.0])
    found = system(tmp_path, text).B(points, [1.0])
    np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())


def test_degree_one_by_hand(tmp_path):
    """Φ = A_1 z is a uniform field −A_1 ẑ; Φ = B_1 z/r³ a dipole, B = 2 B_1/r³ on its axis."""
    inside = one(tmp_path, A="[3.0e-3]", B="~", direction="[0, 0, 7]")
    np.testing.assert_allclose(inside.B([0.01, 0.02, 0.03], [2.0]), [0, 0, -6e-3], rtol=1e-14, atol=1e-18)
    outside = one(tmp_path, B="[1.0e-6]", position="[0, 0, -0.4]", direction="[0, 0, 7]")
    np.testing.assert_allclose(outside.B([0, 0, 0.1], [1.0]), [0, 0, 2e-6 / 0.5**3], rtol=1e-13, atol=1e-18)


@pytest.mark.parametrize(
    "values",
    [
        {"B": "[[1.0e-7], [2.0e-8]]"},  # a column
        {"B": "[1e-7, 2e-8]"},  # YAML 1.1 takes these for texts
        {"A": "[]"},
        {"A": "null"},
        {"position": "[[0.01], [0.02], [-0.4]]", "direction": "[[0], [5], [20]]"},
        {"direction": "[0, 5e+100, 2e+101]"},
    ],
)
def test_ways_to_write_the_same(tmp_path, values):
    points = np.random.default_rng(4).uniform(-0.1, 0.1, (20, 3))
    expected = one(tmp_path).B(points, [1.0])
    np.testing.assert_allclose(one(tmp_path, **values).B(points, [1.0]), expected, rtol=1e-13)


def test_scalar_and_missing_coefficients(tmp_path):
    points = np.zeros((1, 3))
    expected = one(tmp_path, B="[1.0e-7]").B(points, [1.0])
    np.testing.assert_allclose(one(tmp_path, B="1e-7").B(points, [1.0]), expected, rtol=1e-14)
    without = f"{HEAD}Coil_List: [C]\n{coil(B='[1.0e-7]')}".replace("    A_Coeff: ~\n", "")
    np.testing.assert_array_equal(system(tmp_path, without).B(points, [1.0]), expected)


@pytest.mark.parametrize("name", ["Offset", "DC_Offset_2"])
def test_offset_adds_its_field_once(tmp_path, name):
    """As in mag_manip: any coil whose name holds Offset is the background."""
    alone = one(tmp_path)
    both = system(tmp_path, f"{HEAD}Coil_List: [C, {name}]\n{coil()}{coil(name, A='[1.0e-3]', B='~')}")
    points = np.random.default_rng(5).uniform(-0.1, 0.1, (6, 3))
    direction = np.array([0, 0.5, 2]) / np.hypot(0.5, 2)
    for current in (0.0, 3.0):
        difference = both.B(points, [current]) - alone.B(points, [current])
        np.testing.assert_allclose(difference, np.tile(-1e-3 * direction, (6, 1)), atol=1e-17)


def test_no_bit_of_a_coefficient_is_lost(tmp_path):
    """The reference radius is a power of two: writing gives back what was read."""
    rng = np.random.default_rng(6)
    B = (1e-7 * rng.normal(size=5)).tolist()
    magfem.actuation.write_mpem(one(tmp_path, B=B), tmp_path / "again.yaml")
    again = yaml.safe_load((tmp_path / "again.yaml").read_text())
    assert again["Coil_0"]["Src_0"]["B_Coeff"] == B


def test_offset_columns_and_high_degrees_in_mag_manip(tmp_path):
    """The same file there and here, field and gradient, with a background and degrees up to 6."""
    rng = np.random.default_rng(8)
    A, B = rng.normal(size=6).tolist(), (1e-3 * 0.3 ** np.arange(6) * rng.normal(size=6)).tolist()
    parts = [coil("C", B=B), coil("D", A=A, B="~", position="[0.02, 0, 0.1]"), coil("Offset", A="[1.0e-3]", B="~")]
    ours = system(tmp_path, f"{HEAD}Coil_List: [C, D, Offset]\n{''.join(parts)}")
    points, currents = ours.workspace.random_points(rng, 60), [2.0, -3.0]
    theirs = mag_manip.evaluate(tmp_path / "system.yaml", points, currents)
    field, gradient = ours.jet(points, currents)
    assert theirs.coils == 2
    np.testing.assert_allclose(field, theirs.B, atol=1e-12 * np.abs(field).max())
    five = gradient.reshape(-1, 9)[:, [0, 1, 2, 4, 5]]
    np.testing.assert_allclose(five, theirs.five, atol=1e-12 * np.abs(five).max())


# What is wrong


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"expected a table of an MPEM file, got .*\[.*system.yaml\]"),
        ("a: b\nc: [", r"not valid YAML: .*: line 2\]"),
        ("- 1\n- 2\n", "expected a table"),
        (f"{HEAD}", r'missing key "Coil_List".*: Coil_List\]'),
        (f"{HEAD}Coil_List: []\n", r"expected a list of names.*: Coil_List\]"),
        (f"{HEAD}Coil_List: [C]\n", r'missing key "C".*: C\]'),
        (f"{HEAD}Coil_List: [C, C]\n{coil()}", "a name stands twice in the list"),
        (f"{HEAD}Coil_List: [C, [D]]\n{coil()}", "expected a name, got a list"),
        (f"{HEAD}Coil_List: [C]\nC: {{Source_List: [s]}}\n", r'missing key "s".*: C\.s\]'),
        (f"{HEAD}Coil_List: [C]\nC: 3\n", r"expected a table.*: C\]"),
        (f"{HEAD}Coil_List: [C]\n{coil(B='~')}", r"a source needs A_Coeff or B_Coeff \[.*: C\.s\]"),
        (f"{HEAD}Coil_List: [C]\n{coil(B='[1, x]')}", r'expected finite numbers, got "x" \[.*: C\.s\.B_Coeff\]'),
        (f"{HEAD}Coil_List: [C]\n{coil(B='[1, .nan]')}", "expected finite numbers"),
        (f"{HEAD}Coil_List: [C]\n{coil(B='[[[1]]]')}", "expected finite numbers"),
        (f"{HEAD}Coil_List: [C]\n{coil(B='{a: 1}')}", "expected finite numbers, got a table"),
        (f"{HEAD}Coil_List: [C]\n{coil(B=[1.0] * 81)}", "81 coefficients, and 80 is the highest degree"),
        (
            f"{HEAD}Coil_List: [C]\n{coil(position='[1, 2]')}",
            r"Source_Position must be three numbers.*C\.s\.Source_Pos",
        ),
        (f"{HEAD}Coil_List: [C]\n{coil(direction='[0, 0, 0]')}", r"must not be zero.*: C\.s\.Source_Direction\]"),
        (f"{HEAD}Coil_List: [C]\n{coil(direction='~')}", "expected finite numbers"),
        (f"Workspace_Dimensions: [[-1, 1]]\nCoil_List: [C]\n{coil()}", "three pairs of limits"),
        (f"Workspace_Dimensions: [[1, -1], [0, 1], [0, 1]]\nCoil_List: [C]\n{coil()}", "the lower one first"),
        (f"Workspace_Dimensions: [[0, 1], [0, 1], [0, 1]]\nCoil_List: [C]\n{coil()}", r'missing key "System_Name"'),
        (
            f"{HEAD}Coil_List: [Offset, Offset_2]\n{coil('Offset')}{coil('Offset_2')}",
            r"a second background.*: Offset_2\]",
        ),
        ("a: &a [*a]\nWorkspace_Dimensions: *a\n", "finite numbers|YAML"),
    ],
)
def test_broken_files_are_one_sentence_with_file_and_key(tmp_path, text, complaint):
    with pytest.raises(CardError, match=complaint) as caught:
        system(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path):
    with pytest.raises(CardError, match="no such file"):
        magfem.load_system(tmp_path / "none.yaml")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(CardError, match="got a directory"):
        magfem.load_system(tmp_path / "folder.yaml")
    (tmp_path / "latin.yml").write_bytes("System_Name: Größe".encode("latin-1"))
    with pytest.raises(CardError, match="not UTF-8"):
        magfem.load_system(tmp_path / "latin.yml")
    with pytest.raises(InputError, match=r"a card \(.toml\) or an MPEM file \(.yaml\)"):
        magfem.load_system(tmp_path / "system.json")
    with pytest.raises(InputError, match='unknown coil system "octomagg"; the nearest is "octomag"'):
        magfem.load_system("octomagg")
    with pytest.raises(InputError, match="takes a name or path"):
        magfem.load_system(3)
