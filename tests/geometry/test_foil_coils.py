"""Coils etched from foil: lengths and sizes by other routes, and one sentence for windings that do not fit."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial import cKDTree

from magfem.errors import CardError, InputError
from magfem.fields.hull import BoxHull, CylinderHull
from magfem.geometry import (
    Coil,
    CoilArray,
    FoilTrack,
    MeanderCoil,
    PlanarSpiralCoil,
    RectangularCoil,
    Stations,
    Stator,
    card_text,
    check_ribbon,
    geometry_from_text,
    load_geometry,
)
from magfem.geometry.catalogue import folder
from magfem.geometry.outline import Flower, Polygon, Rectangle

CARDS = (
    "planar_coil_12mm",
    "planar_coil_12mm_two_layers",
    "planar_coil_array_3x3",
    "flower_coil_20mm",
    "rectangular_spiral_20x12",
    "meander_coil_10x5",
    "stator_inner_coil_flat",
    "stator_1.6x5.5",
)
COPPER = 58e6  # S/m


def card(name: str) -> str:
    return (folder("geometries") / f"{name}.toml").read_text(encoding="utf-8")


def track(coil: Coil, circuit: int = 0) -> FoilTrack:
    part = coil.circuits[circuit].parts[0]
    assert isinstance(part, FoilTrack)
    return part


def area_vector(stations: Stations) -> np.ndarray:
    """½ ∮ r × dr of the centreline, by the polygon through it."""
    r = 0.5 * (stations.left + stations.right)
    return 0.5 * np.cross(r[:-1], r[1:]).sum(axis=0)


def spiral(**changes: object) -> PlanarSpiralCoil:
    values = dict(outer_diameter=12e-3, inner_diameter=2e-3, turns=24, trace_width=1e-4, gap=1e-4, thickness=9e-6)
    return PlanarSpiralCoil(**{**values, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", CARDS)
def test_cards_are_coils_whose_metal_is_area_times_thickness(name: str) -> None:
    coil = load_geometry(name)
    assert isinstance(coil, Coil) and not coil.axisymmetric
    parts = [part for circuit in coil.circuits for part in circuit.parts]
    assert coil.volume == pytest.approx(sum(part.area * part.thickness for part in parts), rel=1e-14, abs=0)
    assert coil.source


@pytest.mark.parametrize("name", CARDS)
def test_cards_written_anew_give_the_same_coil(name: str) -> None:
    coil = load_geometry(name)
    moved = replace(coil, clearance=2 * coil.region.clearance, extent=coil.region.extent)
    assert geometry_from_text(card_text(moved), "anew") == moved
    assert card_text(coil) == card(name)


def test_the_planar_coil_of_chapter_5() -> None:
    coil = load_geometry("planar_coil_12mm")
    assert isinstance(coil, PlanarSpiralCoil)
    pitch = 4.9e-3 / 24
    length = quad(lambda angle: np.hypot(5.95e-3 - pitch * angle / (2 * pi), pitch / (2 * pi)), 0, 48 * pi)[0]
    part = track(coil)
    assert part.length == pytest.approx(length, rel=1e-9)
    assert part.area == pytest.approx(length * 1e-4, rel=1e-9, abs=0)
    assert coil.smallest_gap == pytest.approx(pitch - 1e-4, rel=1e-12, abs=0)
    assert coil.hull == CylinderHull(12e-3, 9e-6)
    assert coil.region.clearance == 0.2e-3 and coil.region.extent == 6e-3
    assert length / (COPPER * 1e-4 * 9e-6) == pytest.approx(10.11, abs=0.01)  # Ω; the dissertation states 12
    stations = part.stations(1.0)
    turns = np.repeat(~stations.lead, 2)
    radius = np.hypot(*np.concatenate([stations.left[:-1][turns], stations.right[:-1][turns]])[:, :2].T)
    assert radius.max() == pytest.approx(6e-3, rel=1e-5)
    assert radius.min() == pytest.approx(1e-3, rel=1e-2)


def test_positive_current_turns_right_handed_and_encloses_the_spirals_area() -> None:
    """½ ∫ r² dφ of Archimedes' spiral; the return strip adds its little triangle."""
    part = track(load_geometry("planar_coil_12mm"))
    enclosed = area_vector(part.stations(2.0))
    exact = pi * (5.95e-3**3 - 1.05e-3**3) / (3 * 4.9e-3 / 24)
    assert enclosed[2] == pytest.approx(exact, rel=2e-3)
    assert np.abs(enclosed[:2]).max() < 1e-3 * exact


@pytest.mark.parametrize("name", ["flower_coil_20mm", "rectangular_spiral_20x12", "stator_inner_coil_flat"])
def test_other_spirals_are_right_handed_too(name: str) -> None:
    x, y, z = area_vector(track(load_geometry(name)).stations(1.0))
    assert z > 100 * max(abs(x), abs(y))


def test_repeated_and_aligned_points_of_an_outline_are_of_no_account() -> None:
    corners = [(-5e-3, -5e-3), (5e-3, -5e-3), (5e-3, 5e-3), (-5e-3, 5e-3)]
    repeated = [corners[0], corners[0], (0.0, -5e-3), corners[1], *corners[2:], corners[3], corners[0]]
    bare = dict(outer_diameter=None, inner_diameter=None, turns=3)
    one, other = (spiral(outline=Polygon(tuple(points)), **bare) for points in (corners, repeated))
    assert other.winding.length == pytest.approx(one.winding.length, rel=1e-12)
    assert other.winding.size == pytest.approx((10e-3, 10e-3), rel=1e-12)


@pytest.mark.parametrize("name", ["planar_coil_12mm", "flower_coil_20mm", "rectangular_spiral_20x12"])
def test_turns_keep_their_gap(name: str) -> None:
    """Nearest edge points of the turn before, from a dense sampling of the edges."""
    coil = load_geometry(name)
    assert isinstance(coil, PlanarSpiralCoil)
    stations = track(coil).stations(16.0)
    turns = np.append(np.repeat(~stations.lead, 2), False)
    outer, inner = stations.right[turns], stations.left[turns]  # right is outwards
    middle = 0.5 * (outer + inner)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
    pairs = cKDTree(inner).sparse_distance_matrix(cKDTree(outer), 1.2 * coil.gap, output_type="coo_matrix")
    apart = np.abs(along[pairs.row] - along[pairs.col]) > 10 * (coil.trace_width + coil.gap)
    nearest = pairs.data[apart].min()
    assert nearest >= 0.998 * coil.gap
    assert coil.smallest_gap == pytest.approx(nearest, rel=2e-2)


def test_rectangular_coil_fills_its_outline_and_has_the_length_of_its_strands() -> None:
    coil = load_geometry("stator_inner_coil_flat")
    assert isinstance(coil, RectangularCoil)
    part = track(coil)
    stations = part.stations(1.0)
    turns = np.append(np.repeat(~stations.lead, 2), False)
    edges = np.concatenate([stations.left[turns], stations.right[turns]])
    np.testing.assert_allclose(np.ptp(edges, axis=0)[:2], [4.35e-3, 5.5e-3], rtol=1e-12)
    # Strands of turn k, between centrelines: bottom, right, top, left; the next turn's corner is a pitch further in.
    w, across, up = 0.13e-3, 0.18e-3, 0.20e-3
    wide, high = 4.35e-3 - w, 5.5e-3 - w
    k = np.arange(12)
    bottom = wide - 2 * k * across + np.where(k > 0, across, 0)
    strands = bottom + (high - 2 * k * up) + (wide - 2 * k * across) + (high - 2 * k * up - up)
    assert part.length == pytest.approx(strands.sum(), rel=1e-12)
    assert part.length / (COPPER * w * 18e-6) == pytest.approx(0.9, rel=0.07)  # Ω, measured on the real one
    assert coil.hull == BoxHull((4.35e-3, 5.5e-3, 18e-6))


def test_meander_has_its_strands_and_alternates() -> None:
    coil = load_geometry("meander_coil_10x5")
    assert isinstance(coil, MeanderCoil)
    assert coil.width == pytest.approx(4.9e-3)
    part = track(coil)
    assert part.length == pytest.approx(10 * 10e-3 - 18 * 0.2e-3 + 9 * 0.5e-3, rel=1e-12)
    first = part.stations(1.0)
    assert first.left[2, 1] > first.left[0, 1] and first.left[0, 0] > 0  # upwards on the side of +x


@pytest.mark.parametrize("turns", [1, 2, 3, 12])
def test_few_turns_find_room_for_their_return_strip(turns: int) -> None:
    coil = load_geometry("stator_inner_coil_flat")
    assert isinstance(coil, RectangularCoil)
    check_ribbon(track(replace(coil, turns=turns)))
    inner = 12e-3 - 4e-4 * turns - 2e-4
    check_ribbon(track(spiral(turns=turns, inner_diameter=inner)))


@pytest.mark.parametrize("strands", [2, 3, 5, 10])
def test_meanders_of_even_and_odd_strands_close(strands: int) -> None:
    coil = load_geometry("meander_coil_10x5")
    assert isinstance(coil, MeanderCoil)
    check_ribbon(track(replace(coil, strands=strands)))


def test_fractional_turns_of_round_spirals() -> None:
    coil = spiral(turns=23.5, inner_diameter=2.2e-3)
    stations = check_ribbon(track(coil))
    middle = 0.5 * (stations.left + stations.right)
    end = middle[2 * int(np.flatnonzero(stations.lead)[0])]
    assert end[0] == pytest.approx(-1.15e-3) and abs(end[1]) < 1e-12


def test_leads_go_where_they_are_told() -> None:
    coil = spiral()
    for depth in (30e-6, -200e-6):
        leads = replace(coil.leads, depth=depth, width=3e-4, direction=pi / 3)
        stations = check_ribbon(track(replace(coil, leads=leads)))
        middle = 0.5 * (stations.left + stations.right)
        extreme = middle[np.argmax(np.abs(middle[:, 2]))]
        assert extreme[2] == pytest.approx(-depth)
        strips = np.flatnonzero(stations.lead & (np.abs(stations.normal[1::2, 2] - 1) < 1e-9))
        widths = np.linalg.norm(stations.left - stations.right, axis=1)[2 * strips + 1]
        assert widths.max() >= 3e-4 * (1 - 1e-9)
        np.testing.assert_allclose(middle[0, :2], 5.95e-3 * np.array([0.5, 3**0.5 / 2]), rtol=1e-12)


def test_layers_are_stacked_in_series_about_the_middle() -> None:
    coil = load_geometry("planar_coil_12mm_two_layers")
    (circuit,) = coil.circuits
    heights = [part.stations(0.5).left[0, 2] for part in circuit.parts]
    np.testing.assert_allclose(heights, [-59e-6, 59e-6], rtol=1e-12)
    single = load_geometry("planar_coil_12mm")
    assert coil.volume == pytest.approx(2 * single.volume, rel=1e-12, abs=0)
    assert coil.hull == CylinderHull(12e-3, 127e-6)


def test_array_has_a_circuit_for_each_coil() -> None:
    array = load_geometry("planar_coil_array_3x3")
    assert isinstance(array, CoilArray)
    assert [circuit.name for circuit in array.circuits][:4] == ["1_1", "1_2", "1_3", "2_1"]
    single = track(load_geometry("planar_coil_12mm")).stations(0.5)
    for circuit, shift in zip(array.circuits, ((x, y) for y in (-1, 0, 1) for x in (-1, 0, 1)), strict=True):
        stations = circuit.parts[0].stations(0.5)
        np.testing.assert_allclose(stations.left, single.left + 13e-3 * np.array([*shift, 0]), atol=1e-15)
    np.testing.assert_allclose(array.hull.size, [38e-3, 38e-3, 9e-6])
    oblong = replace(array, rows=2, row_pitch=20e-3)
    np.testing.assert_allclose(oblong.size, [38e-3, 32e-3, 9e-6])


def test_the_stator_of_chapter_6() -> None:
    stator = load_geometry("stator_1.6x5.5")
    assert isinstance(stator, Stator)
    assert [circuit.name for circuit in stator.circuits] == ["inner", "outer"]
    radii = {"outer": (0.8 - 0.009) * 1e-3, "inner": (0.8 - 0.055 - 0.035 - 0.009) * 1e-3}
    assert stator.radii == pytest.approx(radii)
    assert np.degrees(stator.angle) == pytest.approx(np.degrees(1.2 / (0.8 - 0.055 - 0.0175)))
    assert 90 < np.degrees(stator.angle) < 95  # "perpendicular"
    assert stator.hull == CylinderHull(1.6e-3, 5.5e-3)
    assert 1.2e-3 < stator.bore.diameter < 2 * radii["inner"]  # a steel rod of 1.2 mm passed through
    for index, (resistance, angle) in enumerate(((0.9, 0.0), (0.82, stator.angle))):
        part = track(stator, index)
        assert part.length / (COPPER * part.width * part.thickness) == pytest.approx(resistance, rel=0.07)
        vector = area_vector(part.stations(1.0))
        np.testing.assert_allclose(
            vector[:2] / np.linalg.norm(vector), [np.cos(angle), np.sin(angle)], atol=0.02
        )  # each coil's moment points along its middle's normal
        lowest = np.hypot(*part.stations(1.0).left[:, :2].T).min()
        assert 2 * lowest > stator.bore.diameter


def test_tape_of_its_full_thickness_leaves_no_room_for_the_inner_coil() -> None:
    stator = load_geometry("stator_1.6x5.5")
    with pytest.raises(
        InputError, match=r"4\.35 mm wide and does not fit the 4\.31027 mm around .* thinner than 43\.6"
    ):
        replace(stator, tape=50e-6)


ROUND = card("planar_coil_12mm")
BARE = "\n".join(line for line in ROUND.splitlines() if "_diameter" not in line).partition("[leads]")[0]
POINTS = '[outline]\nkind = "points"\npoints = [{}]'
RECTANGLE = card("stator_inner_coil_flat")
MEANDER = card("meander_coil_10x5")
ARRAY = card("planar_coil_array_3x3")
STATOR = card("stator_1.6x5.5")


@pytest.mark.parametrize(
    ("text", "old", "new", "words", "key"),
    [
        (ROUND, "turns = 24", "turns = 30", "does not fit its window: 30 turns", "dimensions.turns"),
        (ROUND, "turns = 24", "turns = 300", "at most 29 turns fit at all", "dimensions.turns"),
        (ROUND, "turns = 24", "turns = 12", "inner_diameter 7 mm would fit", "dimensions.turns"),
        (ROUND, "turns = 24", "turns = 0", "turns must lie between 1 and 1000", "dimensions.turns"),
        (ROUND, "turns = 24", "turns = 1e300", "turns must lie between 1 and 1000", "dimensions.turns"),
        (ROUND, "turns = 24", "turns = nan", "turns must be finite", "dimensions.turns"),
        (ROUND, 'gap = "100 um"', 'gap = "0 um"', "gap must be positive", "dimensions.gap"),
        (ROUND, '"2 mm"', '"13 mm"', "inner_diameter must be smaller", "dimensions.inner_diameter"),
        (ROUND, 'inner_diameter = "2 mm"', "", 'missing key "inner_diameter"', "dimensions.inner_diameter"),
        (ROUND, '"59 um"', '"9 um"', "depth must exceed the foil's thickness", "leads.depth"),
        (ROUND, "[conductor]", '[layers]\ncount = 2\nspacing = "60 um"\n[conductor]', "spacing", "layers.spacing"),
        (ROUND, "[conductor]", '[rolled]\nradius = "1 mm"\n[conductor]', "12 mm wide and does not", "rolled.radius"),
        (ROUND, "[conductor]", "[rolled]\n[conductor]", "either radius or diameter", "rolled"),
        (ROUND, "[leads]", '[outline]\nkind = "heart"\n[leads]', 'unknown outline "heart"', "outline.kind"),
        (
            ROUND,
            "[leads]",
            '[outline]\nkind = "rectangle"\nsize = ["9 mm", "9 mm"]\n[leads]',
            "outer_diameter goes with round outlines",
            "dimensions.outer_diameter",
        ),
        (
            BARE + '[outline]\nkind = "rectangle"\nsize = ["12 mm", "9 mm"]',
            "",
            "",
            "at most 22 turns fit",
            "dimensions.turns",
        ),
        (
            BARE + POINTS.format('["0 mm", "0 mm"], ["9 mm", "9 mm"], ["9 mm", "0 mm"], ["0 mm", "9 mm"]'),
            "",
            "",
            "crosses or touches itself",
            "outline.points",
        ),
        (
            BARE
            + POINTS.format('["0 mm", "0 mm"], ["9 mm", "0 mm"], ["7 mm", "0 mm"], ["7 mm", "9 mm"], ["0 mm", "9 mm"]'),
            "",
            "",
            "crosses or touches itself",
            "outline.points",
        ),
        (
            BARE + POINTS.format(", ".join(['["0 mm", "0 mm"]'] * 1002)),
            "",
            "",
            "at most 1000 points, got 1002",
            "outline.points",
        ),
        (
            BARE + POINTS.format('["0 mm", "0 mm"], ["9 mm", "0 mm"]'),
            "",
            "",
            "three or more",
            "outline.points",
        ),
        (
            BARE + POINTS.format('["0 mm", "0 mm"], ["9 mm", "0 mm"], ["0 mm", "1 mm"]'),
            "",
            "",
            "at least 60 deg wide",
            "outline.points",
        ),
        (card("flower_coil_20mm"), "turns = 12", "turns = 40", "does not fit its outline", "dimensions.turns"),
        (card("flower_coil_20mm"), "petals = 5", "petals = 5.5", "petals must be a whole number", "outline.petals"),
        (RECTANGLE, "turns = 12", "turns = 13", "at most 12 turns fit", "dimensions.turns"),
        (RECTANGLE, "turns = 12", "turns = 11.5", "turns must be a whole number", "dimensions.turns"),
        (RECTANGLE, '"0.07 mm"', '"-1 mm"', "transverse_gap must be positive", "dimensions.transverse_gap"),
        (MEANDER, "strands = 10", "strands = 1", "strands must be at least 2", "dimensions.strands"),
        (MEANDER, '"0.1 mm"', '"12 um"', "gap must be at least 100 µm", "dimensions.gap"),
        (MEANDER, '"10 mm"', '"0.5 mm"', "length must be at least 900 µm", "dimensions.length"),
        (ARRAY, '"13 mm"', '"11 mm"', "for neighbours not to touch", "dimensions.pitch"),
        (ARRAY, "turns = 24", "turns = 30", "does not fit its window", "coil.dimensions.turns"),
        (ARRAY, "rows = 3", "rows = 0.5", "rows must be a whole number", "dimensions.rows"),
        (ARRAY, '"planar_spiral_coil"', '"ring_magnet"', "an array has no coils of kind", "coil.kind"),
        (STATOR, '"35 um"', '"50 um"', "does not fit the 4.31027 mm around", "inner.width"),
        (STATOR, '"35 um"', '"18 um"', "tape must be thicker than the copper", "dimensions.tape"),
        (STATOR, '"1.6 mm"', '"0.2 mm"', "leaves no bore", "dimensions.tube_inner_diameter"),
        (STATOR, "turns = 12", "turns = 20", "inner coil: the winding does not fit", "inner.turns"),
    ],
)
def test_faults_are_one_sentence_with_file_and_key(text: str, old: str, new: str, words: str, key: str) -> None:
    assert old in text
    with pytest.raises(CardError) as raised:
        geometry_from_text(text.replace(old, new, 1), "x.toml")
    message = str(raised.value)
    assert words in message and message.endswith(f"[x.toml: {key}]") and "\n" not in message


def test_faults_in_python_say_what_they_are() -> None:
    with pytest.raises(InputError, match="leads must be a Leads"):
        spiral(leads=59e-6)
    with pytest.raises(InputError, match="outline must be an Outline"):
        spiral(outline="circle")
    with pytest.raises(InputError, match="several layers need their spacing"):
        spiral(layers=2)
    with pytest.raises(InputError, match="must be a coil of foil"):
        CoilArray(coil=load_geometry("ring_magnet_4x1.5x1"), rows=1, columns=1, pitch=1.0)  # type: ignore[arg-type]


MM = 1e-3


@given(
    outline=st.one_of(
        st.builds(Flower, petals=st.integers(2, 9), depth=st.floats(0.05 * MM, 3 * MM)),
        st.builds(
            Rectangle,
            size=st.tuples(st.floats(2 * MM, 20 * MM), st.floats(2 * MM, 20 * MM)),
            corner_radius=st.sampled_from([0.0, 0.5 * MM, 2 * MM]),
        ),
        st.builds(
            Polygon,
            points=st.lists(st.tuples(st.floats(0, 10 * MM), st.floats(0, 10 * MM)), min_size=3, max_size=6).map(tuple),
        ),
    ),
    turns=st.integers(1, 12),
    width=st.floats(0.05 * MM, 0.5 * MM),
    gap=st.floats(0.05 * MM, 0.5 * MM),
)
@settings(max_examples=40, derandomize=True, deadline=None)
def test_random_outlines_are_coils_with_their_gap_or_one_sentence(
    outline: Flower | Rectangle | Polygon, turns: int, width: float, gap: float
) -> None:
    diameter = 16 * MM if isinstance(outline, Flower) else None
    try:
        coil = spiral(
            outline=outline,
            turns=turns,
            trace_width=width,
            gap=gap,
            outer_diameter=diameter,
            inner_diameter=None,
        )
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    else:
        check_ribbon(track(coil))
        assert coil.smallest_gap >= 0.8 * gap
