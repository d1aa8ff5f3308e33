"""Magnets of one rod among themselves: what every magnet's field does to the dipoles of the others.

The energy of a pair is U = −µ_i·B_j(p_i), with B_j the field of magnet j, fixed to it; where both have a field, half of
each way round. Moving both magnets together changes nothing, so that the wrench on j follows from that on i by
balance, and all second derivatives from those of i alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from magfem.cross_matrix import cross_matrix
from magfem.fields.field import Field
from magfem.fields.region import Shell
from magfem.rod.applied_field import check_field
from magfem.typing import Floats, Points


@dataclass(frozen=True, eq=False)
class Interaction:
    """Fields (m) of the magnets, each in its magnet's own frame, T; and their moments (m, 3) A·m² there."""

    fields: tuple[Field, ...]
    moments: Floats

    def act(self, R: Floats, p: Points) -> tuple[float, Floats, Floats]:
        """Energy J, wrenches (m, 6) torque, force, and the remainder (m, 6, m, 6) as `Loads` wants it.

        R (m, 3, 3), p (m, 3) m of the magnets' centres.
        """
        count = len(self.fields)
        energy, wrench, tangent = 0.0, np.zeros((count, 6)), np.zeros((count, 6, count, 6))
        for i in range(count):
            for j in range(count):
                if i != j:
                    energy += self._add_pair(i, j, R, p, wrench, tangent)
        for k in range(count):
            tangent[k, :3, k, :3] -= 0.5 * cross_matrix(wrench[k, :3])
        return energy, wrench, tangent

    def misplaced(self, R: Floats, p: Points) -> str:
        """Words for a magnet where another's field makes no promise, empty when there is none.

        Beyond the far end of a shell about its source a field is taken all the same: there it is a dipole's, ever more.
        """
        for i in range(len(self.fields)):
            for j, field in enumerate(self.fields):
                region = getattr(field, "region", None)
                if i == j or region is None:
                    continue
                local = (p[i] - p[j]) @ R[j]
                if isinstance(region, Shell):
                    inside = float(region.hull.distance(local[None])[0]) >= region.clearance * (1 - 1e-9)
                else:
                    inside = bool(np.all(region.contains(local)))
                if not inside:
                    return f"ends where the field of magnet {j} makes no promise ({region.describe()})"
        return ""

    def _add_pair(self, i: int, j: int, R: Floats, p: Points, wrench: Floats, tangent: Floats) -> float:
        """The dipole of i in the field of j: adds the wrenches on both, and −∂w/∂x."""
        local = (p[i] - p[j]) @ R[j]
        B, G, H = self.fields[j].jet(local, 2, outside="extrapolate")
        B, G = R[j] @ B, R[j] @ G @ R[j].T
        mu = 0.5 * (R[i] @ self.moments[i])  # half of each way round
        F = np.einsum("a,abc->bc", R[j].T @ mu, H)
        F = R[j] @ F @ R[j].T
        force, torque = G.T @ mu, np.cross(mu, B)
        own = np.zeros((6, 6))  # ∂w_i/∂x_i
        own[:3, :3] = np.outer(mu, B) - (mu @ B) * np.eye(3)
        own[:3, 3:] = cross_matrix(mu) @ G
        own[3:, :3] = -G.T @ cross_matrix(mu)
        own[3:, 3:] = F
        carry = np.eye(6)  # x_i of a motion x_j of the whole pair
        carry[3:, :3] = -cross_matrix(p[i] - p[j])
        w = np.concatenate([torque, force])
        turned = np.zeros((6, 6))  # of w_i when all turns
        turned[:3, :3], turned[3:, :3] = -cross_matrix(torque), -cross_matrix(force)
        other = turned - own @ carry  # ∂w_i/∂x_j
        # w_j = −carryᵀ w_i; carryᵀ holds (p_i − p_j) × force, which moves with both.
        lever_i, lever_j = np.zeros((6, 6)), np.zeros((6, 6))
        lever_i[:3, 3:], lever_j[:3, 3:] = -cross_matrix(force), cross_matrix(force)
        wrench[i] += w
        wrench[j] -= carry.T @ w
        tangent[i, :, i, :] -= own
        tangent[i, :, j, :] -= other
        tangent[j, :, i, :] += carry.T @ own + lever_i
        tangent[j, :, j, :] += carry.T @ other + lever_j
        return float(-mu @ B)


def check_fields(fields: Sequence[Field | None]) -> None:
    """Raise InputError unless all are fields in T, or None."""
    for k, one in enumerate(fields):
        if one is not None:
            check_field(one, f"entry {k} of magnet_fields is a Field in T, or None")


def interaction_of(fields: Sequence[Field | None], moments: Floats) -> Interaction:
    """Of magnets with `fields`; the field of a dipole stands in for None."""
    from magfem.fields.dipole_field import DipoleField

    return Interaction(
        tuple(DipoleField(moment) if one is None else one for one, moment in zip(fields, moments, strict=True)), moments
    )
