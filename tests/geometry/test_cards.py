"""Device cards: the committed ones give the right numbers, every fault names its file and key."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from magfem.errors import CardError, InputError
from magfem.geometry import CylinderMagnet, RingMagnet, card_text, describe, geometry_from_text, load_geometry
from magfem.geometry.catalogue import folder, names, resolve
from magfem.geometry.load import KINDS

RING = """\
kind = "ring_magnet"
name = "Ring"
source = "a test"

[dimensions]
outer_diameter = "4 mm"
inner_diameter = "1.5 mm"
length = "1 mm"

[material]
remanence = "1.35 T"
recoil_permeability = 1.05
magnetisation = "axial"

[region]
clearance = "0.5 mm"
extent = "6 mm"
"""


def write(folder: Path, text: str | bytes) -> str:
    card = folder / "x.toml"
    card.write_bytes(text.encode() if isinstance(text, str) else text)
    return str(card)


def complaint(name_or_path: str) -> str:
    with pytest.raises(CardError) as raised:
        load_geometry(name_or_path)
    return str(raised.value)


def test_ring_of_the_catalogue() -> None:
    ring = load_geometry("ring_magnet_4x1.5x1")
    assert isinstance(ring, RingMagnet)
    assert (ring.outer_diameter, ring.inner_diameter, ring.length) == (4e-3, 1.5e-3, 1e-3)
    assert (ring.material.remanence, ring.material.recoil_permeability) == (1.35, 1.05)
    assert ring.material.magnetisation == (0.0, 0.0, 1.0)
    assert (ring.region.clearance, ring.region.extent) == (0.5e-3, 6e-3)
    assert ring.name == "Ring magnet N48, 4 × 1.5 × 1 mm"
    assert ring.source == "dissertation, Table 4.1"


def test_rotor_of_the_catalogue() -> None:
    rotor = load_geometry("rotor_1x3")
    assert isinstance(rotor, CylinderMagnet)
    assert (rotor.diameter, rotor.length) == (1e-3, 3e-3)
    assert (rotor.material.remanence, rotor.material.recoil_permeability) == (1.42, 1.05)
    assert rotor.material.magnetisation == (1.0, 0.0, 0.0)
    assert (rotor.region.clearance, rotor.region.extent) == (2e-3, 50e-3)


@pytest.mark.parametrize("name", names("geometries", ".toml"))
def test_origin_is_the_short_path_and_the_hash_of_the_bytes(name: str) -> None:
    origin = load_geometry(name).origin
    assert origin is not None
    assert origin.path == f"geometries/{name}.toml"
    assert origin.sha256 == sha256((folder("geometries") / f"{name}.toml").read_bytes()).hexdigest()


def test_names_resolve_from_any_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert resolve("geometries", "rotor_1x3", ".toml").is_file()


def test_a_path_is_shown_as_the_user_gave_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, RING)
    monkeypatch.chdir(tmp_path)
    for given in ("x.toml", "./x.toml", str(tmp_path / "x.toml")):
        origin = load_geometry(given).origin
        assert origin is not None and origin.path == given
    assert load_geometry(Path("x.toml")) == load_geometry("x.toml")


def test_optional_keys_have_their_documented_defaults(tmp_path: Path) -> None:
    bare = "\n".join(line for line in RING.splitlines() if not line.startswith(("name", "source", "recoil")))
    ring = load_geometry(write(tmp_path, bare.partition("[region]")[0]))
    assert (ring.name, ring.source) == ("ring magnet", "")
    assert ring.bodies[0].material.recoil_permeability == 1.05
    assert (ring.region.clearance, ring.region.extent) == (0.5e-3, 6e-3)


@pytest.mark.parametrize(
    ("written", "unit_vector"),
    [
        ('"axial"', (0, 0, 1)),
        ('"diametric"', (1, 0, 0)),
        ("[0, 1, 1]", (0, 0.5**0.5, 0.5**0.5)),
        ("[0, 0, -2.5]", (0, 0, -1)),
        ("[1e-300, 0, 0]", (1, 0, 0)),
        ("[1e308, 1e308, 0]", (0.5**0.5, 0.5**0.5, 0)),
    ],
)
def test_magnetisation_becomes_a_unit_vector(tmp_path: Path, written: str, unit_vector: tuple[float, ...]) -> None:
    ring = load_geometry(write(tmp_path, RING.replace('"axial"', written)))
    magnetisation = ring.bodies[0].material.magnetisation
    np.testing.assert_allclose(magnetisation, unit_vector, rtol=1e-15, atol=0)


LENGTH = 'expected a length with its unit, such as "4 mm", got'
RANGE = "must lie between 1 µm and 10 m, got"
MESHABLE = "must be at least 1/1000 of the largest dimension"
DIRECTION = "permanent magnet: magnetisation must be three numbers such as [0, 1, 1], got"


@pytest.mark.parametrize(
    ("old", "new", "message", "key"),
    [
        # kind
        ('kind = "ring_magnet"', "", 'missing key "kind"', "kind"),
        ("kind =", "kidn =", 'unknown key "kidn"; did you mean "kind"?', "kidn"),
        ('"ring_magnet"', '"ring_magnt"', 'unknown kind "ring_magnt"; did you mean "ring_magnet"?', "kind"),
        ('"ring_magnet"', '"pump"', f'unknown kind "pump"; known: {", ".join(KINDS)}', "kind"),
        ('"ring_magnet"', "3", "kind must be a text, got 3", "kind"),
        # unknown keys, at every level
        ("source =", "sorce =", 'unknown key "sorce"; did you mean "source"?', "sorce"),
        ("[region]", "[regoin]", 'unknown key "regoin"; did you mean "region"?', "regoin"),
        (
            "outer_diameter =",
            "outer_diametre =",
            'unknown key "outer_diametre"; did you mean "outer_diameter"?',
            "dimensions.outer_diametre",
        ),
        (
            "length =",
            "colour =",
            'unknown key "colour"; known: outer_diameter, inner_diameter, length',
            "dimensions.colour",
        ),
        (
            "remanence =",
            "remanance =",
            'unknown key "remanance"; did you mean "remanence"?',
            "material.remanance",
        ),
        ("extent =", "extend =", 'unknown key "extend"; did you mean "extent"?', "region.extend"),
        # missing keys
        ('length = "1 mm"', "", 'missing key "length"', "dimensions.length"),
        ('remanence = "1.35 T"', "", 'missing key "remanence"', "material.remanence"),
        ('magnetisation = "axial"', "", 'missing key "magnetisation"', "material.magnetisation"),
        (RING.partition("[dimensions]")[2], "", 'missing key "outer_diameter"', "dimensions.outer_diameter"),
        (RING[RING.index("[material]") : RING.index("[region]")], "", 'missing key "material"', "material"),
        (RING[RING.index("[dimensions]") : RING.index("[mat")], "", 'missing key "dimensions"', "dimensions"),
        # types
        ('name = "Ring"', "name = 3", "name must be a text, got 3", "name"),
        ('name = "Ring"', 'name = " "', "name must not be blank", "name"),
        ("[region]", "[[region]]", "region must be a table, got a list", "region"),
        ('"1 mm"', '["1 mm"]', f"{LENGTH} a list", "dimensions.length"),
        ('"1 mm"', "true", f"{LENGTH} true", "dimensions.length"),
        (
            "1.05",
            '"1.05"',
            'recoil_permeability must be a bare number, got "1.05"',
            "material.recoil_permeability",
        ),
        (
            "1.05",
            "true",
            "recoil_permeability must be a bare number, got true",
            "material.recoil_permeability",
        ),
        (
            "1.05",
            "1" + "0" * 400,
            "recoil_permeability must be finite, got ~1e400",
            "material.recoil_permeability",
        ),
        # units
        ('"4 mm"', "4", f"{LENGTH} the bare number 4", "dimensions.outer_diameter"),
        ('"1 mm"', '"1 kg"', f'{LENGTH} "1 kg", which is not a length', "dimensions.length"),
        (
            '"1.35 T"',
            "1.35",
            'expected a flux density with its unit, such as "1.35 T", got the bare number 1.35',
            "material.remanence",
        ),
        ('"6 mm"', '"nan mm"', f'{LENGTH} "nan mm", which is not finite', "region.extent"),
        # dimensions
        (
            '"1.5 mm"',
            '"5 mm"',
            "ring magnet: inner_diameter must be smaller than outer_diameter (4 mm), got 5 mm",
            "dimensions.inner_diameter",
        ),
        ('"1 mm"', '"0 mm"', "ring magnet: length must be positive, got 0 m", "dimensions.length"),
        ('"1 mm"', '"-1 mm"', "ring magnet: length must be positive, got -1 mm", "dimensions.length"),
        ('"1 mm"', '"0.5 µm"', f"ring magnet: length {RANGE} 500 nm", "dimensions.length"),
        ('"4 mm"', '"4 Mm"', f"ring magnet: outer_diameter {RANGE} 4 Mm", "dimensions.outer_diameter"),
        (
            '"1 mm"',
            '"3 µm"',
            f"ring magnet: length {MESHABLE} (4 mm) for a mesh to resolve it, got 3 µm",
            "dimensions.length",
        ),
        (
            '"1.5 mm"',
            '"3.999 mm"',
            f"ring magnet: the wall {MESHABLE} (4 mm) for a mesh to resolve it, got 500 nm",
            "dimensions.inner_diameter",
        ),
        # material
        (
            '"1.35 T"',
            '"0 T"',
            "permanent magnet: remanence must be positive, got 0 T; its sign belongs to magnetisation",
            "material.remanence",
        ),
        (
            '"1.35 T"',
            '"1e-300 T"',
            "permanent magnet: remanence must be at least 1 µT, got 1e-291 nT",
            "material.remanence",
        ),
        (
            '"1.35 T"',
            '"13.5 T"',
            "permanent magnet: remanence must be at most 2 T, got 13.5 T; no permanent magnet has more",
            "material.remanence",
        ),
        (
            "1.05",
            "0.5",
            "permanent magnet: recoil_permeability must lie between 1 and 10, got 0.5",
            "material.recoil_permeability",
        ),
        (
            "1.05",
            "1000",
            "permanent magnet: recoil_permeability must lie between 1 and 10, got 1000",
            "material.recoil_permeability",
        ),
        (
            "1.05",
            "nan",
            "permanent magnet: recoil_permeability must be finite, got nan",
            "material.recoil_permeability",
        ),
        (
            '"axial"',
            '"radial"',
            'magnetisation must be "axial", "diametric" or a direction such as [0, 1, 1], got "radial"',
            "material.magnetisation",
        ),
        (
            '"axial"',
            "[0, 0, 0]",
            "permanent magnet: magnetisation must not be the zero vector",
            "material.magnetisation",
        ),
        ('"axial"', "[0, 1]", f"{DIRECTION} a list of 2", "material.magnetisation"),
        ('"axial"', "1.0", f"{DIRECTION} 1", "material.magnetisation"),
        (
            '"axial"',
            '[0, 0, "1"]',
            'permanent magnet: magnetisation must be a number, got "1"',
            "material.magnetisation",
        ),
        (
            '"axial"',
            "[0, 0, inf]",
            "permanent magnet: magnetisation must be finite, got inf",
            "material.magnetisation",
        ),
        # region
        ('"0.5 mm"', '"0 mm"', "ring magnet: clearance must be positive, got 0 m", "region.clearance"),
        (
            '"0.5 mm"',
            '"6 mm"',
            "ring magnet: clearance must be smaller than extent (6 mm), got 6 mm",
            "region.clearance",
        ),
        (
            'clearance = "0.5 mm"\nextent = "6 mm"',
            'extent = "0.1 mm"',
            "ring magnet: extent must be larger than the default clearance (500 µm), got 100 µm",
            "region.extent",
        ),
        (
            '"0.5 mm"',
            '"1 nm"',
            "ring magnet: clearance must be at least 1/100000 of the largest dimension (4 mm), got 1 nm",
            "region.clearance",
        ),
        (
            '"6 mm"',
            '"5 m"',
            "ring magnet: extent must be at most 1000 times the largest dimension (4 mm), got 5 m",
            "region.extent",
        ),
    ],
)
def test_every_fault_names_file_and_key(tmp_path: Path, old: str, new: str, message: str, key: str) -> None:
    assert old in RING
    card = write(tmp_path, RING.replace(old, new))
    assert complaint(card) == f"{message} [{card}: {key}]"


@pytest.mark.parametrize(
    ("content", "message", "place"),
    [
        ("kind =\n", "not valid TOML: Invalid value", ": line 1"),
        (
            'kind = "a"\nname "b"\n',
            "not valid TOML: Expected '=' after a key in a key/value pair",
            ": line 2",
        ),
        (
            'kind = "a"\n\n[dimensions\n',
            "not valid TOML: Expected ']' at the end of a table declaration",
            ": line 3",
        ),
        ('kind = "a"\nkind = "b"\n', "not valid TOML: Cannot overwrite a value", ": line 2"),
        ('kind = """a\n', "not valid TOML: Unterminated string", ": line 1"),
        (b'kind = "ring"\nname = "\xff"\n', "not UTF-8 text", ": line 2"),
        pytest.param("a = " + "[" * 100_000, "not valid TOML: nested too deeply", "", id="nested"),
        ("", 'missing key "kind"', ": kind"),
    ],
)
def test_files_that_are_no_cards(tmp_path: Path, content: str | bytes, message: str, place: str) -> None:
    card = write(tmp_path, content)
    assert complaint(card) == f"{message} [{card}{place}]"


def test_an_integer_of_too_many_digits_is_no_card(tmp_path: Path) -> None:
    card = write(tmp_path, "a = " + "1" * 5000)
    assert complaint(card).startswith("not valid TOML: Exceeds the limit (4300 digits)")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing, too_long = str(tmp_path / "y.toml"), str(tmp_path / ("y" * 300 + ".toml"))
    assert complaint(missing) == f"no such file [{missing}]"
    assert complaint(f"{tmp_path}/") == f"expected a TOML file, got a directory [{tmp_path}/]"
    assert complaint(too_long) == f"cannot be read: File name too long [{too_long}]"
    assert complaint("a\0b/c\n.toml") == r"cannot be read: not a path [a\x00b/c\n.toml]"


def test_a_file_without_permission_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path) -> bytes:  # root, whom tests may run as, is never refused
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert complaint("x.toml") == "cannot be read: Permission denied [x.toml]"


def test_a_byte_order_mark_is_harmless(tmp_path: Path) -> None:
    assert load_geometry(write(tmp_path, b"\xef\xbb\xbf" + RING.encode())).kind == "ring_magnet"


def test_an_unknown_name_is_told_the_nearest() -> None:
    with pytest.raises(InputError) as raised:
        load_geometry("ring_magnet")
    assert str(raised.value) == (
        'unknown device card "ring_magnet"; the nearest is "ring_magnet_4x1.5x1" '
        "(`magfem list` shows all, a path ends in .toml)"
    )


def test_what_is_neither_name_nor_path_is_refused() -> None:
    with pytest.raises(InputError, match=r"^expected a device card's name or path, got 5$"):
        load_geometry(5)  # type: ignore[arg-type]


def test_a_changed_device_gets_a_card_of_its_own(tmp_path):
    """`dataclasses.replace` keeps the origin, which then no longer describes the device."""
    ring = load_geometry("ring_magnet_4x1.5x1")
    longer = replace(ring, length=2e-3)
    card = describe(longer)["card"]
    assert card["path"] == "made in Python" and card["sha256"] == sha256(card["text"].encode()).hexdigest()
    assert geometry_from_text(card_text(longer), "card") == longer
    assert card_text(ring) == ring.origin.text and describe(ring)["card"]["path"] == ring.origin.path
    assert describe(replace(ring))["card"] == describe(ring)["card"]
