"""Scenario recipes: TOML files of kind "scenario" in `reports/`, or anywhere.

    kind = "scenario"
    name = "Two magnets in the plane of six coils"
    source = "…"
    system = "bigmag"                 # a coil system, or a table as `own_coils` has it
    planar = true                     # all in the xz plane; angles are told from +z towards +x
    compare_forces = true             # also the shapes without magnetic force
    hold = 10                         # steps after a target is reached
    most_steps = 400                  # for one target
    plans = 3                         # other ways that are planned for one target at most
    start = "previous"                # or "straight": every target from currents of zero
    gravity = ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]

    [rod]                             # as `rod_card` has it
    [plant]
    stiffness = 1.15                  # of the plant's elastic moduli over the model's
    [sensing]                         # as `sensing_card` has it; without it poses are exact
    [controller]
    current_step = "0.4 A"            # and joint_step, current_limit, gain, damping, tolerance, …

    [[targets]]                       # a planar one: an angle for every magnet, from the base to the tip
    angles = ["60 deg", "120 deg"]
    [[targets]]                       # one in space: +z turned by an angle about a horizontal axis
    magnets = [{ axis = [0, 1, 0], angle = "60 deg" }, { axis = [1, 1, 0], angle = "90 deg" }]
    expected = "unreachable"          # "reached" when not stated

    [random]                          # instead of [[targets]]: those of stable states of the plant
    count = 20
    seed = 3
    current = "8 A"                   # currents up to
    joint = "45 deg"                  # joints up to; 0 when not stated

All but kind, name, system, rod and the targets may be left out.
"""

from __future__ import annotations

import os

import numpy as np

from magfem.errors import CardError, InputError
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path
from magfem.geometry.vectors import three_numbers
from magfem.rod import Rod
from magfem.scenario.angles import turned_from_z
from magfem.scenario.own_coils import OwnCoils, read_own_coils
from magfem.scenario.plain_values import switch, whole_number
from magfem.scenario.rod_card import read_rod
from magfem.scenario.scenario import PREVIOUS, STRAIGHT, Scenario
from magfem.scenario.sensing_card import read_sensing
from magfem.scenario.targets import REACHED, UNREACHABLE, RandomTargets, Target
from magfem.units import describe, quantity

KIND = "scenario"

SETTINGS = {
    "current_step": "current",
    "current_limit": "current",
    "joint_step": "angle",
    "tolerance": "angle",
    "largest_error": "angle",
    "gain": "",
    "damping": "",
    "relaxation": "",
    "largest_condition": "",
    "patience": "",
}
"""What a recipe may set of the controller, and the dimension it is stated in; empty: a bare number."""


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """The scenario of a name in `reports/` or of a path. Raises InputError or CardError, naming file and key."""
    where = ("reports", name_or_path, ".toml")
    return read_scenario(read_table(resolve(*where), short_path(*where)))


def read_scenario(card: Table) -> Scenario:
    """Read a whole recipe file."""
    if "kind" not in card or card.text("kind") != KIND:
        got = describe(card.value("kind")) if "kind" in card else "none"
        raise card.error(f'a scenario is of kind "{KIND}", got {got}', "kind")
    card.only(
        *("kind", "name", "source", "system", "planar", "compare_forces", "hold", "most_steps", "plans", "start"),
        *("gravity", "rod", "materials", "plant", "sensing", "controller", "targets", "random"),
    )
    planar = switch(card, "planar")
    rod = read_rod(card)
    sensing, seed = read_sensing(card)
    start = card.text("start") if "start" in card else STRAIGHT if "random" in card else PREVIOUS
    if start not in (STRAIGHT, PREVIOUS):
        raise card.error(f'start must be "{STRAIGHT}" or "{PREVIOUS}", got {describe(start)}', "start")
    return Scenario(
        name=card.text("name"),
        source=card.text("source") if "source" in card else "",
        text=card.origin.text,
        system=_system(card),
        rod=rod,
        targets=_random(card) if "random" in card else _targets(card, rod, planar),
        sensing=sensing,
        planar=planar,
        gravity=_gravity(card),
        stiffness=_stiffness(card),
        settings=_settings(card),
        start=start,
        hold=whole_number(card, "hold", 10, 0),
        most_steps=whole_number(card, "most_steps", 400, 1),
        plans=whole_number(card, "plans", 3, 0),
        seed=seed,
        compare_forces=switch(card, "compare_forces"),
    )


def _system(card: Table) -> str | OwnCoils:
    if isinstance(card.value("system"), dict):
        return read_own_coils(card.table("system"))
    return card.text("system")


def _targets(card: Table, rod: Rod, planar: bool) -> tuple[Target, ...]:
    if "targets" not in card:
        raise card.error("a scenario needs [[targets]] or [random]", "targets")
    entries = card.tables("targets")
    if not entries:
        raise card.error("targets must be one or more tables [[targets]]", "targets")
    return tuple(_target(entry, len(rod.magnets), planar) for entry in entries)


def _target(entry: Table, magnets: int, planar: bool) -> Target:
    entry.only("angles" if planar else "magnets", "expected")
    expected = entry.text("expected") if "expected" in entry else REACHED
    if expected not in (REACHED, UNREACHABLE):
        raise entry.error(f'expected must be "{REACHED}" or "{UNREACHABLE}", got {describe(expected)}', "expected")
    key = "angles" if planar else "magnets"
    stated = entry.value(key)
    if not isinstance(stated, list) or len(stated) != magnets:
        raise entry.error(f"{key} must be a list of {magnets}, one for each magnet from the base to the tip", key)
    if not planar:
        return Target(np.array([_direction(one) for one in entry.tables(key)]), expected)
    try:
        angles = np.array([quantity(one, "angle") for one in stated])
    except InputError as error:
        raise entry.error(str(error), key) from None
    return Target(turned_from_z(np.array([0.0, 1.0, 0.0]), angles), expected)


def _direction(one: Table) -> list[float]:
    one.only("axis", "angle")
    axis = np.array(three_numbers(one, "axis"))
    if axis[2] != 0 or not 0 < np.linalg.norm(axis) < np.inf:
        raise one.error("axis must be horizontal, such as [0, 1, 0]: +z is turned about it", "axis")
    angle = np.array(one.quantity("angle", "angle"))
    direction: list[float] = turned_from_z(axis / np.linalg.norm(axis), angle).tolist()
    return direction


def _random(card: Table) -> RandomTargets:
    if "targets" in card:
        raise card.error("a scenario has either [[targets]] or [random], not both", "random")
    table = card.table("random")
    table.only("count", "seed", "current", "joint")
    current = table.quantity("current", "current")
    joint = table.quantity("joint", "angle") if "joint" in table else 0.0
    if not current > 0:
        raise table.error("current must be positive", "current")
    if joint < 0:
        raise table.error("joint must not be negative", "joint")
    return RandomTargets(whole_number(table, "count", 20, 1), whole_number(table, "seed", 0, 0), current, joint)


def _settings(card: Table) -> dict[str, float]:
    if "controller" not in card:
        return {}
    table = card.table("controller")
    table.only(*SETTINGS)
    found: dict[str, float] = {}
    for key in table.values:
        dimension = SETTINGS[key]
        value = table.quantity(key, dimension) if dimension else table.number(key)
        if not 0 <= value < np.inf:
            raise table.error(f"{key} must be finite and not negative", key)
        found[key] = int(value) if key == "patience" else value
    return found


def _stiffness(card: Table) -> float:
    if "plant" not in card:
        return 1.0
    table = card.table("plant")
    table.only("stiffness")
    value = table.number("stiffness")
    if not 0 < value < np.inf:
        raise table.error("stiffness must be a positive factor such as 1.15", "stiffness")
    return value


def _gravity(card: Table) -> tuple[float, float, float]:
    if "gravity" not in card:
        return (0.0, 0.0, -9.81)
    value = card.value("gravity")
    if not isinstance(value, list) or len(value) != 3:
        raise card.error('gravity must be three accelerations such as ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]', "gravity")
    try:
        x, y, z = (quantity(one, "acceleration") for one in value)
    except CardError:
        raise
    except InputError as error:
        raise card.error(str(error), "gravity") from None
    return x, y, z
