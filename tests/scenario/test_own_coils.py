"""The whole chain in one run: a coil's card is solved and fitted, six of it are placed, and steer the rod."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magfem.errors import CardError
from magfem.geometry.card import parse_table
from magfem.scenario import load_scenario, simulate
from magfem.scenario.own_coils import OwnCoils, read_own_coils
from magfem.scenario.summary import summary

MU_0 = 4e-7 * np.pi


def thick_solenoid(z):
    """B (T) per ampere on the axis, z m from the middle: inner diameter 24 mm, outer 48 mm, length 60 mm, 1000 turns.

    The textbook's integral over radius and length (Montgomery, Solenoid Magnet Design, 1969, eq. 1.4).
    """
    inner, outer, half = 12e-3, 24e-3, 30e-3
    density = 1000 / (2 * half * (outer - inner))

    def part(x):
        return x * np.log((outer + np.hypot(outer, x)) / (inner + np.hypot(inner, x)))

    return MU_0 * density / 2 * (part(z + half) - part(z - half))


@pytest.fixture(scope="module")
def run():
    scenario = load_scenario("steer_own_coils")
    assert isinstance(scenario.targets, tuple)
    return simulate(replace(scenario, targets=scenario.targets[:2], compare_forces=False, hold=3))


def test_the_system_has_the_field_of_six_solenoids(run):
    """On each coil's axis, by the closed form; the model's stated error is some 1e-4."""
    for k, coil in enumerate(run.system.coils):
        towards = coil.pose.rotation.apply([0.0, 0.0, 1.0])
        np.testing.assert_allclose(coil.pose.translation, -75e-3 * towards, atol=1e-7)  # it looks at the middle
        currents = np.eye(6)[k]
        for away in (-0.02, 0.0, 0.03):
            found = run.system.B(-away * towards, currents)
            np.testing.assert_allclose(found, thick_solenoid(75e-3 - away) * towards, atol=2e-4 * np.linalg.norm(found))


def test_its_targets_are_reached(run):
    data = summary(run)
    assert [one["outcome"] for one in data["targets"]] == ["converged", "converged"]
    assert max(max(one["error_deg"]) for one in data["targets"]) < 0.15  # two cameras see the rod
    assert data["system"]["own_coil"] == "solenoid_24x48x60"
    assert run.coil is not None and run.coil.unit == "T/A"


SYSTEM = """
coil = "solenoid_20x30x30"
current_limit = "2 A"
workspace = "10 mm"
[[coils]]
name = "one"
position = ["0 mm", "0 mm", "-40 mm"]
direction = [0, 0, 1]
"""


def test_its_table_is_read():
    found = read_own_coils(parse_table(SYSTEM.encode(), "a.toml"))
    assert isinstance(found, OwnCoils) and found.names == ("one",) and found.workspace == 0.01
    np.testing.assert_allclose(found.poses[0].translation, [0, 0, -0.04])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("solenoid_20x30x30", "solenoid_20x30", "solenoid_20x30x30"),
        ('"2 A"', '"-2 A"', "current_limit must be positive"),
        ('"10 mm"', '"10 A"', "expected a length"),
        ("[0, 0, 1]", "[0, 0, 0]", "not all zero"),
        ('name = "one"', 'nam = "one"', 'did you mean "name"?'),
    ],
)
def test_what_is_wrong_in_it_is_told(old, new, words):
    with pytest.raises(CardError, match=r"a\.toml") as caught:
        read_own_coils(parse_table(SYSTEM.replace(old, new, 1).encode(), "a.toml"))
    assert words in str(caught.value)
