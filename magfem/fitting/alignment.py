"""How a measurement sees a source: where the source sits, how the sensor is turned, what it adds; what of it is free.

A three-axis sensor at the nominal place p of the measurement's frame reads, of a source with the field b in its own,

    y_k = g · [Sᵀ R b(Rᵀ(p + o_k − c))]_k + b0_k,

with the source's centre c and rotation R (tilt), the sensor's rotation S (turn), the offset o_k of the element that
measures component k, the gain g and a static background b0. (5.1–5.3 have S, b0 and two components of c.) c, R, S, o
and g are found by variable projection; b0 and the source's coefficients are linear.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.fitting.candidate import Candidate
from magfem.typing import Floats, Points

AXES = ("x", "y", "z")
GROUPS: dict[str, tuple[str, ...]] = {
    "centre": tuple(f"centre_{axis}" for axis in AXES),
    "tilt": tuple(f"tilt_{axis}" for axis in AXES),
    "turn": tuple(f"turn_{axis}" for axis in AXES),
    "offsets": tuple(f"offset_{element}{axis}" for element in ("x", "y") for axis in AXES),
}
"""Several parameters by one name. Elements' offsets count from the z element's place: three together are `centre`."""

LENGTHS = ("centre", "offset")
ANGLES = ("tilt", "turn")
NAMES = (*(name for group in GROUPS.values() for name in group), "gain")
ALIASES = {"height": "centre_z"}


def dimension_of(name: str) -> str:
    """What a free parameter, or a group of them, is measured in; empty for a factor."""
    stem = ALIASES.get(name, name).partition("_")[0].rstrip("s")
    if stem in LENGTHS:
        return "length"
    return "angle" if stem in ANGLES else ""


@dataclass(frozen=True)
class Alignment:
    """Which parameters of a measurement are free, and within which bounds.

    bounds: by name (`NAMES`), lower and upper, m, rad or a factor. All others are fixed: at zero, the gain at one.
    """

    bounds: Mapping[str, tuple[float, float]]

    def __post_init__(self) -> None:
        for name, (low, high) in self.bounds.items():
            if name not in NAMES:
                raise InputError(f"unknown free parameter {name!r}; known: {', '.join((*GROUPS, *NAMES, *ALIASES))}")
            if not low < high:
                raise InputError(
                    f"{name}: the lower bound must be smaller than the upper one, got {low:g} and {high:g}"
                )

    @property
    def names(self) -> tuple[str, ...]:
        """Of the free parameters, in order."""
        return tuple(self.bounds)

    @cached_property
    def lower(self) -> Floats:
        """(q,)"""
        return np.array([low for low, _ in self.bounds.values()])

    @cached_property
    def upper(self) -> Floats:
        """(q,)"""
        return np.array([high for _, high in self.bounds.values()])

    @cached_property
    def start(self) -> Floats:
        """Where to begin (q,): the middle of the bounds, for a gain one if it may be."""
        middle = 0.5 * (self.lower + self.upper)
        gain = np.array([name == "gain" for name in self.names], dtype=bool)
        begin: Floats = np.where(gain, np.clip(1.0, self.lower, self.upper), middle)
        return begin

    def without(self, name: str) -> Alignment:
        """The same with one parameter fixed."""
        return Alignment({key: pair for key, pair in self.bounds.items() if key != name})

    def values(self, theta: Floats) -> dict[str, float]:
        """All parameters by name, fixed ones too."""
        fixed = {name: 0.0 for name in NAMES} | {"gain": 1.0}
        return fixed | dict(zip(self.names, theta.tolist(), strict=True))

    def in_source_frame(self, points: Points, theta: Floats) -> Points:
        """Where nominal `points` (n, 3) m of the measurement lie in the source's own frame."""
        now = self.values(theta)
        centre, tilt = (np.array([now[name] for name in GROUPS[group]]) for group in ("centre", "tilt"))
        found: Points = Rotation.from_rotvec(tilt).inv().apply(points - centre)
        return found

    def columns(self, candidate: Candidate, points: Points, theta: Floats) -> Floats:
        """What each of the candidate's parameters makes the sensor read at nominal `points` (n, 3): (p, n, 3)."""
        now = self.values(theta)
        centre, tilt, turn = (np.array([now[name] for name in GROUPS[group]]) for group in ("centre", "tilt", "turn"))
        source, sensor = Rotation.from_rotvec(tilt), Rotation.from_rotvec(turn)
        rotation = sensor.as_matrix().T @ source.as_matrix()
        offsets = np.array([now[name] for name in GROUPS["offsets"]]).reshape(2, 3)
        if not offsets.any():
            (B,) = candidate.columns(source.inv().apply(points - centre), 0)
            seen: Floats = now["gain"] * B @ rotation.T
            return seen
        elements = np.vstack([offsets, np.zeros(3)])
        components = [
            candidate.columns(source.inv().apply(points + element - centre), 0)[0] @ rotation[k]
            for k, element in enumerate(elements)
        ]
        stacked: Floats = now["gain"] * np.stack(components, axis=-1)
        return stacked


def alignment_of(free: Mapping[str, tuple[float, float] | None] | Iterable[str], extent: float) -> Alignment:
    """The alignment for names of parameters or groups; None takes bounds that suit data of an `extent` (m).

    Default bounds: places within the extent either way, turns within 30°, elements' offsets within a twentieth of the
    extent, gains from 0.5 to 2. Raises InputError for names it does not know.
    """
    wanted = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    bounds: dict[str, tuple[float, float]] = {}
    for given, limits in wanted.items():
        name = ALIASES.get(given, given)
        for one in GROUPS.get(name, (name,)):
            bounds[one] = limits or _default(one, extent)
    return Alignment(bounds)


def _default(name: str, extent: float) -> tuple[float, float]:
    if name.startswith("centre"):
        return -extent, extent
    if name.startswith("offset"):
        return -extent / 20, extent / 20
    if name == "gain":
        return 0.5, 2.0
    return -np.pi / 6, np.pi / 6
