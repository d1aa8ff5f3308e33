"""The run: localize, move the arm, push on; lock, bend and push at every branch."""

from __future__ import annotations

import logging
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.fitting import load_model
from magfem.localization import Branch, Pose, Rotor, as_rotor, localize
from magfem.localization.orientation import orientation
from magfem.localization.sensor import SensorArray, as_sensors
from magfem.localization.stator_influence import Stator
from magfem.scenario.angles import between
from magfem.scenario.closed_system.motor import Play, read_by, turning_field
from magfem.scenario.closed_system.network import Network, Way, angle_to, side_of
from magfem.scenario.closed_system.record import (
    LOCALIZING,
    MANIPULATING,
    MOVING,
    SWITCHING,
    Bending,
    ClosedRun,
    Localization,
    Mode,
)
from magfem.scenario.closed_system.steering import tether_turn, turned, wanted_moment
from magfem.scenario.closed_system.system import ClosedSystem
from magfem.typing import Points, Vectors
from magfem.version import __version__

log = logging.getLogger("magfem")

FAULTY = 15e-3  # m between a pose and where the motor is expected, beyond which the pose is not followed
_MOST_LOCALIZATIONS = 2000


def simulate_closed_system(system: ClosedSystem) -> ClosedRun:
    """Run it. Raises InputError for targets that cannot be reached in this network, and what its parts raise."""
    return _Loop(system).run()


class _Loop:
    """The state of a run: the clock, the motor's arc length on its way, the arm, and what was recorded."""

    def __init__(self, system: ClosedSystem) -> None:
        self.system = system
        self.generator = np.random.default_rng(system.seed)
        self.rotor: Rotor = as_rotor(system.rotor)
        self.stator = Stator(load_model(system.inner), load_model(system.outer), system.stator_current)
        self.play = Play(
            system.motor_diameter,
            system.network.inner_diameter,
            self.generator.uniform(0.0, 2 * np.pi, (3, 3)),
        )
        self.times = np.arange(round(system.window * system.rate)) / system.rate
        self.clock = 0.0
        self.distance = 0.0
        self.way = self.believed = system.network.way(system.targets[0])
        self.s = system.clear
        start = self.play.at(self.way, self.s)
        self.expected = self.s
        self.tool = self._above(start.position, start.axis)
        self.locked = True
        self.localizations: list[Localization] = []
        self.bendings: list[Bending] = []
        self.modes: list[Mode] = []

    def run(self) -> ClosedRun:
        """All targets, one after the other."""
        reached: dict[str, bool] = {}
        for target in self.system.targets:
            log.info("closed system: to %s", target)
            reached[target] = self._go_to(target)
        return ClosedRun(
            system=self.system,
            localizations=tuple(self.localizations),
            bendings=tuple(self.bendings),
            modes=tuple(self.modes),
            reached=reached,
            distance=self.distance,
            provenance={
                "magfem": __version__,
                "numpy": np.__version__,
                "date": datetime.now(UTC).isoformat("T", "seconds"),
            },
        )

    def _go_to(self, target: str) -> bool:
        """Back to where the ways part, and on to the target; whether it was reached."""
        wanted = self.system.network.way(target)
        shared = _shared(self.way, wanted)
        if self.s > shared - self.system.margin and self.way.names != wanted.names:
            self._move_to(shared - self.system.margin, target)
        self.believed = wanted
        for number, node in enumerate(wanted.names[1:-1], 1):
            children = self.system.network.children(node)
            junction = float(wanted.at_nodes[number])
            if len(children) < 2 or self.s > junction:
                continue
            self._move_to(junction - self.system.margin, target)
            if not self._through(wanted, node, wanted.names[number + 1], children, junction, target):
                return False
        self.way = wanted
        self._move_to(wanted.length, target)
        return True

    def _through(self, wanted: Way, node: str, branch: str, children: list[str], junction: float, target: str) -> bool:
        """Bend and push into `branch`, again where the other one was entered; whether it went in."""
        for _ in range(self.system.attempts):
            pose = self._localize(target)
            entered = self._bend(wanted, node, branch, children, pose)
            self.way = self.system.network.way(_leaf(self.system.network, entered))
            if entered == branch:
                self.way = wanted
            self._push(junction + self.system.clear, MANIPULATING)
            self._unlock()
            if self._entered_as_seen(target, wanted):
                return entered == branch
            self._move_to(junction - self.system.margin, target)
        return False

    def _entered_as_seen(self, target: str, wanted: Way) -> bool:
        """Whether localization has the motor on the wanted way: all that the controller knows."""
        pose = self._localize(target)
        _, apart = wanted.nearest(pose.position)
        others = [
            self.system.network.way(name).nearest(pose.position)[1]
            for name in self.system.network.nodes
            if name not in wanted.names
        ]
        # Back only when the wrong way is clearly the nearer one: just beyond a junction they lie close together.
        return apart <= min(others, default=np.inf) + 2 * float(pose.position_deviation)

    def _move_to(self, s: float, target: str) -> None:
        """Push or pull the tether to arc length `s`, localizing on the way."""
        for _ in range(_MOST_LOCALIZATIONS):
            if abs(s - self.s) < 1e-6:
                return
            self._localize(target)
            self._push(self.s + float(np.clip(s - self.s, -self.system.step, self.system.step)), MOVING)

    def _expected_pose(self) -> Branch:
        """Where the controller expects the motor: on the way it is believed to be on, as seen, and pushed since."""
        place, along = self.believed.place(self.expected), self.believed.tangent(self.expected)
        return Branch(place, along, np.asarray(0.0), np.zeros((6, 6)), np.asarray(0.0))

    def _push(self, s: float, mode: str) -> None:
        way = abs(s - self.s)
        self.distance += way
        self.expected += s - self.s
        self._spend(mode, way / self.system.push_speed)
        self.s = s

    def _spend(self, mode: str, seconds: float) -> None:
        if seconds <= 0:
            return
        last = self.modes[-1] if self.modes else None
        if last is not None and last.name == mode:
            self.modes[-1] = replace(last, end=last.end + seconds)
        else:
            self.modes.append(Mode(name=mode, start=self.clock, end=self.clock + seconds))
        self.clock += seconds

    def _unlock(self) -> None:
        if self.locked:
            self._spend(SWITCHING, self.system.heating)
            self.locked = False

    def _localize(self, target: str) -> Pose:
        """A window of samples, the pose that it gives, and the arm moved after it."""
        self._unlock()
        true = self.play.at(self.way, self.s)
        array = self._array(self._truly(self.tool))
        phase = float(self.generator.uniform(-np.pi, np.pi))
        turns = self.system.frequency * self.times
        rotor_alone = turning_field(true, phase, self.rotor, None, array, turns)
        with_stator = turning_field(true, phase, self.rotor, self.stator, array, turns)
        static = np.einsum("sij,i->sj", array.axes, self.system.static)[:, None, :]
        state = self.generator.bit_generator.state
        read = read_by(self.system.sensors, with_stator + static, self.generator)
        self.generator.bit_generator.state = state  # the same noise, without the stator
        quiet = read_by(self.system.sensors, rotor_alone + static, self.generator)
        self._spend(LOCALIZING, self.system.window)

        known = [
            replace(one, pose=RigidTransform.from_translation(self.tool) * one.pose) for one in self.system.sensors
        ]
        near = self._expected_pose() if len(known) == 1 else None
        pose, alone = (
            localize(one, self.times, self.rotor, self.system.frequency, known, near=near, strict=False)
            for one in (read, quiet)
        )
        self.localizations.append(
            Localization(
                time=self.clock,
                true=true,
                position=pose.position,
                axis=pose.axis,
                position_deviation=float(pose.position_deviation),
                axis_deviation=float(pose.axis_deviation),
                without_stator=(alone.position, alone.axis),
                tool=self.tool,
                target=target,
            )
        )
        self.lock_phase = phase + 2 * np.pi * self.system.frequency * self.system.window
        # A pose far from where the tether must have brought the motor does not move the arm: the next would be worse.
        expected = self._expected_pose()
        seen: Branch = pose if np.linalg.norm(pose.position - expected.position) < FAULTY else expected
        self.expected, _ = self.believed.nearest(seen.position)
        self._move_tool(self._above(seen.position, seen.axis), MOVING)
        return pose

    def _bend(self, wanted: Way, node: str, branch: str, children: list[str], pose: Pose) -> str:
        """Lock the rotor, hold the coil, turn the tether, and see where the tip points: the branch that it enters."""
        system, true = self.system, self.play.at(self.way, self.s)
        here = system.network.nodes[node]
        ahead = {name: np.append(system.network.nodes[name] - here, 0.0) for name in children}
        side = side_of(pose.axis, ahead[branch], [one for name, one in ahead.items() if name != branch])
        self._spend(SWITCHING, system.cooling)  # the rotor stops as the window ends, and sets
        self.locked = True
        tool = system.coil.tool_for(pose.position, pose.axis, system.tool_height)
        self._move_tool(tool, MANIPULATING)

        # What the controller believes: the field by the coil's model, the moment by the localized phase.
        believed = system.coil.held(tool).B(pose.position, outside="extrapolate")
        aim = wanted_moment(pose.axis, believed, side)
        angle = tether_turn(pose.axis, pose.moment_direction(system.window), aim)
        self._spend(MANIPULATING, system.turning)

        # What is: the tool a little off, the true moment turned by that angle about the true axis.
        moment = turned(true.axis, orientation(true.axis, np.asarray(self.lock_phase))[:, 0], angle)
        held = system.coil.held(self._truly(tool))
        tip = system.tip.bent(true.position, true.axis, moment, held)
        left = np.cross([0.0, 0.0, 1.0], true.axis)
        left = left / np.linalg.norm(left)
        straight = true.position + 0.5 * system.tip.motor_length * true.axis
        deflection = float((tip - straight) @ left)
        off = side * (deflection + true.lateral)
        # A tip that is not on the wanted side of the wall slides into the branch on the other side.
        entered = (
            branch if off > system.divider else min(ahead, key=lambda name: side * angle_to(pose.axis, ahead[name]))
        )
        at_sensors = max(
            float(np.abs(held.B(one.pose.translation + self.tool, outside="extrapolate")).max())
            for one in system.sensors
        )
        self.bendings.append(
            Bending(
                time=self.clock,
                node=node,
                wanted=branch,
                entered=entered,
                side=side,
                deflection=deflection,
                lateral=true.lateral,
                field=held.B(true.position, outside="extrapolate"),
                turn=angle,
                moment_error=float(between(moment, wanted_moment(true.axis, believed, side))),
                at_sensors=at_sensors,
                tool=tool,
                position=true.position,
                tip=tip,
            )
        )
        return entered

    def _above(self, position: Points, axis: Vectors) -> Points:
        level = axis * [1.0, 1.0, 0.0]
        over = position - self.system.behind * level / np.linalg.norm(level)
        return np.array([over[0], over[1], self.system.tool_height])

    def _truly(self, tool: Points) -> Points:
        return tool + self.system.arm_error * self.generator.standard_normal(3)

    def _array(self, tool: Points) -> SensorArray:
        moved = RigidTransform.from_translation(tool)
        return as_sensors([replace(one, pose=moved * one.pose) for one in self.system.sensors])

    def _move_tool(self, tool: Points, mode: str) -> None:
        self._spend(mode, float(np.linalg.norm(tool - self.tool)) / self.system.arm_speed)
        self.tool = tool


def _shared(one: Way, other: Way) -> float:
    """m of the arc length up to the node where two ways part."""
    last = 0
    for k, (a, b) in enumerate(zip(one.names, other.names, strict=False)):
        if a != b:
            break
        last = k
    return float(one.at_nodes[last])


def _leaf(network: Network, node: str) -> str:
    """A node without children, beyond `node`."""
    children = network.children(node)
    return _leaf(network, children[0]) if children else node
