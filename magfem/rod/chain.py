"""From sections to the chain that the kernels work on: links, nodes, and what rides on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from magfem.errors import InputError
from magfem.rod.sections import FlexibleSection, MagnetSection, three
from magfem.typing import Booleans, Floats, Integers

_GAUSS = 0.5 + np.array([-0.5, 0.5]) / sqrt(3)
_TO_TWISTS = np.array([[0.25 + sqrt(3) / 6, 0.25 - sqrt(3) / 6], [0.25 - sqrt(3) / 6, 0.25 + sqrt(3) / 6]])
"""η/h of the two screws from the strains at the two Gauss points."""

TO_STRAINS = np.linalg.inv(_TO_TWISTS)


@dataclass(frozen=True, eq=False)
class Chain:
    """Links from the base to the tip, e of them between e + 1 nodes; d dipoles of m magnets.

    flexible, length, stiffness, rest: of links, as `chain_kernel.shape` takes them.  section: (e,) which section a link
    is of.  arc_length: (e + 1,) m.  weight: (e + 1,) kg carried by a node.  end_weight: (e + 1, 3) kg·m in the node's
    axes, of the couples (R end_weight) × g that complete the trapezoid rule for a section's weight.  force, couple:
    (e + 1, 3) N and (e + 1, 3, 3) N·m, world by node's axes, the same of forces per length.  torque: (e + 1, 3) N·m of
    moments per length.  dipole_node, dipole_offset, dipole_moment: (d,), (d, 3), (d, 3) in the node's axes.
    dipole_magnet: (d,), the magnet it is of, or −1.  magnet_node: (m,) at their centres.
    """

    flexible: Booleans
    length: Floats
    stiffness: Floats
    rest: Floats
    section: Integers
    arc_length: Floats
    weight: Floats
    end_weight: Floats
    force: Floats
    couple: Floats
    torque: Floats
    dipole_node: Integers
    dipole_offset: Floats
    dipole_moment: Floats
    dipole_magnet: Integers
    magnet_node: Integers
    bending_scale: float  # J, the softest section's EI over the rod's length

    @property
    def links(self) -> int:
        """How many links there are."""
        return self.flexible.size


def chain_of(sections: Sequence[FlexibleSection | MagnetSection]) -> Chain:
    """The chain of a rod's sections, one of which at least is flexible."""
    flexible_ones = [one for one in sections if isinstance(one, FlexibleSection)]
    links: list[tuple[bool, float, int]] = []
    for k, one in enumerate(sections):
        if isinstance(one, FlexibleSection):
            links += [(True, one.length / one.divisions, k)] * one.divisions
        else:
            links += [(False, one.length / 2, k)] * 2
    count = len(links)
    flexible = np.array([link[0] for link in links])
    length = np.array([link[1] for link in links])
    section = np.array([link[2] for link in links], dtype=np.int64)
    stiffness, rest = np.zeros((count, 6)), np.zeros((count, 12))
    weight, end_weight, couple = np.zeros(count + 1), np.zeros((count + 1, 3)), np.zeros((count + 1, 3, 3))
    force, torque = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    dipoles: list[tuple[int, Floats, Floats, int]] = []
    magnets: list[int] = []
    begin = 0
    for one in sections:
        if isinstance(one, FlexibleSection):
            end = begin + one.divisions
            h = one.length / one.divisions
            share = np.full(one.divisions + 1, h)
            share[[0, -1]] = h / 2
            nodes = slice(begin, end + 1)
            stiffness[begin:end] = one.stiffness
            rest[begin:end] = _rest(one, h)
            mass = one.density * one.section.area
            dead, turning = np.asarray(one.force_per_length, float), np.asarray(one.moment_per_length, float)
            weight[nodes] += mass * share
            force[nodes] += share[:, None] * dead
            torque[nodes] += share[:, None] * turning
            # ∫ p ds = trapezoid + h²/12 (p′(0) − p′(L)): the couples that make nodal forces right to order four.
            along = h * h / 12 * np.asarray(one.intrinsic_strain, float)
            for node, sign in ((begin, 1.0), (end, -1.0)):
                end_weight[node] += sign * mass * along
                couple[node] += sign * np.outer(dead, along)
            magnetic = np.asarray(one.magnetic_moment_per_length, float)
            if magnetic.any():
                dipoles += [(begin + n, np.zeros(3), part * magnetic, -1) for n, part in enumerate(share)]
            begin = end
        else:
            node = begin + 1
            weight[node] += one.mass
            where, part = np.polynomial.legendre.leggauss(one.field_points)
            dipoles += [
                (node, np.array([0, 0, one.length / 2 * x]), w / 2 * one.moment_vector, len(magnets))
                for x, w in zip(where, part, strict=True)
            ]
            magnets.append(node)
            begin += 2
    softest = min(float(one.stiffness[:2].min()) for one in flexible_ones)
    return Chain(
        flexible=flexible,
        length=length,
        stiffness=stiffness,
        rest=rest,
        section=section,
        arc_length=np.concatenate([[0.0], np.cumsum(length)]),
        weight=weight,
        end_weight=end_weight,
        force=force,
        couple=couple,
        torque=torque,
        dipole_node=np.array([one[0] for one in dipoles], dtype=np.int64),
        dipole_offset=np.array([one[1] for one in dipoles]).reshape(-1, 3),
        dipole_moment=np.array([one[2] for one in dipoles]).reshape(-1, 3),
        dipole_magnet=np.array([one[3] for one in dipoles], dtype=np.int64),
        magnet_node=np.array(magnets, dtype=np.int64),
        bending_scale=softest / float(sum(one.length for one in flexible_ones)),
    )


def _rest(one: FlexibleSection, h: float) -> Floats:
    """(elements, 12) the twists of a section's links without load."""
    strain = three("flexible section", "intrinsic_strain", one.intrinsic_strain)
    where = (np.arange(one.divisions)[:, None] + _GAUSS) * h  # (elements, 2)
    if callable(one.intrinsic_curvature):
        curvature = np.asarray(one.intrinsic_curvature(where.ravel()), dtype=float)
        if curvature.shape != (where.size, 3) or not np.isfinite(curvature).all():
            raise InputError(
                f"flexible section: intrinsic_curvature must give ({where.size}, 3) finite numbers for as many arc "
                f"lengths, got shape {curvature.shape}"
            )
    else:
        curvature = np.broadcast_to(np.asarray(one.intrinsic_curvature, float), (where.size, 3))
    xi = np.concatenate([curvature, np.broadcast_to(strain, curvature.shape)], axis=1).reshape(-1, 2, 6)
    twists: Floats = h * np.einsum("ij,ejs->eis", _TO_TWISTS, xi)
    return twists.reshape(-1, 12)


def strains(chain: Chain, twist: Floats) -> Floats:
    """(e, 2, 6) curvature and strain at the Gauss points of every link; zero for rigid ones."""
    halves = twist.reshape(-1, 2, 6)
    xi: Floats = np.einsum("ij,ejs->eis", TO_STRAINS, halves) / chain.length[:, None, None]
    return xi
