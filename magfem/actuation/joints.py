"""Joints: what turns or slides the coils of a system, alone or on top of each other.

Axes and points are those at joint values zero, in the system's frame. A body carried by joints 1, 2, …, each on the
one before it, is moved from there by T₁(q₁) T₂(q₂) …, the product of exponentials (Brockett 1984; Lynch & Park,
Modern Robotics, 4.1): no frames have to be chosen for the joints.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from magfem.errors import InputError
from magfem.typing import ArrayLike, Booleans, Floats, Integers
from magfem.units import format_quantity, quoted

Kind: TypeAlias = Literal["revolute", "prismatic"]
KINDS = ("revolute", "prismatic")

_SLACK = 1e-12  # relative: what was computed to lie on a limit is allowed


@dataclass(frozen=True)
class Joint:
    """A joint that turns (revolute) about the line through `point` (m) along `axis`, or slides (prismatic) along it.

    axis: of any length when given, of length one when read.  limits: least and largest value, rad or m; zero, where
    the poses of a system's coils are stated, lies between them.  parent: the joint that carries this one.
    Raises InputError for what is no joint.
    """

    name: str
    kind: Kind
    axis: tuple[float, float, float]
    limits: tuple[float, float]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parent: str | None = None

    def __post_init__(self) -> None:
        shown = f"joint {quoted(self.name)}"
        if self.kind not in KINDS:
            raise InputError(f"{shown}: kind must be revolute or prismatic, got {self.kind!r}")
        axis, point, limits = (np.array(value, dtype=float) for value in (self.axis, self.point, self.limits))
        if axis.shape != (3,) or not 0 < np.linalg.norm(axis) < np.inf:
            raise InputError(f"{shown}: axis must be three finite numbers that are not all zero")
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InputError(f"{shown}: point must be three finite lengths")
        if limits.shape != (2,) or not (np.isfinite(limits).all() and limits[0] <= 0 <= limits[1] != limits[0]):
            raise InputError(
                f"{shown}: limits must be two finite values with zero, where the coils' poses are stated, between them"
            )
        for name, value in (("axis", axis / np.linalg.norm(axis)), ("point", point), ("limits", limits)):
            object.__setattr__(self, name, tuple(value.tolist()))

    @property
    def dimension(self) -> str:
        """What its values are: "angle" (rad) or "length" (m), as in `magfem.units`."""
        return "angle" if self.kind == "revolute" else "length"


class Linkage(NamedTuple):
    """j joints as kernels read them.

    order: (j,) parents before those they carry.  parent: (j,) of each, −1 for none.  revolute: (j,).
    axis: (j, 3) of length one.  point: (j, 3) m.
    """

    order: Integers
    parent: Integers
    revolute: Booleans
    axis: Floats
    point: Floats


@dataclass(frozen=True)
class Joints:
    """The joints of a system. Raises InputError for names given twice, unknown parents and circles of them."""

    joints: tuple[Joint, ...]
    linkage: Linkage = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        names = [joint.name for joint in self.joints]
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise InputError(f"joints of a system have names of their own, and {quoted(twice[0])} is given twice")
        parent = [-1 if joint.parent is None else self.index(joint.parent) for joint in self.joints]
        order: list[int] = []
        while len(order) < len(names):
            ready = [k for k in range(len(names)) if k not in order and (parent[k] < 0 or parent[k] in order)]
            if not ready:
                stuck = next(name for k, name in enumerate(names) if k not in order)
                raise InputError(f"joint {quoted(stuck)} is carried by itself: its parents form a circle")
            order += ready
        count = len(names)
        linkage = Linkage(
            np.array(order, dtype=np.int64),
            np.array(parent, dtype=np.int64),
            np.array([joint.kind == "revolute" for joint in self.joints], dtype=bool),
            np.array([joint.axis for joint in self.joints], dtype=float).reshape(count, 3),
            np.array([joint.point for joint in self.joints], dtype=float).reshape(count, 3),
        )
        object.__setattr__(self, "linkage", linkage)

    def index(self, name: str) -> int:
        """Which joint has this name. InputError for a name that none has."""
        names = [joint.name for joint in self.joints]
        if name not in names:
            known = f"known: {', '.join(map(quoted, names))}" if names else "there are none"
            raise InputError(f"no joint is named {quoted(name)}; {known}")
        return names.index(name)

    def carried_by(self, carrier: Integers) -> Booleans:
        """Which bodies every joint moves: (j, c), from the joint (c,) that carries each, −1 for none."""
        moves = np.zeros((len(self.joints), carrier.size), dtype=bool)
        for body, joint in enumerate(carrier.tolist()):
            while joint >= 0:
                moves[joint, body] = True
                joint = int(self.linkage.parent[joint])
        return moves

    def checked(self, values: ArrayLike | None, owner: str) -> Floats:
        """Values (j,) rad or m as floats, zeros for None; `owner` is how messages name the system.

        Raises InputError for another shape, for what is not finite, and beyond a joint's limits.
        """
        count = len(self.joints)
        if values is None:
            return np.zeros(count)
        try:
            given = np.asarray(values)
        except ValueError:  # ragged
            given = np.asarray(None)
        if not count:
            if given.size or given.dtype == object:
                raise InputError("this system has no joints: leave joints out, or give an empty sequence")
            return np.zeros(0)
        names = ", ".join(joint.name for joint in self.joints)
        if given.dtype.kind not in "fiu":
            raise InputError(f"joints must be real numbers, in rad or m, one for each of {names}")
        if given.shape != (count,):
            raise InputError(f"{owner} has the joints {names}: their values have shape ({count},), got {given.shape}")
        checked = given.astype(float)
        if not np.isfinite(checked).all():
            raise InputError("joints must be finite numbers")
        for joint, value in zip(self.joints, checked.tolist(), strict=True):
            low, high = joint.limits
            slack = _SLACK * (high - low)
            if not low - slack <= value <= high + slack:
                shown = [format_quantity(one, joint.dimension) for one in (low, high, value)]
                raise InputError(
                    f"joint {quoted(joint.name)} of {owner} moves from {shown[0]} to {shown[1]}, got {shown[2]}"
                )
        return checked
