"""Magnet kinds and assemblies: volumes, areas, moments, cards, grades, and refusals of one line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest

from magfem.constants import MU_0
from magfem.errors import CardError, InputError
from magfem.geometry import (
    GRADES,
    BlockMagnet,
    CylinderMagnet,
    CylinderSegmentMagnet,
    DiscMagnet,
    HalbachArray,
    HalbachRing,
    MagnetAssembly,
    MagneticSolids,
    MagnetStack,
    PermanentMagnet,
    PlacedMagnet,
    RingMagnet,
    SphereMagnet,
    card_text,
    geometry_from_text,
    grade_rows,
    load_geometry,
)
from magfem.geometry.catalogue import names
from magfem.mesh.generate import generate
from magfem.mesh.session import gmsh_session

N48 = PermanentMagnet(remanence=1.35)
SKEW = PermanentMagnet(remanence=1.2, recoil_permeability=1.1, magnetisation=(1, 2, 2))
BLOCK = BlockMagnet(size=(5e-3, 4e-3, 2e-3), material=SKEW)
DISC = DiscMagnet(diameter=8e-3, thickness=2e-3, material=N48)
SPHERE = SphereMagnet(diameter=5e-3, material=SKEW)
SEGMENT = CylinderSegmentMagnet(
    outer_diameter=20e-3, inner_diameter=12e-3, length=8e-3, start_angle=-0.3, end_angle=pi - 0.4, material=SKEW
)
WEDGE = CylinderSegmentMagnet(outer_diameter=20e-3, length=8e-3, start_angle=1.0, end_angle=2.0, material=N48)
STACK = MagnetStack(outer_diameter=45e-3, length=30e-3, count=2, gap=10e-3, material=N48)
RINGS = MagnetStack(outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, count=7, material=N48)
HALBACH = HalbachRing(outer_diameter=30e-3, inner_diameter=20e-3, length=10e-3, segments=8, material=N48)
SLIT = replace(HALBACH, segments=6, pole_pairs=2, gap=1e-3)
ARRAY = HalbachArray(size=(5e-3, 4e-3, 3e-3), count=5, gap=0.5e-3, material=SKEW)
ASSEMBLY = MagnetAssembly(
    magnets=(
        PlacedMagnet(BLOCK, (0, 0, 4e-3), (0, 0, pi / 6), "block"),
        PlacedMagnet(SPHERE, (0, 0, -3e-3), (0.3, -0.2, 0.5)),
        PlacedMagnet(CylinderMagnet(diameter=2e-3, length=6e-3, material=N48), (6e-3, 0, 0), (0, pi / 4, 0), "pin"),
    )
)
ALL = [BLOCK, DISC, SPHERE, SEGMENT, WEDGE, STACK, RINGS, HALBACH, SLIT, ARRAY, ASSEMBLY]
IDS = ["block", "disc", "sphere", "segment", "wedge", "stack", "rings", "halbach", "slit", "array", "assembly"]


@pytest.fixture
def occ() -> Iterator[Any]:
    """An empty OpenCASCADE model in metres."""
    with gmsh_session() as gmsh:
        yield gmsh.model.occ


@pytest.mark.parametrize("magnets", ALL, ids=IDS)
def test_solids_have_the_closed_volumes_and_areas(magnets: MagneticSolids, occ: Any) -> None:
    solids = magnets.build(occ)
    occ.synchronize()
    bodies = {body.name: body for body in magnets.bodies}
    assert list(solids) == list(bodies)
    for name, (tag,) in solids.items():
        assert occ.getMass(3, tag) == pytest.approx(bodies[name].volume, rel=1e-9, abs=0)
        _, faces = occ.getSurfaceLoops(tag)
        assert sum(occ.getMass(2, face) for face in np.concatenate(faces)) == pytest.approx(
            bodies[name].area, rel=1e-9, abs=0
        )
    assert sum(occ.getMass(3, tag) for (tag,) in solids.values()) == pytest.approx(magnets.volume, rel=1e-9, abs=0)


@pytest.mark.parametrize("magnets", ALL, ids=IDS)
def test_every_part_contains_its_share_of_a_box(magnets: MagneticSolids) -> None:
    """Monte Carlo: the share of random points that a part contains is its volume's."""
    rng = np.random.default_rng(1)
    for part in magnets.parts[:3]:
        corners = part.corners
        low, high = corners.min(axis=0) - part.shape.bulge, corners.max(axis=0) + part.shape.bulge
        inside = part.contains(low + (high - low) * rng.random((20000, 3)))
        assert inside.mean() * np.prod(high - low) == pytest.approx(part.shape.volume, rel=0.05)


@pytest.mark.parametrize("magnets", ALL, ids=IDS)
def test_solids_fill_hull_and_ball(magnets: MagneticSolids, occ: Any) -> None:
    """Solids touch the hull, which they lie in but for the bulge of round ones, and lie in the ball."""
    bulge = max(part.shape.bulge for part in magnets.parts)
    assert magnets.hull.distance(magnets.corners).max() <= 1e-9
    centre, radius = magnets.ball
    tags = [(3, tag) for found in magnets.build(occ).values() for tag in found]
    occ.synchronize()
    for dim, tag in tags:
        low_high = np.array(occ.getBoundingBox(dim, tag)).reshape(2, 3)
        assert (np.abs(low_high - centre) <= radius + 1e-6).all()
    boxes = np.array([occ.getBoundingBox(*tag) for tag in tags])
    corners = magnets.corners
    np.testing.assert_allclose(boxes[:, :3].min(axis=0), corners.min(axis=0), atol=bulge + 1e-6)
    np.testing.assert_allclose(boxes[:, 3:].max(axis=0), corners.max(axis=0), atol=bulge + 1e-6)


def test_moments_by_hand() -> None:
    np.testing.assert_allclose(BLOCK.moment, 1.2 * 40e-9 / MU_0 * np.array([1, 2, 2]) / 3, rtol=1e-12)
    np.testing.assert_allclose(SPHERE.moment, 1.2 * pi / 6 * 125e-9 / MU_0 * np.array([1, 2, 2]) / 3, rtol=1e-12)
    np.testing.assert_allclose(STACK.moment, [0, 0, 2 * 1.35 * pi / 4 * 45e-3**2 * 30e-3 / MU_0], rtol=1e-12)
    size = np.linalg.norm(HALBACH.parts[0].moment)
    np.testing.assert_allclose(HALBACH.moment / size, 0, atol=1e-12)
    np.testing.assert_allclose(SLIT.moment / size, 0, atol=1e-12)


def test_moment_turns_with_its_magnet() -> None:
    turned = MagnetAssembly(
        magnets=(
            PlacedMagnet(replace(BLOCK, material=replace(SKEW, magnetisation=(1, 0, 0))), rotation=(0, 0, pi / 2)),
        )
    )
    np.testing.assert_allclose(turned.moment, [0, 1.2 * 40e-9 / MU_0, 0], rtol=1e-12, atol=1e-15)
    assert turned.bodies[0].material.magnetisation == pytest.approx((0, 1, 0), abs=1e-15)


def test_halbach_magnetisation_turns() -> None:
    """Dipole: radially outwards on +x, inwards on +y, outwards on -x; quadrupole of six: 3·60° a segment."""
    directions = np.array([body.material.magnetisation for body in HALBACH.bodies])
    np.testing.assert_allclose(directions[[0, 1, 2, 4]], [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(SLIT.bodies[1].material.magnetisation, [-1, 0, 0], atol=1e-15)
    row = HalbachArray(size=(1e-3, 1e-3, 1e-3), count=5, material=N48).bodies
    steps = [[0, 0, -1], [-1, 0, 0], [0, 0, 1], [1, 0, 0], [0, 0, -1]]
    np.testing.assert_allclose([body.material.magnetisation for body in row], steps, atol=1e-15)


def test_slits_have_the_stated_width() -> None:
    one, other = SLIT.parts[:2]
    near = np.linalg.norm(one.corners[:, None] - other.corners[None], axis=-1).min()
    assert near == pytest.approx(1e-3, rel=1e-9)


def test_which_are_axisymmetric() -> None:
    axial = replace(SPHERE, material=N48)
    assert [m.axisymmetric for m in (DISC, STACK, RINGS, axial)] == [True] * 4
    assert not any(m.axisymmetric for m in (BLOCK, SPHERE, SEGMENT, HALBACH, ARRAY, ASSEMBLY))
    coaxial = MagnetAssembly(magnets=(PlacedMagnet(DISC, (0, 0, 2e-3)), PlacedMagnet(axial, (0, 0, -3e-3))))
    assert coaxial.axisymmetric
    assert not replace(coaxial, magnets=(PlacedMagnet(DISC, (1e-3, 0, 0)),)).axisymmetric


@pytest.mark.parametrize("magnets", [STACK, RINGS, replace(SPHERE, material=N48)], ids=["stack", "rings", "sphere"])
def test_half_sections_turned_about_the_axis_are_the_solids(magnets: MagneticSolids, occ: Any) -> None:
    for (tag,), body in zip(magnets.build_meridian(occ).values(), magnets.bodies, strict=True):
        rho, _, _ = occ.getCenterOfMass(2, tag)
        assert 2 * pi * rho * occ.getMass(2, tag) == pytest.approx(body.volume, rel=1e-9, abs=0)  # Pappus


@pytest.mark.parametrize("magnets", ALL, ids=IDS)
def test_a_card_reads_back_to_the_same_device(magnets: MagneticSolids) -> None:
    stated = replace(magnets, clearance=magnets.region.clearance, extent=magnets.region.extent)
    assert geometry_from_text(card_text(stated), "made here") == stated


@pytest.mark.parametrize("name", [name for name in names("geometries", ".toml")])
def test_cards_of_the_catalogue_load(name: str) -> None:
    device = load_geometry(name)
    assert device.source
    assert 0 < device.region.clearance < device.region.extent


def test_actuation_magnet_of_chapter_4() -> None:
    stack = load_geometry("magnet_stack_2x45x30")
    assert isinstance(stack, MagnetStack)
    assert stack.total_length == pytest.approx(70e-3)
    assert [part.position[2] for part in stack.parts] == pytest.approx([-20e-3, 20e-3])
    assert stack.parts[0].material.remanence == pytest.approx(1.345)  # middle of N45's 1.32 to 1.37 T


# Grades


def test_grades_are_in_order() -> None:
    for name, grade in GRADES.items():
        assert name == grade.name
        assert grade.range is None or grade.range[0] < grade.remanence < grade.range[1]
        assert 0.2 < grade.remanence < 1.55
        assert grade.family.temperature_coefficient < 0
        assert grade.family.source
    for suffix in ("", "M", "H"):
        stronger = [GRADES[f"N{number}{suffix}"].remanence for number in (35, 38, 40, 42, 45, 48, 50)]
        assert stronger == sorted(stronger)
    assert {"N35", "N55", "N48SH", "N42UH", "SmCo5-20", "Sm2Co17-30", "Y30", "Y35", "C5", "C8"} <= set(GRADES)
    assert len(grade_rows()) == len(GRADES)


def test_energy_product_is_the_number_of_the_grade() -> None:
    """(BH)max ≤ B_r²/(4µ₀µ_rec) on a straight line: the grade's number in MGOe (7.96 kJ/m³ each) within 8 %."""
    for number in (35, 38, 40, 42, 45, 48, 50, 52, 55):
        remanence = GRADES[f"N{number}"].remanence
        product = remanence**2 / (4 * MU_0 * 1.05) / 7958
        assert product == pytest.approx(number, rel=0.08)


def test_temperature_lowers_the_remanence() -> None:
    cold = PermanentMagnet.of_grade("n45")
    warm = PermanentMagnet.of_grade("N45", temperature=333.15)
    assert (cold.grade, cold.working_remanence) == ("N45", cold.remanence)
    assert warm.working_remanence == pytest.approx(1.345 * (1 - 0.0012 * 40), rel=1e-12)
    np.testing.assert_allclose(warm.remanence_vector, [0, 0, warm.working_remanence])


CARD = """
kind = "block_magnet"
[dimensions]
size = ["5 mm", "5 mm", "2 mm"]
[material]
magnetisation = "axial"
"""


def test_material_of_a_card_with_grade_and_temperature() -> None:
    read = geometry_from_text(CARD + 'grade = "N48"\ntemperature = "60 degC"\nrecoil_permeability = 1.0\n', "c.toml")
    assert isinstance(read, BlockMagnet)
    assert read.material.recoil_permeability == 1.0
    assert read.material.working_remanence == pytest.approx(1.395 * (1 - 0.0012 * 40))
    own = 'remanence = "1.2 T"\ntemperature = "100 degC"\ntemperature_coefficient = "-0.1 %/K"\n'
    stated = geometry_from_text(CARD + own, "c.toml")
    assert isinstance(stated, BlockMagnet)
    assert stated.material.working_remanence == pytest.approx(1.2 * 0.92)


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ('grade = "N47"', 'unknown grade "N47"; did you mean "N'),
        ('grade = "N48"\nremanence = "1.3 T"', "state grade or remanence, not both"),
        ('grade = "N48"\ntemperature = "90 degC"', "temperature must be at most 80 °C for N48"),
        ('grade = "N48"\ntemperature_coefficient = "-0.1 %/K"', "state grade or temperature_coefficient, not both"),
        ('remanence = "1.3 T"\ntemperature = "60 degC"', "a temperature needs a grade or a temperature_coefficient"),
        ('remanence = "1.3 T"\ntemperature_coefficient = -0.1', 'must be a text such as "-0.12 %/K", got -0.1'),
        ('remanence = "1.3 T"\ntemperature_coefficient = "-5 %/K"', "must lie within ±1 %/K, got -5 %/K"),
        ('remanence = "1.3 T"\ntemperature_coefficient = "-0.1 %/K"\ntemperature = "5 K"', "between -196.1 °C and"),
    ],
)
def test_bad_materials(material: str, message: str) -> None:
    with pytest.raises(CardError) as raised:
        geometry_from_text(CARD + material + "\n", "c.toml")
    text = str(raised.value)
    assert message in text and "[c.toml: material." in text and len(text.splitlines()) == 1


# Refusals


def card(kind: str, dimensions: str, material: str = 'remanence = "1.2 T"\nmagnetisation = "axial"') -> str:
    return f'kind = "{kind}"\n[dimensions]\n{dimensions}\n[material]\n{material}\n'


RING = 'outer_diameter = "30 mm"\ninner_diameter = "20 mm"\nlength = "10 mm"\n'
BARE = 'remanence = "1.2 T"'


@pytest.mark.parametrize(
    ("text", "message", "key"),
    [
        (card("block_magnet", 'size = ["5 mm", "5 mm"]'), "size must be three lengths such as", "dimensions.size"),
        (card("block_magnet", 'size = ["5 mm", "5 mm", 2]'), "expected a length with its unit", "dimensions.size"),
        (
            card("block_magnet", 'size = ["5 mm", "5 mm", "-2 mm"]'),
            "size must be positive, got -2 mm",
            "dimensions.size",
        ),
        (card("block_magnet", 'size = ["5 mm", "5 mm", "2 um"]'), "at least 1/1000 of the largest", "dimensions.size"),
        (card("sphere_magnet", 'diameter = "0 mm"'), "diameter must be positive", "dimensions.diameter"),
        (card("disc_magnet", 'diameter = "8 mm"\nlength = "2 mm"'), 'unknown key "length"', "dimensions.length"),
        (card("cylinder_segment_magnet", RING + 'angle = "360 deg"'), "between 1° and 359°", "dimensions.angle"),
        (card("cylinder_segment_magnet", RING + 'angle = "0.5 deg"'), "between 1° and 359°", "dimensions.angle"),
        (
            card("cylinder_segment_magnet", RING + 'start_angle = "0 deg"\nend_angle = "359.9 deg"'),
            "less than a full turn",
            "dimensions.end_angle",
        ),
        (
            card("cylinder_segment_magnet", RING + 'angle = "30 deg"\nend_angle = "2 deg"'),
            "state angle, which is centred on +x, or start_angle and end_angle, not both",
            "dimensions.end_angle",
        ),
        (
            card("cylinder_segment_magnet", RING + 'start_angle = "30 deg"\nend_angle = "20 deg"'),
            "end_angle must exceed start_angle by at least 1°",
            "dimensions.end_angle",
        ),
        (
            card("cylinder_segment_magnet", RING.replace("20", "40") + 'angle = "30 deg"'),
            "inner_diameter must be smaller than outer_diameter (30 mm), got 40 mm",
            "dimensions.inner_diameter",
        ),
        (
            card("magnet_stack", 'diameter = "8 mm"\nlength = "2 mm"\ncount = 2\ngap = "0 mm"'),
            "gap must be positive, or left out for magnets that touch, got 0 m",
            "dimensions.gap",
        ),
        (
            card("magnet_stack", 'diameter = "8 mm"\nlength = "2 mm"\ncount = 2.5'),
            "count must be a whole number from 1 to 200, got 2.5",
            "dimensions.count",
        ),
        (
            card("halbach_ring", RING + "segments = 1", BARE),
            "segments must be a whole number from 2",
            "dimensions.segments",
        ),
        (
            card("halbach_ring", RING + 'segments = 8\nfield = "bipole"', BARE),
            "field must be one of",
            "dimensions.field",
        ),
        (card("halbach_ring", RING + 'segments = 8\ngap = "8 mm"', BARE), "gap must leave room", "dimensions.gap"),
        (card("halbach_ring", RING + 'segments = 8\ngap = "-1 mm"', BARE), "gap must be positive", "dimensions.gap"),
        (
            card("halbach_ring", RING + "segments = 8"),
            'unknown key "magnetisation"',
            "material.magnetisation",
        ),
        (
            card("halbach_array", 'size = ["5 mm", "5 mm", "5 mm"]\ncount = 0'),
            "count must be a whole number from 1",
            "dimensions.count",
        ),
    ],
)
def test_bad_cards_name_file_and_key(text: str, message: str, key: str) -> None:
    with pytest.raises(CardError) as raised:
        geometry_from_text(text, "c.toml")
    said = str(raised.value)
    assert message in said and said.endswith(f"[c.toml: {key}]") and len(said.splitlines()) == 1


TWO = """
kind = "magnet_assembly"
[material]
remanence = "1.2 T"
magnetisation = "axial"
[[magnets]]
kind = "block_magnet"
dimensions = {{ size = ["4 mm", "4 mm", "4 mm"] }}
[[magnets]]
kind = "block_magnet"
name = "other"
dimensions = {{ size = ["4 mm", "4 mm", "4 mm"] }}
{0}
"""


@pytest.mark.parametrize(
    ("rest", "message", "key"),
    [
        ('position = ["3.99 mm", "0 mm", "0 mm"]', '"magnet_1" and "other" overlap', "magnets"),
        ('position = ["3 mm", "3 mm", "3 mm"]', '"magnet_1" and "other" overlap', "magnets"),
        ('position = ["4 mm", "0 mm"]', "position must be three lengths", "magnets[1].position"),
        ('position = ["4 mm", "0 mm", "0 deg"]', "expected a length", "magnets[1].position"),
        ("rotation = { axis = [0, 0, 0], angle = '30 deg' }", "axis must be", "magnets[1].rotation.axis"),
        (
            f"rotation = {{ axis = [0, 0, {10**400}], angle = '30 deg' }}",
            "three finite numbers",
            "magnets[1].rotation.axis",
        ),
        ("rotation = { axis = [0, 0, 1], angle = '30 mm' }", "expected an angle", "magnets[1].rotation.angle"),
        ("rotation = [0, 0, 1]", "expected an angle", "magnets[1].rotation"),
        ("colour = 1", 'unknown key "colour"', "magnets[1].colour"),
        ("material = { remanence = '1 T' }", 'missing key "magnetisation"', "magnets[1].material.magnetisation"),
        ("magnetisation = [0, 0, 0]", "must not be the zero vector", "magnets[1].material.magnetisation"),
    ],
)
def test_bad_assemblies_name_file_and_key(rest: str, message: str, key: str) -> None:
    with pytest.raises(CardError) as raised:
        geometry_from_text(TWO.format(rest), "c.toml")
    said = str(raised.value)
    assert message in said and said.endswith(f"[c.toml: {key}]") and len(said.splitlines()) == 1


def test_assemblies_beyond_rounding_are_refused() -> None:
    block = BlockMagnet(size=(2e-3, 2e-3, 2e-3), material=N48)
    assert MagnetAssembly(magnets=(PlacedMagnet(block, (1e3, 0, 0)),)).volume == pytest.approx(8e-9, rel=1e-12, abs=0)
    with pytest.raises(InputError, match='position of "magnet_1" must lie within 2 km of the origin'):
        MagnetAssembly(magnets=(PlacedMagnet(block, (0, -1e6, 0)),))


def test_magnets_may_touch() -> None:
    touching = geometry_from_text(
        TWO.format('position = ["4 mm", "0 mm", "0 mm"]\nmagnetisation = [1, 0, 0]'), "c.toml"
    )
    assert isinstance(touching, MagnetAssembly)
    assert touching.bodies[1].material.magnetisation == (1, 0, 0)
    mesh = generate(touching, 3, 0.5)
    assert mesh.names == ("magnet_1", "other")
    shared = [set(map(tuple, np.sort(mesh.body_facets(k)[0][:, :3], axis=1).tolist())) for k in (0, 1)]
    area = sum(
        np.linalg.norm(np.cross(mesh.points[b] - mesh.points[a], mesh.points[c] - mesh.points[a])) / 2
        for a, b, c in shared[0] & shared[1]
    )
    assert area == pytest.approx(16e-6, rel=1e-9, abs=0)


def test_a_pin_in_a_bore_does_not_overlap_and_too_thick_a_one_does() -> None:
    ring = RingMagnet(outer_diameter=8e-3, inner_diameter=4e-3, length=4e-3, material=N48)
    pin = CylinderMagnet(diameter=3.9e-3, length=6e-3, material=N48)
    MagnetAssembly(magnets=(PlacedMagnet(ring), PlacedMagnet(pin)))
    with pytest.raises(InputError, match="overlap"):
        MagnetAssembly(magnets=(PlacedMagnet(ring), PlacedMagnet(replace(pin, diameter=4.3e-3))))


def test_an_overlap_too_thin_for_samples_is_found_before_meshing() -> None:
    """Two spheres that share a lens of 1 µm: no plane separates them, no sample lies in both."""
    sphere = SphereMagnet(diameter=4e-3, material=N48)
    both = MagnetAssembly(magnets=(PlacedMagnet(sphere), PlacedMagnet(sphere, (3.999e-3, 0, 0))))
    with pytest.raises(InputError, match='"magnet_1" and "magnet_2" overlap'):
        generate(both, 3, 0.5)
