"""The closed system in simulation: its tubes, its physics, its clock, and what it says of itself."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from magfem.cli import main
from magfem.errors import CardError, InputError
from magfem.fields import UniformField
from magfem.geometry.card import parse_table
from magfem.localization import as_rotor, simulated_samples
from magfem.localization.sensor import as_sensors
from magfem.scenario.closed_system import ClosedRun, read_closed_system, simulate_closed_system
from magfem.scenario.closed_system.motor import Play, TrueMotor, turning_field
from magfem.scenario.closed_system.network import Network, side_of
from magfem.scenario.closed_system.record import LOCALIZING, MANIPULATING, SWITCHING
from magfem.scenario.closed_system.steering import Tip, tether_turn, turned, wanted_moment

REPORTS = Path(__file__).parents[2] / "reports"


def recipe(name: str = "localize_and_steer", **changes: str) -> str:
    lines = (REPORTS / f"{name}.toml").read_text().splitlines()
    for key, value in changes.items():
        found = [k for k, line in enumerate(lines) if line.startswith(f"{key} =")]
        lines[found[0]] = f"{key} = {value}"
    return "\n".join(lines)


@pytest.fixture(scope="module")
def run() -> ClosedRun:
    return simulate_closed_system(read_closed_system(parse_table(recipe().encode(), "a.toml")))


@pytest.fixture(scope="module")
def network() -> Network:
    nodes = {"A": (0, 0), "B": (40, 0), "C": (70, 30), "D": (70, -30)}
    return Network(
        nodes={name: 1e-3 * np.array(at, dtype=float) for name, at in nodes.items()},
        edges=(("A", "B"), ("B", "C"), ("B", "D")),
        entry="A",
        inner_diameter=6e-3,
        corner=10e-3,
    )


def test_ways_are_as_long_as_their_edges_less_their_corners(network: Network) -> None:
    """A corner of 45° of radius R cuts 2 R tan(22.5°) off the edges and adds an arc of R π/4."""
    way = network.way("C")
    edges = 0.04 + np.hypot(0.03, 0.03)
    assert way.length == pytest.approx(edges - 2 * 0.01 * np.tan(np.pi / 8) + 0.01 * np.pi / 4, rel=1e-4)
    assert way.names == ("A", "B", "C") and network.children("B") == ["C", "D"]
    np.testing.assert_allclose(way.tangent(way.length), [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-9)
    s, apart = way.nearest(np.array([0.02, 0.004, 0.1]))
    assert s == pytest.approx(0.02, abs=2e-4) and apart == pytest.approx(0.004, rel=1e-3)


def test_sides_are_seen_along_the_way(network: Network) -> None:
    here, left, right = np.array([1.0, 0, 0]), np.array([1.0, 1, 0]), np.array([1.0, -1, 0])
    assert side_of(here, left, [right]) == 1.0 and side_of(here, right, [left]) == -1.0
    with pytest.raises(InputError, match="leftmost or the rightmost"):
        side_of(here, here, [left, right])


def test_the_motor_stays_in_its_tube(network: Network) -> None:
    play = Play(2e-3, 6e-3, np.random.default_rng(0).uniform(0, 6, (3, 3)))
    way = network.way("D")
    for s in np.linspace(0, way.length, 60):
        found = play.at(way, float(s))
        off = found.position - way.place(float(s))
        assert np.linalg.norm(off) == pytest.approx(2e-3) and off[2] < 0  # on the wall, below
        assert np.degrees(np.arccos(found.axis @ way.tangent(float(s)))) < 5
        assert np.linalg.norm(found.axis) == pytest.approx(1.0)


def test_the_sampled_field_is_that_of_a_turning_rotor() -> None:
    rotor = as_rotor("rotor_1x3")
    motor = TrueMotor(np.array([5e-3, -3e-3, -2e-3]), np.array([0.6, 0.64, 0.48]), 0.0)
    array = as_sensors(None)
    times = np.arange(40) / 20
    ours = turning_field(motor, 0.7, rotor, None, array, times)
    expected = simulated_samples(rotor, motor.position, motor.axis, times, 1.0, phase=0.7)
    np.testing.assert_allclose(ours[0], expected, atol=1e-9 * np.abs(expected).max())


def test_the_wanted_moment_has_the_greatest_torque_about_the_vertical() -> None:
    rng = np.random.default_rng(1)
    axis = np.array([0.8, 0.6, 0.0])
    B = np.array([3e-3, 1e-3, -2e-3])
    for side in (1.0, -1.0):
        best = wanted_moment(axis, B, side)
        assert best @ axis == pytest.approx(0.0, abs=1e-12)
        others = np.cross(axis, rng.normal(size=(500, 3)))
        others /= np.linalg.norm(others, axis=1, keepdims=True)
        torques = side * np.cross(others, B)[:, 2]
        ours = side * np.cross(best, B)[2]
        assert ours > 0 and torques.max() <= ours * (1 + 1e-12) and torques.max() > 0.99 * ours
    now = wanted_moment(axis, B, 1.0)
    angle = tether_turn(axis, now, wanted_moment(axis, B, -1.0))
    np.testing.assert_allclose(turned(axis, now, angle), -now, atol=1e-12)


def test_the_tip_bends_as_a_beam() -> None:
    """A small torque m B on a uniform beam: the motor turns by m B L/(E I), and its end moves by that times L/2 + l."""
    tip = Tip(length=20e-3, radius=1e-3, youngs_modulus=1.5e6, motor_length=8e-3, moment=2.6e-3)
    axis = np.array([1.0, 0.0, 0.0])
    B = 5e-5
    end = tip.bent(np.zeros(3), axis, np.array([0.0, -1.0, 0.0]), UniformField([B, 0.0, 0.0]))
    angle = 2.6e-3 * B * 20e-3 / (1.5e6 * np.pi / 4 * 1e-12)
    assert end[1] == pytest.approx(angle * (10e-3 + 8e-3), rel=2e-3)
    assert end[2] == pytest.approx(0.0, abs=1e-9)


def test_it_reaches_its_targets(run: ClosedRun) -> None:
    data = run.summary()
    assert run.passed and data["passed"] and [one["node"] for one in data["targets"]] == ["D", "E", "F"]
    assert all(one["as_wanted"] for one in data["junctions"]) and len(data["junctions"]) >= 4
    assert 300 < data["distance_mm"] < 450 and 150 < data["duration_s"] < 350
    # Stated deviations are what the errors are.
    found = data["localization"]
    assert 0.5 < found["position_error_mm"]["rms"] / found["stated_position_mm"] < 2.0
    assert data["coil_at_sensors"]["saturates"]  # why both modes have to take turns


def test_the_clock_adds_up(run: ClosedRun) -> None:
    """Modes follow each other without gaps; windows and meltings are as many as were counted."""
    for before, after in zip(run.modes, run.modes[1:], strict=False):
        assert after.start == pytest.approx(before.end)
    system = run.system
    total = {
        name: sum(one.end - one.start for one in run.modes if one.name == name) for name in (LOCALIZING, SWITCHING)
    }
    assert total[LOCALIZING] == pytest.approx(len(run.localizations) * system.window)
    meltings = len(run.bendings) + 1  # at the start, and after each
    assert total[SWITCHING] == pytest.approx(meltings * system.heating + len(run.bendings) * system.cooling)
    assert sum(run.share(name) for name in {one.name for one in run.modes}) == pytest.approx(1.0)
    assert run.share(MANIPULATING) < 0.2


def test_without_the_coil_branches_are_left_to_chance() -> None:
    """No current: the tip does not bend, and where the motor lies by itself decides."""
    text = recipe().replace('current = "4 A"', 'current = "1 uA"')
    run = simulate_closed_system(read_closed_system(parse_table(text.encode(), "a.toml")))
    assert not run.passed
    for one in run.bendings:
        assert abs(one.deflection) < 1e-5
        assert (one.entered == one.wanted) == (one.alone > run.system.divider - 1e-5)


def test_the_stator_shifts_poses_by_less_than_they_scatter(run: ClosedRun) -> None:
    """Its field is a hundred times weaker than the rotor's and acts like 0.28 % more moment: 0.1 % of 30 mm."""
    shift = [np.linalg.norm(one.position - one.without_stator[0]) for one in run.localizations]
    assert 1e-6 < np.median(shift) < 0.2e-3


def test_same_seed_same_run(run: ClosedRun) -> None:
    again = simulate_closed_system(run.system)
    np.testing.assert_array_equal(
        [one.position for one in again.localizations], [one.position for one in run.localizations]
    )


def test_the_localized_moment_is_the_true_one(run: ClosedRun) -> None:
    """What the tether is turned by rests on it: within the axis' and the phase's errors."""
    assert max(np.degrees(one.moment_error) for one in run.bendings) < 30


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"targets": '["Z"]'}, "no node"),
        ({"targets": '["C"]'}, "is a junction"),
        ({"targets": "[]"}, "list of nodes"),
        ({"edges": '[["A", "B"]]'}, "must join all nodes"),
        ({"edges": '[["A", "Q"]]'}, "no node 'Q'"),
        ({"diameter": '"7 mm"'}, "below the tubes"),
        ({"heating": '"-1 s"'}, "must not be negative"),
        ({"model": '"rotor_1x3"'}, "per ampere"),
        ({"positions": "[]"}, "one for each sensor"),
        ({"height": '"25"'}, "height"),
        ({"kind": '"scenario"'}, "of kind"),
    ],
)
def test_bad_recipes_are_told(changes: dict[str, str], words: str) -> None:
    with pytest.raises((CardError, InputError), match=words):
        read_closed_system(parse_table(recipe(**changes).encode(), "a.toml"))


def test_the_command_leaves_a_whole_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    card = tmp_path / "mine.toml"
    card.write_text(recipe(targets='["F"]'))
    assert main(["simulate", str(card), "-o", str(out), "--json", "--quiet"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((out / "summary.json").read_text())
    assert {one.name for one in out.iterdir()} == {
        *("summary.json", "timeseries.csv", "recipe.toml", "way.png", "errors.png", "animation.gif", "report.html")
    }
    rows = np.genfromtxt(out / "timeseries.csv", delimiter=",", names=True)
    off = np.sqrt(sum((rows[f"found_{k}"] - rows[f"true_{k}"]) ** 2 for k in "xyz"))
    assert 1e3 * np.sqrt(np.mean(off**2)) == pytest.approx(
        printed["localization"]["position_error_mm"]["rms"], rel=1e-5
    )
