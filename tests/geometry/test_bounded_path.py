"""Shortest ways of bounded curvature: smooth, from one direction into another, and no shorter than is possible."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magfem.geometry.bounded_path import bounded_paths

ANGLES = st.floats(-np.pi, np.pi)


def heading(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


@given(x=st.floats(-10, 10), y=st.floats(-10, 10), before=ANGLES, after=ANGLES)
def test_ways_join_smoothly_and_arrive(x: float, y: float, before: float, after: float) -> None:
    end, radius = np.array([x, y]), 0.7
    ways = bounded_paths(np.zeros(2), heading(before), end, heading(after), radius)
    lengths = [sum(leg.length for leg in way) for way in ways]
    assert lengths == sorted(lengths) and len(ways) >= 2
    for way in ways:
        place, direction = np.zeros(2), before
        for leg in way:
            np.testing.assert_allclose(leg.place, place, atol=1e-6)
            np.testing.assert_allclose(leg.along, heading(direction), atol=1e-6)
            if leg.turn:
                assert leg.length == pytest.approx(radius * abs(leg.turn))
                side = np.sign(leg.turn) * radius
                centre = place + side * heading(direction + np.pi / 2)
                direction += leg.turn
                place = centre - side * heading(direction + np.pi / 2)
            else:
                place = place + leg.length * heading(direction)
        np.testing.assert_allclose(place, end, atol=1e-6)
        np.testing.assert_allclose(heading(direction), heading(after), atol=1e-6)


def test_known_shortest_ways() -> None:
    def shortest(end: tuple[float, float], after: float) -> float:
        (way, *_) = bounded_paths(np.zeros(2), heading(0.0), np.array(end), heading(after), 1.0)
        return sum(leg.length for leg in way)

    assert shortest((5.0, 0.0), 0.0) == pytest.approx(5.0)
    assert shortest((0.0, 2.0), np.pi) == pytest.approx(np.pi)
    assert shortest((0.0, 6.0), np.pi) == pytest.approx(4.0 + np.pi)
    assert shortest((2.0, 2.0), 0.0) == pytest.approx(np.pi)
