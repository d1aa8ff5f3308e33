"""One compiled call for the jets of any number of sources of all kinds, at any number of points."""

from __future__ import annotations

import numpy as np

from magfem.compiled import kernel
from magfem.fields.charge_disc import add_charge_discs
from magfem.fields.closed_path import add_closed_path
from magfem.fields.loop import add_loops
from magfem.fields.packed import (
    CONDUCTOR,
    DISC,
    LOOPS,
    MIXED_INTERIOR,
    OBLATE_DISC,
    TRANSVERSE_COS,
    TRANSVERSE_SIN,
    ZONAL,
)
from magfem.fields.packing import BLOCK, WORK_ROWS, add_rotated, unpack
from magfem.fields.solid_harmonics import add_harmonics
from magfem.fields.transverse_harmonics import add_transverse
from magfem.fields.zonal_harmonics import add_oblate, add_zonal
from magfem.typing import Complexes, Floats, Integers, Points


@kernel
def evaluate(
    points: Points,
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
    """Write the jets of all sources at `points` (n, 3) to B, gradient and hessian, as far as `order` goes.

    The sources are those of `Packed`, in its order.
    """
    x = np.empty(BLOCK)
    y = np.empty(BLOCK)
    z = np.empty(BLOCK)
    total = np.empty((15, BLOCK))
    turned = np.empty((15, BLOCK))
    work = np.empty((WORK_ROWS, BLOCK))
    entries = 3 if order == 0 else 8 if order == 1 else 15
    for begin in range(0, points.shape[0], BLOCK):
        count = min(BLOCK, points.shape[0] - begin)
        total[:entries, :count] = 0.0
        fresh = True
        for k in range(layout.shape[0]):
            how, first, last, common, flush = layout[k, 0], layout[k, 1], layout[k, 2], layout[k, 3], layout[k, 4]
            radius, cx, cy, cz, value = numbers[k, 0], numbers[k, 1], numbers[k, 2], numbers[k, 3], numbers[k, 13]
            f = numbers[k, 4:13]
            out = total if common else turned
            for j in range(count):
                x[j] = points[begin + j, 0] - cx
                y[j] = points[begin + j, 1] - cy
                z[j] = points[begin + j, 2] - cz
            if not common:
                for j in range(count):
                    dx, dy, dz = x[j], y[j], z[j]
                    x[j] = f[0] * dx + f[3] * dy + f[6] * dz
                    y[j] = f[1] * dx + f[4] * dy + f[7] * dz
                    z[j] = f[2] * dx + f[5] * dy + f[8] * dz
                if fresh:
                    turned[:entries, :count] = 0.0
                    fresh = False
            if how == LOOPS:
                add_loops(x, y, z, count, radius, value, order, work, out)
            elif how == ZONAL:
                add_zonal(x, y, z, count, radius, reals[first:last], order, work, out)
            elif how in (TRANSVERSE_COS, TRANSVERSE_SIN):
                add_transverse(x, y, z, count, radius, reals[first:last], how == TRANSVERSE_SIN, order, work, out)
            elif how == OBLATE_DISC:
                add_oblate(x, y, z, count, radius, complexes[first:last], order, out)
            elif how == CONDUCTOR:
                add_closed_path(x, y, z, count, nodes[first:last], value, order, work, out)
            elif how == DISC:
                add_charge_discs(x, y, z, count, radius, value, order, work, out)
            else:
                add_harmonics(
                    x,
                    y,
                    z,
                    count,
                    radius,
                    indices[first:last, 0],
                    indices[first:last, 1],
                    complexes[first:last],
                    how == MIXED_INTERIOR,
                    order,
                    out,
                )
            if (flush or k == layout.shape[0] - 1) and not common:
                add_rotated(f, turned, count, order, total)
                fresh = True
        unpack(total, count, order, B[begin:], gradient[begin:], hessian[begin:])


@kernel
def evaluate_each(
    points: Points,
    begin: int,
    end: int,
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
    """As `evaluate`, but the jets of every group of sources on its own, at the points from `begin` to `end`.

    B: (g, n, 3), gradient: (g, n, 3, 3), hessian: (g, n, 3, 3, 3), or of one group and no points beyond `order`.
    group: (g + 1,), group i has the rows group[i]:group[i + 1] of `layout`.
    """
    for i in range(group.size - 1):
        a, b = group[i], group[i + 1]
        evaluate(
            points[begin:end],
            layout[a:b],
            numbers[a:b],
            reals,
            complexes,
            indices,
            nodes,
            order,
            B[i][begin:end],
            gradient[i if order > 0 else 0][begin:end],
            hessian[i if order > 1 else 0][begin:end],
        )
