"""Joints and currents together: the smallest currents that produce what is wanted, wherever joints may put the coils.

The dissertation (3.24, 3.25) searches the joints alone and takes the currents of each from a pseudo-inverse. Here both
are unknowns of one problem with its exact derivatives, so that limits and tolerances hold at the solution:

    minimise ½ Σ (I/limit)²   subject to   rows(I, q) = wanted, |rows(I, q) − wanted| ≤ within, limits on I and q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares, minimize

from magfem.actuation.inverse import (
    CUTOFF,
    METHODS,
    CurrentSolution,
    Method,
    checked_problem,
    solution,
)
from magfem.actuation.target import Demand, Target
from magfem.actuation.wrench import eight_numbers
from magfem.errors import ConvergenceError, InputError
from magfem.typing import ArrayLike, Floats

if TYPE_CHECKING:
    from magfem.actuation.coil_system import CoilSystem


@dataclass(frozen=True, eq=False)
class JointSolution(CurrentSolution):
    """As `CurrentSolution`, at the best joints found.

    starts: (s, j) joint values that the search began at.  ends: (s, j) where it ended.  norms: (s,) √(Σ I²) A of the
    currents there, NaN where the targets were not met.  converged: whether the search that found the best one did.
    """

    starts: Floats
    ends: Floats
    norms: Floats


def find_currents_and_joints(
    system: CoilSystem,
    targets: Target | Sequence[Target],
    starts: int = 16,
    seed: int | np.random.Generator = 0,
    joints: ArrayLike | None = None,
    method: Method = "least_norm",
    limits: ArrayLike | None = None,
    cutoff: float = CUTOFF,
    iterations: int = 200,
    strict: bool = True,
) -> JointSolution:
    """Currents and joint values of least norm that produce what is wanted, within the limits of both.

    Searches from `joints` (None: zero) and from starts − 1 random joint values, sequential quadratic programming with
    exact derivatives, and keeps the best. When no start meets the targets, the smallest misses are searched instead.
    At the best joints the currents are those of `find_currents` by `method`.
    The targets must lie in the system's region wherever the joints are searched; places are checked at the solution.

    Raises as `find_currents`, and ConvergenceError when no search converged, unless strict=False.
    """
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if not system.joints:
        raise InputError(f"{system.name} has no joints: find_currents finds its currents")
    if starts < 1 or iterations < 1:
        raise InputError("starts and iterations must be 1 or more")
    rows, first, bounds = checked_problem(system, targets, joints, limits)
    search = _Search(system, rows, bounds, first)
    low, high = np.array([joint.limits for joint in system.joints]).T
    random = np.random.default_rng(seed).uniform(low, high, (starts - 1, len(first)))
    begins = np.vstack([first, random])
    searched = [search.smallest(begin, low, high, iterations) for begin in begins]
    found = [solution(system, rows, q, bounds, "least_norm", cutoff, False) for q, _, _ in searched]
    if not any(one.met for one in found):
        searched = [search.nearest(q, low, high, iterations) for q, _, _ in searched]
        found = [solution(system, rows, q, bounds, "least_norm", cutoff, False) for q, _, _ in searched]
    norms = np.array([one.norm if one.met else np.nan for one in found])
    best = int(np.nanargmin(norms) if np.isfinite(norms).any() else np.argmin([one.residual for one in found]))
    end, count, converged = searched[best]
    if strict and not any(done for _, _, done in searched):
        raise ConvergenceError(
            f"no search of {len(begins)} for the joints of {system.name} ended within {iterations} iterations, the "
            f"best misses by {found[best].residual:.2g} of what the coils do; strict=False returns it"
        )
    checked_problem(system, targets, end, limits)  # the region goes with the joints
    final = solution(system, rows, end, bounds, method, cutoff, strict)
    known = {name: getattr(final, name) for name in CurrentSolution.__dataclass_fields__}
    known |= {"converged": converged and final.converged, "iterations": count}
    return JointSolution(**known, starts=begins, ends=np.array([q for q, _, _ in searched]), norms=norms)


class _Search:
    """Rows and their derivatives at unknowns u = (currents over their size, joint values); the last ones are kept."""

    def __init__(self, system: CoilSystem, rows: Demand, limits: Floats, first: Floats) -> None:
        self.system, self.rows, self.limits = system, rows, limits
        self.size = np.where(np.isfinite(limits), limits, 1.0)
        self.c = len(limits)
        self.background = rows.background(system)
        scale = rows.scale(rows.unit(system.unit_jets(rows.points, first, 1)), limits)
        self.exact = rows.independent(scale, np.flatnonzero(rows.within == 0))
        self.inexact = np.flatnonzero(rows.within > 0)
        self.last = np.full(self.c + len(first), np.nan)
        self.value, self.slope = np.empty(0), np.empty((0, 0))

    def at(self, u: Floats) -> tuple[Floats, Floats]:
        """Rows less what is wanted (r,), and their derivative (r, c + j)."""
        if not np.array_equal(u, self.last):
            currents, joints = u[: self.c] * self.size, np.ascontiguousarray(u[self.c :])
            jets = self.system.unit_jets(self.rows.points, joints, 2)
            unit = self.rows.unit(jets)
            moved = eight_numbers(*self.system.joint_jets(self.rows.points, currents, joints, jets))
            by_joint = np.einsum("rte,jte->rj", self.rows.select, moved)
            self.value = self.background + unit @ currents - self.rows.wanted
            self.slope = np.hstack([unit * self.size, by_joint])
            self.last = u.copy()
        return self.value, self.slope

    def begin(self, joints: Floats) -> Floats:
        """Unknowns to begin with: these joints, and the best currents there."""
        there = solution(self.system, self.rows, joints, self.limits, "least_norm", CUTOFF, False)
        return np.concatenate([there.currents / self.size, joints])

    def smallest(self, joints: Floats, low: Floats, high: Floats, iterations: int) -> tuple[Floats, int, bool]:
        """Joints, iterations and success of a search for the least norm."""
        ones, c = self.limits / self.size, self.c
        weight = np.concatenate([np.ones(c), np.zeros(len(joints))])
        constraints = []
        if len(self.exact):
            constraints.append(
                {
                    "type": "eq",
                    "fun": lambda u: self.exact @ self.at(u)[0],
                    "jac": lambda u: self.exact @ self.at(u)[1],
                }
            )
        if self.inexact.size:
            within = self.rows.within[self.inexact]
            for sign in (1.0, -1.0):
                constraints.append(
                    {
                        "type": "ineq",
                        "fun": lambda u, sign=sign: 1.0 - sign * self.at(u)[0][self.inexact] / within,
                        "jac": lambda u, sign=sign: -sign * self.at(u)[1][self.inexact] / within[:, None],
                    }
                )
        found = minimize(
            lambda u: 0.5 * float(u[:c] @ u[:c]),
            self.begin(joints),
            jac=lambda u: weight * u,
            bounds=list(zip([*-ones, *low], [*ones, *high], strict=True)),
            constraints=constraints,
            method="SLSQP",
            options={"maxiter": iterations, "ftol": 1e-10},
        )
        return np.clip(found.x[c:], low, high), int(found.nit), bool(found.success)

    def nearest(self, joints: Floats, low: Floats, high: Floats, iterations: int) -> tuple[Floats, int, bool]:
        """Joints, iterations and success of a search for the least misses."""
        ones, c = self.limits / self.size, self.c
        within = self.rows.within[self.inexact]
        scale = self.rows.scale(self.rows.unit(self.system.unit_jets(self.rows.points, joints, 1)), self.limits)
        size = scale[self.inexact]

        def miss(u: Floats) -> Floats:
            value = self.at(u)[0]
            beyond = np.sign(value[self.inexact]) * np.maximum(np.abs(value[self.inexact]) - within, 0.0)
            return np.concatenate([self.exact @ value, beyond / size])

        def slope(u: Floats) -> Floats:
            value, full = self.at(u)
            active = np.abs(value[self.inexact]) > within
            return np.vstack([self.exact @ full, full[self.inexact] * (active / size)[:, None]])

        lower, upper = np.concatenate([-ones, low]), np.concatenate([ones, high])
        start = np.clip(self.begin(joints), lower + 1e-9 * (upper - lower), upper - 1e-9 * (upper - lower))
        start = np.where(np.isfinite(start), start, 0.0)
        found = least_squares(miss, start, slope, (lower, upper), max_nfev=iterations, x_scale="jac")
        return np.clip(found.x[c:], low, high), int(found.nfev), bool(found.status > 0)
