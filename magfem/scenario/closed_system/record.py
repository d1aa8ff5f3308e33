"""What a run of the closed system leaves: localizations, bent tips, modes, and a summary of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from magfem.scenario.angles import between
from magfem.scenario.closed_system.motor import TrueMotor
from magfem.scenario.closed_system.system import ClosedSystem
from magfem.typing import Floats, Points, Vectors

LOCALIZING, MOVING, MANIPULATING, SWITCHING = "localizing", "moving", "manipulating", "switching"
FORMAT, VERSION = "magfem closed system", 1


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


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
