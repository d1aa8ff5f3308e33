"""Errors of goals: against angles worked out by hand, and their slopes against differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from magfem.errors import InputError
from magfem.rod.goals import POSITION_SCALE, Goal, goal_error


def frames_of(rotation: Rotation) -> np.ndarray:
    return rotation.as_matrix()[None]


def test_the_angle_is_the_one_that_was_turned():
    for degrees in (1e-6, 0.01, 1.0, 45.0, 90.0, 135.0, 179.9):
        turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.8, 0.0]))
        for goal in (Goal(magnet=0, direction=(0, 0, 5.0)), Goal(magnet=0, rotation=Rotation.identity())):
            error = goal_error([goal], np.zeros((1, 3)), frames_of(turn))
            assert np.degrees(error.angles[0]) == pytest.approx(degrees, rel=1e-9)
            if degrees < 177:  # nearer to the opposite, a direction's error is that of an axis some way off it
                assert np.linalg.norm(error.vector) == pytest.approx(np.radians(degrees), rel=1e-9)


def test_a_direction_does_not_ask_about_twist():
    turn = Rotation.from_euler("z", 70, degrees=True)
    error = goal_error([Goal(magnet=0, direction=(0, 0, 1))], np.zeros((1, 3)), frames_of(turn))
    assert error.size < 1e-15


def test_positions_in_their_scale():
    error = goal_error(
        [Goal(magnet=1, position=(0, 0, 0))], np.array([[1, 1, 1], [3e-3, 4e-3, 0]]), np.tile(np.eye(3), (2, 1, 1))
    )
    assert error.distances[0] == pytest.approx(5e-3, rel=1e-12)
    assert error.size == pytest.approx(5e-3 / POSITION_SCALE, rel=1e-12)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_slopes_are_those_of_differences(seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    turn = Rotation.from_rotvec(rng.uniform(1e-3, 2.8) * axis / np.linalg.norm(axis))
    goals = [
        Goal(magnet=1, direction=rng.normal(size=3)),
        Goal(magnet=1, rotation=Rotation.random(rng=rng), position=rng.normal(size=3)),
    ]
    if (
        min(
            abs(np.pi - goal_error([one], np.zeros((2, 3)), np.tile(turn.as_matrix(), (2, 1, 1))).angles[0])
            for one in goals
        )
        < 0.1
    ):
        return  # opposite the goal, a direction's error has no slope
    p = rng.normal(size=(2, 3))

    def at(shift, small_turn):
        frames = np.stack([np.eye(3), (Rotation.from_rotvec(small_turn) * turn).as_matrix()])
        return goal_error(goals, p + np.stack([np.zeros(3), shift]), frames)

    slope, h = at(np.zeros(3), np.zeros(3)).slope, 1e-6
    assert np.all(slope[:, 0] == 0)
    for k in range(3):
        e = np.eye(3)[k] * h
        assert np.allclose((at(e, 0 * e).vector - at(-e, 0 * e).vector) / (2 * h), slope[:, 1, k], rtol=0, atol=1e-7)
        assert np.allclose(
            (at(0 * e, e).vector - at(0 * e, -e).vector) / (2 * h), slope[:, 1, 3 + k], rtol=0, atol=1e-7
        )


def test_opposite_a_direction_there_is_a_way_on():
    """At 180° the error is π long and finite, so that a step away from there is asked for."""
    error = goal_error([Goal(magnet=0, direction=(0, 0, -1))], np.zeros((1, 3)), np.eye(3)[None])
    assert np.linalg.norm(error.vector) == pytest.approx(np.pi, abs=0.06)
    assert np.isfinite(error.slope).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Goal(magnet=0), "a direction, a rotation or a position"),
        (lambda: Goal(magnet=0, direction=(0, 0, 0)), "must not be zero"),
        (lambda: Goal(magnet=0, direction=(0, 1)), "three finite numbers"),
        (lambda: Goal(magnet=0, direction=(0, 0, 1), rotation=Rotation.identity()), "either"),
        (
            lambda: goal_error([Goal(magnet=2, direction=(0, 0, 1))], np.zeros((2, 3)), np.zeros((2, 3, 3))),
            "counted from 0",
        ),
    ],
)
def test_what_is_no_goal(make, words):
    with pytest.raises(InputError, match=words):
        make()
