"""What is wanted of a coil system at one or several magnets, as rows that are linear in the currents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as attribute
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.actuation.wrench import eight_numbers, field_to_wrench
from magfem.actuation.wrench_map import magnets
from magfem.errors import InputError
from magfem.fields.field import as_points
from magfem.typing import ArrayLike, Floats, Integers, Jet, Points

if TYPE_CHECKING:
    from magfem.actuation.coil_system import CoilSystem

KINDS = {"field": 3, "gradient": 5, "force": 3, "torque": 3}
"""What can be wanted, and how many components it has."""

_COMPONENTS = {"gradient": ("dBx_dx", "dBx_dy", "dBx_dz", "dBy_dy", "dBy_dz")}


@dataclass(frozen=True, eq=False)
class Target:
    """What is wanted at one place; what is None, the whole or a component, is left free.

    place: a point (3,) m, or the pose of a magnet.  moment: A·m², in the magnet's own frame, which is the system's for
    a point; needed for force and torque.  field: (3,) T.  gradient: (5,) T/m, in the order of `ROWS`.
    force, torque: (3,) N, N·m, about the place.  All in the system's axes.
    within: how far each component may be off, by kind, such as {"force": 5e-3}; exactly where nothing is said.

    Raises InputError for what is no target.
    """

    place: ArrayLike | RigidTransform
    field: Sequence[float | None] | ArrayLike | None = None
    gradient: Sequence[float | None] | ArrayLike | None = None
    force: Sequence[float | None] | ArrayLike | None = None
    torque: Sequence[float | None] | ArrayLike | None = None
    moment: ArrayLike | None = None
    within: Mapping[str, float] = attribute(default_factory=dict)

    def __post_init__(self) -> None:
        if not any(np.isfinite(self.wanted(kind)).any() for kind in KINDS):
            raise InputError("a target wants a field, a gradient, a force or a torque")
        if self.moment is None and not (self.force is None and self.torque is None):
            raise InputError("a target with a force or torque needs the moment of the magnet")
        for kind, tolerance in self.within.items():
            if kind not in KINDS:
                raise InputError(f"within is by {', '.join(KINDS)}, got {kind!r}")
            if not 0 <= tolerance < np.inf:
                raise InputError(f"within must be zero or positive and finite, got {tolerance!r} for {kind}")
        if not isinstance(self.place, RigidTransform) and as_points(self.place).shape != (3,):
            raise InputError("a target is at one place: a point (3,) m or a pose")
        if isinstance(self.place, RigidTransform) and not self.place.single:
            raise InputError("a target is at one place, got several poses: give one target for each")
        if self.moment is not None and self.magnet.shape != (3,):
            raise InputError("a target is of one magnet: moment (3,) A·m²")

    def wanted(self, kind: str) -> Floats:
        """The components of a kind, NaN where free."""
        given = getattr(self, kind)
        if given is None:
            return np.full(KINDS[kind], np.nan)
        try:
            values = np.array(given, dtype=float)  # None becomes NaN
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape != (KINDS[kind],) or np.isinf(values).any():
            raise InputError(f"{kind} must be {KINDS[kind]} finite numbers, or None for those left free")
        return values

    @property
    def point(self) -> Points:
        """(3,) m."""
        return self.place.translation if isinstance(self.place, RigidTransform) else as_points(self.place)

    @property
    def magnet(self) -> Floats:
        """The moment in the system's axes, (3,) A·m²; zero for none."""
        if self.moment is None:
            return np.zeros(3)
        pose = self.place if isinstance(self.place, RigidTransform) else RigidTransform.identity()
        return magnets(self.moment, pose)[0]


@dataclass(frozen=True, eq=False)
class Demand:
    """The rows of several targets: r linear functions of the eight numbers of the field at t points.

    names: of the rows.  points: (t, 3) m.  select: (r, t, 8).  wanted, within: (r,) SI.
    kind: (r,), rows of one number are of one kind at one target, and share a unit.
    """

    names: tuple[str, ...]
    points: Points
    select: Floats
    wanted: Floats
    within: Floats
    kind: Integers

    def unit(self, jets: Jet) -> Floats:
        """What every coil does to the rows per ampere, (r, c), from unit jets of order 1 or 2."""
        unit: Floats = np.einsum("rte,cte->rc", self.select, eight_numbers(jets[0], jets[1]))
        return unit

    def background(self, system: CoilSystem) -> Floats:
        """The rows (r,) without any current."""
        around = system.background_jets(self.points, 1)
        if around is None:
            return np.zeros(len(self.names))
        rows: Floats = np.einsum("rte,te->r", self.select, eight_numbers(*around))
        return rows

    def scale(self, unit: Floats, limits: Floats) -> Floats:
        """What coils at their limits (c,), infinite ones at 1 A, do to rows of each kind: (r,), root mean square."""
        squares = np.sum((unit * np.where(np.isfinite(limits), limits, 1.0)) ** 2, axis=1)
        means = np.bincount(self.kind, squares) / np.bincount(self.kind)
        scale: Floats = np.sqrt(means)[self.kind]
        scale[scale == 0] = 1.0
        return scale

    def independent(self, scale: Floats, rows: Integers) -> Floats:
        """Combinations (e, r) of some rows, over their scale (r,), that do not depend on each other whatever the field.

        There are as many as these rows have degrees of freedom: a torque along the moment, for one, is none.
        """
        chosen = [np.zeros((0, len(self.names)))]
        for target in range(len(self.points)):
            own = rows[np.any(self.select[rows, target] != 0, axis=1)]
            if own.size:
                # Field and gradient numbers have units of their own: each column is scaled by its largest entry.
                block = self.select[own, target] / scale[own, None]
                size = np.abs(block).max(axis=0)
                U, s, _ = np.linalg.svd(block / np.where(size > 0, size, 1.0), full_matrices=False)
                combined = np.zeros((np.count_nonzero(s > 1e-10 * s[0]), len(self.names)))
                combined[:, own] = U[:, : len(combined)].T / scale[own]
                chosen.append(combined)
        return np.concatenate(chosen)


def demand(targets: Target | Sequence[Target]) -> Demand:
    """The rows of one target or several. Raises InputError for what is none."""
    every = [targets] if isinstance(targets, Target) else list(targets)
    if not every or not all(isinstance(target, Target) for target in every):
        raise InputError("give one Target or several: what is wanted, and where")
    names, select, wanted, within, kinds = [], [], [], [], []
    for t, target in enumerate(every):
        wrench = field_to_wrench(target.magnet)
        maps = {"field": np.eye(8)[:3], "gradient": np.eye(8)[3:], "force": wrench[:3], "torque": wrench[3:]}
        for k, (kind, rows) in enumerate(maps.items()):
            values = target.wanted(kind)
            for i in np.flatnonzero(np.isfinite(values)):
                component = _COMPONENTS.get(kind, ("x", "y", "z"))[i]
                names.append(f"{kind} {component}" + (f" at {t}" if len(every) > 1 else ""))
                row = np.zeros((len(every), 8))
                row[t] = rows[i]
                select.append(row)
                wanted.append(values[i])
                within.append(float(target.within.get(kind, 0.0)))
                kinds.append(len(KINDS) * t + k)
    _, kind_of = np.unique(kinds, return_inverse=True)
    points = np.ascontiguousarray([target.point for target in every], dtype=float)
    return Demand(tuple(names), points, np.array(select), np.array(wanted), np.array(within), kind_of)
