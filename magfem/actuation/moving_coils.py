"""The unit fields of coils that joints carry, as compiled calls that take joint values as they come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magfem.actuation.joints import Joints
from magfem.actuation.moving_kernel import carried_numbers, joint_derivatives, joint_motions, moved_jets
from magfem.fields.packed import Packed
from magfem.fields.packing import BLOCK
from magfem.fields.term_groups import TermGroups
from magfem.fields.terms import PARALLEL_FROM, Terms
from magfem.fields.terms_kernel import evaluate_each
from magfem.threads import in_chunks
from magfem.typing import Booleans, Floats, Integers, Jet, Points


class MovingCoils:
    """g groups of sources, the first of them coils that a joint carries, or none; nothing is checked here.

    Sources are packed once, where they are at joint values zero; a call moves their centres and frames.
    """

    joints: Joints
    carrier: Integers  # (g,) the joint that carries each group, −1 for none
    carried: Booleans  # (j, c) which coils every joint moves
    group: Integers  # (g + 1,) rows of `packed`
    packed: Packed

    def __init__(self, groups: Sequence[Terms], joints: Joints, carrier: Sequence[int]) -> None:
        """carrier: of the first groups, the coils; the others stand still."""
        fixed = [-1] * (len(groups) - len(carrier))
        self.joints, self.carrier = joints, np.array([*carrier, *fixed], dtype=np.int64)
        self.carried = joints.carried_by(self.carrier[: len(carrier)])
        packed = TermGroups(groups)
        self.group = packed.start
        layout = packed.packed.layout.copy()
        layout[np.repeat(self.carrier >= 0, np.diff(self.group)), 3] = 0  # no frame stays the common one
        self.packed = packed.packed._replace(layout=layout)

    def motions(self, values: Floats) -> Floats:
        """How every joint's body is moved from where it is at zero: (j, 3, 4), rotation and translation (m)."""
        motions = np.empty((values.size, 3, 4))
        joint_motions(values, *self.joints.linkage, motions)
        return motions

    def jets(self, points: Points, values: Floats, order: int, count: int) -> Jet:
        """(B (g, n, 3), gradient (g, n, 3, 3), hessian (g, n, 3, 3, 3)) up to `order`, of the first `count` groups.

        points: (n, 3) m, C-contiguous.  values: (j,).
        """
        n = points.shape[0]
        B = np.empty((count, n, 3))
        gradient = np.empty((count, n, 3, 3) if order > 0 else (1, 0, 3, 3))
        hessian = np.empty((count, n, 3, 3, 3) if order > 1 else (1, 0, 3, 3, 3))
        carrier, group = self.carrier[:count], self.group[: count + 1]
        if n < 2 * PARALLEL_FROM:
            sequence, parent, revolute, axis, point = self.joints.linkage
            moved_jets(
                points,
                values,
                sequence,
                parent,
                revolute,
                axis,
                point,
                carrier,
                group,
                *self.packed,
                order,
                B,
                gradient,
                hessian,
            )
        else:
            numbers = self.packed.numbers.copy()
            carried_numbers(self.motions(values), carrier, group, numbers)
            packed = self.packed._replace(numbers=numbers)

            def run(chunk: slice) -> None:
                evaluate_each(points, chunk.start, chunk.stop, group, *packed, order, B, gradient, hessian)

            in_chunks(run, n, PARALLEL_FROM, BLOCK)
        return (B, gradient, hessian)[: order + 1]

    def joint_jets(self, points: Points, currents: Floats, values: Floats, jets: Jet) -> tuple[Floats, Floats]:
        """Derivatives (j, n, 3), (j, n, 3, 3) of B and gradient of the currents (c,), from the jets of order 2."""
        shape = (values.size, points.shape[0])
        dB, dG = np.empty((*shape, 3)), np.empty((*shape, 3, 3))
        B, gradient, hessian = jets
        joint_derivatives(points, currents, values, *self.joints.linkage, self.carried, B, gradient, hessian, dB, dG)
        return dB, dG
