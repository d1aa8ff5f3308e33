"""A rod in equilibrium: its shape, what it carries inside, whether it is stable, how it answers to changes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.rod.chain import strains
from magfem.typing import Floats, Points, Vectors

if TYPE_CHECKING:
    from magfem.rod.equilibrium import Equilibrium
    from magfem.rod.factored import Factored
    from magfem.rod.loads import Loads
    from magfem.rod.rod import Rod
    from magfem.rod.sensitivity import Sensitivity


@dataclass(frozen=True, eq=False, repr=False)
class RodState:
    """What `Rod.solve` found, at n cross-sections from the base to the tip.

    All vectors are in world axes. `rod`, `loads` and `factored` are what it was computed from and with. snapped:
    whether the rod has left the branch of the guess, which lost its stability on the way: it turned by more than
    `rod.SNAP`, and not as both shapes answer to the change.
    """

    rod: Rod
    loads: Loads
    found: Equilibrium
    snapped: bool = False

    def __repr__(self) -> str:
        words = "stable" if self.stable else self.found.outcome
        tip = ", ".join(f"{1e3 * value:.4g}" for value in self.positions[-1])
        return f"<RodState: {words}, tip at ({tip}) mm, residual {self.residual:.1e}>"

    @property
    def factored(self) -> Factored:
        """The Hessian at the shape."""
        return self.found.factored

    @property
    def positions(self) -> Points:
        """(n, 3) m; the last is the tip."""
        return self.factored.shape.p

    @cached_property
    def rotations(self) -> Rotation:
        """Of the n cross-sections; their z is along the rod."""
        return Rotation.from_matrix(self.factored.shape.R)

    @property
    def frames(self) -> Floats:
        """(n, 3, 3) the same as matrices, columns the cross-sections' axes."""
        return self.factored.shape.R

    @property
    def arc_lengths(self) -> Floats:
        """(n,) m along the unloaded rod."""
        return self.loads.chain.arc_length

    @property
    def converged(self) -> bool:
        """Whether all loads balance to the tolerance."""
        return self.found.converged

    @property
    def stable(self) -> bool:
        """Whether the equilibrium is a minimum of the energy.

        With loads that have no potential: whether the overdamped rod creeps back to it. That excludes buckling, not the
        flutter of a rod with mass.
        """
        return self.found.outcome == "stable"

    @property
    def unstable_directions(self) -> int:
        """Negative eigenvalues of the energy's Hessian: along how many directions the rod would leave this shape."""
        return self.factored.unstable_directions

    @property
    def residual(self) -> float:
        """Unbalanced loads as an angle, rad."""
        return self.factored.residual

    @property
    def iterations(self) -> int:
        """Of Newton's method."""
        return self.found.iterations

    @property
    def outcome(self) -> str:
        """ "stable", "unstable", "outside", "stalled" or "iterations", as `equilibrium.Equilibrium` explains."""
        return self.found.outcome

    @property
    def energy(self) -> float:
        """Elastic energy plus the potential of the loads, J."""
        return self.factored.shape.elastic_energy + self.factored.acting.energy

    @property
    def internal_force(self) -> Vectors:
        """(n, 3) N that the rest of the rod exerts across each section, loads at the section included."""
        return self.factored.resultant[:, 3:]

    @property
    def internal_moment(self) -> Vectors:
        """(n, 3) N·m about each section's centre."""
        return self.factored.resultant[:, :3]

    @cached_property
    def gauss_strains(self) -> tuple[Floats, Floats]:
        """Arc lengths (k,) m and curvature, strain (k, 6) in the sections' axes, where the flexible links have them."""
        chain = self.loads.chain
        flexible = chain.flexible
        where = chain.arc_length[:-1, None] + chain.length[:, None] * (0.5 + np.array([-0.5, 0.5]) / np.sqrt(3))
        return where[flexible].ravel(), strains(chain, self.factored.shape.twist)[flexible].reshape(-1, 6)

    @cached_property
    def magnet_positions(self) -> Points:
        """(m, 3) m, of the magnets' centres."""
        return self.positions[self.loads.chain.magnet_node]

    @cached_property
    def magnet_rotations(self) -> Rotation:
        """Of the m magnets."""
        return Rotation.from_matrix(self.magnet_frames)

    @cached_property
    def magnet_frames(self) -> Floats:
        """(m, 3, 3) the same as matrices."""
        return self.frames[self.loads.chain.magnet_node]

    @property
    def tip(self) -> RigidTransform:
        """The tip's pose."""
        return RigidTransform.from_components(self.positions[-1], Rotation.from_matrix(self.frames[-1]))

    @cached_property
    def magnet_wrenches(self) -> tuple[Vectors, Vectors]:
        """Force (m, 3) N and torque (m, 3) N·m of field, weight and other magnets on every magnet, about its centre."""
        wrench = self.factored.acting.wrench[self.loads.chain.magnet_node]
        return wrench[:, 3:], wrench[:, :3]

    @cached_property
    def jacobian(self) -> Floats:
        """(m, 6, c + j): every magnet's motion per ampere of every coil and per rad or m of every joint.

        Of the six rows three are its centre's shift, m, and three its turn about the world's axes, rad. Exact, by
        implicit differentiation. Raises InputError without a coil system.
        """
        from magfem.rod.sensitivity import currents_and_joints

        x = self.factored.answer(node_load=currents_and_joints(self))[1][self.loads.chain.magnet_node]
        return np.concatenate([x[:, 3:], x[:, :3]], axis=1)

    def sensitivity(self, parameter: str) -> Sensitivity:
        """Derivatives of the whole shape: "currents", "joints", "base", "youngs_modulus", "shear_modulus", "density",
        "moment", "tip_force" or "tip_moment". Raises InputError for others."""
        from magfem.rod.sensitivity import sensitivity

        return sensitivity(self, parameter)
