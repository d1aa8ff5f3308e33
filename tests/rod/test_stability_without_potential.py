"""Stability under loads that have no potential: textbook shapes that are stable, and Beck's column."""

from __future__ import annotations

import numpy as np
import pytest

from magfem.rod import FlexibleSection, Rod

SECTION = FlexibleSection(length=0.1, radius=1e-3, youngs_modulus=1e7)
EI, L = float(SECTION.stiffness[0]), 0.1


@pytest.mark.parametrize("follower", [False, True])
@pytest.mark.parametrize("turn", [1.0, 2.5, 3.0, 6.0, 2 * np.pi])
def test_a_rod_bent_into_an_arc_by_a_moment_is_stable(turn, follower):
    """Pure bending up to the full circle: the moment is the same all along, and nothing lets the arc go."""
    state = Rod([SECTION]).solve(gravity=(0, 0, 0), tip_moment=(0, turn * EI / L, 0), follower=follower)
    z = state.frames[-1, :, 2]
    assert np.array([z[2], z[0]]) == pytest.approx(np.array([np.cos(turn), np.sin(turn)]), abs=1e-6)
    assert state.stable and state.unstable_directions == 0


def test_a_side_force_that_follows_the_tip():
    state = Rod([SECTION]).solve(gravity=(0, 0, 0), tip_force=(5 * EI / L**2, 0, 0), follower=True)
    assert state.stable


@pytest.mark.parametrize("load", [1.0, 3.0, 10.0, 19.0])
def test_becks_column_does_not_buckle(load):
    """A thrust along the tip has no static critical load; Beck's 20.05 EI/L² is that of flutter."""
    state = Rod([SECTION]).solve(gravity=(0, 0, 0), tip_force=(0, 0, -load * EI / L**2), follower=True)
    assert state.stable
    assert np.abs(state.positions[:, :2]).max() < 1e-12


def test_a_straight_column_above_eulers_load_is_unstable_with_the_same_moment():
    state = Rod([SECTION]).solve(
        gravity=(0, 0, 0),
        tip_force=(0, 0, -3 * EI / L**2),
        tip_moment=(0, 0, 1e-3 * EI / L),
        leave_saddles=False,
    )
    assert not state.stable and state.unstable_directions == 2
