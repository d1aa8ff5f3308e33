"""Terms: the flat array of sources that every field model lowers to, and the one function that evaluates it.

A *source* is a loop or a set of solid harmonics, with a centre, a frame and a radius; it owns a run of
*coefficients*. Concatenating two `Terms` adds their fields, so systems and sums stay one array and one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from magfem.compiled import kernel
from magfem.constants import MU_0
from magfem.fields.loop import add_loop
from magfem.fields.packing import unpack_gradient, unpack_hessian
from magfem.fields.solid_harmonics import Complexes, add_harmonics, schmidt_scale
from magfem.threads import in_chunks
from magfem.typing import Floats, Integers, Jet, Points

LOOP, HARMONIC = 0, 1
_PARALLEL_FROM = 4096  # points; below, starting threads costs more than it saves


@dataclass(frozen=True)
class Terms:
    """n sources in one frame, with c coefficients altogether.

    kind: (n,) LOOP or HARMONIC.  centre: (n, 3) m.  frame: (n, 3, 3), columns are the source's axes.
    radius: (n,) m, a loop's radius or the harmonics' reference radius.
    start: (n + 1,), source k owns the coefficients start[k]:start[k + 1].
    degree, order: (c,), zero for loops.  sine: (c,), true for the h_lm.
    coefficient: (c,), A (turns) for loops, T (T/A) for harmonics in Schmidt's semi-normalisation.
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

    @property
    def moment(self) -> Floats:
        """Magnetic dipole moment (3,) A·m² (A·m²/A for fields per ampere)."""
        total = np.zeros(3)
        for k in range(self.kind.size):
            run = slice(self.start[k], self.start[k + 1])
            if self.kind[k] == LOOP:
                local = np.array([0.0, 0.0, np.pi * self.radius[k] ** 2 * self.coefficient[run].sum()])
            else:
                local = np.zeros(3)
                for m, sine, value in zip(self.order[run], self.sine[run], _of_degree_one(self, run), strict=True):
                    local[2 if m == 0 else (1 if sine else 0)] += value
                local *= 4 * np.pi / MU_0 * self.radius[k] ** 3
            total += self.frame[k] @ local
        return total

    def jet(self, points: Points, order: int = 1) -> Jet:
        """(B, gradient[, hessian]) at `points` (n, 3) m; `order` 0 gives B alone, 1 and 2 the derivatives."""
        points = np.ascontiguousarray(points, dtype=float)
        count = points.shape[0]
        results = [np.empty((count, *(3,) * rank)) for rank in range(1, order + 2)]
        work = [
            array if rank <= order else np.empty((0, *(3,) * (rank + 1)))
            for rank, array in enumerate(results + [np.empty(0)] * (2 - order))
        ]
        coefficients = _complex_coefficients(self)

        def run(chunk: slice) -> None:
            parts = [array[chunk] if rank <= order else array for rank, array in enumerate(work)]
            _evaluate(
                points[chunk],
                self.kind,
                self.centre,
                self.frame,
                self.radius,
                self.start,
                self.degree,
                self.order,
                self.coefficient,
                coefficients,
                order,
                *parts,
            )

        in_chunks(run, count, _PARALLEL_FROM)
        return tuple(results)


def loops(centre: Points, radius: Floats, current: Floats, frame: Floats | None = None) -> Terms:
    """Circular loops: centres (n, 3) m, radii (n,) m, currents (n,) A, one common frame (3, 3) (default: world)."""
    centre = np.atleast_2d(np.asarray(centre, dtype=float))
    n = centre.shape[0]
    zeros = np.zeros(n, dtype=np.int64)
    return Terms(
        kind=np.full(n, LOOP, dtype=np.int64),
        centre=centre,
        frame=np.tile(np.eye(3) if frame is None else frame, (n, 1, 1)),
        radius=np.broadcast_to(np.asarray(radius, dtype=float), (n,)).copy(),
        start=np.arange(n + 1, dtype=np.int64),
        degree=zeros,
        order=zeros,
        sine=zeros,
        coefficient=np.broadcast_to(np.asarray(current, dtype=float), (n,)).copy(),
    )


def harmonics(
    radius: float,
    degree: Sequence[int],
    order: Sequence[int],
    sine: Sequence[bool],
    coefficient: Floats,
    centre: Points | None = None,
    frame: Floats | None = None,
) -> Terms:
    """One centre's exterior solid harmonics: reference radius m, and per coefficient (T) its degree, order, part."""
    c = len(degree)
    return Terms(
        kind=np.array([HARMONIC], dtype=np.int64),
        centre=np.zeros((1, 3)) if centre is None else np.asarray(centre, dtype=float).reshape(1, 3),
        frame=(np.eye(3) if frame is None else np.asarray(frame, dtype=float)).reshape(1, 3, 3),
        radius=np.array([radius], dtype=float),
        start=np.array([0, c], dtype=np.int64),
        degree=np.asarray(degree, dtype=np.int64),
        order=np.asarray(order, dtype=np.int64),
        sine=np.asarray(sine, dtype=np.int64),
        coefficient=np.broadcast_to(np.asarray(coefficient, dtype=float), (c,)).copy(),
    )


def concatenate(parts: Sequence[Terms]) -> Terms:
    """All sources of all parts: the sum of their fields."""
    offsets = np.cumsum([0] + [part.coefficient.size for part in parts])
    starts = [part.start[:-1] + offset for part, offset in zip(parts, offsets, strict=False)]
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("kind", "centre", "frame", "radius", "degree", "order", "sine", "coefficient")
    }
    return Terms(start=np.concatenate([*starts, offsets[-1:]]).astype(np.int64), **joined)


def frame_about(direction: Floats, azimuth: Floats | None = None) -> Floats:
    """A right-handed frame (3, 3) whose third column is `direction` and whose first lies towards `azimuth`.

    Without `azimuth` the first column is any perpendicular, chosen the same way every time.
    """
    z = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    towards = np.eye(3)[np.argmin(np.abs(z))] if azimuth is None else np.asarray(azimuth, dtype=float)
    x = towards - (towards @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _of_degree_one(terms: Terms, run: slice) -> Floats:
    """Coefficients of degree one, zero elsewhere: the dipole part of a run."""
    return np.where(terms.degree[run] == 1, terms.coefficient[run], 0.0)


def _complex_coefficients(terms: Terms) -> Complexes:
    """C_lm of every coefficient (c,); loops take no part."""
    owner = np.repeat(np.arange(terms.kind.size), np.diff(terms.start))
    scale = np.array([schmidt_scale(n, m) for n, m in zip(terms.degree.tolist(), terms.order.tolist(), strict=True)])
    part = np.where(terms.sine == 1, -1j, 1.0)
    complexes: Complexes = terms.radius[owner] * scale * part * terms.coefficient
    return complexes


@kernel
def _evaluate(
    points: Points,
    kind: Integers,
    centre: Points,
    frame: Floats,
    radius: Floats,
    start: Integers,
    degree: Integers,
    harmonic_order: Integers,
    current: Floats,
    coefficients: Complexes,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Sum all sources at all points; sources that follow each other in one frame are rotated together."""
    size = 0 if degree.size == 0 else degree.max() + 5
    table = np.empty((size, size), dtype=np.complex128)
    local = np.zeros(15)
    total = np.zeros(15)
    work = np.zeros((3, 3, 3))
    half = np.zeros((3, 3, 3))
    for i in range(points.shape[0]):
        total[:] = 0.0
        local[:] = 0.0
        for k in range(kind.size):
            dx = points[i, 0] - centre[k, 0]
            dy = points[i, 1] - centre[k, 1]
            dz = points[i, 2] - centre[k, 2]
            f = frame[k]
            x = f[0, 0] * dx + f[1, 0] * dy + f[2, 0] * dz
            y = f[0, 1] * dx + f[1, 1] * dy + f[2, 1] * dz
            z = f[0, 2] * dx + f[1, 2] * dy + f[2, 2] * dz
            a, b = start[k], start[k + 1]
            if kind[k] == LOOP:
                add_loop(x, y, z, radius[k], current[a], order, local)
            else:
                add_harmonics(
                    x,
                    y,
                    z,
                    radius[k],
                    degree[a:b],
                    harmonic_order[a:b],
                    coefficients[a:b],
                    order,
                    table,
                    local,
                )
            if k + 1 == kind.size or not _same_frame(frame, k, k + 1):
                _add_rotated(f, local, order, work, half, total)
                local[:] = 0.0
        B[i, 0], B[i, 1], B[i, 2] = total[0], total[1], total[2]
        if order > 0:
            unpack_gradient(total, gradient[i])
        if order > 1:
            unpack_hessian(total, hessian[i])


@kernel
def _same_frame(frame: Floats, k: int, other: int) -> bool:
    for i in range(3):
        for j in range(3):
            if frame[k, i, j] != frame[other, i, j]:
                return False
    return True


@kernel
def _add_rotated(f: Floats, local: Floats, order: int, work: Floats, half: Floats, total: Floats) -> None:
    """Add a jet of the frame f (columns: its axes) to `total`, turned into the common frame."""
    if f[0, 0] == 1.0 and f[1, 1] == 1.0 and f[2, 2] == 1.0:
        for i in range(3 if order == 0 else 8 if order == 1 else 15):
            total[i] += local[i]
        return
    for i in range(3):
        total[i] += f[i, 0] * local[0] + f[i, 1] * local[1] + f[i, 2] * local[2]
    if order > 0:
        unpack_gradient(local, work[0])
        for i in range(2):
            for b in range(3):
                half[0, i, b] = f[i, 0] * work[0, 0, b] + f[i, 1] * work[0, 1, b] + f[i, 2] * work[0, 2, b]
        for n, (i, j) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))):
            total[3 + n] += f[j, 0] * half[0, i, 0] + f[j, 1] * half[0, i, 1] + f[j, 2] * half[0, i, 2]
    if order > 1:
        unpack_hessian(local, work)
        for n, (i, j, k) in enumerate(((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 1), (0, 1, 2), (1, 1, 1), (1, 1, 2))):
            value = 0.0
            for a in range(3):
                for b in range(3):
                    for c in range(3):
                        value += f[i, a] * f[j, b] * f[k, c] * work[a, b, c]
            total[8 + n] += value
