"""What sensors of uncertain gain, mounting and offset read at known poses, and how that changes with the unknowns.

A sensor at place x whose nominal axes are the columns of W reads of a rotor at y with orientation R

    static:  M Wᵀ (E + κ R b₀(q)) + o        quadratures:  κ M Wᵀ R C(q),  κ M Wᵀ R S(q)        q = Rᵀ(x − y)

M, the reading matrix, is the product of gain and mounting rotation; o is the offset, E the static field of everything
else, κ the rotor's moment over that of its model. Unknowns change by small amounts about where they are: places along
the axes of the frame they are stated in, turns multiply.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.localization.orientation import rotation_matrix
from magfem.localization.rotor import Rotor
from magfem.typing import Floats, Points, Vectors

FINDABLE = ("gain", "rotation", "position", "offset", "moment", "rotor", "phase")
LONGEST_MOVE, LONGEST_TURN = 0.2, 0.3  # of the distance, and rad
COMPONENTS = 9  # of a reading: static, C, S
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Motion:
    """Where k poses carry s sensors: carriers' places (k, 3) m and axes (k, 3, 3), and the sensors' nominal axes
    (s, 3, 3) on the carrier."""

    places: Points
    axes: Floats
    nominal: Floats


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Everything that may be unknown.

    matrix: (s, 3, 3), M.  gain: (s, 3, 3), what M is a rotation of when only the mounting is to be found.  place:
    (s, 3) m on the carrier.  offset: (s, 3) T.  static: (3,) T.  moment: κ.  rotor: (k, 3) m.  upright: (k, 3, 3), the
    rotors' orientations at phase zero.  phase: (k,) rad.
    """

    matrix: Floats
    gain: Floats
    place: Points
    offset: Vectors
    static: Vectors
    moment: float
    rotor: Points
    upright: Floats
    phase: Floats


@dataclass(frozen=True)
class Layout:
    """Which unknowns are found, and the columns that they take.

    sensors, poses: their numbers.  find: out of FINDABLE.  background: whether the static field is found.  each_phase:
    whether every pose has a phase of its own to be found.
    """

    sensors: int
    poses: int
    find: frozenset[str]
    background: bool
    each_phase: bool

    @property
    def static_used(self) -> bool:
        """Whether static readings count: they are for offsets, and are left out where these are not found."""
        return "offset" in self.find

    @property
    def own(self) -> tuple[str, ...]:
        """What the columns of one sensor are of, one name a column."""
        matrix = ("gain",) * 9 if "gain" in self.find else ("rotation",) * 3 if "rotation" in self.find else ()
        return (*matrix, *("position",) * 3 * ("position" in self.find), *("offset",) * 3 * ("offset" in self.find))

    @property
    def common(self) -> tuple[str, ...]:
        """What the columns after the sensors' are of."""
        return (
            *("the static field",) * 3 * self.background,
            *("the rotor's moment",) * ("moment" in self.find),
            *("the rotor's position",) * 3 * ("rotor" in self.find),
            *("the rotor's axis",) * 2 * ("rotor" in self.find),
            *("the phase",) * ("phase" in self.find),
            *("the phases",) * (self.poses if self.each_phase else 0),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """One for each column."""
        of = [f" of sensor {k}" for k in range(self.sensors)] if self.sensors > 1 else [" of the sensor"]
        return (*(f"the {name}{whose}" for whose in of for name in self.own), *self.common)

    def columns(self, name: str) -> slice:
        """Those of a name among `common`."""
        first = self.sensors * len(self.own) + self.common.index(name)
        return slice(first, first + self.common.count(name))

    def own_columns(self, name: str) -> slice:
        """Those of a name among one sensor's."""
        return slice(self.own.index(name), self.own.index(name) + self.own.count(name))

    def longest(self, distance: float) -> Floats:
        """(unknowns,), how far one step may go: places a part of the distance, turns a part of a radian."""
        place, turn = ("position", "the rotor's position"), ("rotation", "the rotor's axis", "the phase", "the phases")
        names = np.array([*self.own * self.sensors, *self.common])
        free = np.where(np.isin(names, turn), LONGEST_TURN, np.inf)
        return np.asarray(np.where(np.isin(names, place), LONGEST_MOVE * distance, free))


def readings(rotor: Rotor, motion: Motion, at: Unknowns, layout: Layout) -> tuple[Floats, Floats]:
    """Readings (k, s, 9) T, static before C before S, and their derivatives (k, s, 9, unknowns)."""
    k, s = layout.poses, layout.sensors
    R = at.upright @ _about_axis(at.phase)
    x = motion.places[:, None] + np.einsum("kij,sj->ksi", motion.axes, at.place)
    to_nominal = np.swapaxes(motion.axes[:, None] @ motion.nominal, -1, -2)  # Wᵀ (k, s, 3, 3)
    to_rotor = np.swapaxes(R, -1, -2)
    q = np.einsum("kij,ksj->ksi", to_rotor, x - at.rotor[:, None])
    B, gradient = _fields(rotor, q)  # (k, s, 3 parts, 3), (k, s, 3, 3, 3)
    B, gradient = at.moment * B, at.moment * gradient
    turn = (to_nominal @ R[:, None])[:, :, None]  # from the rotor's frame to the sensor's nominal one
    seen = np.einsum("kspij,kspj->kspi", turn, B)
    from_rotor = seen.copy()
    seen[:, :, 0] += np.einsum("ksij,j->ksi", to_nominal, at.static)
    values = np.einsum("sij,kspj->kspi", at.matrix, seen)
    values[:, :, 0] += at.offset

    read = at.matrix[:, None] @ turn  # (k, s, 1, 3, 3)
    moved = read @ gradient  # (k, s, 3, 3, 3), per metre in the rotor's frame
    J = np.zeros((k, s, 3, 3, len(layout.names)))
    width = len(layout.own)
    for j in range(s):
        own = J[:, j, ..., j * width : (j + 1) * width]
        if "gain" in layout.find:
            own[..., :9] = np.einsum("ab,kpc->kpabc", np.eye(3), seen[:, j]).reshape(k, 3, 3, 9)
        elif "rotation" in layout.find:
            own[..., :3] = at.gain[j] @ cross_matrix(seen[:, j] @ (np.linalg.inv(at.gain[j]) @ at.matrix[j]).T)
        if "position" in layout.find:
            own[..., layout.own_columns("position")] = moved[:, j] @ (to_rotor @ motion.axes)[:, None]
        if "offset" in layout.find:
            own[:, 0, :, layout.own_columns("offset")] = np.eye(3)
    if layout.background:
        J[:, :, 0, :, layout.columns("the static field")] = at.matrix @ to_nominal
    if "moment" in layout.find:
        J[..., layout.columns("the rotor's moment")] = np.einsum("sij,kspj->kspi", at.matrix, from_rotor / at.moment)[
            ..., None
        ]
    turned = read @ (gradient @ cross_matrix(q)[:, :, None] - cross_matrix(B))  # small turns about the rotor's axes
    if "rotor" in layout.find:
        J[..., layout.columns("the rotor's position")] = -moved @ to_rotor[:, None, None]
        # Turns about the axes at phase zero are the same for all poses.
        upright = turned @ np.swapaxes(_about_axis(at.phase), -1, -2)[:, None, None]
        J[..., layout.columns("the rotor's axis")] = upright[..., :2]
    if "phase" in layout.find:
        J[..., layout.columns("the phase")] = turned[..., 2:]
    if layout.each_phase:
        every = np.arange(k)
        J[every, ..., layout.columns("the phases").start + every] = turned[..., 2]
    return values.reshape(k, s, COMPONENTS), J.reshape(k, s, COMPONENTS, -1)


def changed(at: Unknowns, step: Floats, layout: Layout) -> Unknowns:
    """The unknowns after a small step (unknowns,)."""
    width = len(layout.own)
    own = step[: layout.sensors * width].reshape(layout.sensors, width)
    new = at
    if "gain" in layout.find:
        new = replace(new, matrix=at.matrix + own[:, :9].reshape(-1, 3, 3))
    elif "rotation" in layout.find:
        turned = rotation_matrix(-own[:, :3]) @ np.linalg.inv(at.gain) @ at.matrix
        new = replace(new, matrix=at.gain @ turned)
    if "position" in layout.find:
        new = replace(new, place=at.place + own[:, layout.own_columns("position")])
    if "offset" in layout.find:
        new = replace(new, offset=at.offset + own[:, layout.own_columns("offset")])
    if layout.background:
        new = replace(new, static=at.static + step[layout.columns("the static field")])
    if "moment" in layout.find:
        new = replace(new, moment=at.moment + float(step[layout.columns("the rotor's moment")][0]))
    if "rotor" in layout.find:
        turn = np.append(step[layout.columns("the rotor's axis")], 0.0)
        new = replace(
            new,
            rotor=at.rotor + step[layout.columns("the rotor's position")],
            upright=at.upright @ rotation_matrix(turn),
        )
    if "phase" in layout.find:
        new = replace(new, phase=at.phase + step[layout.columns("the phase")])
    if layout.each_phase:
        new = replace(new, phase=at.phase + step[layout.columns("the phases")])
    return new


def _fields(rotor: Rotor, q: Points) -> tuple[Floats, Floats]:
    """b₀, C and S in the rotor's frame, (..., 3 parts, 3), and gradients (..., 3 parts, 3, 3)."""
    C, S, dC, dS = rotor.quadratures(q)
    steady, d_steady = rotor.steady(q)
    return np.stack([steady, C, S], axis=-2), np.stack([d_steady, dC, dS], axis=-3)


def _about_axis(phase: Floats) -> Floats:
    """(k, 3, 3), turns about z."""
    return rotation_matrix(phase[:, None] * _Z)
