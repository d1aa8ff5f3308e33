"""What joints do to coils, compiled: rigid motions, sources carried along, and the derivatives of their fields.

A rigid motion is a row of (j, 3, 4): the rotation and, in the last column, the translation.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from magfem.compiled import kernel
from magfem.fields.terms_kernel import evaluate_each
from magfem.typing import Booleans, Complexes, Floats, Integers, Points


@kernel
def joint_motions(
    values: Floats, sequence: Integers, parent: Integers, revolute: Booleans, axis: Floats, point: Floats, out: Floats
) -> None:
    """Write to `out` (j, 3, 4) how every joint's body is moved from where it is at zero.

    values: (j,) rad or m.  The others: a `Linkage`.  Rotations by Rodrigues' formula.
    """
    turn = np.empty((3, 4))
    for k in sequence:
        x, y, z, value = axis[k, 0], axis[k, 1], axis[k, 2], values[k]
        if revolute[k]:
            s, half = sin(value), sin(0.5 * value)
            v = 2.0 * half * half  # 1 − cos without cancellation
            c = cos(value)
            turn[0, 0], turn[0, 1], turn[0, 2] = c + v * x * x, v * x * y - s * z, v * x * z + s * y
            turn[1, 0], turn[1, 1], turn[1, 2] = v * x * y + s * z, c + v * y * y, v * y * z - s * x
            turn[2, 0], turn[2, 1], turn[2, 2] = v * x * z - s * y, v * y * z + s * x, c + v * z * z
            for i in range(3):
                turn[i, 3] = point[k, i]
                for m in range(3):
                    turn[i, 3] -= turn[i, m] * point[k, m]
        else:
            for i in range(3):
                for m in range(3):
                    turn[i, m] = 1.0 if i == m else 0.0
                turn[i, 3] = value * axis[k, i]
        below = parent[k]
        for i in range(3):
            for m in range(4):
                if below < 0:
                    out[k, i, m] = turn[i, m]
                else:
                    total = out[below, i, 3] if m == 3 else 0.0
                    for n in range(3):
                        total += out[below, i, n] * turn[n, m]
                    out[k, i, m] = total


@kernel
def carried_numbers(motions: Floats, carrier: Integers, group: Integers, numbers: Floats) -> None:
    """Move centre and frame of the sources in `numbers` (n, 14; of `Packed`), in place.

    motions: (j, 3, 4).  carrier: (g,) the joint that carries each group, −1 for none.  group: (g + 1,) its rows.
    """
    old = np.empty(12)
    for g in range(carrier.size):
        k = carrier[g]
        if k < 0:
            continue
        for row in range(group[g], group[g + 1]):
            for i in range(12):
                old[i] = numbers[row, 1 + i]
            for i in range(3):
                a, b, c = motions[k, i, 0], motions[k, i, 1], motions[k, i, 2]
                numbers[row, 1 + i] = a * old[0] + b * old[1] + c * old[2] + motions[k, i, 3]
                for m in range(3):
                    numbers[row, 4 + 3 * i + m] = a * old[3 + m] + b * old[6 + m] + c * old[9 + m]


@kernel
def moved_jets(
    points: Points,
    values: Floats,
    sequence: Integers,
    parent: Integers,
    revolute: Booleans,
    axis: Floats,
    point: Floats,
    carrier: Integers,
    group: Integers,
    layout: Integers,
    numbers: Floats,
    reals: Floats,
    complexes: Complexes,
    indices: Integers,
    nodes: Floats,
    order: int,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """As `evaluate_each` at all points, with the groups of sources where the joint values (j,) carry them."""
    moved = numbers
    if values.size:
        motions = np.empty((values.size, 3, 4))
        joint_motions(values, sequence, parent, revolute, axis, point, motions)
        moved = numbers.copy()
        carried_numbers(motions, carrier, group, moved)
    evaluate_each(
        points,
        0,
        points.shape[0],
        group,
        layout,
        moved,
        reals,
        complexes,
        indices,
        nodes,
        order,
        B,
        gradient,
        hessian,
    )


@kernel
def joint_derivatives(
    points: Points,
    currents: Floats,
    values: Floats,
    sequence: Integers,
    parent: Integers,
    revolute: Booleans,
    axis: Floats,
    point: Floats,
    carried: Booleans,
    B: Floats,
    gradient: Floats,
    hessian: Floats,
    dB: Floats,
    dG: Floats,
) -> None:
    """Derivatives of the total B and gradient at fixed points with respect to every joint.

    carried: (j, c).  B (c, n, 3), gradient, hessian: per ampere, at these joint values.  dB: (j, n, 3) and
    dG: (j, n, 3, 3) are written.  The field of a source that turns at the angular velocity w and moves at v where
    the point is:

        dB_i = (w × B)_i − B_i,k v_k,      dG_ij = W_ia G_aj − G_ia W_aj − B_i,jk v_k,      W = [w]×.
    """
    motions = np.empty((values.size, 3, 4))
    joint_motions(values, sequence, parent, revolute, axis, point, motions)
    b, g, h = np.empty(3), np.empty((3, 3)), np.empty((3, 3, 3))
    w, centre, v, W = np.empty(3), np.empty(3), np.empty(3), np.zeros((3, 3))
    for k in range(values.size):
        below = parent[k]
        for i in range(3):
            if below < 0:
                w[i], centre[i] = axis[k, i], point[k, i]
            else:
                w[i], centre[i] = 0.0, motions[below, i, 3]
                for m in range(3):
                    w[i] += motions[below, i, m] * axis[k, m]
                    centre[i] += motions[below, i, m] * point[k, m]
        if revolute[k]:
            W[0, 1], W[0, 2], W[1, 2] = -w[2], w[1], -w[0]
            W[1, 0], W[2, 0], W[2, 1] = w[2], -w[1], w[0]
        else:
            W[:] = 0.0
        for n in range(points.shape[0]):
            b[:], g[:], h[:] = 0.0, 0.0, 0.0
            for c in range(currents.size):
                if carried[k, c]:
                    ampere = currents[c]
                    for i in range(3):
                        b[i] += ampere * B[c, n, i]
                        for j in range(3):
                            g[i, j] += ampere * gradient[c, n, i, j]
                            for m in range(3):
                                h[i, j, m] += ampere * hessian[c, n, i, j, m]
            for i in range(3):
                if revolute[k]:
                    v[i] = 0.0
                    for m in range(3):
                        v[i] += W[i, m] * (points[n, m] - centre[m])
                else:
                    v[i] = w[i]
            for i in range(3):
                total = 0.0
                for m in range(3):
                    total += W[i, m] * b[m] - g[i, m] * v[m]
                dB[k, n, i] = total
                for j in range(3):
                    total = 0.0
                    for m in range(3):
                        total += W[i, m] * g[m, j] - g[i, m] * W[m, j] - h[i, j, m] * v[m]
                    dG[k, n, i, j] = total
