"""Values of recipes, in Python and in files: each is what it must be, or one sentence says what was expected."""

from __future__ import annotations

import importlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import magfem
from magfem.cli import main
from magfem.errors import CardError, ConvergenceError, InputError
from magfem.fields.region import Shell
from magfem.fitting import Recipe, load_recipe, model_from_recipe
from magfem.fitting.families import FAMILIES, SAMPLE_FAMILIES
from magfem.fitting.families.options import OPTIONS
from magfem.fitting.readings import Reading
from magfem.geometry import CylinderMagnet, RingMagnet
from magfem.samples import Samples

RING = "ring_magnet_4x1.5x1"
SOLENOID = "solenoid_24x48x60"
SAMPLES = '[samples]\nfile = "x.csv"\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "recipe.toml"
    path.write_text(text)
    return path


def never(*arguments: object, **keywords: object) -> None:
    raise AssertionError("solved before the recipe was looked at")


@pytest.fixture
def unsolved(monkeypatch: pytest.MonkeyPatch) -> None:
    """A device that is solved within this test fails it."""
    # Modules by name: a package's function of the same name hides its module.
    monkeypatch.setattr(importlib.import_module("magfem.fitting.from_recipe"), "solve", never)


# Fields of a recipe


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"geometry": 3}, "geometry must be a device"),
        ({"family": 3}, "unknown family"),
        ({"family": []}, "unknown family"),
        ({"options": 3}, "options must be a dict"),
        ({"options": {3: 3}}, "options must be a dict"),
        ({"region": 3}, "region must be a Shell"),
        ({"circuit": 3}, "circuit must be the name"),
        ({"target_B": "x"}, "target_B must be a relative error between 0 and 1"),
        ({"target_B": True}, "target_B must be a relative error between 0 and 1"),
        ({"target_gradient": [0.1]}, "target_gradient must be a relative error between 0 and 1"),
        ({"objective": np.zeros(2)}, "objective must be"),
        ({"most_parameters": "a"}, "most_parameters must be a whole number, 1 or more"),
        ({"most_parameters": math.inf}, "most_parameters must be a whole number, 1 or more"),
        ({"most_parameters": 2.5}, "most_parameters must be a whole number, 1 or more"),
        ({"seed": None}, "seed must be a whole number, 0 or more"),
        ({"seed": True}, "seed must be a whole number, 0 or more"),
        ({"dimension": "2"}, "dimension must be 2 or 3"),
        ({"dimension": 2.5}, "dimension must be 2 or 3"),
        ({"resolution": "x"}, "resolution must be positive and finite"),
        ({"resolution": 10**400}, "resolution must be positive and finite"),
        ({"name": 3}, "name must be a text"),
        ({"source": None}, "source must be a text"),
        ({"weighting": 3}, "weighting must be"),
        ({"ridge": []}, "ridge must be"),
        ({"loss": None}, "loss must be"),
        ({"heldout": 3}, "heldout must be"),
        ({"background": "yes"}, "background must be true or false"),
        ({"free": 3}, "free must be a dict"),
        ({"free": {"centre": 3}}, "free must be a dict"),
        ({"free": {"centre": (0.0, "x")}}, "free must be a dict"),
        ({"free": {"centre": (0.0, math.nan)}}, "free must be a dict"),
        ({"samples": 3}, "samples must be a SamplesFile"),
        ({"samples": "x.csv"}, "samples must be a SamplesFile"),
        ({"measurements": 3}, "measurements must be a tuple"),
        ({"measurements": (3,)}, "measurements must be a tuple"),
    ],
    ids=str,
)
def test_fields_of_the_wrong_type_are_one_sentence(values: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        Recipe(**values)
    assert str(refused.value).startswith(words) and "\n" not in str(refused.value)


# Options of families


def test_every_option_of_every_family_has_a_rule_that_its_default_keeps() -> None:
    import inspect

    for family, make in {**FAMILIES, **SAMPLE_FAMILIES}.items():
        for name, parameter in inspect.signature(make).parameters.items():
            if name not in ("geometry", "region", "window", "samples"):
                assert parameter.default is None or OPTIONS[name].holds(parameter.default), (family, name)


WRONG_OPTIONS: list[tuple[str, str, dict[str, Any], str]] = [
    (RING, "axial_multipole", {"poles": "six"}, "poles must be a whole number from 1 to 80"),
    (RING, "axial_multipole", {"poles": -2}, "poles must be"),
    (RING, "axial_multipole", {"poles": 81}, "poles must be"),
    (RING, "axial_multipole", {"poles": True}, "poles must be"),
    (RING, "axial_multipole", {"poles": None}, "poles must be"),
    (RING, "axial_multipole", {"height": "1 mm"}, "height must be a finite number of metres"),
    (RING, "axial_multipole", {"height": math.inf}, "height must be"),
    (RING, "displaced_multipoles", {"sources": []}, "sources must be a whole number from 1 to 40, or a list"),
    (RING, "displaced_multipoles", {"sources": 2.5}, "sources must be"),
    (RING, "displaced_multipoles", {"sources": 10**9}, "sources must be"),
    (RING, "displaced_multipoles", {"orders": [0]}, "orders must be"),
    (RING, "displaced_multipoles", {"shared": "yes"}, "shared must be true or false"),
    (RING, "oblate_discs", {"discs": 0}, "discs must be"),
    (RING, "oblate_discs", {"degrees": "x"}, "degrees must be"),
    (RING, "charged_faces", {"rings": [0]}, "rings must be"),
    (RING, "charged_faces", {"rings": [[1]]}, "rings must be"),
    ("rotor_1x3", "eight_source", {"sets": -1}, "sets must be"),
    ("rotor_1x3", "eight_source", {"orders": 2}, "odd orders only"),
    ("rotor_1x3", "eight_source", {"orders": [1, 2]}, "odd orders only"),
    ("stator_1.6x5.5", "closed_paths", {"circuit": 3}, "circuit must be the name of a circuit"),
    ("stator_1.6x5.5", "closed_paths", {"circuit": "middle"}, "has no circuit 'middle'"),
    ("", "interior_harmonics", {"degrees": 2.5}, "degrees must be"),
    ("", "interior_harmonics", {"degrees": 0}, "degrees must be"),
    ("", "interior_harmonics", {"symmetry": 3}, "symmetry must be one of none, axial"),
    ("", "search", {"degrees": "x"}, "degrees must be"),
    ("", "exterior_harmonics", {"centre": (0.0, 0.0)}, "centre must be three finite numbers of metres"),
    ("", "exterior_harmonics", {"radius": 0}, "radius must be a positive number of metres"),
    ("", "exterior_harmonics", {"radius": -1.0}, "radius must be"),
    ("", "device", {"degrees": 3}, "the family device has no option 'degrees'"),
]


@pytest.mark.parametrize(("device", "family", "options", "words"), WRONG_OPTIONS, ids=str)
def test_wrong_options_are_one_sentence(device: str, family: str, options: dict[str, Any], words: str) -> None:
    geometry = magfem.load_geometry(device) if device else None
    with pytest.raises(InputError) as refused:
        Recipe(geometry=geometry, family=family, options=options)
    assert words in str(refused.value) and "\n" not in str(refused.value)


# Lengths are texts there, and TOML has no None.
IN_FILES = [
    one for one in WRONG_OPTIONS if not {"height", "centre", "radius"} & set(one[2]) and one[2] != {"poles": None}
]


@pytest.mark.parametrize(("device", "family", "options", "words"), IN_FILES, ids=str)
def test_wrong_options_of_files_name_their_key(
    device: str, family: str, options: dict[str, Any], words: str, tmp_path: Path
) -> None:
    ((name, value),) = options.items()
    head = f'device = "{device}"\n' if device else ""
    body = "" if device else SAMPLES
    file = written(tmp_path, f'{head}family = "{family}"\n{body}[terms]\n{name} = {json.dumps(value)}\n')
    with pytest.raises(CardError) as refused:
        load_recipe(file)
    message = str(refused.value)
    assert words in message and message.endswith(f"[{file}: terms.{name}]") and "\n" not in message


@pytest.mark.parametrize("given", [3, np.int64(3), [3], (3,), np.array([3]), range(3, 4)], ids=repr)
def test_one_number_or_a_list_of_any_kind_is_the_same(given: Any) -> None:
    """Three discs of three degrees have 2 · 3 numbers each."""
    disc = magfem.load_geometry("disc_magnet_8x2")
    recipe = Recipe(geometry=disc, family="oblate_discs", options={"discs": given, "degrees": given})
    made = FAMILIES["oblate_discs"](disc, disc.region, **recipe.options)
    assert [member.parameters for member in made] == [3 * 2 * 3]


# Lengths


@pytest.mark.parametrize(
    ("family", "text", "name", "value"),
    [
        ("axial_multipole", 'height = "30 mm"', "height", 0.03),
        ("exterior_harmonics", 'centre = ["0 mm", "1 cm", "-2 um"]', "centre", (0.0, 0.01, -2e-6)),
        ("exterior_harmonics", 'radius = "2 mm"', "radius", 0.002),
    ],
)
def test_lengths_in_files_carry_units(family: str, text: str, name: str, value: Any, tmp_path: Path) -> None:
    head = f'device = "{SOLENOID}"\n' if family == "axial_multipole" else SAMPLES
    top = f'family = "{family}"\n'
    options = load_recipe(written(tmp_path, f"{top}{head}[terms]\n{text}\n")).options
    assert options == {name: value}
    assert Recipe(family=family, options=options).options == options


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("height = 0.03", "height"),
        ("height = true", "height"),
        ('height = "30 mT"', "height"),
        ('radius = "-1 mm"', "radius"),
        ('radius = "0 mm"', "radius"),
        ("radius = 1", "radius"),
        ("centre = [0, 0, 1]", "centre"),
        ('centre = ["0 mm", "1 mm"]', "centre"),
        ('centre = "1 mm"', "centre"),
    ],
)
def test_bare_lengths_in_files_are_refused(text: str, words: str, tmp_path: Path) -> None:
    family = 'family = "axial_multipole"' if words == "height" else 'family = "exterior_harmonics"'
    file = written(tmp_path, f"{family}\n{SAMPLES}[terms]\n{text}\n")
    with pytest.raises(CardError) as refused:
        load_recipe(file)
    message = str(refused.value)
    assert message.endswith(f"[{file}: terms.{words}]") and ("length" in message or "positive" in message), message


def test_the_solenoid_s_multipole_stands_on_its_face() -> None:
    recipe = load_recipe("solenoid_24x48x60_front_dissertation")
    assert recipe.options == {"poles": 6, "height": 0.03}
    assert recipe.geometry is not None and recipe.geometry.hull.length / 2 == pytest.approx(0.03)  # type: ignore[attr-defined]


# Families of samples


@pytest.mark.parametrize("family", ["interior_harmonics", "exterior_harmonics", "device"])
def test_families_of_samples_are_refused_before_the_solve(
    family: str, tmp_path: Path, rotor: CylinderMagnet, unsolved: None
) -> None:
    words = f"the family {family} is for measured samples"
    with pytest.raises(InputError, match=words):
        magfem.fit(magfem.exact(rotor), Recipe(family=family))
    with pytest.raises(InputError, match=words):
        model_from_recipe(Recipe(geometry=rotor, family=family))
    file = written(tmp_path, f'device = "rotor_1x3"\nfamily = "{family}"\n')
    with pytest.raises(CardError, match=words) as refused:
        model_from_recipe(file)
    assert str(refused.value).endswith(f"[{file}: family]")


def test_the_command_line_refuses_them_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], unsolved: None
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["fit", RING, "--family", "interior_harmonics"]) == 2
    error = capsys.readouterr().err
    assert "the family interior_harmonics is for measured samples" in error and len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


# What was tried, and what would help


def test_fewer_parameters_than_any_candidate_has(ring: RingMagnet) -> None:
    """Wall and face loops of a ring are two at least on each of two walls and two faces: eight."""
    with pytest.raises(
        InputError, match=r"has at most 7 parameters, as most_parameters asks; the smallest has \d+"
    ) as no:
        magfem.fit(magfem.exact(ring), Recipe(most_parameters=7))
    smallest = int(str(no.value).rpartition(" ")[2])
    assert smallest >= 8
    model = magfem.fit(magfem.exact(ring), Recipe(most_parameters=smallest))
    assert model.report["parameters"] == smallest


def test_a_family_at_fault_is_named_and_not_the_clearance(ring: RingMagnet, caplog: pytest.LogCaptureFixture) -> None:
    """One pole 5 mm above a ring, within the region itself, describes nothing; at the centre, far away, too little."""
    outside = Recipe(family="axial_multipole", options={"poles": 1, "height": 5e-3})
    with pytest.raises(ConvergenceError) as refused:
        magfem.fit(magfem.exact(ring), outside)
    far = Shell(ring.region.hull, 20e-3, 60e-3)
    magfem.fit(magfem.exact(ring), Recipe(family="axial_multipole", options={"poles": 1}, region=far))
    for said in (str(refused.value), caplog.text):
        assert "wall_and_face_loops is what suits this device" in said and "clearance" not in said


def test_the_default_family_asks_for_a_larger_clearance(ring: RingMagnet, caplog: pytest.LogCaptureFixture) -> None:
    magfem.fit(magfem.exact(ring), Recipe(most_parameters=60, target_B=1e-9, target_gradient=1e-9))
    assert "a larger clearance makes it better" in caplog.text


# The command line's --circuit and --family


@pytest.mark.parametrize(
    ("words", "label"),
    [
        (["--circuit", "winding"], "1 disc of radius"),
        (["--family", "oblate_discs"], "1 disc of radius"),
        (["--family", "solid_harmonics"], "order 0"),
    ],
)
def test_terms_stay_unless_the_family_is_another(
    words: list[str], label: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    coil = magfem.load_geometry(SOLENOID)
    words = [coil.circuits[0].name if word == "winding" else word for word in words]  # type: ignore[attr-defined]
    text = f"""
        device = "{SOLENOID}"
        family = "oblate_discs"
        terms = {{ discs = 1, degrees = 2 }}
        [region]
        clearance = "20 mm"
        extent = "125 mm"
        z = ["30 mm"]
    """
    file = written(tmp_path, text)
    assert main(["fit", str(file), "-o", "model.json", "-q", *words]) == 0
    report = magfem.load_model(tmp_path / "model.json").report
    assert report["label"].startswith(label)
    if label.startswith("1"):
        assert report["label"].endswith("degrees up to 2")


# Single readings


READING = """
[[measurement]]
position = ["{x}", "0 mm", "0 mm"]
direction = [1, 0, 0]
value = "{value}"
source = "here"
"""
SURE = 'uncertainty = "1 uT"\n'


@pytest.mark.parametrize(
    ("readings", "words", "key"),
    [
        (READING.format(x="3 m", value="1 mT") + SURE, "lies outside the model's region", "measurement[0].position"),
        (
            READING.format(x="5 mm", value="1 mT") + SURE + READING.format(x="0 mm", value="1 mT") + SURE,
            "lies outside the model's region",
            "measurement[1].position",
        ),
        (
            READING.format(x="5 mm", value="1 mT") + SURE + READING.format(x="6 mm", value="1 mT"),
            "either all measurements have an uncertainty or none",
            "measurement[1].uncertainty",
        ),
        (
            READING.format(x="5 mm", value="1 mT"),
            "single measurement needs its uncertainty",
            "measurement[0].uncertainty",
        ),
        (
            READING.format(x="5 mm", value="1 mT") + READING.format(x="5 mm", value="0 T"),
            "zero needs an uncertainty",
            "measurement[1].uncertainty",
        ),
    ],
)
def test_readings_are_checked_before_the_solve(
    readings: str, words: str, key: str, tmp_path: Path, unsolved: None
) -> None:
    file = written(tmp_path, 'device = "rotor_1x3"\n' + readings)
    with pytest.raises(CardError) as refused:
        model_from_recipe(file)
    message = str(refused.value)
    assert words in message and message.endswith(f"[{file}: {key}]") and "extrapolate" not in message


def test_readings_outside_a_recipe_s_own_region(rotor: CylinderMagnet) -> None:
    """5 mm from the middle is in the card's region, and not in one that ends 1 mm from the hull."""
    reading = Reading(np.array([5e-3, 0, 0]), np.array([1.0, 0, 0]), 1e-3, 1e-6, "here")
    Recipe(geometry=rotor, measurements=(reading,))
    with pytest.raises(InputError, match=r"at \(5, 0, 0\) mm lies outside"):
        Recipe(geometry=rotor, region=Shell(rotor.region.hull, 0.5e-3, 1e-3), measurements=(reading,))


def test_readings_outside_what_the_samples_fill(tmp_path: Path) -> None:
    """Where the region is only known from the samples, file and key are named all the same."""
    points = np.random.default_rng(0).uniform(-10, 10, (60, 3))
    rows = [",".join(map(str, (*p, 2 * p[0], -p[1], -p[2]))) for p in points.tolist()]
    (tmp_path / "field.csv").write_text("\n".join(["x_mm,y_mm,z_mm,bx_mT,by_mT,bz_mT", *rows]))
    text = '[samples]\nfile = "field.csv"\nsigma = "1 uT"\n' + READING.format(x="90 mm", value="1 mT") + SURE
    file = written(tmp_path, text)
    with pytest.raises(CardError, match="lies outside the model's region") as refused:
        model_from_recipe(file)
    assert str(refused.value).endswith(f"[{file}: measurement[0].position]")


def test_samples_take_options_of_search() -> None:
    """Both families of samples have degrees; a quadrupole has two."""
    points = np.random.default_rng(0).uniform(-10e-3, 10e-3, (60, 3))
    samples = Samples(points, points @ np.diag([2.0, -1.0, -1.0]), 1e-9)
    model = magfem.fit(samples, Recipe(family="search", options={"degrees": 2}))
    assert model.gradient(np.zeros(3)) == pytest.approx(np.diag([2.0, -1.0, -1.0]), abs=1e-6)
