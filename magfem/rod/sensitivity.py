"""How an equilibrium moves with what it depends on, by implicit differentiation.

The gradient of the energy stays zero: H dη = −∂(gradient)/∂parameter. H is factored already; each parameter is one
more right-hand side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from magfem.errors import InputError
from magfem.rod.applied_field import DrivenField
from magfem.rod.chain import chain_of
from magfem.rod.chain_kernel import CROSS, OWN
from magfem.rod.load_kernel import field_loads
from magfem.rod.sections import FlexibleSection, MagnetSection
from magfem.typing import Floats

if TYPE_CHECKING:
    from magfem.rod.state import RodState

Load = tuple[Floats | None, Floats | None, Floats | None]
"""On the twists (e, 12, k), on the nodes (e + 1, 6, k) torque, force, and the base's variation (6, k)."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of the whole shape with respect to k parameters.

    positions: (n, 3, k) m per unit.  rotations: (n, 3, k) rad per unit, small turns about the world's axes:
    dR = [rotations]× R.  parameters: their names.
    """

    positions: Floats
    rotations: Floats
    parameters: tuple[str, ...]


def sensitivity(state: RodState, parameter: str) -> Sensitivity:
    """With respect to `parameter`, a name of PARAMETERS. Raises InputError for another, or one the rod has not."""
    if parameter not in PARAMETERS:
        raise InputError(f"sensitivities are with respect to {', '.join(PARAMETERS)}, got {parameter!r}")
    names, load = PARAMETERS[parameter](state)
    x = state.factored.answer(*load)[1]
    return Sensitivity(x[:, 3:], x[:, :3], names)


def driven(state: RodState, what: str = "a derivative with respect to currents or joints") -> DrivenField:
    """The coil system that the state is in; InputError when there is none."""
    applied = state.loads.applied
    if not isinstance(applied, DrivenField):
        raise InputError(f"{what} needs a rod that was solved with field=(system, currents, joints)")
    return applied


def currents_and_joints(state: RodState) -> Floats:
    """(e + 1, 6, c + j) torque, force on the nodes, per ampere of every coil and per rad or m of every joint."""
    applied = driven(state)
    points = state.factored.acting.points
    dB, dG = applied.coil_jets(points)
    if applied.joints is not None and applied.joints.size:
        jB, jG = applied.joint_jets(points)
        dB, dG = np.concatenate([dB, jB]), np.concatenate([dG, jG])
    return _of_field(state, dB, dG)


def _of_field(state: RodState, dB: Floats, dG: Floats) -> Floats:
    chain = state.loads.chain
    load = np.zeros((chain.links + 1, 6, len(dB)))
    field_loads(
        chain.dipole_node,
        chain.dipole_offset,
        chain.dipole_moment,
        state.factored.shape.R,
        np.ascontiguousarray(dB),
        np.ascontiguousarray(dG),
        load,
    )
    return load


def _currents(state: RodState) -> tuple[tuple[str, ...], Load]:
    applied = driven(state)
    names = tuple(coil.name for coil in applied.system.coils)
    return names, (None, _of_field(state, *applied.coil_jets(state.factored.acting.points)), None)


def _joints(state: RodState) -> tuple[tuple[str, ...], Load]:
    applied = driven(state)
    names = tuple(joint.name for joint in applied.system.joints)
    return names, (None, _of_field(state, *applied.joint_jets(state.factored.acting.points)), None)


def _base(state: RodState) -> tuple[tuple[str, ...], Load]:
    """A shift of the base and a turn about itself, along and about the world's axes."""
    x = np.zeros((6, 6))
    x[3:, :3] = x[:3, 3:] = np.eye(3)
    return ("x", "y", "z", "turn about x", "turn about y", "turn about z"), (None, None, x)


def _elastic(of_stiffness: Callable[[FlexibleSection], Floats]) -> Callable[[RodState], tuple[tuple[str, ...], Load]]:
    """Of a modulus: the change of a section's six stiffnesses with it."""

    def load(state: RodState) -> tuple[tuple[str, ...], Load]:
        chain, twist = state.loads.chain, state.factored.shape.twist
        chosen = [k for k, one in enumerate(state.rod.sections) if isinstance(one, FlexibleSection)]
        loads = np.zeros((chain.links, 12, len(chosen)))
        for column, k in enumerate(chosen):
            one = state.rod.sections[k]
            assert isinstance(one, FlexibleSection)
            links = chain.section == k
            e = twist[links] - chain.rest[links]
            spring = of_stiffness(one) / (one.length / one.divisions)
            loads[links, :6, column] = -spring * (OWN * e[:, :6] + CROSS * e[:, 6:])
            loads[links, 6:, column] = -spring * (OWN * e[:, 6:] + CROSS * e[:, :6])
        return tuple(f"section {k}" for k in chosen), (loads, None, None)

    return load


def _of_youngs_modulus(one: FlexibleSection) -> Floats:
    stiffness = one.stiffness / one.youngs_modulus
    if one.shear_modulus is not None:
        stiffness[2:5] = 0.0
    return stiffness


def _of_shear_modulus(one: FlexibleSection) -> Floats:
    stiffness = np.zeros(6)
    stiffness[2] = one.section.torsion_constant
    stiffness[3:5] = one.section.area
    return stiffness


def _density(state: RodState) -> tuple[tuple[str, ...], Load]:
    chain, g = state.loads.chain, state.loads.gravity
    chosen = [k for k, one in enumerate(state.rod.sections) if isinstance(one, FlexibleSection)]
    load = np.zeros((chain.links + 1, 6, len(chosen)))
    R = state.factored.shape.R
    for column, k in enumerate(chosen):
        unit = chain_of(
            [
                replace(one, density=float(n == k)) if isinstance(one, FlexibleSection) else replace(one, mass=0.0)
                for n, one in enumerate(state.rod.sections)
            ]
        )
        load[:, 3:, column] = unit.weight[:, None] * g
        load[:, :3, column] = np.cross(np.einsum("nij,nj->ni", R, unit.end_weight), g)
    return tuple(f"section {k}" for k in chosen), (None, load, None)


def _moment(state: RodState) -> tuple[tuple[str, ...], Load]:
    """Of the three components of every magnet's moment in its own axes, A·m²."""
    chain, acting = state.loads.chain, state.factored.acting
    if state.loads.interaction is not None:
        raise InputError("sensitivities to moments are not there for magnets that act on each other")
    magnets = [one for one in state.rod.sections if isinstance(one, MagnetSection)]
    load = np.zeros((chain.links + 1, 6, 3 * len(magnets)))
    if len(acting.points):
        for k, one in enumerate(magnets):
            mine = np.flatnonzero(chain.dipole_magnet == k)
            shares = np.polynomial.legendre.leggauss(one.field_points)[1] / 2
            for d, share in zip(mine.tolist(), shares.tolist(), strict=True):
                node = chain.dipole_node[d]
                R = state.factored.shape.R[node]
                mu = share * R  # columns: per component
                force = np.einsum("ij,ik->jk", acting.jets[1][d], mu)
                torque = np.cross(mu.T, acting.jets[0][d]).T + np.cross(R @ chain.dipole_offset[d], force.T).T
                load[node, :3, 3 * k : 3 * k + 3] += torque
                load[node, 3:, 3 * k : 3 * k + 3] += force
    return tuple(f"magnet {k}, {axis}" for k in range(len(magnets)) for axis in "xyz"), (None, load, None)


def _tip_force(state: RodState) -> tuple[tuple[str, ...], Load]:
    return _at_tip(state, 3)


def _tip_moment(state: RodState) -> tuple[tuple[str, ...], Load]:
    return _at_tip(state, 0)


def _at_tip(state: RodState, first: int) -> tuple[tuple[str, ...], Load]:
    load = np.zeros((state.loads.chain.links + 1, 6, 3))
    load[-1, first : first + 3] = state.factored.shape.R[-1] if state.loads.follower else np.eye(3)
    return ("x", "y", "z"), (None, load, None)


PARAMETERS: dict[str, Callable[[RodState], tuple[tuple[str, ...], Load]]] = {
    "currents": _currents,
    "joints": _joints,
    "base": _base,
    "youngs_modulus": _elastic(_of_youngs_modulus),
    "shear_modulus": _elastic(_of_shear_modulus),
    "density": _density,
    "moment": _moment,
    "tip_force": _tip_force,
    "tip_moment": _tip_moment,
}
"""What shapes can be differentiated by, and how."""
