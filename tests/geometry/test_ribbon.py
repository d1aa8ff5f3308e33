"""Ribbons of foil: closed, of one width, mitred at corners, folded at vias, true to curves and to a cylinder."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from shapely import Polygon, unary_union

from magfem.errors import InputError, MeshError
from magfem.geometry import FoilTrack, Stations, check_ribbon, load_geometry
from magfem.geometry.foil_ribbon import Curved, Ribbon, Straight, ribbon_size
from magfem.geometry.polyline_track import polyline_track
from magfem.geometry.rolled import RolledRibbon

UP = np.array([0.0, 0.0, 1.0])
FLAT_CARDS = (
    "planar_coil_12mm",
    "planar_coil_12mm_two_layers",
    "flower_coil_20mm",
    "rectangular_spiral_20x12",
    "meander_coil_10x5",
    "stator_inner_coil_flat",
)
CARDS = (*FLAT_CARDS, "stator_1.6x5.5", "planar_coil_array_3x3")


def tracks(name: str) -> list[FoilTrack]:
    return [part for circuit in load_geometry(name).circuits for part in circuit.parts]


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def square_loop(width: float, side: float = 1.0) -> Ribbon:
    """Four straight strips, right-handed about +z, the corners mitred."""
    points = 0.5 * side * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], dtype=float)
    spatial = np.pad(points, ((0, 0), (0, 1)))
    pieces = []
    for start, end in pairwise(spatial):
        along = unit(end - start)
        pieces.append(Straight(start, end, np.cross(UP, along), (width, width)))
    return Ribbon(tuple(pieces))


@pytest.mark.parametrize("name", CARDS)
def test_ribbons_are_closed_and_agree_with_their_closed_forms(name: str) -> None:
    for track in tracks(name):
        stations = check_ribbon(track)
        for rows in (stations.left, stations.right, stations.normal):
            assert len(rows) == 2 * len(stations.lead) + 1
            np.testing.assert_allclose(rows[-1], rows[0], rtol=0, atol=1e-12)
        assert stations.lead.any() and not stations.lead.all()
        lead_length = ribbon_size(stations, lead=True)[0]
        assert lead_length == pytest.approx(track.lead_length, rel=1e-3)


@pytest.mark.parametrize("name", FLAT_CARDS)
def test_area_and_length_of_flat_ribbons_converge_to_the_closed_forms(name: str) -> None:
    track = tracks(name)[0]
    for resolution, tolerance in ((1.0, 1e-6), (2.0, 1e-7)):
        length, area = ribbon_size(track.stations(resolution))
        assert length == pytest.approx(track.length, rel=tolerance)
        assert area == pytest.approx(track.area, rel=tolerance)


@pytest.mark.parametrize("name", ["meander_coil_10x5", "stator_inner_coil_flat"])
def test_area_of_straight_tracks_by_the_polygon_of_their_edges(name: str) -> None:
    """The shoelace formula knows nothing of elements."""
    track = tracks(name)[0]
    stations = track.stations(1.0)
    last = 2 * int(np.flatnonzero(~stations.lead)[-1]) + 3
    x, y = np.concatenate([stations.right[:last], stations.left[last - 1 :: -1]])[:, :2].T
    assert 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)) == pytest.approx(track.area, rel=1e-12, abs=0)


@pytest.mark.parametrize("name", FLAT_CARDS)
def test_every_element_has_the_width_of_the_track(name: str) -> None:
    """Across: from the right edge to the line through two stations of the left one."""
    track = tracks(name)[0]
    stations = track.stations(8.0)  # chords are edges then
    turns = np.flatnonzero(~stations.lead)
    for a, b in ((stations.left, stations.right), (stations.right, stations.left)):
        along = unit(b[2 * turns + 2] - b[2 * turns])
        gap = np.cross(along, a[2 * turns + 1] - b[2 * turns + 1])
        np.testing.assert_allclose(np.linalg.norm(gap, axis=1), track.width, rtol=2e-3)


def test_corners_are_mitred() -> None:
    width = 0.1
    stations = square_loop(width)(1.0)
    corner = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])
    for places, reach in ((stations.left, 0.5 - width / 2), (stations.right, 0.5 + width / 2)):
        for x, y in reach * corner:
            assert np.abs(places - [x, y, 0]).max(axis=1).min() < 1e-15
    length, area = ribbon_size(stations)
    assert length == pytest.approx(4.0, rel=1e-14) and area == pytest.approx(4 * width, rel=1e-14)


def test_elements_are_graded_towards_corners_and_halved_at_double_resolution() -> None:
    width = 0.1
    ribbon = square_loop(width)
    coarse, fine = ribbon(1.0), ribbon(2.0)
    sizes = [np.linalg.norm(np.diff((s.left + s.right)[::2] / 2, axis=0), axis=1) for s in (coarse, fine)]
    assert sizes[0].min() == pytest.approx(width / 20) and sizes[1].min() == pytest.approx(width / 40)
    assert (sizes[0][1:] / sizes[0][:-1]).max() < 2.5
    assert len(fine.lead) == 2 * len(coarse.lead)
    np.testing.assert_allclose(fine.left[::4], coarse.left[::2], rtol=0, atol=1e-15)


def test_layers_offset_along_leaning_normals_stay_parallel_at_folds() -> None:
    """Every quad of edges, pushed out by h along its normals, lies h from its plane."""
    track = tracks("planar_coil_12mm")[0]
    stations = track.stations(1.0)
    height = 10e-6
    checked = 0
    for n in np.flatnonzero(stations.lead):
        a, b = 2 * n, 2 * n + 2
        plane = unit(np.cross(stations.left[b] - stations.left[a], stations.left[a] - stations.right[a]))
        plane *= np.sign(plane @ stations.normal[a + 1])
        for i in (a, b):
            assert height * plane @ stations.normal[i] == pytest.approx(height, rel=1e-12, abs=0)
            checked += np.linalg.norm(stations.normal[i]) > 1.4
    assert checked == 6  # four folds, seen from either side but for the turns'


def test_a_via_goes_straight_down_and_the_strip_forward_again() -> None:
    stations = tracks("planar_coil_12mm")[0].stations(1.0)
    first = int(np.flatnonzero(stations.lead)[0])
    middle = 0.5 * (stations.left + stations.right)
    directions = unit(-3 * middle[:-2:2] + 4 * middle[1::2] - middle[2::2])  # where elements begin
    strip = first + int(np.argmax(np.abs(directions[first:, 2]) < 1e-9))
    np.testing.assert_allclose(directions[first:strip], np.tile([0, 0, -1], (strip - first, 1)), atol=1e-9)
    ending = unit(middle[2 * first - 2] - 4 * middle[2 * first - 1] + 3 * middle[2 * first])
    assert ending @ directions[strip] == pytest.approx(1, abs=1e-4)  # parabolas, not the curves themselves
    np.testing.assert_allclose(stations.normal[2 * first + 1], directions[strip], atol=2e-3)


@pytest.mark.parametrize("name", CARDS)
def test_return_strips_bend_gently(name: str) -> None:
    """No two chords of a level strip turn by more than an arc's element does: nowhere a mitre."""
    for track in tracks(name):
        stations = track.stations(1.0)
        middle = 0.5 * (stations.left + stations.right)
        radius = np.hypot(middle[:, 0], middle[:, 1])
        plan = middle[:, :2]
        if name.startswith("stator_1.6"):  # unrolled
            plan = np.stack([np.unwrap(np.arctan2(middle[:, 1], middle[:, 0])) * radius, middle[:, 2]], axis=1)
        chords = np.diff(plan[::2], axis=0)
        level = np.isclose(
            np.linalg.norm(chords, axis=1), np.linalg.norm(np.diff(middle[::2], axis=0), axis=1), rtol=0.05
        )
        strip = np.flatnonzero(stations.lead & level)
        assert (np.diff(strip) == 1).all()
        along = unit(chords[strip])
        turns = np.arccos(np.clip((along[1:] * along[:-1]).sum(axis=1), -1, 1))
        assert np.degrees(turns.max()) < 9.0
        bends = np.linalg.norm(chords[strip], axis=1)[1:-1] / np.maximum(turns[:-1], 1e-9)
        assert bends.min() > 0.6 * track.width


@pytest.mark.parametrize(("turns", "strands"), [(1, 2), (2, 3), (3, 4), (5, 5)])
def test_return_strips_keep_off_themselves(turns: int, strands: int) -> None:
    """By the area of the union of their elements."""
    rectangle, meander = load_geometry("stator_inner_coil_flat"), load_geometry("meander_coil_10x5")
    for coil in (replace(rectangle, turns=turns), replace(meander, strands=strands)):  # type: ignore[call-arg]
        stations = coil.circuits[0].parts[0].stations(2.0)
        low = np.flatnonzero(stations.lead & (np.abs(np.diff(stations.left[::2, 2])) < 1e-12))
        quads = [
            np.concatenate([stations.left[2 * n : 2 * n + 3], stations.right[2 * n : 2 * n + 3][::-1]]) for n in low
        ]
        shapes = [Polygon(quad[:, :2]) for quad in quads]
        assert unary_union(shapes).area == pytest.approx(sum(shape.area for shape in shapes), rel=1e-6, abs=0)


def test_elements_next_to_a_via_follow_the_strips_bend_beyond_it() -> None:
    """A via is much shorter than the track is wide: what is uneven in the strip is uneven in the turns."""
    for name in FLAT_CARDS:
        track = tracks(name)[0]
        stations = track.stations(1.0)
        middle = 0.5 * (stations.left + stations.right)
        sizes = np.linalg.norm(np.diff(middle[::2], axis=0), axis=1)
        turns = np.flatnonzero(~stations.lead)
        assert sizes[turns[[0, -1]]].max() < 1.5 * track.width


def test_curved_tracks_curve_on_the_cylinder() -> None:
    assert [track.curvature for track in tracks("meander_coil_10x5")] == [0.0]
    radii = load_geometry("stator_1.6x5.5").radii  # type: ignore[attr-defined]
    assert [1 / track.curvature for track in tracks("stator_1.6x5.5")] == pytest.approx(
        [radii["inner"], radii["outer"]]
    )


def test_parabolas_through_the_stations_follow_the_spiral() -> None:
    """Archimedes: the radius falls with the angle; off between stations by a millionth of the coil's."""
    coil = load_geometry("planar_coil_12mm")
    stations = coil.circuits[0].parts[0].stations(1.0)
    middle = 0.5 * (stations.left + stations.right)
    turns = np.flatnonzero(~stations.lead)
    u = np.linspace(-1, 1, 9)[:, None, None]
    nodes = [middle[2 * turns + i] for i in range(3)]
    places = 0.5 * u * (u - 1) * nodes[0] + (1 - u**2) * nodes[1] + 0.5 * u * (u + 1) * nodes[2]
    radius = np.hypot(places[..., 0], places[..., 1])
    angle = np.arctan2(places[..., 1], places[..., 0])
    outer, pitch = 5.95e-3, (6e-3 - 1e-3 - 0.1e-3) / 24
    turn = (outer - radius) / pitch - angle / (2 * np.pi)
    assert (np.abs(turn - np.round(turn)) * pitch).max() < 1e-6 * outer


def test_rolling_keeps_lengths_and_heights() -> None:
    track = tracks("stator_inner_coil_flat")[0]
    flat = track.stations(1.0)
    errors = []
    for radius in (0.8e-3, 1.6e-3):
        rolled = RolledRibbon(track.stations, radius)(1.0)
        middle = 0.5 * (rolled.left + rolled.right)
        plan = 0.5 * (flat.left + flat.right)
        np.testing.assert_allclose(middle[:, 2], plan[:, 1], atol=1e-15)
        unrolled = np.unwrap(np.arctan2(middle[:, 1], middle[:, 0])) * radius
        np.testing.assert_allclose(unrolled - unrolled[0], plan[:, 0] - plan[0, 0], atol=1e-12)
        widths = np.linalg.norm(rolled.left - rolled.right, axis=1)
        np.testing.assert_allclose(widths, np.linalg.norm(flat.left - flat.right, axis=1), rtol=1e-12)
        outward = unit(middle * [1, 1, 0])
        upright = np.abs(flat.normal[:, 2] - 1) < 1e-12
        assert ((rolled.normal * outward).sum(axis=1)[upright] > 0.999).all()
        # A section's mean square distance from the axis, but for leads, is the radius's.
        turns = np.repeat(~flat.lead, 2)
        square = (middle**2)[:-1, :2].sum(axis=1) + ((rolled.left - rolled.right)[:-1, :2] ** 2).sum(axis=1) / 12
        np.testing.assert_allclose(square[turns][2:-2], radius**2, rtol=1e-9)
        errors.append(abs(ribbon_size(rolled)[1] / track.area - 1))
    assert errors[1] < 0.35 * errors[0]  # of strips that are flat across: with the square of width over radius


def test_stators_have_their_lengths_on_the_cylinder() -> None:
    for track in tracks("stator_1.6x5.5"):
        length, area = ribbon_size(track.stations(1.0))
        assert length == pytest.approx(track.length, rel=5e-5) and area == pytest.approx(track.area, rel=5e-5)


def test_a_wrong_closed_form_is_a_mesh_error() -> None:
    track = tracks("meander_coil_10x5")[0]
    for key in ("length", "area"):
        with pytest.raises(MeshError, match=key):
            check_ribbon(replace(track, **{key: 1.0002 * getattr(track, key)}))


def test_an_open_ribbon_is_a_mesh_error() -> None:
    track = tracks("meander_coil_10x5")[0]

    def opened(resolution: float) -> Stations:
        stations = track.stations(resolution)
        left = stations.left.copy()
        left[-1] += 1e-6
        return replace(stations, left=left)

    with pytest.raises(MeshError, match="not closed"):
        check_ribbon(replace(track, stations=opened))


def test_a_track_that_turns_twice_within_its_width_is_refused() -> None:
    with pytest.raises(InputError, match="turns twice"):
        square_loop(width=0.6, side=0.5)(1.0)


def test_rounded_corners_are_arcs() -> None:
    points = np.array([[0, 0], [1, 0], [1, 1]], dtype=float)
    pieces, length = polyline_track(points, 0.1, np.array([0, 0.3, 0]))
    assert length == pytest.approx(2 * 0.7 + 0.3 * np.pi / 2, rel=1e-15)
    arc = pieces[1]
    assert isinstance(arc, Curved)
    stations = Ribbon((arc,)).open(1.0)
    np.testing.assert_allclose(np.linalg.norm(stations.left[:, :2] - [0.7, 0.3], axis=1), 0.25, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(stations.right[:, :2] - [0.7, 0.3], axis=1), 0.35, rtol=1e-12)
