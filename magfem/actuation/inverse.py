"""From what is wanted at magnets to currents: least norm, bounded least squares, least peak, all within limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from scipy.optimize import linprog, lsq_linear

from magfem.actuation.least_distance import TOLERANCE, least_distance
from magfem.actuation.target import Demand, Target, demand
from magfem.errors import ConvergenceError, InputError
from magfem.fields.field import promised_points
from magfem.typing import ArrayLike, Booleans, Floats

if TYPE_CHECKING:
    from magfem.actuation.coil_system import CoilSystem

Method: TypeAlias = Literal["least_norm", "least_squares", "least_peak"]
METHODS = ("least_norm", "least_squares", "least_peak")
Outcome: TypeAlias = Literal["met", "limited", "impossible"]

CUTOFF = 1e-5
"""Singular values below this share of the largest count as zero (dissertation, 2.22)."""

_MET = 1e-7  # of what is wanted


@dataclass(frozen=True, eq=False)
class Conditioning:
    """How well rows can be produced: singular values of the map from currents to them.

    Rows count in units of what the coils do to rows of their kind at their limits. singular_values: largest first.
    rank: how many are above the cutoff.  freedoms: how many there could be with enough coils, at most eight for each
    magnet and five of its wrench.  condition: the largest over the last of those that freedoms and coils allow,
    infinite when that is zero.  lost: (r − rank, r) directions of the rows, of length one in those units, that no
    current produces.
    """

    rows: tuple[str, ...]
    singular_values: Floats
    rank: int
    freedoms: int
    condition: float
    lost: Floats


@dataclass(frozen=True, eq=False)
class CurrentSolution:
    """Currents for what was wanted, and what to think of them.

    currents: (c,) A.  joints: (j,) rad or m.  rows: names of the r rows of all targets.  wanted, achieved: (r,) SI.
    outcome: "met"; "limited", as near as limits allow, which currents beyond them would meet; or "impossible", because
    no currents whatever produce it: see `conditioning.lost`.
    active: names of the coils at their limits.  residual: largest miss of a row beyond what it may be off, in units of
    what the coils do to it at their limits.  converged, iterations: of the method, which is direct for least norm.
    """

    currents: Floats
    joints: Floats
    rows: tuple[str, ...]
    wanted: Floats
    achieved: Floats
    outcome: Outcome
    active: tuple[str, ...]
    conditioning: Conditioning
    residual: float
    converged: bool
    iterations: int

    @property
    def met(self) -> bool:
        return self.outcome == "met"

    @property
    def norm(self) -> float:
        """√(Σ I²), A."""
        return float(np.linalg.norm(self.currents))

    @property
    def peak(self) -> float:
        """max |I|, A."""
        return float(np.abs(self.currents).max())


@dataclass(frozen=True, eq=False)
class Problem:
    """Rows in units of their scale: exact ones A x = b, and |D x − d| ≤ w, with |x| ≤ limits."""

    unit: Floats
    wanted: Floats
    within: Floats
    limits: Floats
    cutoff: float

    @property
    def exact(self) -> Booleans:
        chosen: Booleans = self.within == 0
        return chosen

    def miss(self, x: Floats) -> float:
        """The largest miss of a row beyond what it may be off."""
        return float(np.maximum(np.abs(self.unit @ x - self.wanted) - self.within, 0.0).max())

    @property
    def tolerated(self) -> float:
        """A miss that is rounding."""
        return _MET * max(float(np.abs(self.wanted).max()), float(self.within.max())) + 1e-14

    def reduced(self) -> tuple[Floats, Floats, Floats]:
        """Shortest x₀ (c,) by the truncated pseudo-inverse of exact rows, the rows V (rank, c) it lies in, and N with
        V N = 0 (c, c − rank)."""
        A, b = self.unit[self.exact], self.wanted[self.exact]
        c = A.shape[1]
        if not A.size:
            return np.zeros(c), np.zeros((0, c)), np.eye(c)
        U, s, Vt = np.linalg.svd(A)
        rank = int(np.count_nonzero(s > self.cutoff * s[0])) if s[0] > 0 else 0
        x = Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank])
        return x, Vt[:rank], Vt[rank:].T

    def shortest(self, limits: Floats) -> Floats | None:
        """The x of least norm that meets what can be met of the exact rows and all others; None when there is none."""
        x, _, N = self.reduced()
        inexact, bounded = ~self.exact, np.isfinite(limits)
        D, d, w = self.unit[inexact], self.wanted[inexact], self.within[inexact]
        # ±(D (x + N z) − d) ≤ w and ±(x + N z) ≤ limits, each over its size.
        rows, middle, half = [D / w[:, None]], [(d - D @ x) / w], [np.ones(len(w))]
        rows.append(np.eye(len(x))[bounded] / limits[bounded, None])
        middle.append(-x[bounded] / limits[bounded])
        half.append(np.ones(np.count_nonzero(bounded)))
        G, m, h = np.concatenate(rows) @ N, np.concatenate(middle), np.concatenate(half)
        z = least_distance(np.concatenate([G, -G]), np.concatenate([m - h, -m - h]))
        return None if z is None else np.clip(x + N @ z, -limits, limits)

    def nearest(self) -> tuple[Floats, int, bool]:
        """The x within limits whose misses have the least sum of squares, iterations, and whether they converged.

        A row that may be off has a variable of its own for that.
        """
        free = np.flatnonzero(self.within > 0)
        slack = np.zeros((len(self.wanted), free.size))
        slack[free, np.arange(free.size)] = self.within[free]
        size = np.where(np.isfinite(self.limits), self.limits, 1.0)
        matrix = np.hstack([self.unit * size, slack])
        bound = np.concatenate([self.limits / size, np.ones(free.size)])
        found = lsq_linear(matrix, self.wanted, (-bound, bound), method="bvls" if np.isfinite(bound).all() else "trf")
        x = np.clip(found.x[: len(size)] * size, -self.limits, self.limits)
        return x, int(found.nit), bool(found.status > 0)

    def lowest_peak(self) -> tuple[Floats | None, int]:
        """The x of least max |x|, and of those the shortest; None when none meets the rows."""
        x, V, _ = self.reduced()
        inexact = ~self.exact
        D, d, w = self.unit[inexact], self.wanted[inexact], self.within[inexact]
        c = len(x)
        size = max(float(np.abs(x).max()), 1e-12)
        ones = np.ones((c, 1))
        upper = [np.hstack([np.eye(c), -ones]), np.hstack([-np.eye(c), -ones])]
        upper += [np.hstack([sign * D / w[:, None], np.zeros((len(w), 1))]) for sign in (1.0, -1.0)]
        right = np.concatenate([np.zeros(2 * c), (d / w + 1) / size, (-d / w + 1) / size])
        bounds = [*((-limit / size, limit / size) for limit in self.limits), (0, None)]
        found = linprog(
            np.append(np.zeros(c), 1.0),
            np.concatenate(upper),
            right,
            np.hstack([V, np.zeros((len(V), 1))]) if len(V) else None,
            V @ x / size if len(V) else None,
            bounds,
            method="highs",
        )
        if found.status != 0:
            return None, int(found.nit)
        peak = np.minimum(self.limits, found.fun * size * (1 + 1e-7))
        shortest = self.shortest(peak)
        return (found.x[:c] * size if shortest is None else shortest), int(found.nit)


def find_currents(
    system: CoilSystem,
    targets: Target | Sequence[Target],
    joints: ArrayLike | None = None,
    method: Method = "least_norm",
    limits: ArrayLike | None = None,
    cutoff: float = CUTOFF,
    strict: bool = True,
) -> CurrentSolution:
    """Currents that produce what is wanted, within limits, at stated joints.

    method: "least_norm", the least Σ I² (the truncated pseudo-inverse where its currents are within limits, and
    exactly the least norm within limits where they are not); "least_peak", the least max |I|; "least_squares", the
    least sum of squared misses, each row in units of what the coils do to its kind. When the targets cannot be met, all
    methods give the last, and `outcome` says so.
    limits: (c,) A, or one for all; None takes the coils' own.  cutoff: of singular values, relative.

    Raises InputError for wrong input, OutsideRegionError for targets outside the system's region, and
    ConvergenceError when a solver gave up, unless strict=False.
    """
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    rows, values, bounds = checked_problem(system, targets, joints, limits)
    return solution(system, rows, values, bounds, method, cutoff, strict)


def solution(
    system: CoilSystem, rows: Demand, joints: Floats, limits: Floats, method: Method, cutoff: float, strict: bool
) -> CurrentSolution:
    """As `find_currents`, of what has been checked."""
    unit, background = rows.unit(system.unit_jets(rows.points, joints, 1)), rows.background(system)
    scale = rows.scale(unit, limits)
    problem = Problem(unit / scale[:, None], (rows.wanted - background) / scale, rows.within / scale, limits, cutoff)
    x: Floats | None = None
    iterations, converged = 1, True
    if method == "least_norm":
        x = problem.shortest(limits)
    elif method == "least_peak":
        x, iterations = problem.lowest_peak()
    if x is None or problem.miss(x) > problem.tolerated:
        x, iterations, converged = problem.nearest()
    if strict and not converged:
        raise ConvergenceError(
            f"bounded least squares for {system.name} ended after {iterations} iterations with a miss of "
            f"{problem.miss(x):.2g} of what the coils do; strict=False returns what it has"
        )
    miss = problem.miss(x)
    outcome: Outcome = "met"
    if miss > problem.tolerated:
        unlimited = problem.shortest(np.full(len(limits), np.inf))
        met_somehow = unlimited is not None and problem.miss(unlimited) <= problem.tolerated
        outcome = "limited" if met_somehow else "impossible"
    active = tuple(
        coil.name
        for coil, current, limit in zip(system.coils, x.tolist(), limits.tolist(), strict=True)
        if abs(current) >= limit * (1 - TOLERANCE)
    )
    return CurrentSolution(
        currents=x,
        joints=joints,
        rows=rows.names,
        wanted=rows.wanted,
        achieved=background + unit @ x,
        outcome=outcome,
        active=active,
        conditioning=_conditioning(rows, unit, scale, limits, cutoff),
        residual=miss,
        converged=converged,
        iterations=iterations,
    )


def conditioning(
    system: CoilSystem,
    targets: Target | Sequence[Target],
    joints: ArrayLike | None = None,
    limits: ArrayLike | None = None,
    cutoff: float = CUTOFF,
) -> Conditioning:
    """How well what targets want can be produced, whatever its values.

    A target with field and gradient has the eight rows of one magnet: all can be produced when rank is eight for
    each magnet (Petruska & Nelson, IEEE Trans. Robotics 31, 714 (2015), doi:10.1109/TRO.2015.2424051). A wrench has
    at most five: no torque acts along the moment.
    """
    rows, values, bounds = checked_problem(system, targets, joints, limits)
    unit = rows.unit(system.unit_jets(rows.points, values, 1))
    return _conditioning(rows, unit, rows.scale(unit, bounds), bounds, cutoff)


def _conditioning(rows: Demand, unit: Floats, scale: Floats, limits: Floats, cutoff: float) -> Conditioning:
    U, s, _ = np.linalg.svd(unit / scale[:, None] * np.where(np.isfinite(limits), limits, 1.0))
    rank = int(np.count_nonzero(s > cutoff * s[0])) if s[0] > 0 else 0
    freedoms = len(rows.independent(scale, np.arange(len(scale))))
    last = s[min(freedoms, len(limits)) - 1] if freedoms else 0.0
    return Conditioning(rows.names, s, rank, freedoms, float(s[0] / last) if last > 0 else np.inf, U[:, rank:].T)


def checked_problem(
    system: CoilSystem, targets: Target | Sequence[Target], joints: ArrayLike | None, limits: ArrayLike | None
) -> tuple[Demand, Floats, Floats]:
    """The rows, joint values (j,) and limits (c,) A. Raises InputError, OutsideRegionError."""
    if not system.coils:
        raise InputError(f"{system.name} has no coils, so there are no currents to find")
    rows, values = demand(targets), system.checked_joints(joints)
    promised_points(rows.points, system.region_at(values), "raise")
    return rows, values, checked_limits(system, limits)


def checked_limits(system: CoilSystem, limits: ArrayLike | None) -> Floats:
    """Limits (c,) A, infinite where a coil has none; never beyond a coil's own. Raises InputError."""
    own: Floats = np.array([np.inf if coil.current_limit is None else coil.current_limit for coil in system.coils])
    if limits is None:
        return own
    try:
        given = np.broadcast_to(np.asarray(limits, dtype=float), own.shape)
    except (TypeError, ValueError):
        given = np.zeros(0)
    if not (given.size and np.all(given > 0)):
        raise InputError(f"limits must be positive, in A: one for all coils, or one for each of {len(own)}")
    least: Floats = np.minimum(given, own)
    return least
