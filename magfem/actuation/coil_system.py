"""Coil systems: several coils, each by a model per ampere, in one frame; currents in, field out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.errors import InputError
from magfem.fields.field import OUTSIDE, Evaluated, Unit, as_points, promised_points
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Region
from magfem.fields.term_groups import TermGroups
from magfem.fields.terms import Terms, concatenate
from magfem.fields.workspace_region import bounding_ball, surely_holds
from magfem.typing import ArrayLike, Booleans, Floats, Hessians, Jet, Outside, Points, Tensors, Vectors
from magfem.units import format_quantity, quoted

ROWS = ("Bx", "By", "Bz", "dBx_dx", "dBx_dy", "dBx_dz", "dBy_dy", "dBy_dz")
"""What the eight rows of `unit_fields` are: in air these are all of B and its gradient."""

_BLOCK = 16384  # points worked on at a time: every coil takes its own numbers at each

_FIVE = [0, 1, 2, 4, 5]  # of the gradient's nine, row by row: the others follow from div B = 0 and curl B = 0


@dataclass(frozen=True, eq=False, repr=False)
class SystemCoil:
    """A coil in its place.

    own_terms, own_region: its model per ampere and where that holds, in the coil's own frame.  pose: of that frame
    in the system's.  current_limit: A, either way; None when there is none.
    """

    name: str
    own_terms: Terms
    own_region: Region = field(default_factory=Everywhere)
    pose: RigidTransform = field(default_factory=RigidTransform.identity)
    current_limit: float | None = None

    def __post_init__(self) -> None:
        if self.current_limit is not None and not 0 < self.current_limit < np.inf:
            raise InputError(f"coil {quoted(self.name)}: current_limit must be positive and finite")

    def __repr__(self) -> str:
        limit = "no limit" if self.current_limit is None else format_quantity(self.current_limit, "current")
        return f"<SystemCoil {self.name!r}: {self.own_terms.kind.size} sources, {limit}>"

    @cached_property
    def terms(self) -> Terms:
        """The coil's model per ampere, in the system's frame."""
        return self.own_terms.placed(self.pose)

    @cached_property
    def region(self) -> Region:
        """Where the coil's model holds, in the system's frame."""
        return self.own_region if isinstance(self.own_region, Everywhere) else PlacedRegion(self.own_region, self.pose)


@dataclass(frozen=True, repr=False)
class SystemField(Evaluated):
    """The field of a coil system at certain currents, in T; what moves or changes afterwards is another field."""

    name: str
    lowered: Terms
    region: Region
    unit: Unit = "T"

    def __repr__(self) -> str:
        return f"<SystemField of {self.name!r}: {self.lowered.kind.size} sources, {self.region.describe()}>"

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.lowered.jet(points, order)


@dataclass(frozen=True, eq=False, repr=False)
class CoilSystem:
    """Coils in one frame, whose fields add up.

    background: sources whose field (T) is there whatever the currents.  workspace: where the system is used.
    source: where its numbers come from.  report, provenance: what a calibration found out about itself, and of what.

    Points are (..., 3) m in the system's frame, currents (c,) A, or (..., c) for currents of their own at every
    point: leading axes broadcast. `joints` are for coils that move; these are fixed, and it is None or empty.
    `outside` as for any Field: "raise", "nan" or "extrapolate".
    """

    name: str
    coils: tuple[SystemCoil, ...]
    background: Terms | None = None
    workspace: Region = field(default_factory=Everywhere)
    source: str = ""
    report: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.coils and self.background is None:
            raise InputError("a coil system needs at least one coil")
        twice = [name for name, count in Counter(coil.name for coil in self.coils).items() if count > 1]
        if twice:
            raise InputError(f"coils of a system have names of their own, and {quoted(twice[0])} is given twice")

    def __repr__(self) -> str:
        count = len(self.coils)
        return f"<CoilSystem {self.name!r}: {count} coil{'s' * (count != 1)}, {self.region.describe()}>"

    @cached_property
    def region(self) -> Region:
        """Where the field is promised: in the workspace, and where every coil's model holds."""
        ball = bounding_ball(self.workspace)
        limits = [self.workspace] + [
            coil.region for coil in self.coils if ball is None or not surely_holds(coil.region, ball)
        ]
        limits = [limit for limit in limits if not isinstance(limit, Everywhere)]
        return limits[0] if len(limits) == 1 else Intersection(tuple(limits)) if limits else Everywhere()

    def B(
        self, points: ArrayLike, currents: ArrayLike, joints: ArrayLike | None = None, outside: Outside = "raise"
    ) -> Vectors:
        """Flux density (..., 3) T."""
        return self.jet(points, currents, joints, 0, outside)[0]

    def gradient(
        self, points: ArrayLike, currents: ArrayLike, joints: ArrayLike | None = None, outside: Outside = "raise"
    ) -> Tensors:
        """Gradient (..., 3, 3) T/m, [..., i, j] = ∂B_i/∂x_j."""
        return self.jet(points, currents, joints, 1, outside)[1]

    def hessian(
        self, points: ArrayLike, currents: ArrayLike, joints: ArrayLike | None = None, outside: Outside = "raise"
    ) -> Hessians:
        """Hessian (..., 3, 3, 3) T/m², [..., i, j, k] = ∂²B_i/∂x_j∂x_k."""
        return self.jet(points, currents, joints, 2, outside)[2]

    def jet(
        self,
        points: ArrayLike,
        currents: ArrayLike,
        joints: ArrayLike | None = None,
        order: int = 1,
        outside: Outside = "raise",
    ) -> Jet:
        """(B, gradient[, hessian]) of the currents, in one pass.

        Raises InputError for currents that are not one finite number for each coil or exceed a coil's limit,
        OutsideRegionError as `outside` says.
        """
        if order not in (0, 1, 2):
            raise InputError(f"order must be 0, 1 or 2, got {order!r}")
        amperes = self.checked_currents(currents)
        flat, promised, lead = self._checked_points(points, joints, outside)
        try:
            shape = np.broadcast_shapes(lead, amperes.shape[:-1])
        except ValueError:
            raise InputError(
                f"currents {amperes.shape} do not go with points {(*lead, 3)}: give one set for all, or one for each"
            ) from None
        weights = amperes if self.background is None else np.append(amperes, np.ones((*amperes.shape[:-1], 1)), axis=-1)
        if weights.ndim == 1:
            total = self._summed(flat, weights, order, lead)
        else:
            which = np.broadcast_to(np.arange(len(flat)).reshape(lead), shape).ravel()
            every = np.broadcast_to(weights, (*shape, weights.shape[-1])).reshape(-1, weights.shape[-1])
            total = self._summed(flat[which], every, order, shape)
        if not promised.all():
            lost = np.broadcast_to(~promised.reshape(lead), shape)
            for part in total:
                part[lost] = np.nan
        return tuple(total)

    def _summed(self, flat: Points, weights: Floats, order: int, lead: tuple[int, ...]) -> list[Floats]:
        """The jets of all groups at points (n, 3), times a weight for each (g,), or for each at each point (n, g)."""
        total = [np.empty((len(flat), 3**rank)) for rank in range(1, order + 2)]
        for begin in range(0, len(flat), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            for part, jets in zip(total, self._groups.jets(flat[block], order), strict=True):
                if weights.ndim == 1:
                    part[block] = (weights @ jets.reshape(len(weights), -1)).reshape(-1, part.shape[1])
                else:
                    numbers = jets.reshape(*jets.shape[:2], -1)
                    part[block] = np.einsum("ng,gna->na", weights[block], numbers)
        return [part.reshape(lead + (3,) * rank) for rank, part in enumerate(total, start=1)]

    def at(self, currents: ArrayLike, joints: ArrayLike | None = None) -> SystemField:
        """The field of the currents (c,) A: a Field in T, whose terms are evaluated in one call."""
        amperes = self.checked_currents(currents)
        if amperes.ndim != 1:
            raise InputError(f"a field has one current for each coil: shape ({len(self.coils)},), got {amperes.shape}")
        _no_joints(joints)
        parts = [coil.terms.scaled(current) for coil, current in zip(self.coils, amperes.tolist(), strict=True)]
        if self.background is not None:
            parts.append(self.background)
        return SystemField(self.name, concatenate(parts), self.region)

    def unit_fields(self, points: ArrayLike, joints: ArrayLike | None = None, outside: Outside = "raise") -> Floats:
        """What every coil does per ampere: (..., 8, c), rows as `ROWS` names them, T/A and T/(A·m).

        Row by row B and the independent part of its gradient; the background is not in it.
        """
        flat, promised, lead = self._checked_points(points, joints, outside)
        count = len(self.coils)
        rows = np.empty((len(flat), len(ROWS), count))
        for begin in range(0, len(flat), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            B, gradient = (jets[:count] for jets in self._groups.jets(flat[block], 1))
            rows[block, :3] = B.transpose(1, 2, 0)
            rows[block, 3:] = gradient.reshape(count, -1, 9)[:, :, _FIVE].transpose(1, 2, 0)
        rows[~promised] = np.nan
        return rows.reshape(*lead, *rows.shape[1:])

    def checked_currents(self, currents: ArrayLike) -> Floats:
        """Currents (..., c) A as floats; InputError when they are not finite, or beyond a coil's limit."""
        try:
            given = np.asarray(currents)
        except ValueError:  # ragged
            given = np.asarray(None)
        if given.dtype.kind not in "fiub" and given.size:
            raise InputError("currents must be real numbers, in A, one for each coil")
        amperes = given.astype(float)
        if amperes.ndim == 0 or amperes.shape[-1] != len(self.coils):
            raise InputError(
                f"{self.name} has {len(self.coils)} coils: currents must have shape (..., {len(self.coils)}), "
                f"got {amperes.shape}"
            )
        if not np.isfinite(amperes).all():
            raise InputError("currents must be finite numbers")
        excess = np.abs(amperes) > self._limits
        if excess.any():
            k = int(np.nonzero(excess)[-1][0])
            worst = float(np.abs(amperes[..., k]).max())
            raise InputError(
                f"coil {quoted(self.coils[k].name)} of {self.name} bears up to "
                f"{format_quantity(self.coils[k].current_limit or 0.0, 'current')}, got {worst:.6g} A"
            )
        return amperes

    def save(self, path: str | Path) -> None:
        """Write the system file, whole or not at all."""
        from magfem.actuation.system_file import write_system

        write_system(self, Path(path))

    @cached_property
    def _groups(self) -> TermGroups:
        """Every coil's terms on its own, the background's last."""
        background = [] if self.background is None else [self.background]
        return TermGroups([*(coil.terms for coil in self.coils), *background])

    @cached_property
    def _limits(self) -> Floats:
        limits = [np.inf if coil.current_limit is None else coil.current_limit for coil in self.coils]
        return np.array(limits) * (1 + 1e-12)  # what was computed to lie on the limit is allowed

    def _checked_points(
        self, points: ArrayLike, joints: ArrayLike | None, outside: Outside
    ) -> tuple[Points, Booleans, tuple[int, ...]]:
        """Points as (n, 3), which of them get a value, and their leading shape."""
        _no_joints(joints)
        array = as_points(points)
        if array.ndim == 1 and outside in OUTSIDE and (outside == "extrapolate" or self.region.contains(array)):
            return array[None], _ONE, ()  # one point, the short way
        flat = array.reshape(-1, 3)
        return flat, promised_points(flat, self.region, outside), array.shape[:-1]


_ONE = np.ones(1, dtype=bool)


def _no_joints(joints: ArrayLike | None) -> None:
    """Raise InputError for anything but None or an empty sequence."""
    if joints is not None and np.size(joints) > 0:
        raise InputError("this system has no joints: leave joints out, or give an empty sequence")
