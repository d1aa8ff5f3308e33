"""Reading matrices as gain and rotation: against their definition and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magfem.localization.gain_split import split_derivatives, split_gain


@pytest.mark.parametrize("hand", [1, -1])
def test_a_gain_is_symmetric_and_the_rest_a_rotation(hand: int) -> None:
    rng = np.random.default_rng(1)
    gain = np.diag([1.1, 0.9, 1.0]) + 0.05 * np.ones((3, 3))
    turn = Rotation.random(5, random_state=rng).as_matrix()
    found, turned = split_gain(hand * gain @ turn)
    assert found == pytest.approx(np.broadcast_to(hand * gain, (5, 3, 3)), abs=1e-14)
    assert turned == pytest.approx(turn, abs=1e-14)


@pytest.mark.parametrize("hand", [1, -1])
def test_its_changes_are_those_of_finite_differences(hand: int) -> None:
    rng = np.random.default_rng(2)
    matrix = hand * (np.eye(3) + 0.2 * rng.normal(size=(3, 3)))
    gain, turn = split_gain(matrix)
    d_gain, d_turn = split_derivatives(gain, turn)
    step = 1e-6
    for column, change in enumerate(np.eye(9).reshape(9, 3, 3)):
        after, before = (split_gain(matrix + sign * step * change) for sign in (1, -1))
        assert (after[0] - before[0]).ravel() / (2 * step) == pytest.approx(d_gain[:, column], abs=1e-8)
        # The mounting's axes, in the frame they are stated in, are the columns of Uᵀ: a turn about its own axes.
        own = Rotation.from_matrix(before[1] @ after[1].T).as_rotvec() / (2 * step)
        assert own == pytest.approx(d_turn[:, column], abs=1e-8)
