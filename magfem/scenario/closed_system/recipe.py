"""Recipes of closed systems: TOML files of kind "localize_and_steer" in `reports/`, or anywhere.

kind = "localize_and_steer"
name = "…"
source = "…"
targets = ["D", "E"]              # ends of the network, one after the other
seed = 1

[network]                         # a tree of tubes in the plane z = 0
entry = "A"
inner_diameter = "6 mm"
corner = "12 mm"                  # radius that centre lines are rounded with
divider = "0.4 mm"                # half the width of the wall between two branches
edges = [["A", "B"], ["B", "C"]]
[network.nodes]
A = ["0 mm", "0 mm"]              # and so on

[motor]
rotor = "rotor_1x3"               # field models
inner_coil = "stator_1.6x5.5_inner"
outer_coil = "stator_1.6x5.5_outer"
current = "200 mA"                # of the stator
frequency = "1 Hz"
diameter = "2 mm"
length = "8 mm"
heating = "20 s"                  # until the alloy has melted
cooling = "2 s"                   # until it has set

[tether]                          # the bendable tip
length = "20 mm"
radius = "1 mm"
youngs_modulus = "1.5 MPa"
speed = "8 mm/s"
step = "10 mm"                    # pushed between two localizations
margin = "6 mm"                   # before a junction, where the tip is bent
clear = "8 mm"                    # beyond a junction, where it is let go
turning = "1 s"                   # to turn it about itself
attempts = 2

[arm]
height = "25 mm"                  # of the tool above the network
behind = "12 mm"                  # the motor, when localizing
error = "0.2 mm"                  # standard deviation of its place
speed = "50 mm/s"

[coil]
model = "solenoid_24x48x60_front"
front = "30 mm"                   # from its origin to its face
gap = "5 mm"                      # from the tool's tip up to its face
current = "8 A"
ahead = "20 mm"                   # of the motor, when steering

[sensors]                         # all alike
positions = [["-10 mm", "0 mm", "0 mm"], ["10 mm", "0 mm", "0 mm"]]    # on the tool
noise = "3 uT"
resolution = "0.1 uT"
saturation = "5 mT"
rate = "20 Hz"
window = "2 s"
static = ["18 uT", "2 uT", "-45 uT"]
"""

from __future__ import annotations

import os

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fitting import load_model
from magfem.geometry.card import Table, read_table
from magfem.geometry.catalogue import resolve, short_path
from magfem.localization import Sensor, as_rotor
from magfem.scenario.closed_system.network import Network
from magfem.scenario.closed_system.steering import Coil, Tip
from magfem.scenario.closed_system.system import ClosedSystem, check_targets
from magfem.scenario.plain_values import whole_number
from magfem.typing import Floats
from magfem.units import describe, quantity

KIND = "localize_and_steer"


def load_closed_system(name_or_path: str | os.PathLike[str]) -> ClosedSystem:
    """The closed system of a name in `reports/` or of a path. Raises InputError or CardError, naming file and key."""
    where = ("reports", name_or_path, ".toml")
    return read_closed_system(read_table(resolve(*where), short_path(*where)))


def read_closed_system(card: Table) -> ClosedSystem:
    """Read a whole recipe. Raises CardError, naming the key."""
    if "kind" not in card or card.text("kind") != KIND:
        got = describe(card.value("kind")) if "kind" in card else "none"
        raise card.error(f'a closed system is of kind "{KIND}", got {got}', "kind")
    card.only("kind", "name", "source", "targets", "seed", "network", "motor", "tether", "arm", "coil", "sensors")
    motor, tether, arm, sensors = (card.table(key) for key in ("motor", "tether", "arm", "sensors"))
    motor.only(
        *("rotor", "inner_coil", "outer_coil", "current", "frequency", "diameter", "length", "heating", "cooling")
    )
    tether.only(*("length", "radius", "youngs_modulus", "speed", "step", "margin", "clear", "turning", "attempts"))
    arm.only("height", "behind", "error", "speed")
    sensors.only("positions", "noise", "resolution", "saturation", "rate", "window", "static")
    network = _network(card.table("network"))
    targets = _names(card, "targets")
    try:
        check_targets(network, targets)
    except InputError as error:
        raise card.error(str(error), "targets") from None
    rotor = motor.text("rotor")
    return ClosedSystem(
        name=card.text("name"),
        source=card.text("source") if "source" in card else "",
        text=card.origin.text,
        network=network,
        targets=targets,
        rotor=rotor,
        inner=motor.text("inner_coil"),
        outer=motor.text("outer_coil"),
        stator_current=_least(motor, "current", "current"),
        frequency=_positive(motor, "frequency", "frequency"),
        rate=_positive(sensors, "rate", "frequency"),
        window=_positive(sensors, "window", "time"),
        motor_diameter=_below(motor, "diameter", "length", network.inner_diameter, "the tubes' inner diameter"),
        tip=Tip(
            length=_positive(tether, "length", "length"),
            radius=_positive(tether, "radius", "length"),
            youngs_modulus=_positive(tether, "youngs_modulus", "pressure"),
            motor_length=_positive(motor, "length", "length"),
            moment=as_rotor(rotor).moment,
        ),
        coil=_coil(card.table("coil")),
        sensors=_sensors(sensors),
        static=_three(sensors, "static", "flux density"),
        tool_height=_positive(arm, "height", "length"),
        behind=arm.quantity("behind", "length"),
        arm_error=_least(arm, "error", "length"),
        arm_speed=_positive(arm, "speed", "speed"),
        push_speed=_positive(tether, "speed", "speed"),
        step=_positive(tether, "step", "length"),
        margin=_positive(tether, "margin", "length"),
        clear=_positive(tether, "clear", "length"),
        divider=_least(card.table("network"), "divider", "length"),
        heating=_least(motor, "heating", "time"),
        cooling=_least(motor, "cooling", "time"),
        turning=_least(tether, "turning", "time"),
        attempts=whole_number(tether, "attempts", 1, 1),
        seed=whole_number(card, "seed", 0, 0),
    )


def _network(table: Table) -> Network:
    table.only("entry", "inner_diameter", "corner", "divider", "edges", "nodes")
    nodes = table.table("nodes")
    places = {name: _two(nodes, name) for name in nodes.values}
    stated = table.value("edges")
    if not isinstance(stated, list) or not all(isinstance(one, list) and len(one) == 2 for one in stated):
        raise table.error('edges must be pairs of nodes such as ["A", "B"]', "edges")
    try:
        return Network(
            nodes=places,
            edges=tuple((str(a), str(b)) for a, b in stated),
            entry=table.text("entry"),
            inner_diameter=_positive(table, "inner_diameter", "length"),
            corner=_least(table, "corner", "length"),
        )
    except InputError as error:
        raise table.error(str(error), "edges") from None


def _coil(table: Table) -> Coil:
    table.only("model", "front", "gap", "current", "ahead")
    name = table.text("model")
    field = load_model(name)
    if field.unit != "T/A":
        raise table.error("the coil needs a field model in T/A, per ampere", "model")
    return Coil(
        field=field,
        front=_least(table, "front", "length"),
        gap=_least(table, "gap", "length"),
        current=table.quantity("current", "current"),
        ahead=table.quantity("ahead", "length"),
    )


def _sensors(table: Table) -> tuple[Sensor, ...]:
    places = table.value("positions")
    if not isinstance(places, list) or not places:
        raise table.error("positions must be a list of places, one for each sensor", "positions")
    resolution = _least(table, "resolution", "flux density") if "resolution" in table else 0.0
    saturation = _positive(table, "saturation", "flux density") if "saturation" in table else np.inf
    noise = _positive(table, "noise", "flux density")
    return tuple(
        Sensor(
            pose=RigidTransform.from_translation(_vector(table, "positions", one, "length", 3)),
            noise=noise,
            resolution=resolution,
            saturation=saturation,
        )
        for one in places
    )


def _names(card: Table, key: str) -> tuple[str, ...]:
    stated = card.value(key)
    if not isinstance(stated, list) or not stated or not all(isinstance(one, str) for one in stated):
        raise card.error(f"{key} must be a list of nodes' names", key)
    return tuple(stated)


def _two(table: Table, key: str) -> Floats:
    return _vector(table, key, table.value(key), "length", 2)


def _three(table: Table, key: str, dimension: str) -> Floats:
    return _vector(table, key, table.value(key), dimension, 3)


def _vector(table: Table, key: str, stated: object, dimension: str, count: int) -> Floats:
    if not isinstance(stated, list) or len(stated) != count:
        raise table.error(f"{key} must be {count} quantities with their units", key)
    try:
        return np.array([quantity(one, dimension) for one in stated])
    except InputError as error:
        raise table.error(str(error), key) from None


def _positive(table: Table, key: str, dimension: str) -> float:
    value = table.quantity(key, dimension)
    if not 0 < value < np.inf:
        raise table.error(f"{key} must be positive", key)
    return value


def _least(table: Table, key: str, dimension: str) -> float:
    value = table.quantity(key, dimension)
    if not 0 <= value < np.inf:
        raise table.error(f"{key} must not be negative", key)
    return value


def _below(table: Table, key: str, dimension: str, limit: float, what: str) -> float:
    value = _positive(table, key, dimension)
    if value >= limit:
        raise table.error(f"{key} must be below {what}", key)
    return value
