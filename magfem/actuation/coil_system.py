"""Coil systems: several coils, each by a model per ampere, in one frame; currents in, field out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.actuation.joints import Joint, Joints
from magfem.actuation.moving_coils import MovingCoils
from magfem.actuation.wrench import dipole_wrench
from magfem.actuation.wrench_map import WrenchMap, magnets, wrench_map
from magfem.errors import InputError
from magfem.fields.field import OUTSIDE, Evaluated, Unit, as_points, promised_points
from magfem.fields.region import Everywhere, Intersection, PlacedRegion, Region
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
    in the system's, at joint values zero.  current_limit: A, either way; None when there is none.  joint: the name of
    the joint that carries it.
    """

    name: str
    own_terms: Terms
    own_region: Region = field(default_factory=Everywhere)
    pose: RigidTransform = field(default_factory=RigidTransform.identity)
    current_limit: float | None = None
    joint: str | None = None

    def __post_init__(self) -> None:
        if self.current_limit is not None and not 0 < self.current_limit < np.inf:
            raise InputError(f"coil {quoted(self.name)}: current_limit must be positive and finite")

    def __repr__(self) -> str:
        limit = "no limit" if self.current_limit is None else format_quantity(self.current_limit, "current")
        return f"<SystemCoil {self.name!r}: {self.own_terms.kind.size} sources, {limit}>"

    @cached_property
    def terms(self) -> Terms:
        """The coil's model per ampere, in the system's frame, at joint values zero."""
        return self.own_terms.placed(self.pose)

    @cached_property
    def region(self) -> Region:
        """Where the coil's model holds, in the system's frame, at joint values zero."""
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
    joints: what carries coils that move.

    Points are (..., 3) m in the system's frame, currents (c,) A, or (..., c) for currents of their own at every
    point: leading axes broadcast. Joint values are (j,) rad or m, in the order of `joints`; None is zero.
    `outside` as for any Field: "raise", "nan" or "extrapolate".
    """

    name: str
    coils: tuple[SystemCoil, ...]
    background: Terms | None = None
    workspace: Region = field(default_factory=Everywhere)
    source: str = ""
    report: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    joints: tuple[Joint, ...] = ()

    def __post_init__(self) -> None:
        if not self.coils and self.background is None:
            raise InputError("a coil system needs at least one coil")
        twice = [name for name, count in Counter(coil.name for coil in self.coils).items() if count > 1]
        if twice:
            raise InputError(f"coils of a system have names of their own, and {quoted(twice[0])} is given twice")
        for coil in self.coils:
            try:
                if coil.joint is not None:
                    self._joints.index(coil.joint)
            except InputError as error:
                raise InputError(f"coil {quoted(coil.name)}: {error}") from None

    def __repr__(self) -> str:
        parts = [(len(self.coils), "coil"), (len(self._joints.joints), "joint")]
        counts = ", ".join(f"{count} {noun}{'s' * (count != 1)}" for count, noun in parts if count or noun == "coil")
        return f"<CoilSystem {self.name!r}: {counts}, {self.region.describe()}>"

    @cached_property
    def region(self) -> Region:
        """Where the field is promised at joint values zero: in the workspace, and where every coil's model holds."""
        ball = bounding_ball(self.workspace)
        limits = [self.workspace] + [
            coil.region for coil in self.coils if ball is None or not surely_holds(coil.region, ball)
        ]
        limits = [limit for limit in limits if not isinstance(limit, Everywhere)]
        return limits[0] if len(limits) == 1 else Intersection(tuple(limits)) if limits else Everywhere()

    def region_at(self, joints: ArrayLike | None = None) -> Region:
        """Where the field is promised at these joint values. Raises InputError as `checked_joints`."""
        if not self.joints or joints is None:
            self.checked_joints(joints)
            return self.region
        values = self.checked_joints(joints)
        ball = bounding_ball(self.workspace)
        if ball is not None and self.region is self.workspace:
            # Every model surely holds in a ball about this point, and so they do when turned about it.
            motions = self._moving.motions(values)
            moved = motions[:, :, :3] @ np.array(ball.centre) + motions[:, :, 3] - ball.centre
            if np.abs(moved).max() <= 1e-12 * ball.radius:
                return self.region
        return self.fixed(values).region

    def fixed(self, joints: ArrayLike | None = None) -> CoilSystem:
        """The system with its coils fixed where these joint values carry them: one without joints."""
        values = self.checked_joints(joints)
        if not self.joints:
            return self
        motions = self._moving.motions(values)
        coils = []
        for coil in self.coils:
            if coil.joint is not None:
                motion = motions[self._joints.index(coil.joint)]
                moved = RigidTransform.from_components(motion[:, 3], Rotation.from_matrix(motion[:, :3]))
                coil = replace(coil, pose=moved * coil.pose, joint=None)
            coils.append(coil)
        return replace(self, coils=tuple(coils), joints=())

    def joint_motions(self, joints: ArrayLike | None = None) -> Floats:
        """How every joint's body is moved from where it is at zero: (j, 3, 4), rotation and translation (m)."""
        return self._moving.motions(self.checked_joints(joints))

    def unit_jets(self, points: Points, joints: Floats | None, order: int) -> Jet:
        """What every coil does per ampere: B (c, n, 3), gradient (c, n, 3, 3), hessian (c, n, 3, 3, 3) up to `order`.

        One compiled call for control loops and rods: nothing is checked. points: (n, 3) m, C-contiguous floats in
        the system's frame; joints: (j,) floats.
        """
        return self._moving.jets(points, self._at_zero if joints is None else joints, order, len(self.coils))

    def background_jets(self, points: Points, order: int) -> Jet | None:
        """The background's B (n, 3), gradient, hessian up to `order`, unchecked as `unit_jets`; None without one."""
        return None if self.background is None else self.background.jet(points, order)

    def joint_jets(self, points: Points, currents: Floats, joints: Floats | None, jets: Jet) -> tuple[Floats, Floats]:
        """Derivatives of B (j, n, 3) and gradient (j, n, 3, 3) at fixed points with respect to every joint.

        Exact, for currents (c,) A; `jets` are the `unit_jets` of order 2 at these points and joint values. Unchecked.
        """
        return self._moving.joint_jets(points, currents, self._at_zero if joints is None else joints, jets)

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
        amperes, values = self.checked_currents(currents), self.checked_joints(joints)
        flat, promised, lead = self._checked_points(points, joints, outside)
        try:
            shape = np.broadcast_shapes(lead, amperes.shape[:-1])
        except ValueError:
            raise InputError(
                f"currents {amperes.shape} do not go with points {(*lead, 3)}: give one set for all, or one for each"
            ) from None
        weights = amperes if self.background is None else np.append(amperes, np.ones((*amperes.shape[:-1], 1)), axis=-1)
        if weights.ndim == 1:
            total = self._summed(flat, values, weights, order, lead)
        else:
            which = np.broadcast_to(np.arange(len(flat)).reshape(lead), shape).ravel()
            every = np.broadcast_to(weights, (*shape, weights.shape[-1])).reshape(-1, weights.shape[-1])
            total = self._summed(flat[which], values, every, order, shape)
        if not promised.all():
            lost = np.broadcast_to(~promised.reshape(lead), shape)
            for part in total:
                part[lost] = np.nan
        return tuple(total)

    def _summed(self, flat: Points, joints: Floats, weights: Floats, order: int, lead: tuple[int, ...]) -> list[Floats]:
        """The jets of all groups at points (n, 3), times a weight for each (g,), or for each at each point (n, g)."""
        total = [np.empty((len(flat), 3**rank)) for rank in range(1, order + 2)]
        for begin in range(0, len(flat), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            every = self._moving.jets(flat[block], joints, order, weights.shape[-1])
            for part, jets in zip(total, every, strict=True):
                if weights.ndim == 1:
                    part[block] = (weights @ jets.reshape(len(weights), -1)).reshape(-1, part.shape[1])
                else:
                    numbers = jets.reshape(*jets.shape[:2], -1)
                    part[block] = np.einsum("ng,gna->na", weights[block], numbers)
        return [part.reshape(lead + (3,) * rank) for rank, part in enumerate(total, start=1)]

    def wrench(
        self,
        moment: ArrayLike,
        pose: RigidTransform,
        currents: ArrayLike,
        joints: ArrayLike | None = None,
        outside: Outside = "raise",
    ) -> tuple[Vectors, Vectors]:
        """(force, torque), (..., 3) N and N·m, on magnets of dipole moment (..., 3) A·m² in their own frame.

        pose: of the magnet's frame in the system's, one or as many as there are moments. The torque is about the
        magnet's origin, both are in the system's axes. Raises as `jet` does, and InputError for what is no pose.
        """
        own, places, _ = magnets(moment, pose)
        return dipole_wrench(own, *self.jet(places, currents, joints, 1, outside))

    def wrench_map(
        self,
        moment: ArrayLike,
        pose: RigidTransform,
        currents: ArrayLike,
        joints: ArrayLike | None = None,
        outside: Outside = "raise",
    ) -> WrenchMap:
        """As `wrench`, for currents (c,), with the 6 × c map from currents and all other derivatives."""
        return wrench_map(self, moment, pose, currents, joints, outside)

    def at(self, currents: ArrayLike, joints: ArrayLike | None = None) -> SystemField:
        """The field of the currents (c,) A at these joint values: a Field in T, evaluated in one call."""
        amperes = self.checked_currents(currents)
        if amperes.ndim != 1:
            raise InputError(f"a field has one current for each coil: shape ({len(self.coils)},), got {amperes.shape}")
        coils = self.fixed(joints).coils
        parts = [coil.terms.scaled(current) for coil, current in zip(coils, amperes.tolist(), strict=True)]
        if self.background is not None:
            parts.append(self.background)
        return SystemField(self.name, concatenate(parts), self.region_at(joints))

    def unit_fields(self, points: ArrayLike, joints: ArrayLike | None = None, outside: Outside = "raise") -> Floats:
        """What every coil does per ampere: (..., 8, c), rows as `ROWS` names them, T/A and T/(A·m).

        Row by row B and the independent part of its gradient; the background is not in it.
        """
        values = self.checked_joints(joints)
        flat, promised, lead = self._checked_points(points, joints, outside)
        count = len(self.coils)
        rows = np.empty((len(flat), len(ROWS), count))
        for begin in range(0, len(flat), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            B, gradient = self.unit_jets(flat[block], values, 1)
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

    def checked_joints(self, joints: ArrayLike | None) -> Floats:
        """Joint values (j,) rad or m as floats, zeros for None.

        Raises InputError for another shape, for what is not finite, and beyond a joint's limits.
        """
        return self._joints.checked(joints, self.name)

    def save(self, path: str | Path) -> None:
        """Write the system file, whole or not at all."""
        from magfem.actuation.system_file import write_system

        write_system(self, Path(path))

    @cached_property
    def _joints(self) -> Joints:
        return Joints(self.joints)

    @cached_property
    def _at_zero(self) -> Floats:
        return np.zeros(len(self.joints))

    @cached_property
    def _moving(self) -> MovingCoils:
        """Every coil's terms on its own, the background's last."""
        background = [] if self.background is None else [self.background]
        carrier = [-1 if coil.joint is None else self._joints.index(coil.joint) for coil in self.coils]
        return MovingCoils([*(coil.terms for coil in self.coils), *background], self._joints, carrier)

    @cached_property
    def _limits(self) -> Floats:
        limits = [np.inf if coil.current_limit is None else coil.current_limit for coil in self.coils]
        return np.array(limits) * (1 + 1e-12)  # what was computed to lie on the limit is allowed

    def _checked_points(
        self, points: ArrayLike, joints: ArrayLike | None, outside: Outside
    ) -> tuple[Points, Booleans, tuple[int, ...]]:
        """Points as (n, 3), which of them get a value, and their leading shape."""
        array, region = as_points(points), self.region_at(joints)
        if array.ndim == 1 and outside in OUTSIDE and (outside == "extrapolate" or region.contains(array)):
            return np.ascontiguousarray(array)[None], _ONE, ()  # one point, the short way
        flat = np.ascontiguousarray(array.reshape(-1, 3))
        return flat, promised_points(flat, region, outside), array.shape[:-1]


_ONE = np.ones(1, dtype=bool)
