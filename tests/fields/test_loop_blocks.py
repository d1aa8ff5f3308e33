"""Loops in blocks against the scalar kernel and magpylib, all regimes of the evaluation mixed in every block."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest
from references.jets import cylindrical, relative, scattered

from magfem.fields.loop import add_loop, add_loops
from magfem.fields.packing import BLOCK, WORK_ROWS
from magfem.fields.terms import loops
from magfem.typing import Floats, Points

RADIUS, CURRENT = 2e-3, 3.0  # m, A
ENTRIES = (3, 8, 15)  # of a packed jet, by order


def mixed() -> Points:
    """192 points: axis, near it, at the wire, near it, between, where series and integrals hand over, and far away."""
    angle = np.arange(8) * 2 * np.pi / 8
    regimes = [
        cylindrical(0.0, np.linspace(-3, 3, 32)),
        cylindrical(np.geomspace(1e-12, 1e-2, 32), 0.4),
        *(cylindrical(1 + d * np.cos(angle), d * np.sin(angle), angle) for d in (1e-1, 1e-2, 1e-4, 1e-6)),
        cylindrical(np.linspace(0.05, 0.6, 32), 0.3),
        scattered(1, 32, 0.3, 3.0),
        scattered(2, 32, 30.0, 1000.0),
    ]
    points = RADIUS * np.concatenate(regimes)
    return points[np.random.default_rng(3).permutation(len(points))]


def in_blocks(points: Points, order: int) -> Floats:
    """(n, 15) packed jets from the block kernel, which is handed whole blocks and a rest."""
    packed = []
    for begin in range(0, len(points), BLOCK):
        piece = points[begin : begin + BLOCK]
        x, y, z = np.full((3, BLOCK), np.nan)  # what lies beyond `count` must not be read
        x[: len(piece)], y[: len(piece)], z[: len(piece)] = piece.T
        out = np.zeros((15, BLOCK))
        add_loops(x, y, z, len(piece), RADIUS, CURRENT, order, np.empty((WORK_ROWS, BLOCK)), out)
        assert not out[:, len(piece) :].any() and not out[ENTRIES[order] :].any()
        packed.append(out[:, : len(piece)].T)
    return np.concatenate(packed)


def one_by_one(points: Points, order: int) -> Floats:
    """(n, 15) packed jets from the scalar kernel."""
    packed = np.zeros((len(points), 15))
    for point, out in zip(points, packed, strict=True):
        add_loop(*point, RADIUS, CURRENT, order, out)
    return packed


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("count", [192, 45, 1])
def test_block_kernel_equals_the_scalar_one(order, count):
    """A block takes as many steps of the mean as its point nearest to the wire needs: no digit may change elsewhere."""
    points = mixed()[:count]
    blocks, single = in_blocks(points, order), one_by_one(points, order)
    for begin, end in zip((0, 3, 8), ENTRIES[: order + 1], strict=False):
        error, size = (np.linalg.norm(part[:, begin:end], axis=1) for part in (blocks - single, single))
        assert np.all(error <= 1e-13 * size)


def test_blocks_match_magpylib_in_all_regimes():
    points = mixed()
    peer = magpylib.current.Circle(diameter=2 * RADIUS, current=CURRENT)
    terms = loops(np.zeros((1, 3)), RADIUS, CURRENT)
    # magpylib's µ₀ differs by 1.6e-10; both lose digits 1e-6 radii from the wire, where the points themselves round
    assert relative(terms.jet(points, 0)[0], peer.getB(points)).max() < 1e-9


def test_kernels_add_to_what_is_there():
    points = mixed()[:BLOCK]
    out = np.ones((15, BLOCK))
    add_loops(*points.T.copy(), BLOCK, RADIUS, CURRENT, 2, np.empty((WORK_ROWS, BLOCK)), out)
    np.testing.assert_array_equal(out.T, 1 + in_blocks(points, 2))


def test_a_point_on_the_wire_spoils_no_other():
    points = mixed()[:BLOCK]
    alone = in_blocks(points, 2)
    points[7] = RADIUS, 0, 0
    spoilt = in_blocks(points, 2)
    assert not np.isfinite(spoilt[7]).all()
    rest = np.arange(BLOCK) != 7
    error, size = (np.linalg.norm(part[rest, :8], axis=1) for part in (spoilt - alone, alone))
    assert np.all(error < 1e-12 * size)
