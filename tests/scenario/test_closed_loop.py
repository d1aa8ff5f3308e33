"""A run's numbers against a second route to the plant, its limits, its seeds, its verdicts."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from scenario.planar_shooting import magnet_angles
from scenario.recipes import TWO_MAGNETS, with_cameras

import magfem
from magfem.geometry.card import parse_table
from magfem.scenario import simulate
from magfem.scenario.scenario_file import read_scenario
from magfem.scenario.summary import summary
from magfem.scenario.time_series import shapes, time_series


def scenario(text):
    return read_scenario(parse_table(text.encode(), "a.toml"))


def columns(run):
    rows = list(csv.DictReader(io.StringIO(time_series(run))))
    return {name: [row[name] for row in rows] for name in rows[0]}


def numbers(table, start, end=""):
    """(steps, n) of the columns whose names start and end like that."""
    chosen = [name for name in table if name.startswith(start) and name.endswith(end)]
    return np.array([table[name] for name in chosen], dtype=float).T


@pytest.fixture(scope="module")
def run():
    return simulate(scenario(TWO_MAGNETS))


@pytest.fixture(scope="module")
def table(run):
    return columns(run)


def test_targets_are_reached_and_the_summary_has_its_keys(run):
    data = summary(run)
    assert set(data["step_ms"]) == {"median", "worst"}
    for one, wanted in zip(data["targets"], ([80, 60], [85, 70]), strict=True):
        assert {"wanted_deg", "reached_deg", "iterations", "outcome"} <= set(one)
        np.testing.assert_allclose(one["wanted_deg"], wanted, rtol=1e-12)
        assert one["outcome"] == "converged" and one["iterations"] < 100
        assert np.abs(one["reached_deg"] - np.array(wanted)).max() < 0.1
    assert data["passed"] and data["converged"] == 2


@pytest.mark.parametrize("forces", [True, False])
def test_logged_angles_are_those_of_another_solution_at_the_logged_currents(table, forces):
    """Elastica by shooting with scipy; it has no shear and no stretch, which are some 1e-4 here."""
    bigmag = magfem.load_system("bigmag")
    currents = numbers(table, "current_")
    logged = np.radians(numbers(table, "actual_" if forces else "without_force_", "_deg"))
    places = np.array([numbers(table, f"magnet_{m}_") for m in range(2)])
    assert places.shape == (2, len(currents), 3)
    for k in np.linspace(0, len(currents) - 1, 6).astype(int):

        def field(point, k=k):
            return bigmag.jet(point, currents[k], order=1)

        found = magnet_angles(field, 1.15 * 5.5e6, logged[k], forces)
        assert np.degrees(np.abs(found - logged[k])).max() < 0.02


def test_forces_matter(table):
    """Without them the same currents give other angles, by more than the loop's tolerance."""
    apart = numbers(table, "actual_", "_deg") - numbers(table, "without_force_", "_deg")
    assert np.abs(apart[0]).max() < 1e-6  # no currents yet
    assert np.abs(apart).max() > 1


def test_currents_and_rates_keep_their_limits(table):
    currents, joints = numbers(table, "current_"), numbers(table, "joint_")
    assert currents.shape[1] == 6 and joints.shape[1] == 2
    assert np.abs(currents).max() <= 6.0
    assert np.abs(np.diff(currents, axis=0)).max() <= 0.3 + 1e-12
    assert not joints.any()
    assert [float(one) for one in table["switched_off"]] == [1] + [0] * (len(currents) - 1)


def test_the_model_takes_on_the_plants_stiffness(table):
    assert float(table["stiffness"][0]) == 1
    assert float(table["stiffness"][-1]) == pytest.approx(1.15, rel=0.01)


def test_shapes_agree_with_the_time_series(run, table):
    content = np.load(io.BytesIO(shapes(run)))
    assert content["plant"].shape == content["model"].shape == content["without_force"].shape
    assert content["plant"].shape[0] == len(table["step"])
    np.testing.assert_allclose(content["places"][:, 1], numbers(table, "magnet_1_"), rtol=1e-15)
    tip = content["plant"][:, -1] - content["plant"][:, -3]  # across the last magnet
    angle = np.degrees(np.arctan2(tip[:, 0], tip[:, 2]))
    np.testing.assert_allclose(angle, numbers(table, "actual_", "_deg")[:, 1], atol=1e-6)


def test_equal_seeds_give_equal_runs_and_others_do_not():
    seen = scenario(with_cameras())
    one, same, other = (columns(simulate(replace(seen, seed=seed))) for seed in (4, 4, 5))
    for table in (one, same, other):
        del table["controller_ms"]
    assert one == same
    assert one["measured_0_deg"] != other["measured_0_deg"]
    assert np.abs(numbers(one, "error_")[-1]).max() < 0.5


def test_what_cannot_be_reached_is_recognised_and_the_next_target_is_reached():
    run = simulate("steer_unreachable")
    assert [one.outcome for one in run.endings] == ["converged", "unreachable", "converged"]
    assert run.passed.all()
    unexpected = replace(run.endings[1], target=replace(run.endings[1].target, expected="reached"))
    assert not unexpected.as_expected


def test_random_targets_are_reached_from_the_straight_rod():
    """Twenty of them with each system is what the scenarios of the catalogue do; here a few, in space."""
    text = TWO_MAGNETS.replace("planar = true\n", "").replace("compare_forces = true\n", "")
    text = text.replace('"bigmag"', '"bigmag_extended"')
    text = text[: text.index("[[targets]]")] + '[random]\ncount = 4\nseed = 9\ncurrent = "6 A"\njoint = "45 deg"\n'
    run = simulate(scenario(text))
    data = summary(run)
    assert [one["outcome"] for one in data["targets"]] == ["converged"] * 4
    assert max(max(one["error_deg"]) for one in data["targets"]) < 0.1
    assert max(max(one["axis_error_deg"]) for one in data["targets"]) < 0.2
    starts = [step for step in run.steps if step.off]
    assert len(starts) >= 4 and not any(step.currents.any() for step in starts)
