"""Where straight rods buckle: the load at which the Hessian's inertia changes, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jv

from magfem.fields import UniformField
from magfem.rod import FlexibleSection, MagnetSection, Rod

LENGTH, RADIUS, E = 0.1, 1e-5, 1e12
EI, AREA = E * np.pi * RADIUS**4 / 4, np.pi * RADIUS**2
WEIGHTLESS = dict(gravity=(0, 0, 0))


def slender(**changes):
    return FlexibleSection(length=LENGTH, radius=RADIUS, youngs_modulus=E, **changes)


def two_magnets():
    magnet = MagnetSection(length=0, moment=1.0)
    return Rod([slender(), magnet, slender(), magnet])


def compressed(load):
    return Rod([slender()]), dict(tip_force=(0, 0, -load * EI / LENGTH**2), **WEIGHTLESS)


def standing(load):
    return Rod([slender(density=load * EI / LENGTH**3 / (9.81 * AREA))]), {}


def magnetised_against(load):
    section = slender(magnetic_moment_per_length=(0, 0, 1.0))
    return Rod([section]), dict(field=UniformField((0, 0, -load * EI / LENGTH**2)), **WEIGHTLESS)


def magnets_against(load):
    return two_magnets(), dict(field=UniformField((0, 0, -load * EI / LENGTH)), **WEIGHTLESS)


# Greenhill, Proc. Camb. Phil. Soc. 4 (1881) 65: 9/4 of the square of the first zero of J₋₁/₃.
GREENHILL = 9 / 4 * brentq(lambda x: jv(-1 / 3, x), 1.5, 2.5, xtol=1e-14) ** 2
# A hard-magnetic rod against the field obeys Euler's equation. Two equal magnets, each section a rotational spring
# EI/L: det [2 − q, −1; −1, 1 − q] = 0 with q = µBL/EI.
CASES = {
    "Euler": (compressed, np.pi**2 / 4),
    "own weight": (standing, GREENHILL),
    "hard-magnetic": (magnetised_against, np.pi**2 / 4),
    "two magnets": (magnets_against, (3 - np.sqrt(5)) / 2),
}


@pytest.mark.parametrize("name", CASES)
def test_critical_load_by_the_inertia(name):
    make, expected = CASES[name]

    def unstable_directions(load):
        rod, loads = make(load)
        state = rod.solve(leave_saddles=False, **loads)
        assert state.positions[-1][:2] == pytest.approx([0, 0], abs=1e-12)
        return state.unstable_directions

    low, high = 0.8 * expected, 1.2 * expected
    assert unstable_directions(low) == 0 and unstable_directions(high) == 2  # x and y buckle together
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if unstable_directions(middle) == 0 else (low, middle)
    assert low == pytest.approx(expected, abs=1e-5)


def test_greenhills_number():
    assert pytest.approx(7.83735, abs=5e-6) == GREENHILL


def test_a_flat_rod_buckles_one_way_first():
    from magfem.rod import CrossSection

    flat = CrossSection(AREA, EI / E, 2 * EI / E, 1e-17)
    rod = Rod([FlexibleSection(length=LENGTH, cross_section=flat, youngs_modulus=E)])
    unit = np.pi**2 / 4 * EI / LENGTH**2
    for load, expected in ((0.99, 0), (1.01, 1), (1.99, 1), (2.01, 2), (8.99, 2), (9.01, 3)):
        state = rod.solve(tip_force=(0, 0, -load * unit), leave_saddles=False, **WEIGHTLESS)
        assert (state.unstable_directions, state.stable) == (expected, expected == 0)


@pytest.mark.parametrize("load", [0.3, 0.39, 0.5, 2.0, 10.0, 40.0])
def test_saddles_are_left_for_a_stable_shape(load):
    """The straight rod is an equilibrium for every load; beyond the critical one the solver goes on from it.

    The bent shape obeys θ₁ − (θ₂ − θ₁) = q sin θ₁, θ₂ − θ₁ = q sin θ₂; it may point anywhere about the axis, and
    this turn, which costs nothing, is no instability.
    """
    rod, loads = magnets_against(load)
    state = rod.solve(**loads)
    assert state.stable and state.unstable_directions == 0
    one, two = np.arccos(np.clip(state.magnet_frames[:, 2, 2], -1, 1))
    assert 2 * one - two == pytest.approx(load * np.sin(one), abs=1e-6)
    assert two - one == pytest.approx(load * np.sin(two), abs=1e-6)
    assert (two > 0.1) == (load > (3 - np.sqrt(5)) / 2)


def test_an_unstable_equilibrium_is_said_to_be_one():
    rod, loads = magnets_against(0.5)
    state = rod.solve(leave_saddles=False, **loads)
    assert state.converged and not state.stable
    assert (state.outcome, state.unstable_directions) == ("unstable", 2)
    assert "unstable" in repr(state)
    assert rod.solve(**loads).energy < state.energy
