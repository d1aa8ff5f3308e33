"""Groups of terms in one call: each group's jet is what the group gives alone, to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from exchange.exchanged_fields import KINDS, SHELL

from magfem import threads
from magfem.fields.packing import BLOCK
from magfem.fields.term_groups import TermGroups
from magfem.fields.terms import PARALLEL_FROM, Terms
from magfem.typing import Jet, Points

GROUPS = list(
    KINDS.values()
)  # every kind, and all in one: groups of one source and of many, of one frame and of several


def scattered(count: int) -> Points:
    """Points (count, 3) m off every source."""
    points: Points = SHELL.layers(np.random.default_rng(8), 40, -(-count // 40)).reshape(-1, 3)[:count]
    return points


def same(together: Jet, groups: list[Terms], points: Points, order: int) -> bool:
    """Whether every group's part is the bits of its own jet, and nothing else came out."""
    alone = [terms.jet(points, order) for terms in groups]
    expected = [np.array(parts) for parts in zip(*alone, strict=True)]
    return len(together) == order + 1 and all(map(np.array_equal, together, expected))


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("count", [1, BLOCK - 1, 3 * BLOCK + 5])
def test_every_group_is_what_it_is_alone(order: int, count: int) -> None:
    points = scattered(count)
    together = TermGroups(GROUPS).jets(points, order)
    assert same(together, GROUPS, points, order)
    assert all(np.isfinite(part).all() and part.any(axis=tuple(range(1, part.ndim))).all() for part in together[:1])


@pytest.mark.parametrize("name", KINDS)
def test_one_group_of_every_kind(name: str) -> None:
    points = scattered(40)
    assert same(TermGroups([KINDS[name]]).jets(points, 2), [KINDS[name]], points, 2)


def test_groups_keep_their_order_and_may_repeat() -> None:
    """Neighbours share no frame, rotation or coefficients: any order gives the same fields."""
    points = scattered(50)
    order = np.random.default_rng(5).permutation(np.repeat(np.arange(len(GROUPS)), 2))
    mixed = [GROUPS[k] for k in order]
    assert same(TermGroups(mixed).jets(points, 1), mixed, points, 1)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_no_points(order: int) -> None:
    jet = TermGroups(GROUPS).jets(np.empty((0, 3)), order)
    assert [part.shape for part in jet] == [(len(GROUPS), 0, *(3,) * rank) for rank in range(1, order + 2)]


@pytest.mark.parametrize("processors", [1, 2, 3])
def test_many_points_across_threads(processors: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The truth is made of pieces too small to be shared among threads."""
    groups = [KINDS[name] for name in ("loops", "tilted loop", "transverse harmonics", "uniform")]
    points = scattered(3 * PARALLEL_FROM + 17)
    step = 100 * BLOCK
    pieces = [[terms.jet(points[k : k + step], 2) for k in range(0, len(points), step)] for terms in groups]
    monkeypatch.setattr(threads, "_processors", lambda: processors)
    together = TermGroups(groups).jets(points, 2)
    for g, parts in enumerate(pieces):
        for ours, truth in zip(together, zip(*parts, strict=True), strict=True):
            assert np.array_equal(ours[g], np.concatenate(truth))
