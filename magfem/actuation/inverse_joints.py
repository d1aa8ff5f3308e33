"""Joints and currents together: the smallest currents that produce what is wanted, wherever joints may put the coils.

As in the dissertation (3.24, 3.25) the joints q are searched and the currents of each follow from a linear problem, but
here that one keeps limits and tolerances, and its value has an exact slope. With slack s that costs ρ,

    φ(q) = min ½ |I|² + ½ ρ |s|²   subject to   rows(I, q) + s = wanted (or within of it), |I| ≤ limits,

is smooth where rows can just not be met as well, and by the envelope theorem ∂φ/∂q = −λ·∂rows/∂q with the multipliers
λ = ρ s. Variable projection; see Golub & Pereyra, Inverse Problems 19, R1 (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

from magfem.actuation.inverse import (
    CUTOFF,
    METHODS,
    CurrentSolution,
    Method,
    Problem,
    checked_problem,
    solution,
)
from magfem.actuation.target import Demand, Target
from magfem.actuation.wrench import eight_numbers
from magfem.errors import ConvergenceError, InputError
from magfem.typing import ArrayLike, Floats

if TYPE_CHECKING:
    from magfem.actuation.coil_system import CoilSystem

_SLACK = 1e-4  # 1/√ρ: what the coils do at their limits, missed by this, costs as much as a coil's limit


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

    Searches from `joints` (None: zero) and from starts − 1 random joint values, by exact derivatives, and keeps the
    best; where targets cannot be met, the joints at which least is missed. At the best joints the currents are those
    of `find_currents` by `method`. Whether the targets lie in the system's region is checked at the first joint values
    and at the last.

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
    searched = [search.end(begin, low, high, iterations) for begin in begins]
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
    """The smallest currents as a function of the joints."""

    def __init__(self, system: CoilSystem, rows: Demand, limits: Floats, first: Floats) -> None:
        self.system, self.rows, self.limits = system, rows, limits
        self.ampere = float(limits[np.isfinite(limits)].max(initial=1.0))  # currents count in these
        self.background = rows.background(system)
        self.scale = rows.scale(rows.unit(system.unit_jets(rows.points, first, 1)), limits)

    def value(self, joints: Floats) -> tuple[float, Floats]:
        """φ and its slope (j,)."""
        rows, system, count = self.rows, self.system, len(self.limits)
        jets = system.unit_jets(rows.points, np.ascontiguousarray(joints), 2)
        matrix = np.hstack([rows.unit(jets) * (self.ampere / self.scale[:, None]), _SLACK * np.eye(len(self.scale))])
        limits = np.append(self.limits / self.ampere, np.full(len(self.scale), np.inf))
        wanted, within = (rows.wanted - self.background) / self.scale, rows.within / self.scale
        y = Problem(matrix, wanted, within, limits, 0.0).shortest(limits)
        assert y is not None, "slack meets every row"
        jet = system.joint_jets(rows.points, y[:count] * self.ampere, np.ascontiguousarray(joints), jets)
        by_joint = np.einsum("rte,jte->rj", rows.select, eight_numbers(*jet)) / self.scale[:, None]
        return 0.5 * float(y @ y), -(y[count:] / _SLACK) @ by_joint

    def end(self, joints: Floats, low: Floats, high: Floats, iterations: int) -> tuple[Floats, int, bool]:
        """Where a search from these joints ends, its iterations, and whether it converged."""
        found = minimize(
            self.value,
            joints,
            jac=True,
            bounds=list(zip(low, high, strict=True)),
            method="L-BFGS-B",
            options={"maxiter": iterations, "ftol": 1e-12, "gtol": 1e-7},
        )
        return np.clip(found.x, low, high), int(found.nit), bool(found.success)
