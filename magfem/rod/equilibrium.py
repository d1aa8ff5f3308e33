"""From loads to a stable shape: Newton's method on the potential energy, with damping where it is not convex.

The unknowns are curvatures, in which even a rod that curls up is near a straight one; every accepted step lowers the
energy, so that no start is too far away. Where the gradient vanishes and the Hessian has negative eigenvalues, the
shape is a saddle: it is left along the direction of the lowest one. Loads without a potential (a moment that keeps
its direction, loads that follow the tip) have no energy to lower: there the rod creeps to its equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from magfem.rod.chain import Chain
from magfem.rod.factored import NEUTRAL, Factored, Shape, elastic_forces, factored, shape_of
from magfem.rod.loads import Acting, Loads
from magfem.typing import Floats, Points

TOLERANCE = 1e-9
"""rad, of the residual."""

_LARGEST_TURN = 1.0  # rad, of any cross-section in one step
_LARGEST_PREDICTED = 0.3  # rad, of any cross-section
_ROUNDING = 1e-11  # of the energy: smaller changes say nothing
_ESCAPES = 8
_SETTLED = 1e-2  # of the tolerance: a step that turns and shifts by less has nothing to mend
_AT_HAND = 1e-2  # rad, of any cross-section
_NEAR = 1e-3  # rad, of the residual
_SLOW = 30  # damped steps after which the lowest eigenvector is tried
_BLOCKED = 12  # steps in a row that the edge of what is allowed has shortened


@dataclass(frozen=True)
class Equilibrium:
    """Where the iteration ended.

    outcome: "stable", "unstable", "outside" (a magnet is pulled out of the field's region), "stalled" (no step lowers
    the energy), "iterations" (too many).
    """

    factored: Factored
    iterations: int
    outcome: str

    @property
    def converged(self) -> bool:
        """Whether all loads balance."""
        return self.outcome in ("stable", "unstable")


@dataclass(frozen=True)
class _Point:
    shape: Shape
    acting: Acting
    energy: float


def find_equilibrium(
    chain: Chain,
    loads: Loads,
    R_base: Floats,
    p_base: Points,
    start: Floats,
    tolerance: float = TOLERANCE,
    most_iterations: int = 400,
    leave_saddles: bool = True,
    allowed: Callable[[Points], bool] | None = None,
) -> Equilibrium:
    """For loads with a potential, the equilibrium that descending from the twists `start` (e, 12) leads to.

    R_base (3, 3), p_base (3,) m: the base's pose.  leave_saddles: go on from an unstable equilibrium to a stable one.
    allowed: whether the dipoles may be at points (d, 3) m; they do not leave what is allowed, unless they start beyond.
    """

    def at(twist: Floats) -> _Point:
        shape = shape_of(chain, twist, R_base, p_base)
        acting = loads.act(shape.R, shape.p)
        return _Point(shape, acting, shape.elastic_energy + acting.energy)

    here = at(start)
    if allowed is not None and not allowed(here.acting.points):
        allowed = None
    damping, iterations, escapes, blocked = 0.0, 0, 0, 0
    while True:
        system = factored(chain, here.shape, here.acting, loads.coupled, damping)
        if not np.isfinite(system.residual):
            return Equilibrium(system, iterations, "stalled")
        if system.residual <= tolerance:
            if damping:
                system = factored(chain, here.shape, here.acting, loads.coupled)
                damping = 0.0
            unstable = system.unstable_directions
            if not unstable or not leave_saddles or escapes == _ESCAPES:
                return Equilibrium(system, iterations, "unstable" if unstable else "stable")
            escapes += 1
            here = _leave_saddle(chain, here, loads, at, escapes)
            continue
        if iterations == most_iterations:
            return Equilibrium(system, iterations, "iterations")
        iterations += 1
        if system.negative and not damping:
            closer = _towards_saddle(system, loads, R_base, p_base)
            if closer is not None:
                here = at(closer)
                continue
        if leave_saddles and damping and iterations % _SLOW == 0:
            here = _leave_saddle(chain, here, loads, at, iterations)
            damping = 0.0
            continue
        if system.negative:
            neutral = not damping and system.residual < _NEAR  # perhaps only a turn that nothing resists
            damping = NEUTRAL if neutral else max(4 * damping, 1e-3)
            continue
        step, moved = system.step(-system.gradient)
        slope = float(np.vdot(system.gradient, step))
        if slope > 0:  # the remainder has made the Hessian indefinite
            damping = max(4 * damping, 1e-3)
            continue
        turn = float(np.abs(moved[:, :3]).max())
        shift = float(np.abs(moved[:, 3:]).max()) / chain.arc_length[-1]
        if not damping and max(turn, shift) <= _SETTLED * tolerance:  # all that is left of the residual is rounding
            return Equilibrium(system, iterations, "unstable" if system.unstable_directions else "stable")
        length = min(1.0, _LARGEST_TURN / turn) if turn > 0 else 1.0
        found, met_the_edge = _search(here, step, slope, length, at, system, allowed)
        blocked = blocked + 1 if met_the_edge else 0
        if blocked == _BLOCKED:
            return Equilibrium(system, iterations, "outside")
        if found is None:
            if damping > 1e8:
                return Equilibrium(system, iterations, "stalled")
            damping = max(16 * damping, 1e-2)
            continue
        here, taken = found
        damping = damping / 8 if taken == 1.0 else damping if taken > 0.2 else max(4 * damping, 1e-3)
        if damping < 1e-4:
            damping = 0.0


def _towards_saddle(system: Factored, loads: Loads, R_base: Floats, p_base: Points) -> Floats | None:
    """Twists nearer to a saddle that is at hand, such as that of a straight rod pressed along its axis; or None.

    Damping, which a Hessian with negative eigenvalues asks for, would take many small steps there.
    """
    step, moved = system.step(-system.gradient)
    if not np.abs(moved[:, :3]).max() < _AT_HAND:
        return None
    twist: Floats = system.shape.twist + step
    shape = shape_of(system.chain, twist, R_base, p_base)
    closer = factored(system.chain, shape, loads.act(shape.R, shape.p), loads.coupled)
    return twist if closer.residual < 0.5 * system.residual else None


def _search(
    here: _Point,
    step: Floats,
    slope: float,
    length: float,
    at: Callable[[Floats], _Point],
    system: Factored,
    allowed: Callable[[Points], bool] | None,
) -> tuple[tuple[_Point, float] | None, bool]:
    """A point along the step that is good enough, and how much of it was taken; None when there is none.

    And whether points were refused because they are not allowed.
    """
    met_the_edge = False
    rounding = _ROUNDING * (system.chain.bending_scale + abs(here.energy))
    for _ in range(8):
        there = at(here.shape.twist + length * step)
        if allowed is not None and not allowed(there.acting.points):
            met_the_edge = True
            length *= 0.5
            continue
        if there.energy <= here.energy + 1e-4 * length * slope:
            return (there, length), met_the_edge
        # At rounding's level, energies cannot tell; the step is then small enough to be trusted.
        if -slope < rounding and there.energy <= here.energy + rounding:
            return (there, length), met_the_edge
        length *= 0.25
    return None, met_the_edge


def _leave_saddle(chain: Chain, here: _Point, loads: Loads, at: Callable[[Floats], _Point], attempt: int) -> _Point:
    """A point of lower energy along the lowest eigenvector of the Hessian (in the elastic metric)."""
    damping = 1e-3
    while True:
        system = factored(chain, here.shape, here.acting, loads.coupled, damping)
        if system.negative == 0:
            break
        damping *= 2
    z = np.random.default_rng(attempt).normal(size=here.shape.twist.shape)
    z[:, [3, 4, 5, 9, 10, 11]] = 0.0
    moved = np.empty(0)
    for _ in range(12):
        z, x = system.step(elastic_forces(chain, z))
        moved = x[:, :3]
        z /= np.abs(moved).max()
    best = here
    for size in (0.02, 0.1, 0.4):
        for sign in (1.0, -1.0):
            there = at(here.shape.twist + sign * size * z)
            if there.energy < best.energy - 1e-15 * abs(best.energy):
                best = there
    return best


def relax(
    chain: Chain,
    loads: Loads,
    R_base: Floats,
    p_base: Points,
    start: Floats,
    tolerance: float = TOLERANCE,
    most_iterations: int = 400,
) -> Equilibrium:
    """The equilibrium that an overdamped rod creeps to: for loads without a potential.

    Implicit Euler steps of K dη/dt = −gradient, K the elastic Hessian, each of one Newton iteration; time steps grow as
    the residual falls, until they are Newton's own (switched evolution relaxation; Kelley & Keyes, SIAM J. Numer. Anal.
    35 (1998) 508).
    """
    twist, damping, before, iterations = start, 1e-2, np.inf, 0
    while True:
        shape = shape_of(chain, twist, R_base, p_base)
        system = factored(chain, shape, loads.act(shape.R, shape.p), loads.coupled, damping)
        if not np.isfinite(system.residual):
            return Equilibrium(system, iterations, "stalled")
        if system.residual <= tolerance:
            system = factored(chain, shape, system.acting, loads.coupled)
            return Equilibrium(system, iterations, "unstable" if system.unstable_directions else "stable")
        if iterations == most_iterations:
            return Equilibrium(system, iterations, "iterations")
        iterations += 1
        while system.negative:
            damping *= 4
            system = factored(chain, shape, system.acting, loads.coupled, damping)
        step, moved = system.step(-system.gradient)
        turn = float(np.abs(moved[:, :3]).max())
        twist = twist + min(1.0, _LARGEST_TURN / 2 / max(turn, 1e-300)) * step
        damping = min(damping * float(np.clip(system.residual / before, 0.1, 2.0)), 1e3) if before < np.inf else damping
        damping = damping if damping > 1e-9 else 0.0
        before = system.residual


def predicted(before: Factored, loads: Loads) -> Floats:
    """Twists (e, 12) near the equilibrium under other loads, by how an equilibrium answers to small ones.

    Where that is much, prediction is of no use: the twists are those of before.
    """
    step, turns = answer_to(before, loads)
    return before.shape.twist + step if np.abs(turns).max() < _LARGEST_PREDICTED else before.shape.twist


def answer_to(before: Factored, loads: Loads) -> tuple[Floats, Floats]:
    """How twists (e, 12) change and nodes turn (e + 1, 3) rad when the loads become `loads`, to first order."""
    change = loads.act(before.shape.R, before.shape.p).wrench - before.acting.wrench
    step, moved = before.step(node_load=change)
    return step, moved[:, :3]
