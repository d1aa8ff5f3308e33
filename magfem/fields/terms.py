"""Terms: the flat array of sources that every field model lowers to, and the one call that evaluates it.

A *source* has a kind (`term_kinds`), a centre, a frame and a radius; it owns a run of *coefficients* and, if it is a
path, a run of *nodes*. Concatenating two `Terms` adds their fields, so systems and sums stay one array and one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.packed import Packed, pack
from magfem.fields.packing import BLOCK
from magfem.fields.term_kinds import CHARGE_DISC, HARMONIC, INTERIOR, LOOP, OBLATE, PATH
from magfem.fields.terms_kernel import evaluate
from magfem.threads import in_chunks
from magfem.typing import ArrayLike, Floats, Integers, Jet, Points

HIGHEST_DEGREE = 80
"""Of harmonics: factorials of twice this, and of the derivatives, still fit a float."""

PARALLEL_FROM = 4096
"""Points for each thread; below, starting threads costs more than it saves."""

_NEUTRAL = 1e-9  # of the discs' charges taken one by one: their sum must be below
_NONE: tuple[Floats, Floats] = (np.empty((0, 3, 3)), np.empty((0, 3, 3, 3)))


@dataclass(frozen=True, eq=False)
class Terms:
    """n sources in one frame, with c coefficients and v nodes altogether.

    kind: (n,) of `term_kinds`.  centre: (n, 3) m.  frame: (n, 3, 3), columns are the source's axes.
    radius: (n,) m, of a loop or disc, or the harmonics' reference radius.
    start: (n + 1,), source k owns the coefficients start[k]:start[k + 1].
    degree, order: (c,), zero but for harmonics.  sine: (c,), true for the h_lm, and for imaginary parts of OBLATE.
    coefficient: (c,), A (turns) for loops and paths, T (T/A) for discs and for harmonics, these in Schmidt's
    semi-normalisation.
    node_start: (n + 1,), source k owns the nodes node_start[k]:node_start[k + 1].  nodes: (v, 3) m, in its frame.
    """

    kind: Integers
    centre: Points
    frame: Floats
    radius: Floats
    start: Integers
    degree: Integers
    order: Integers
    sine: Integers
    coefficient: Floats
    node_start: Integers
    nodes: Points

    def __add__(self, other: Terms) -> Terms:
        return concatenate([self, other])

    def with_coefficients(self, coefficient: Floats) -> Terms:
        """The same sources with other coefficients (c,)."""
        return replace(self, coefficient=np.asarray(coefficient, dtype=float))

    def scaled(self, factor: float) -> Terms:
        """The field times `factor`."""
        return self.with_coefficients(self.coefficient * factor)

    def placed(self, pose: RigidTransform) -> Terms:
        """The sources moved by `pose` from their frame to the frame it maps to."""
        rotation = pose.rotation.as_matrix()
        return replace(self, centre=pose.apply(self.centre), frame=rotation @ self.frame)

    def without_zeros(self) -> Terms:
        """The same field without the sources whose coefficients are all zero; one source stays."""
        alive = np.zeros(self.kind.size, dtype=bool)
        alive[self.owner[self.coefficient != 0.0]] = True
        if alive.all():
            return self
        kept = np.flatnonzero(alive)
        return concatenate([self.source(int(k)) for k in kept]) if kept.size else self.source(0)

    def source(self, k: int) -> Terms:
        """Source `k` alone."""
        own, nodes = slice(self.start[k], self.start[k + 1]), slice(self.node_start[k], self.node_start[k + 1])
        return Terms(
            kind=self.kind[k : k + 1],
            centre=self.centre[k : k + 1],
            frame=self.frame[k : k + 1],
            radius=self.radius[k : k + 1],
            start=np.array([0, own.stop - own.start]),
            degree=self.degree[own],
            order=self.order[own],
            sine=self.sine[own],
            coefficient=self.coefficient[own],
            node_start=np.array([0, nodes.stop - nodes.start]),
            nodes=self.nodes[nodes],
        )

    @property
    def owner(self) -> Integers:
        """The source (c,) of every coefficient."""
        return np.repeat(np.arange(self.kind.size), np.diff(self.start))

    @property
    def net_charge(self) -> float:
        """Sum of the discs' magnetic charges over the sum of their sizes; zero for a field that exists."""
        discs = self.kind[self.owner] == CHARGE_DISC
        charges = self.coefficient[discs] * self.radius[self.owner[discs]] ** 2
        total = float(np.abs(charges).sum())
        return float(charges.sum()) / total if total > 0 else 0.0

    def check_sources(self) -> None:
        """Raise InputError for what cannot be a field in air: magnetic charge, monopoles, open or endless paths."""
        if abs(self.net_charge) > _NEUTRAL:
            raise InputError(
                f"magnetic charge discs must cancel, a monopole does not exist: {self.net_charge:.1%} of their charge "
                "remains"
            )
        harmonic = np.isin(self.kind[self.owner], (HARMONIC, INTERIOR, OBLATE))
        lowest = np.where((self.kind[self.owner] == OBLATE) & (self.sine == 1), 0, 1)
        wrong = (self.degree < lowest) | (self.degree > HIGHEST_DEGREE) | (self.order < 0) | (self.order > self.degree)
        if np.any(harmonic & wrong):
            raise InputError(
                f"harmonics have degrees from 1 to {HIGHEST_DEGREE} (there is no monopole) and orders between 0 and "
                "their degree"
            )
        if np.any((self.kind[self.owner] == OBLATE) & (self.order != 0)):
            raise InputError("oblate sources are axial: their harmonics have order 0")
        if np.any((self.kind == PATH) & (np.diff(self.node_start) < 3)):
            raise InputError("a closed path needs three nodes or more")

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m² (A·m²/A for fields per ampere) of all sources but those far away."""
        total = np.zeros(3)
        for k in range(self.kind.size):
            run = slice(self.start[k], self.start[k + 1])
            local, values = np.zeros(3), self.coefficient[run]
            if self.kind[k] == LOOP:
                local[2] = np.pi * self.radius[k] ** 2 * values.sum()
            elif self.kind[k] == HARMONIC:
                dipole = np.where(self.degree[run] == 1, values, 0.0)
                for axis, chosen in enumerate(((1, 0), (1, 1), (0, 0))):
                    local[axis] = dipole[(self.order[run] == chosen[0]) & (self.sine[run] == chosen[1])].sum()
                local *= 4 * np.pi / MU_0 * self.radius[k] ** 3
            elif self.kind[k] == OBLATE:
                # 1/R = 1/r + i a cos θ/r² + …: degree 0 gives a dipole by its imaginary part, degree 1 by its real one.
                real, degree = self.sine[run] == 0, self.degree[run]
                local[2] = values[real & (degree == 1)].sum() + values[~real & (degree == 0)].sum()
                local *= 4 * np.pi / MU_0 * self.radius[k] ** 3
            elif self.kind[k] == PATH:
                nodes = self.nodes[self.node_start[k] : self.node_start[k + 1]]
                local = 0.5 * values.sum() * np.cross(nodes, np.roll(nodes, -1, axis=0)).sum(axis=0)
            elif self.kind[k] == CHARGE_DISC:
                total += values.sum() / MU_0 * np.pi * self.radius[k] ** 2 * self.centre[k]
            total += self.frame[k] @ local
        return total

    @cached_property
    def packed(self) -> Packed:
        """What the kernel reads."""
        return pack(self)

    def jet(self, points: Points, order: int = 1) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m; `order` 0 gives B alone, 1 and 2 the derivatives."""
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        B = np.empty((count, 3))
        gradient = np.empty((count, 3, 3)) if order > 0 else _NONE[0]
        hessian = np.empty((count, 3, 3, 3)) if order > 1 else _NONE[1]
        packed = self.packed

        def run(chunk: slice) -> None:
            evaluate(points[chunk], *packed, order, B[chunk], gradient[chunk], hessian[chunk])

        if count < 2 * PARALLEL_FROM:
            evaluate(points, *packed, order, B, gradient, hessian)
        else:
            in_chunks(run, count, PARALLEL_FROM, BLOCK)
        return (B, gradient, hessian)[: order + 1]


def loops(centre: Points, radius: ArrayLike, current: ArrayLike, frame: Floats | None = None) -> Terms:
    """Circular loops: centres (n, 3) m, radii (n,) m, currents (n,) A, one common frame (3, 3) (default: world)."""
    return _singles(LOOP, centre, radius, current, frame)


def charge_discs(centre: Points, radius: ArrayLike, density: ArrayLike, frame: Floats | None = None) -> Terms:
    """Discs of magnetic charge: centres (n, 3) m, radii (n,) m, densities (n,) T, one common frame (3, 3)."""
    return _singles(CHARGE_DISC, centre, radius, density, frame)


def _singles(kind: int, centre: Points, radius: ArrayLike, value: ArrayLike, frame: Floats | None) -> Terms:
    """Sources of one coefficient each, all in one frame."""
    centre = np.atleast_2d(np.asarray(centre, dtype=float))
    n = centre.shape[0]
    zeros = np.zeros(n, dtype=np.int64)
    return Terms(
        kind=np.full(n, kind, dtype=np.int64),
        centre=centre,
        frame=np.tile(np.eye(3) if frame is None else frame, (n, 1, 1)),
        radius=np.broadcast_to(np.asarray(radius, dtype=float), (n,)).copy(),
        start=np.arange(n + 1, dtype=np.int64),
        degree=zeros,
        order=zeros,
        sine=zeros,
        coefficient=np.broadcast_to(np.asarray(value, dtype=float), (n,)).copy(),
        node_start=np.zeros(n + 1, dtype=np.int64),
        nodes=np.empty((0, 3)),
    )


def closed_path(
    nodes: Points, current: float = 1.0, centre: Points | None = None, frame: Floats | None = None
) -> Terms:
    """A closed conductor through `nodes` (v, 3) m of its frame, in the direction of the current (A)."""
    nodes = np.asarray(nodes, dtype=float)
    source = _singles(PATH, np.zeros(3) if centre is None else centre, 1.0, current, frame)
    return replace(source, node_start=np.array([0, len(nodes)]), nodes=nodes)


def harmonics(
    radius: float,
    degree: Sequence[int],
    order: Sequence[int],
    sine: Sequence[bool],
    coefficient: ArrayLike,
    centre: Points | None = None,
    frame: Floats | None = None,
    kind: int = HARMONIC,
) -> Terms:
    """One centre's solid harmonics: reference radius m, and per coefficient (T) its degree, order, part.

    kind: HARMONIC (exterior), INTERIOR or OBLATE.
    """
    c = len(degree)
    return Terms(
        kind=np.array([kind], dtype=np.int64),
        centre=np.zeros((1, 3)) if centre is None else np.asarray(centre, dtype=float).reshape(1, 3),
        frame=(np.eye(3) if frame is None else np.asarray(frame, dtype=float)).reshape(1, 3, 3),
        radius=np.array([radius], dtype=float),
        start=np.array([0, c], dtype=np.int64),
        degree=np.asarray(degree, dtype=np.int64),
        order=np.asarray(order, dtype=np.int64),
        sine=np.asarray(sine, dtype=np.int64),
        coefficient=np.broadcast_to(np.asarray(coefficient, dtype=float), (c,)).copy(),
        node_start=np.zeros(2, dtype=np.int64),
        nodes=np.empty((0, 3)),
    )


def uniform(B: ArrayLike, radius: float = 1.0) -> Terms:
    """A uniform field B (3,) T, as interior harmonics of degree 1: B = −∇V with V = −B·x."""
    x, y, z = np.asarray(B, dtype=float)
    return harmonics(radius, [1, 1, 1], [1, 1, 0], [False, True, False], [-x, -y, -z], kind=INTERIOR)


def concatenate(parts: Sequence[Terms]) -> Terms:
    """All sources of all parts: the sum of their fields."""
    owned = {"start": "coefficient", "node_start": "nodes"}
    joined: dict[str, Any] = {}
    for start, array in owned.items():
        offsets = np.cumsum([0] + [len(getattr(part, array)) for part in parts])
        starts = [getattr(part, start)[:-1] + offset for part, offset in zip(parts, offsets, strict=False)]
        joined[start] = np.concatenate([*starts, offsets[-1:]]).astype(np.int64)
    names = ("kind", "centre", "frame", "radius", "degree", "order", "sine", "coefficient", "nodes")
    joined |= {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Terms(**joined)


def frame_about(direction: Floats, azimuth: Floats | None = None) -> Floats:
    """A right-handed frame (3, 3) whose third column is `direction` and whose first lies towards `azimuth`.

    Without `azimuth` the first column is any perpendicular, chosen the same way every time.
    """
    z = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    towards = np.eye(3)[np.argmin(np.abs(z))] if azimuth is None else np.asarray(azimuth, dtype=float)
    x = towards - (towards @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
