"""All that acts on a rod: weight, dead loads, magnets in a field, a wrench at the tip, magnets among themselves."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.rod.applied_field import AppliedField
from magfem.rod.chain import Chain
from magfem.rod.interaction import Interaction
from magfem.rod.load_kernel import field_points, node_loads
from magfem.typing import Floats, Integers, Jet, Points


@dataclass(frozen=True, eq=False)
class Acting:
    """What the loads do at one shape.

    energy: J, of what has a potential.  wrench: (e + 1, 6) torque, force.  tangent: (e + 1, 6, 6), the symmetric part
    of −∂wrench/∂x, x = (ω, v).  remainder: (k, k) of the coordinates `Loads.coupled`, what the tangents lack; None when
    there are none.  points: (d, 3) m of the dipoles.  jets: the field there.
    """

    energy: float
    wrench: Floats
    tangent: Floats
    remainder: Floats | None
    points: Points
    jets: Jet


@dataclass(frozen=True, eq=False)
class Loads:
    """Loads on a chain.

    gravity: (3,) m/s².  tip_force, tip_moment: (3,) N, N·m, in world axes, or in the tip's if `follower`.
    """

    chain: Chain
    applied: AppliedField | None = None
    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    tip_force: Floats = field(default_factory=lambda: np.zeros(3))
    tip_moment: Floats = field(default_factory=lambda: np.zeros(3))
    follower: bool = False
    interaction: Interaction | None = None

    @cached_property
    def dead_force(self) -> Floats:
        """(e + 1, 3) N on the nodes."""
        force = self.chain.weight[:, None] * self.gravity + self.chain.force
        if not self.follower:
            force[-1] += self.tip_force
        return force

    @cached_property
    def dead_couple(self) -> Floats:
        """(e + 1, 3, 3) N·m, of −Σ c_ij R_ij."""
        return self.gravity[:, None] * self.chain.end_weight[:, None, :] + self.chain.couple

    @cached_property
    def conservative(self) -> bool:
        """Whether all loads have a potential: a moment that keeps its direction has none, nor one that follows."""
        return not (self.tip_moment.any() or (self.follower and self.tip_force.any()) or self.chain.torque.any())

    @cached_property
    def coupled(self) -> Integers:
        """(k,) coordinates, 6 · node + component of (ω, v), whose loads the symmetric tangents do not describe.

        Of a node they follow each other: all six, or the first three where torques are all there is.
        """
        chain = self.chain
        if self.conservative and self.interaction is None:
            return _NO_COORDINATES
        turning = set(np.flatnonzero(chain.torque.any(axis=1)).tolist())
        moving: set[int] = set()
        if self.follower and self.tip_force.any():
            moving.add(chain.links)
        elif self.tip_moment.any():
            turning.add(chain.links)
        if self.interaction is not None:
            moving |= set(chain.magnet_node.tolist())
        coordinates = [6 * node + i for node in turning - moving for i in range(3)]
        coordinates += [6 * node + i for node in moving for i in range(6)]
        return np.array(sorted(coordinates), dtype=np.int64)

    def act(self, R: Floats, p: Points) -> Acting:
        """On nodes of rotations R (e + 1, 3, 3) at p (e + 1, 3)."""
        chain, nodes = self.chain, p.shape[0]
        points = np.empty((chain.dipole_node.size if self.applied is not None else 0, 3))
        wrench, tangent = np.empty((nodes, 6)), np.empty((nodes, 6, 6))
        if self.applied is not None and points.size:
            field_points(chain.dipole_node, chain.dipole_offset, R, p, points)
            jets = self.applied.jets(points)
        else:
            jets = _NOTHING
        energy = node_loads(
            self.dead_force,
            self.dead_couple,
            chain.dipole_node[: len(points)],
            chain.dipole_offset,
            chain.dipole_moment,
            R,
            p,
            jets[0],
            jets[1],
            jets[2],
            wrench,
            tangent,
        )
        remainder = None
        if self.coupled.size:
            more, remainder = self._beyond(R, p, wrench)
            energy += more
        return Acting(energy, wrench, tangent, remainder, points, jets)

    def _beyond(self, R: Floats, p: Points, wrench: Floats) -> tuple[float, Floats]:
        """Add to `wrench` what has no symmetric tangent of its own; its energy and the coupled nodes' remainder.

        A torque τ that does not turn leaves −½ [τ]× of −∂w/∂x beside the symmetric part that the chain takes, one that
        turns with its section +½ [τ]×; a force F that turns [F]×.
        """
        W = np.zeros((self.coupled.size, self.coupled.size))
        energy = 0.0

        def turns(node: int) -> slice:
            first = int(np.searchsorted(self.coupled, 6 * node))
            return slice(first, first + 3)

        for node in np.flatnonzero(self.chain.torque.any(axis=1)).tolist():
            wrench[node, :3] += self.chain.torque[node]
            W[turns(node), turns(node)] -= 0.5 * cross_matrix(self.chain.torque[node])
        tip = self.chain.links
        torque = self.tip_moment
        if self.follower:
            torque, force = R[-1] @ torque, R[-1] @ self.tip_force
            if force.any():
                wrench[-1, 3:] += force
                first = turns(tip).start
                W[first + 3 : first + 6, turns(tip)] += cross_matrix(force)
        if torque.any():
            wrench[-1, :3] += torque
            W[turns(tip), turns(tip)] += (0.5 if self.follower else -0.5) * cross_matrix(torque)
        if self.interaction is not None:
            nodes = self.chain.magnet_node
            energy, between, tangent = self.interaction.act(R[nodes], p[nodes])
            wrench[nodes] += between
            at = (np.searchsorted(self.coupled, 6 * nodes)[:, None] + np.arange(6)).ravel()
            W[np.ix_(at, at)] += tangent.reshape(at.size, at.size)
        return energy, W


_NO_COORDINATES: Integers = np.empty(0, dtype=np.int64)
_NOTHING: Jet = (np.empty((0, 3)), np.empty((0, 3, 3)), np.empty((0, 3, 3, 3)))
