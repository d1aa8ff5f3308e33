"""Coils of wire: closed forms for metal and lengths, ribbons that close and turn the right way, faults named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from magfem.constants import MU_0
from magfem.errors import CardError, InputError
from magfem.geometry import (
    CoaxialWinding,
    Coil,
    Geometry,
    HelmholtzPair,
    LoopCoil,
    RacetrackCoil,
    SaddleCoil,
    Solenoid,
    Stations,
    SweptWinding,
    Wire,
    card_text,
    geometry_from_text,
    load_geometry,
)
from magfem.typing import Floats

CARDS = {
    "solenoid_24x48x60": Solenoid,
    "solenoid_20x30x30": Solenoid,
    "loop_50": LoopCoil,
    "helmholtz_pair_200": HelmholtzPair,
    "racetrack_coil_60x20": RacetrackCoil,
    "team13_coil": RacetrackCoil,
    "saddle_coil_pair_40x60": SaddleCoil,
}
SWEPT = ("racetrack_coil_60x20", "team13_coil", "saddle_coil_pair_40x60")

SOLENOID: dict[str, Any] = {"inner_diameter": 20e-3, "outer_diameter": 30e-3, "length": 30e-3, "turns": 1000}
SADDLE: dict[str, Any] = {
    "inner_diameter": 40e-3,
    "outer_diameter": 44e-3,
    "length": 60e-3,
    "breadth": 5e-3,
    "bend_radius": 3e-3,
    "arc_angle": 2.3,
    "turns": 50,
}


def coil(name: str) -> Any:
    device = load_geometry(name)
    assert isinstance(device, Coil)
    return device


def swept(name: str) -> list[SweptWinding]:
    parts = [part for circuit in coil(name).circuits for part in circuit.parts]
    assert all(isinstance(part, SweptWinding) for part in parts)
    return parts


def along(line: Floats) -> tuple[Floats, Floats]:
    """Gauss points (n, 4, 3) of the parabolas through a line's stations, and their line elements."""
    places, weights = np.polynomial.legendre.leggauss(4)
    x = places[:, None, None]
    a, b, c = line[:-2:2], line[1::2], line[2::2]
    points = a * x * (x - 1) / 2 + b * (1 - x**2) + c * x * (x + 1) / 2
    steps = (a * (x - 0.5) - 2 * b * x + c * (x + 0.5)) * weights[:, None, None]
    return points.reshape(-1, 3), steps.reshape(-1, 3)


def middle(stations: Stations) -> Floats:
    return 0.5 * (stations.left + stations.right)


def length(line: Floats) -> float:
    return float(np.linalg.norm(along(line)[1], axis=1).sum())


def centre_field(layers: tuple[tuple[Stations, float], ...]) -> Floats:
    """B (3,) at the origin, each ribbon as eight filaments."""
    field = np.zeros(3)
    places, weights = np.polynomial.legendre.leggauss(8)
    for stations, turns in layers:
        for place, weight in zip(places, weights, strict=True):
            line = middle(stations) + 0.5 * place * (stations.left - stations.right)
            points, steps = along(line)
            kernel = np.cross(steps, -points) / np.linalg.norm(points, axis=1)[:, None] ** 3
            field += MU_0 / (4 * np.pi) * 0.5 * weight * turns * kernel.sum(axis=0)
    return field


@pytest.mark.parametrize(("name", "kind"), CARDS.items())
def test_cards_of_the_catalogue_come_back(name: str, kind: type) -> None:
    device = load_geometry(name)
    assert isinstance(device, kind)
    assert isinstance(device, Coil)
    assert device.source
    assert geometry_from_text(card_text(device), "x") == device
    stated = {"clearance": device.region.clearance, "extent": device.region.extent}
    made = replace(device, origin=None, **stated)  # type: ignore[type-var]
    assert geometry_from_text(card_text(made), "x") == made


def test_metal_of_the_coaxial_coils() -> None:
    """By Pappus: the wire's sections times the way of their middle; or the window's ring times the fill."""
    fine = coil("solenoid_24x48x60")
    assert fine.volume == pytest.approx(1000 * np.pi * 36e-3 * np.pi / 4 * 0.75e-3**2, rel=1e-14, abs=0)
    filled = coil("solenoid_20x30x30")
    assert filled.volume == pytest.approx(0.6 * np.pi * (15e-3**2 - 10e-3**2) * 30e-3, rel=1e-14, abs=0)
    loop = coil("loop_50")
    assert loop.volume == pytest.approx(2 * np.pi**2 * 25e-3 * 0.5e-3**2, rel=1e-14, abs=0)  # a torus
    pair = coil("helmholtz_pair_200")
    assert pair.volume == pytest.approx(240 * 0.2 * np.pi * np.pi / 4 * 0.9e-3**2, rel=1e-14, abs=0)


def test_helmholtz_pair_stands_a_mean_radius_apart() -> None:
    pair = coil("helmholtz_pair_200")
    lower, upper = pair.circuits[0].parts
    assert isinstance(lower, CoaxialWinding)
    assert upper.centre - lower.centre == pytest.approx(0.1, rel=1e-14)
    assert (lower.turns, upper.turns) == (120, 120)
    assert pair.hull.length == pytest.approx(0.114, rel=1e-14)
    opposed = replace(pair, origin=None, opposed=True)
    below, above = opposed.circuits[0].parts
    assert (below.turns, above.turns) == (-120, 120)
    assert above.centre == pytest.approx(np.sqrt(3) / 2 * 0.1, rel=1e-14)
    assert below.wire_length > 0


@pytest.mark.parametrize("name", SWEPT)
def test_ribbons_close_and_share_the_turns(name: str) -> None:
    for part in swept(name):
        for resolution in (0.5, 1.0, 2.0):
            layers = part.layers(resolution)
            assert sum(turns for _, turns in layers) == pytest.approx(part.turns, rel=1e-13)
            for stations, _ in layers:
                assert len(stations.left) == 2 * len(stations.lead) + 1
                assert not stations.lead.any()
                for edge in (stations.left, stations.right, stations.normal):
                    assert (edge[0] == edge[-1]).all()
                    assert np.isfinite(edge).all()


@pytest.mark.parametrize("name", SWEPT)
def test_right_edge_is_right_of_the_current(name: str) -> None:
    for part in swept(name):
        for stations, _ in part.layers(1.0):
            ahead = np.diff(middle(stations)[::2], axis=0)
            right = (stations.right - stations.left)[1::2]
            normal = stations.normal[1::2]
            ahead /= np.linalg.norm(ahead, axis=1)[:, None]
            right /= np.linalg.norm(right, axis=1)[:, None]
            assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, rel=1e-12)
            assert np.sum(np.cross(ahead, normal) * right, axis=1) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", ["racetrack_coil_60x20", "team13_coil"])
def test_racetrack_length_and_areas(name: str) -> None:
    """Two sides and four quarter circles, of which the ribbons' parabolas are short by less than 1e-5."""
    racetrack = coil(name)
    radius = 10e-3 if racetrack.bend_radius is None else racetrack.bend_radius
    straights = 2 * (racetrack.inner_length + racetrack.inner_width - 4 * radius)
    (part,) = swept(name)
    mean = straights + 2 * np.pi * (radius + 0.5 * racetrack.build)
    assert part.wire_length == pytest.approx(racetrack.turns * mean, rel=1e-14)
    layers = part.layers(1.0)
    wound = sum(turns * length(middle(stations)) for stations, turns in layers)
    assert wound == pytest.approx(part.wire_length, rel=1e-5)
    inner, outer = layers[0][0], layers[-1][0]
    for stations in (inner, outer):
        height = np.linalg.norm(stations.left - stations.right, axis=1)
        assert height == pytest.approx(racetrack.height, rel=1e-12)
        assert length(stations.left) == pytest.approx(length(stations.right), rel=1e-12)
    enclosed = [0.5 * np.cross(*along(middle(s))).sum(axis=0) for s in (inner, outer)]
    for stations, vector in zip((inner, outer), enclosed, strict=True):
        r = 0.5 * (length(middle(stations)) - straights) / np.pi
        a, b = racetrack.inner_length - 2 * radius, racetrack.inner_width - 2 * radius
        assert vector == pytest.approx([0, 0, a * b + 2 * r * (a + b) + np.pi * r**2], rel=1e-4, abs=1e-12)


def test_ribbon_lengths_converge_with_order_four() -> None:
    (part,) = swept("racetrack_coil_60x20")
    errors = [
        abs(sum(turns * length(middle(stations)) for stations, turns in part.layers(resolution)) / part.wire_length - 1)
        for resolution in (0.5, 1.0, 2.0)
    ]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert ((slopes > 3.8) & (slopes < 4.2)).all()


def test_racetrack_with_a_long_side_converges_to_two_wires() -> None:
    """Halfway along a race of length L: µ₀I/(2πd) from each straight, less a share (d/L)²."""
    thin = RacetrackCoil(
        inner_length=1.0, inner_width=20e-3, build=1e-3, height=1e-3, turns=10, wire=Wire(fill_factor=0.5)
    )
    (part,) = thin.parts
    field = centre_field(part.layers(16.0))  # elements short enough for the test's few points on each
    assert field[:2] == pytest.approx([0, 0], abs=1e-12)
    assert field[2] == pytest.approx(2 * MU_0 * 10 / (2 * np.pi * 10.5e-3), rel=5e-3)


def test_saddle_field_points_along_x() -> None:
    first, second = (centre_field(part.layers(1.0)) for part in swept("saddle_coil_pair_40x60"))
    assert first[0] > 0
    assert second[0] == pytest.approx(first[0], rel=1e-12, abs=0)
    assert first + second == pytest.approx([2 * first[0], 0, 0], abs=1e-12)


def test_saddle_of_thin_wire_matches_its_segments() -> None:
    """Two lines along z and two arcs, whose fields at the centre are closed forms."""
    radius, half_angle, half = 21e-3, np.pi / 3, 30e-3
    thin = 0.1e-3
    saddle = SaddleCoil(
        inner_diameter=2 * radius - thin,
        outer_diameter=2 * radius + thin,
        length=2 * half + thin,
        arc_angle=2 * half_angle + thin / radius,
        breadth=thin,
        bend_radius=thin,
        turns=1,
    )
    (part,) = saddle.parts
    field = centre_field(part.layers(1.0))
    far = np.hypot(radius, half)
    lines = 2 * MU_0 / (4 * np.pi * radius) * 2 * half / far * np.sin(half_angle)
    arcs = 2 * MU_0 / (4 * np.pi) * radius * half / far**3 * 2 * np.sin(half_angle)
    assert field == pytest.approx([lines + arcs, 0, 0], rel=1e-4, abs=1e-11)


def test_saddle_walls_lie_between_their_cylinders() -> None:
    for part in swept("saddle_coil_pair_40x60"):
        for stations, _ in part.layers(1.0):
            edges = np.array([stations.left, stations.right])
            radii = np.sort(np.hypot(edges[..., 0], edges[..., 1]), axis=0)
            assert radii[0] == pytest.approx(20e-3, rel=1e-12)
            assert radii[1] == pytest.approx(22e-3, rel=1e-12)
            assert np.abs(edges[..., 2]).max() < 30e-3


def test_saddle_wall_areas() -> None:
    """Radial walls over a path with speed (u', v') on the mean cylinder: ∫∫ √((ρu'/R)² + v'²) ds dρ."""
    saddle = coil("saddle_coil_pair_40x60")
    mean = saddle.mean_radius
    part = swept("saddle_coil_pair_40x60")[0]
    stations, _ = part.layers(2.0)[0]
    places, weights = np.polynomial.legendre.leggauss(6)
    levels = [0.5 * (1 + p) * stations.left + 0.5 * (1 - p) * stations.right for p in places]
    area = sum(0.5 * w * 2e-3 * length(line) for w, line in zip(weights, levels, strict=True))
    unrolled = np.column_stack([mean * np.arctan2(stations.left[:, 1], stations.left[:, 0]), stations.left[:, 2]])
    radius = (np.ptp(unrolled[:, 1]) - saddle.path.straight_v) / 2

    def speed(angle: float) -> float:
        return float(
            sum(
                0.5 * w * 2e-3 * np.hypot((mean + 1e-3 * p) / mean * np.sin(angle), np.cos(angle))
                for p, w in zip(places, weights, strict=True)
            )
        )

    corners = 4 * radius * quad(speed, 0, np.pi / 2)[0]
    assert area == pytest.approx(2e-3 * 2 * (saddle.path.straight_u + saddle.path.straight_v) + corners, rel=1e-6)


def test_saddle_wire_length_is_the_mean_over_its_window() -> None:
    """On the mean cylinder exactly; over the whole window but for second-order terms of the bends."""
    part = swept("saddle_coil_pair_40x60")[0]
    mean = sum(turns * length(middle(stations)) for stations, turns in part.layers(2.0))
    assert mean == pytest.approx(part.wire_length, rel=1e-6)
    ends = sum(
        turns * (length(s.left) / 6 + length(middle(s)) * 2 / 3 + length(s.right) / 6) for s, turns in part.layers(2.0)
    )
    assert ends == pytest.approx(part.wire_length, rel=1e-4)


def test_layers_follow_the_clearance() -> None:
    racetrack = coil("racetrack_coil_60x20")
    counts = [
        len(replace(racetrack, origin=None, clearance=clearance).parts[0].layers(1.0))
        for clearance in (20e-3, 5e-3, 1e-3)
    ]
    assert counts[0] < counts[1] < counts[2]


def test_racetrack_hull_holds_the_winding_closely() -> None:
    for name in ("racetrack_coil_60x20", "team13_coil"):
        racetrack = coil(name)
        half = 0.5 * racetrack.build
        path = racetrack.path
        skeleton, outward = path.stations(4, 4, 24)
        plane = skeleton + (path.radius + racetrack.build + 1e-9) * outward
        outline = np.column_stack([plane, np.zeros(len(plane))])
        assert racetrack.hull.distance(outline).max() < 1e-8
        further = outline + half * np.column_stack([outward, np.zeros(len(plane))])
        distance = racetrack.hull.distance(further)
        assert distance.max() == pytest.approx(half, rel=1e-6)
        assert distance.min() > half - 0.01 * (path.radius + racetrack.build)


def test_turns_that_just_fit() -> None:
    """Ten layers of thirty turns of 0.5 mm wire fill 5 mm by 15 mm to the last place."""
    window = {"inner_diameter": 20e-3, "outer_diameter": 30e-3, "length": 15e-3}
    wire = Wire(diameter=0.4e-3, insulation=0.05e-3)
    assert Solenoid(**window, turns=300, layers=10, wire=wire).layers == 10
    for turns, layers, words in ((301, 10, "at most 30 do, 300 in 10 layers"), (300, 11, "at most 10 do")):
        with pytest.raises(InputError, match=words):
            Solenoid(**window, turns=turns, layers=layers, wire=wire)
    Solenoid(**window, turns=346, wire=wire)  # hexagons: 0.9069 · 75 / (π/4 · 0.25) = 346.4
    with pytest.raises(InputError, match="at most 346 do"):
        Solenoid(**window, turns=347, wire=wire)


FAULTS = [
    ("solenoid", {"inner_diameter": '"30 mm"'}, "", "dimensions.inner_diameter", "smaller than outer_diameter"),
    ("solenoid", {"turns": "0"}, "", "dimensions.turns", "at least 1"),
    ("solenoid", {"turns": "nan"}, "", "dimensions.turns", "finite"),
    ("solenoid", {"turns": '"many"'}, "", "dimensions.turns", "bare number"),
    ("solenoid", {"turns": "1e9"}, "", "dimensions.turns", "do not fit"),
    ("solenoid", {"layers": "10"}, "", "dimensions.layers", "diameter of the wire"),
    ("solenoid", {"layers": "2.5"}, '[wire]\ndiameter = "0.1 mm"', "dimensions.layers", "whole number"),
    ("solenoid", {}, '[wire]\ndiameter = "1 mm"', "dimensions.turns", "at most 173 do"),
    ("solenoid", {}, '[wire]\ndiameter = "6 mm"', "wire.diameter", "at most 5 mm fits"),
    ("solenoid", {}, '[wire]\ndiameter = "-1 mm"', "wire.diameter", "positive"),
    ("solenoid", {}, '[wire]\ndiameter = "0.1 mm"\ninsulation = "-1 um"', "wire.insulation", "negative"),
    ("solenoid", {}, '[wire]\ninsulation = "1 um"', "wire.insulation", "needs a diameter"),
    ("solenoid", {}, "[wire]\nfill_factor = 1.2", "wire.fill_factor", "at most at 1"),
    ("solenoid", {}, '[wire]\nfill_factor = 0.5\ndiameter = "0.1 mm"', "wire.fill_factor", "not both"),
    ("solenoid", {}, '[wire]\ndiametre = "0.1 mm"', "wire.diametre", "did you mean"),
    ("solenoid", {}, '[core]\ndiameter = "5 mm"', "core", "not supported yet"),
    ("solenoid", {}, '[conductor]\nmaterial = "lead"', "conductor.material", "must be"),
    ("helmholtz_pair", {"spacing": '"20 mm"'}, "", "dimensions.spacing", "overlap"),
    ("helmholtz_pair", {}, "", "dimensions.length", "overlap"),
    ("racetrack_coil", {"bend_radius": '"11 mm"'}, "", "dimensions.bend_radius", "at most half"),
    ("racetrack_coil", {"bend_radius": '"-1 mm"'}, "", "dimensions.bend_radius", "positive"),
    ("racetrack_coil", {"height": '"0 mm"'}, "", "dimensions.height", "positive"),
    ("saddle_coil", {"arc_angle": '"0 deg"'}, "", "dimensions.arc_angle", "between 0 and 360 deg"),
    ("saddle_coil", {"arc_angle": '"20 deg"'}, "", "dimensions.arc_angle", "must fit into"),
    ("saddle_coil", {"arc_angle": '"120 mm"'}, "", "dimensions.arc_angle", "angle"),
    ("saddle_coil", {"breadth": '"28 mm"'}, "", "dimensions.length", "must fit into"),
    ("saddle_coil", {"bend_radius": '"0 mm"'}, "", "dimensions.bend_radius", "positive"),
    ("loop_coil", {"wire_diameter": '"60 mm"'}, "", "dimensions.wire_diameter", "smaller than diameter"),
    ("loop_coil", {"wire_diameter": '"10.1 mm"'}, "", "dimensions.wire_diameter", "at most 10 mm, 0.2 of the diameter"),
    ("loop_coil", {"wire_diameter": '"2 um"'}, "", "dimensions.wire_diameter", "at least 10 µm"),
    ("loop_coil", {"turns": "2"}, "", "dimensions.turns", "unknown key"),
]

DIMENSIONS: dict[str, dict[str, str]] = {
    "solenoid": {"inner_diameter": '"20 mm"', "outer_diameter": '"30 mm"', "length": '"30 mm"', "turns": "1000"},
    "helmholtz_pair": {"inner_diameter": '"20 mm"', "outer_diameter": '"30 mm"', "length": '"30 mm"', "turns": "9"},
    "racetrack_coil": {
        "inner_length": '"60 mm"',
        "inner_width": '"20 mm"',
        "build": '"5 mm"',
        "height": '"5 mm"',
        "turns": "50",
    },
    "saddle_coil": {
        "inner_diameter": '"40 mm"',
        "outer_diameter": '"44 mm"',
        "length": '"60 mm"',
        "breadth": '"5 mm"',
        "bend_radius": '"3 mm"',
        "arc_angle": '"130 deg"',
        "turns": "50",
    },
    "loop_coil": {"diameter": '"50 mm"', "wire_diameter": '"1 mm"'},
}


def card(kind: str, changes: dict[str, str], tables: str, top: str = "") -> Geometry:
    lines = [f"{key} = {value}" for key, value in (DIMENSIONS[kind] | changes).items()]
    text = "\n".join([f'kind = "{kind}"', top, "[dimensions]", *lines, tables])
    return geometry_from_text(text, "x.toml")


@pytest.mark.parametrize(("kind", "changes", "tables", "key", "words"), FAULTS)
def test_fault_names_file_and_key(kind: str, changes: dict[str, str], tables: str, key: str, words: str) -> None:
    with pytest.raises(CardError) as raised:
        card(kind, changes, tables)
    message = str(raised.value)
    assert "\n" not in message
    assert message.endswith(f"[x.toml: {key}]")
    assert words in message


def test_pairs_of_saddles_must_not_meet() -> None:
    card("saddle_coil", {"arc_angle": '"200 deg"'}, "")
    with pytest.raises(CardError, match="where the coils of a pair meet"):
        card("saddle_coil", {"arc_angle": '"200 deg"'}, "", "pair = true")
    with pytest.raises(CardError, match=r"true or false, got 2 \[x.toml: pair\]"):
        card("saddle_coil", {}, "", "pair = 2")


def test_devices_made_in_python_are_checked() -> None:
    with pytest.raises(InputError, match="wire must be a Wire"):
        Solenoid(**SOLENOID, wire="copper")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="arc_angle must be finite"):
        SaddleCoil(**SADDLE | {"arc_angle": float("nan")})
