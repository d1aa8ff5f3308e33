"""The energy's Hessian at one shape, factored: how the rod answers to loads, and whether it is stable."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np

from magfem.rod import chain_kernel
from magfem.rod.chain import Chain
from magfem.rod.loads import Acting
from magfem.typing import Floats, Integers, Points

NEUTRAL = 1e-7
"""Eigenvalues of less, in units of the elastic Hessian, are those of a turn that no load resists."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Twists (e, 12), and the poses that follow: R (e + 1, 3, 3), p (e + 1, 3) m of nodes, and between two screws."""

    twist: Floats
    R: Floats
    p: Points
    R_middle: Floats
    p_middle: Points
    elastic_energy: float


def shape_of(chain: Chain, twist: Floats, R_base: Floats, p_base: Points) -> Shape:
    """The shape of a chain that begins at the base's pose."""
    links = chain.links
    R, p = np.empty((links + 1, 3, 3)), np.empty((links + 1, 3))
    R_middle, p_middle = np.empty((links, 3, 3)), np.empty((links, 3))
    R[0], p[0] = R_base, p_base
    energy = chain_kernel.shape(
        chain.flexible, chain.length, chain.stiffness, chain.rest, twist, R, p, R_middle, p_middle
    )
    return Shape(twist, R, p, R_middle, p_middle, energy)


@dataclass(frozen=True, eq=False)
class Factored:
    """H = H₀ + GᵀWG: H₀ as the chain factors it, W the remainder of the coupled coordinates, G what they do.

    gradient: (e, 12) of the energy, or minus the unbalanced loads.  resultant: (e + 1, 6) moment, force that the loads
    from a node on exert about it.  chain_negative: negative eigenvalues of H₀ with its damping.
    """

    chain: Chain
    shape: Shape
    acting: Acting
    coupled: Integers
    gradient: Floats
    B: Floats
    mixed: Floats
    gain: Floats
    pivots: Floats
    resultant: Floats
    chain_negative: int
    gradient_square: float  # J, in the elastic energy's norm

    @property
    def residual(self) -> float:
        """Unbalanced loads, as the angle in rad by which they would bend the unloaded rod (elastic energy's norm)."""
        return sqrt(self.gradient_square / self.chain.bending_scale)

    def step(self, twist_load: Floats | None = None, node_load: Floats | None = None) -> tuple[Floats, Floats]:
        """As `answer`, to one load: (e, 12), (e + 1, 6), without the last axis."""
        chain, links = self.chain, self.chain.links
        twist_load = np.zeros((links, 12)) if twist_load is None else twist_load
        node_load = np.zeros((links + 1, 6)) if node_load is None else node_load
        twist, x = np.zeros((links, 12)), np.empty((links + 1, 6))
        chain_kernel.solve_one(
            chain.flexible,
            self.shape.p,
            self.B,
            self.mixed,
            self.gain,
            self.pivots,
            twist_load,
            node_load,
            twist,
            x,
        )
        if self.acting.remainder is None:
            return twist, x
        twist, x = self._corrected(twist[..., None], x[..., None])
        return twist[..., 0], x[..., 0]

    def answer(
        self, twist_load: Floats | None = None, node_load: Floats | None = None, base: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """How twists (e, 12, n) and nodes (e + 1, 6, n) move under small loads.

        twist_load: (e, 12, n) on the twists.  node_load: (e + 1, 6, n) torque, force on the nodes.  base: (6, n)
        variations of the base's pose.
        """
        return self._corrected(*self._chain_answer(twist_load, node_load, base))

    def stiffening(self) -> Floats:
        """(e + 1, 6) variations of the nodes per unit of the logarithm of a factor of all moduli.

        The elastic forces grow in proportion to it, and the rod answers to that as to loads.
        """
        return self.step(twist_load=-elastic_forces(self.chain, self.shape.twist - self.chain.rest))[1]

    def _corrected(self, twist: Floats, x: Floats) -> tuple[Floats, Floats]:
        """What H answers, from what H₀ does."""
        if self.acting.remainder is None:
            return twist, x
        unit_twist, unit_x, _ = self._unit_answers
        moved = x.reshape(-1, x.shape[2])[self.coupled]
        extra = np.linalg.solve(self._with_remainder, self.acting.remainder @ moved)
        return twist - unit_twist @ extra, x - unit_x @ extra

    def _chain_answer(
        self, twist_load: Floats | None, node_load: Floats | None, base: Floats | None
    ) -> tuple[Floats, Floats]:
        given = next(one for one in (twist_load, node_load, base) if one is not None)
        n, links = given.shape[-1], self.chain.links
        twist_load = np.zeros((links, 12, n)) if twist_load is None else twist_load
        node_load = np.zeros((links + 1, 6, n)) if node_load is None else node_load
        base = np.zeros((6, n)) if base is None else base
        twist, x = np.zeros((links, 12, n)), np.empty((links + 1, 6, n))
        chain_kernel.solve(
            self.chain.flexible,
            self.shape.p,
            self.B,
            self.mixed,
            self.gain,
            self.pivots,
            twist_load,
            node_load,
            base,
            twist,
            x,
        )
        return twist, x

    @cached_property
    def _unit_answers(self) -> tuple[Floats, Floats, Floats]:
        """H₀⁻¹Gᵀ: twists (e, 12, k), nodes (e + 1, 6, k), and of them the coupled coordinates' (k, k)."""
        size = self.coupled.size
        load = np.zeros((6 * (self.chain.links + 1), size))
        load[self.coupled, np.arange(size)] = 1.0
        twist, x = self._chain_answer(None, load.reshape(-1, 6, size), None)
        return twist, x, x.reshape(-1, size)[self.coupled]

    @cached_property
    def _with_remainder(self) -> Floats:
        """1 + W C, by which (H₀ + GᵀWG)⁻¹ = H₀⁻¹ − H₀⁻¹Gᵀ (1 + W C)⁻¹ W G H₀⁻¹."""
        assert self.acting.remainder is not None
        return np.eye(len(self.acting.remainder)) + self.acting.remainder @ self._unit_answers[2]

    @cached_property
    def negative(self) -> int:
        """Negative eigenvalues of the Hessian, or of its symmetric part where loads have no potential.

        Of H₀ by the signs of its pivots; with a remainder by Haynsworth's formula for [H₀, Gᵀ, 0; G, 0, −1; 0, −1, W].
        """
        if self.acting.remainder is None:
            return self.chain_negative
        W = self.acting.remainder
        if not (W + W.T).any():
            return self.chain_negative
        C, size = self._unit_answers[2], len(W)
        scale = np.sqrt(np.maximum(np.abs(np.diag(C)), np.finfo(float).tiny))
        C, W = 0.5 * (C + C.T) / np.outer(scale, scale), 0.5 * (W + W.T) * np.outer(scale, scale)
        small = np.block([[-C, -np.eye(size)], [-np.eye(size), W]])
        return self.chain_negative + int(np.count_nonzero(np.linalg.eigvalsh(small) < -chain_kernel.NEUTRAL)) - size

    @cached_property
    def unstable_directions(self) -> int:
        """Eigenvalues below −`NEUTRAL` of the Hessian without damping, in units of the elastic one."""
        if not self.negative:
            return 0
        if self._symmetric:
            return factored(self.chain, self.shape, self.acting, self.coupled, NEUTRAL).negative
        return self._creeping_away

    @property
    def _symmetric(self) -> bool:
        """Whether the Hessian is one: loads without a potential leave an unsymmetric tangent."""
        W = self.acting.remainder
        return W is None or bool(np.abs(W - W.T).max() <= 1e-9 * np.abs(W).max())

    @property
    def _creeping_away(self) -> int:
        """Modes in which the overdamped rod K dη/dt = −(unbalanced loads) leaves the shape: its static instability.

        Of K⁻¹H with the unsymmetric H, whose symmetric part need not be positive for that; eigenvalues of H⁻¹K lie on
        the same sides of the imaginary axis.
        """
        links = np.flatnonzero(self.chain.flexible)
        units = np.zeros((self.chain.links, 12, 12 * links.size))
        for k, link in enumerate(links):
            units[link, :, 12 * k : 12 * k + 12] = np.eye(12)
        answers, _ = self.answer(twist_load=elastic_forces(self.chain, units))
        modes = np.linalg.eigvals(answers[links].reshape(12 * links.size, -1))
        return int(np.count_nonzero(modes.real < -NEUTRAL * np.abs(modes) ** 2))  # Re 1/mode < −NEUTRAL


def elastic_forces(chain: Chain, twist: Floats) -> Floats:
    """The elastic Hessian times twists (e, 12) or (e, 12, n)."""
    spring = np.zeros_like(chain.stiffness)
    spring[chain.flexible] = chain.stiffness[chain.flexible] / chain.length[chain.flexible, None]
    spring = spring.reshape(*spring.shape, *(1,) * (twist.ndim - 2))
    a, b = twist[:, :6], twist[:, 6:]
    own, cross = chain_kernel.OWN, chain_kernel.CROSS
    forces: Floats = np.concatenate([spring * (own * a + cross * b), spring * (own * b + cross * a)], axis=1)
    return forces


def factored(chain: Chain, shape: Shape, acting: Acting, coupled: Integers, damping: float = 0.0) -> Factored:
    """Gradient and factored Hessian at a shape under what acts on it; `damping` times the elastic Hessian is added."""
    links = chain.links
    gradient, B, mixed = np.zeros((links, 12)), np.empty((links, 6, 12)), np.empty((links, 6, 12))
    gain, pivots, resultant = np.empty((links, 12, 6)), np.empty((links, 12, 12)), np.empty((links + 1, 6))
    negative, square = chain_kernel.factor(
        chain.flexible,
        chain.length,
        chain.stiffness,
        chain.rest,
        shape.twist,
        shape.R,
        shape.p,
        shape.R_middle,
        shape.p_middle,
        acting.wrench,
        acting.tangent,
        damping,
        gradient,
        B,
        mixed,
        gain,
        pivots,
        resultant,
    )
    return Factored(chain, shape, acting, coupled, gradient, B, mixed, gain, pivots, resultant, negative, square)
