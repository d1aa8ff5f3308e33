"""The run: localize, move the arm, push on; lock, bend and push at every branch; and what came of it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fitting import load_model
from magfem.localization import Branch, Pose, Rotor, Sensor, as_rotor, localize
from magfem.localization.orientation import orientation
from magfem.localization.sensor import SensorArray, as_sensors
from magfem.localization.stator_influence import Stator
from magfem.scenario.angles import between
from magfem.scenario.closed_system.motor import Play, TrueMotor, read_by, turning_field
from magfem.scenario.closed_system.network import Network, Way, angle_to, side_of
from magfem.scenario.closed_system.steering import Coil, Tip, tether_turn, turned, wanted_moment
from magfem.typing import Floats, Points, Vectors
from magfem.version import __version__

log = logging.getLogger("magfem")

LOCALIZING, MOVING, MANIPULATING, SWITCHING = "localizing", "moving", "manipulating", "switching"
FORMAT, VERSION = "magfem closed system", 1
FAULTY = 15e-3  # m between a pose and where the motor is expected, beyond which the pose is not followed
_MOST_LOCALIZATIONS = 2000


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


@dataclass(frozen=True, eq=False, kw_only=True)
class Localization:
    """One localization: when, what is true, what is found, and what is found without the stator's field."""

    time: float
    true: TrueMotor
    position: Points
    axis: Vectors
    position_deviation: float
    axis_deviation: float
    without_stator: tuple[Points, Vectors]
    tool: Points
    target: str

    @property
    def position_error(self) -> float:
        """m."""
        return float(np.linalg.norm(self.position - self.true.position))

    @property
    def axis_error(self) -> float:
        """rad."""
        return float(between(self.axis, self.true.axis))


@dataclass(frozen=True, eq=False, kw_only=True)
class Bending:
    """One manipulation before a junction.

    side: +1 to the left.  deflection: m of the tip to the left.  lateral: m that the motor lies to the left of the
    centre line.  entered: the branch.  field: T at the motor.  turn: rad that the tether was turned.  moment_error:
    rad, between the wanted moment and the true one.  at_sensors: T, the largest field of the coil at a sensor.
    """

    time: float
    node: str
    wanted: str
    entered: str
    side: float
    deflection: float
    lateral: float
    field: Vectors
    turn: float
    moment_error: float
    at_sensors: float
    tool: Points
    position: Points
    tip: Points

    @property
    def alone(self) -> float:
        """m to the wanted side without any field: positive would have entered by chance."""
        return self.side * self.lateral


@dataclass(frozen=True, eq=False, kw_only=True)
class Mode:
    """A stretch of time, s."""

    name: str
    start: float
    end: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedRun:
    """What came of it. reached: by target.  distance: m pushed and pulled."""

    system: ClosedSystem
    localizations: tuple[Localization, ...]
    bendings: tuple[Bending, ...]
    modes: tuple[Mode, ...]
    reached: Mapping[str, bool]
    distance: float
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether every target was reached."""
        return all(self.reached.values())

    @property
    def duration(self) -> float:
        """s."""
        return self.modes[-1].end if self.modes else 0.0

    def share(self, name: str) -> float:
        """Of the time that a mode takes."""
        return sum(one.end - one.start for one in self.modes if one.name == name) / max(self.duration, 1e-12)

    def summary(self) -> dict[str, Any]:
        """What `summary.json` holds; mm, deg, s, mT."""
        off = np.array([one.position_error for one in self.localizations])
        turned_by = np.array([one.axis_error for one in self.localizations])
        shift = np.array([np.linalg.norm(one.position - one.without_stator[0]) for one in self.localizations])
        swing = np.array([between(one.axis, one.without_stator[1]) for one in self.localizations])
        full = max((one.at_sensors for one in self.bendings), default=0.0)
        limit = min(one.saturation for one in self.system.sensors)
        return {
            "format": FORMAT,
            "version": VERSION,
            "name": self.system.name,
            "source": self.system.source,
            "passed": self.passed,
            "targets": [{"node": name, "reached": done} for name, done in self.reached.items()],
            "junctions": [
                {
                    "time_s": one.time,
                    "node": one.node,
                    "wanted": one.wanted,
                    "entered": one.entered,
                    "as_wanted": one.entered == one.wanted,
                    "deflection_mm": 1e3 * one.side * one.deflection,
                    "without_field_mm": 1e3 * one.alone,
                    "field_mT": 1e3 * float(np.linalg.norm(one.field)),
                    "tether_turn_deg": np.degrees(one.turn),
                    "moment_error_deg": np.degrees(one.moment_error),
                }
                for one in self.bendings
            ],
            "localization": {
                "count": len(self.localizations),
                "position_error_mm": {"rms": 1e3 * _rms(off), "worst": 1e3 * float(off.max())},
                "axis_error_deg": {"rms": np.degrees(_rms(turned_by)), "worst": np.degrees(float(turned_by.max()))},
                "stated_position_mm": 1e3 * _rms(np.array([one.position_deviation for one in self.localizations])),
                "stated_axis_deg": np.degrees(_rms(np.array([one.axis_deviation for one in self.localizations]))),
                "rate_Hz": len(self.localizations) / self.duration,
            },
            "stator": {
                "largest_shift_mm": 1e3 * float(shift.max()),
                "largest_turn_deg": np.degrees(float(swing.max())),
            },
            "coil_at_sensors": {
                "largest_mT": 1e3 * full,
                "saturation_mT": None if np.isinf(limit) else 1e3 * limit,
                "saturates": bool(full >= limit),
            },
            "distance_mm": 1e3 * self.distance,
            "duration_s": self.duration,
            "share_of_time": {name: self.share(name) for name in (LOCALIZING, MOVING, MANIPULATING, SWITCHING)},
            "published": {"distance_mm": 400.0, "duration_s": 300.0, "localization_rate_Hz": 0.3},
            "provenance": self.provenance,
        }


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


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


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
