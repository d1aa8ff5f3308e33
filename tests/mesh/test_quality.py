"""Shape measures against elements made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.geometry import BlockMagnet, PermanentMagnet
from magfem.mesh.generate import generate
from magfem.mesh.mesh import Mesh
from magfem.mesh.quality import quality, shape_measures


def one_element(corners: list[list[float]]) -> Mesh:
    d = len(corners) - 1
    nodes = 10 if d == 3 else 6
    points = np.concatenate([np.array(corners, dtype=float), np.zeros((nodes - d - 1, d))])
    return Mesh(points, np.arange(nodes)[None], np.array([-1]), (), 1.0)


REGULAR = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
RIGHT = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_known_shapes() -> None:
    assert shape_measures(one_element([REGULAR[k] for k in (1, 0, 2, 3)]))[0] == pytest.approx(1.0)
    assert shape_measures(one_element([[0, 0], [2, 0], [1, 3**0.5]]))[0] == pytest.approx(1.0)
    # 12 (3V)^(2/3) / Σ edge² (Liu and Joe's other form): V = 1/6, edges² 1, 1, 1, 2, 2, 2.
    assert shape_measures(one_element(RIGHT))[0] == pytest.approx(12 * 0.5 ** (2 / 3) / 9)
    # 4√3 area / Σ edge² for triangles: area 1/2, edges² 1, 1, 2.
    assert shape_measures(one_element([[0, 0], [1, 0], [0, 1]]))[0] == pytest.approx(4 * 3**0.5 * 0.5 / 4)


def test_shape_does_not_know_size_or_place_and_flat_ones_have_none() -> None:
    moved = (np.array(RIGHT) * 1e-3 + 5).tolist()
    assert shape_measures(one_element(moved))[0] == pytest.approx(shape_measures(one_element(RIGHT))[0], rel=1e-6)
    flat = [*RIGHT[:3], [0.3, 0.3, 1e-6]]
    assert shape_measures(one_element(flat))[0] < 1e-3
    inverted = [RIGHT[0], RIGHT[2], RIGHT[1], RIGHT[3]]
    assert shape_measures(one_element(inverted))[0] == 0.0


def test_a_device_gets_well_shaped_elements() -> None:
    found = quality(generate(BlockMagnet(size=(5e-3, 5e-3, 2e-3), material=PermanentMagnet(1.3)), 3, 0.5))
    assert 0.1 < found.least < found.mean < 1.0
    assert found.mean > 0.6
