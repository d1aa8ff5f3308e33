"""What the closed system is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.errors import InputError
from magfem.localization import Sensor
from magfem.scenario.closed_system.network import Network, side_of
from magfem.scenario.closed_system.steering import Coil, Tip
from magfem.typing import Vectors


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedSystem:
    """Everything that the closed system is made of; see `recipe`.

    tool_height: m above the network's plane.  sensors: on the tool, in its frame, whose axes are the base's.
    behind: m, how far behind the motor, along its axis, the tool is held to localize: right above it one sensor sees β
    = 0.  arm_error: m, standard deviation of where the tool truly is.  step: m pushed between localizations.  speeds in
    m/s, times in s.  margin: m before a junction at which the tip is bent.  clear: m that a junction is left behind by.
    divider: m, half the width of the wall between two branches.
    """

    name: str
    source: str
    text: str
    network: Network
    targets: tuple[str, ...]
    rotor: str
    inner: str
    outer: str
    stator_current: float
    frequency: float
    rate: float
    window: float
    motor_diameter: float
    tip: Tip
    coil: Coil
    sensors: tuple[Sensor, ...]
    static: Vectors
    tool_height: float
    behind: float
    arm_error: float
    arm_speed: float
    push_speed: float
    step: float
    margin: float
    clear: float
    divider: float
    heating: float
    cooling: float
    turning: float
    attempts: int
    seed: int


def check_targets(network: Network, targets: tuple[str, ...]) -> None:
    """Raise InputError unless every target is an end of the network and all branches on the way lie to one side."""
    for target in targets:
        names = network.names_to(target)
        if network.children(target):
            raise InputError(f"target {target!r} is a junction: targets are ends of the network")
        for before, node, after in zip(names, names[1:], names[2:], strict=False):
            here = np.append(network.nodes[node] - network.nodes[before], 0.0)
            ahead = {name: np.append(network.nodes[name] - network.nodes[node], 0.0) for name in network.children(node)}
            if len(ahead) > 1:
                side_of(here, ahead[after], [one for name, one in ahead.items() if name != after])
