"""The rod: sections on a base, and the shape they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import ConvergenceError, InputError, OutsideRegionError
from magfem.rod.sections import FlexibleSection, MagnetSection, positive, three
from magfem.typing import ArrayLike, Floats, Points

if TYPE_CHECKING:
    from magfem.fields.field import Field
    from magfem.rod.applied_field import Driven
    from magfem.rod.chain import Chain
    from magfem.rod.factored import Factored
    from magfem.rod.loads import Loads
    from magfem.rod.state import RodState

Section = FlexibleSection | MagnetSection

SNAP = 0.25
"""rad: smaller turns from a guess are no snap."""

_UNLIKE = 0.5  # of the turn: an answer that is further off is not that of the same branch


@dataclass(frozen=True, eq=False, init=False)
class Rod:
    """Sections from the base to the tip; the base's +z is the rod's axis.

    sections: one or more, at least one of them flexible.  base: the pose of the rod's beginning in the world.
    magnet_fields: with it, the magnets act on each other: a field (T, in the magnet's frame) for every MagnetSection,
    such as its fitted model, or None for a dipole's. Each acts on the others as on dipoles at their centres, whatever
    their `field_points`; hard-magnetic sections take no part.
    """

    sections: tuple[Section, ...]
    base: RigidTransform = field(default_factory=RigidTransform.identity)
    magnet_fields: tuple[Field | None, ...] | None = None

    def __init__(
        self,
        sections: Sequence[Section],
        base: RigidTransform | None = None,
        magnet_fields: Sequence[Field | None] | None = None,
    ) -> None:
        base = RigidTransform.identity() if base is None else base
        if not isinstance(base, RigidTransform) or not base.single:
            raise InputError("a rod's base is one pose, a scipy.spatial.transform.RigidTransform")
        if not isinstance(sections, Sequence) or isinstance(sections, str):
            raise InputError(f"a rod takes a list of sections: Rod([section]), got {type(sections).__name__}")
        for name, value in (
            ("sections", tuple(sections)),
            ("base", base),
            ("magnet_fields", None if magnet_fields is None else tuple(magnet_fields)),
        ):
            object.__setattr__(self, name, value)
        if not any(isinstance(one, FlexibleSection) for one in self.sections):
            raise InputError("a rod needs at least one FlexibleSection")
        for k, one in enumerate(self.sections):
            if not isinstance(one, FlexibleSection | MagnetSection):
                raise InputError(
                    f"a rod is made of FlexibleSection and MagnetSection, got {type(one).__name__} as section {k}"
                )
        if self.magnet_fields is not None and len(self.magnet_fields) != len(self.magnets):
            raise InputError(
                f"the rod has {len(self.magnets)} magnets, and magnet_fields has {len(self.magnet_fields)} entries"
            )
        if self.magnet_fields is not None:
            from magfem.rod.interaction import check_fields

            check_fields(self.magnet_fields)

    @property
    def magnets(self) -> tuple[MagnetSection, ...]:
        """Its magnets, from the base to the tip."""
        return tuple(one for one in self.sections if isinstance(one, MagnetSection))

    @property
    def length(self) -> float:
        """m, without load."""
        return float(sum(one.length for one in self.sections))

    @cached_property
    def chain(self) -> Chain:
        """What the kernels work on."""
        from magfem.rod.chain import chain_of

        return chain_of(self.sections)

    def solve(
        self,
        field: Field | Driven | None = None,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        tip_force: ArrayLike = (0.0, 0.0, 0.0),
        tip_moment: ArrayLike = (0.0, 0.0, 0.0),
        follower: bool = False,
        guess: RodState | None = None,
        *,
        strict: bool = True,
        outside: str = "raise",
        leave_saddles: bool = True,
        tolerance: float = 1e-9,
        most_iterations: int = 400,
    ) -> RodState:
        """The shape in which all loads balance.

        Parameters
        ----------
        field : a Field in T, or (system, currents, joints) of a coil system, or None.
        gravity : (3,) m/s².
        tip_force, tip_moment : (3,) N and N·m on the tip; in world axes, or with `follower` in the tip's.
        guess : the state of a rod with equal sections, to start from; without one, the unloaded shape.
        strict : False returns a state that did not converge, instead of raising.
        outside : "raise" when a magnet ends outside the field's region, or "extrapolate".
        leave_saddles : False returns an unstable equilibrium when Newton's method has found one. Under loads without a
            potential the rod creeps to its equilibrium, which does not leave a saddle that it starts on.
        tolerance : of the residual, rad.

        Raises InputError for what cannot be used, ConvergenceError (residual, iterations), OutsideRegionError.
        """
        from magfem.rod.applied_field import applied_field
        from magfem.rod.equilibrium import find_equilibrium, predicted, relax
        from magfem.rod.first_use import compile_beside
        from magfem.rod.interaction import interaction_of
        from magfem.rod.loads import Loads
        from magfem.rod.state import RodState

        if outside not in ("raise", "extrapolate"):
            raise InputError(f'outside must be "raise" or "extrapolate", got {outside!r}')
        positive("rod", "tolerance", tolerance)
        if type(most_iterations) is not int or most_iterations < 1:
            raise InputError(f"rod: most_iterations must be a whole number from 1, got {most_iterations!r}")
        if guess is not None and not isinstance(guess, RodState):
            raise InputError(f"guess is a RodState that solve returned, got {type(guess).__name__}")
        applied = applied_field(field)
        compile_beside(applied)
        chain = self.chain
        interaction = None
        if self.magnet_fields is not None:
            interaction = interaction_of(self.magnet_fields, np.array([one.moment_vector for one in self.magnets]))
        loads = Loads(
            chain,
            applied,
            three("rod", "gravity", gravity),
            three("rod", "tip_force", tip_force),
            three("rod", "tip_moment", tip_moment),
            follower,
            interaction,
        )
        R, p = self._base
        if guess is None:
            start = chain.rest
        elif guess.rod is self and guess.stable:
            start = predicted(guess.factored, loads)
        else:
            start = _start(guess, chain)
        region = None if loads.applied is None or outside == "extrapolate" else loads.applied.region
        if loads.conservative:

            def allowed(points: Points) -> bool:
                return region is None or bool(np.all(region.contains(points)))

            found = find_equilibrium(chain, loads, R, p, start, tolerance, most_iterations, leave_saddles, allowed)
        else:
            found = relax(chain, loads, R, p, start, tolerance, most_iterations)
        why = ""
        if interaction is not None and outside == "raise":
            nodes = chain.magnet_node
            why = interaction.misplaced(found.factored.shape.R[nodes], found.factored.shape.p[nodes])
        if region is not None and (
            found.outcome == "outside" or not np.all(region.contains(found.factored.acting.points))
        ):
            why = f"is pulled out of the field's region ({region.describe()})"
        if why:
            found = replace(found, outcome="outside")
            if strict:
                raise OutsideRegionError(
                    f"a magnet of the rod {why}; strict=False returns the last shape, "
                    'outside="extrapolate" takes the field there as it is'
                )
        snapped = guess is not None and guess.rod is self and guess.stable and _snapped(guess, found.factored, loads)
        state = RodState(self, loads, found, snapped)
        if strict and not found.converged:
            raise ConvergenceError(
                f"the rod's shape did not converge ({found.outcome}): residual {state.residual:.1e} rad after "
                f"{found.iterations} iterations; strict=False returns it as it is"
            )
        return state

    @cached_property
    def _base(self) -> tuple[Floats, Floats]:
        return np.ascontiguousarray(self.base.rotation.as_matrix()), np.array(self.base.translation)


def _snapped(guess: RodState, found: Factored, loads: Loads) -> bool:
    """Whether the rod has turned by much, and not as it would along one branch of shapes.

    Along one, what the old shape answers to the change of loads and what the new one answers to the change back are
    about opposite, and their mean is the turn, to third order.
    """
    if largest_turn(guess.frames, found.shape.R) <= SNAP:
        return False
    from magfem.rod.equilibrium import answer_to

    turned = Rotation.from_matrix(found.shape.R @ guess.frames.transpose(0, 2, 1)).as_rotvec()
    there, back = answer_to(guess.factored, loads)[1], answer_to(found, guess.loads)[1]
    off = np.linalg.norm(turned - 0.5 * (there - back), axis=1).max()
    return bool(off > _UNLIKE * np.linalg.norm(turned, axis=1).max())


def largest_turn(before: Floats, after: Floats) -> float:
    """rad, the most that any of the frames (n, 3, 3) has turned."""
    least = float(np.einsum("nij,nij->n", before, after).min())
    return float(np.arccos(np.clip((least - 1) / 2, -1.0, 1.0)))


def _start(guess: RodState, chain: Chain) -> Floats:
    """The guess's twists."""
    twist = guess.factored.shape.twist
    if twist.shape != chain.rest.shape or not np.array_equal(guess.loads.chain.flexible, chain.flexible):
        raise InputError("guess is the state of a rod with other sections: start without one")
    return twist
