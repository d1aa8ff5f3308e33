"""Magnets of one rod that act on each other: closed forms of two dipoles, reaction, balance, buckling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.errors import InputError
from magfem.fields import DipoleField, UniformField
from magfem.rod import FlexibleSection, MagnetSection, Rod
from magfem.rod.interaction import interaction_of

MU_0 = 4e-7 * np.pi
WEIGHTLESS = dict(gravity=(0, 0, 0))


def dipoles(moments, places, turns=None):
    moments = np.array(moments, float)
    turns = [Rotation.identity()] * len(moments) if turns is None else turns
    return interaction_of([None] * len(moments), moments).act(
        np.array([one.as_matrix() for one in turns]), np.array(places, float)
    )


@pytest.mark.parametrize("one,other", [(0.02, 0.03), (0.02, -0.03)])
def test_two_dipoles_in_line_and_side_by_side(one, other):
    """Forces 3µ₀m₁m₂/2πr⁴ in line and −3µ₀m₁m₂/4πr⁴ side by side; energies −µ₀m₁m₂/2πr³ and µ₀m₁m₂/4πr³."""
    r = 0.04
    energy, wrench, _ = dipoles([[0, 0, one], [0, 0, other]], [[0, 0, 0], [0, 0, r]])
    force = 3 * MU_0 * one * other / (2 * np.pi * r**4)
    assert energy == pytest.approx(-MU_0 * one * other / (2 * np.pi * r**3), rel=1e-7)
    assert wrench[0, 3:] == pytest.approx([0, 0, force], rel=1e-7, abs=1e-15)
    assert wrench[:, :3] == pytest.approx(np.zeros((2, 3)), abs=1e-18)
    energy, wrench, _ = dipoles([[0, 0, one], [0, 0, other]], [[0, 0, 0], [r, 0, 0]])
    assert energy == pytest.approx(MU_0 * one * other / (4 * np.pi * r**3), rel=1e-7)
    assert wrench[0, 3:] == pytest.approx([-force / 2, 0, 0], rel=1e-7, abs=1e-15)


def test_two_dipoles_askew():
    """Torque m₁ × B₂ with the dipole's formula, at right angles: µ₀m₁m₂/2πr³ and half of it."""
    r, one, other = 0.04, 0.02, 0.03
    _, wrench, _ = dipoles([[0, 0, one], [other, 0, 0]], [[0, 0, 0], [r, 0, 0]])
    torque = MU_0 * one * other / (2 * np.pi * r**3)
    assert wrench[0, :3] == pytest.approx([0, torque, 0], rel=1e-7, abs=1e-18)
    assert wrench[1, :3] == pytest.approx([0, torque / 2, 0], rel=1e-7, abs=1e-18)


def random_magnets(seed, fields=(None, None, None)):
    rng = np.random.default_rng(seed)
    moments = 0.02 * rng.normal(size=(3, 3))
    turns = Rotation.random(3, rng=rng).as_matrix()
    return interaction_of(fields, moments), turns, np.array([[0, 0, 0], [0, 0.01, 0.04], [0.02, 0, 0.08]])


@pytest.mark.parametrize("seed", range(3))
def test_action_is_reaction(seed):
    act, R, p = random_magnets(seed, (None, magfem.load_model("ring_magnet_4x1.5x1"), None))
    _, wrench, _ = act.act(R, p)
    size = np.abs(wrench[:, 3:]).max()
    assert wrench[:, 3:].sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-14 * size)
    about_origin = wrench[:, :3] + np.cross(p, wrench[:, 3:])
    assert about_origin.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-14 * np.abs(about_origin).max())


@pytest.mark.parametrize("seed", range(3))
def test_wrenches_are_minus_the_energys_gradient(seed):
    act, R, p = random_magnets(seed)
    _, wrench, _ = act.act(R, p)
    step, found = 1e-5, np.zeros((3, 6))
    for k in range(3):
        for i in range(6):
            energies = []
            for sign in (1, -1):
                Rs, ps = R.copy(), p.copy()
                if i < 3:
                    Rs[k] = Rotation.from_rotvec(sign * step * np.eye(3)[i]).as_matrix() @ R[k]
                else:
                    ps[k] += sign * step * np.eye(3)[i - 3]
                energies.append(act.act(Rs, ps)[0])
            found[k, i] = (energies[1] - energies[0]) / (2 * step)
    assert found[:, :3] == pytest.approx(wrench[:, :3], rel=1e-6, abs=1e-6 * np.abs(wrench[:, :3]).max())
    assert found[:, 3:] == pytest.approx(wrench[:, 3:], rel=1e-6, abs=1e-6 * np.abs(wrench[:, 3:]).max())


def test_a_magnets_own_model_of_a_dipole_is_a_dipole():
    """The field of half the moment, twice; placed in the magnet's frame."""
    _, R, p = random_magnets(4)
    moments = np.array([[0, 0, 0.02], [0.01, 0, 0.0], [0, 0.01, 0.01]])
    fields = [2 * DipoleField(0.5 * one) for one in moments]
    ours, plain = interaction_of(fields, moments).act(R, p), interaction_of([None] * 3, moments).act(R, p)
    for one, other in zip(ours, plain, strict=True):
        assert one == pytest.approx(other, rel=1e-12, abs=1e-18)


def soft(**changes):
    return FlexibleSection(**(dict(length=0.02, radius=1e-3, youngs_modulus=1e6) | changes))


def test_magnets_in_line_stretch_or_press_the_rod_between_them():
    """Attraction shortens the section between the magnets, N = F(r) along it: r = d + L (1 − F(r)/EA)."""
    d, L = 4e-3, 0.01
    for sign in (1, -1):
        one, other = MagnetSection(length=d, moment=0.02), MagnetSection(length=d, moment=sign * 0.02)
        section = soft(length=L, radius=4e-3, youngs_modulus=1e5)
        state = Rod([soft(), one, section, other], magnet_fields=[None, None]).solve(**WEIGHTLESS)
        r, EA = d + L, 1e5 * np.pi * 4e-3**2
        for _ in range(60):
            r = d + L * (1 - sign * 3 * MU_0 * 4e-4 / (2 * np.pi * r**4) / EA)
        assert state.stable
        assert np.diff(state.magnet_positions[:, 2]) == pytest.approx(r, rel=1e-6)
        assert abs(r - d - L) > 1e-4 * L


def test_attraction_buckles_a_rod_at_the_closed_forms_load():
    """A magnet at the base and one at the tip, in line, press the rod of length L between them with N = 6k/L.

    To second order the pair's energy is k (−2 + θ² − 3θw/L + 6w²/L²), k = µ₀m²/4πL³, for a tip offset w and turn θ; the
    rod is Euler's column, y = A (cos κx − 1) + B (sin κx − κx), κ² = N/EI. Moments and shear at the tip balance where
    a determinant in A and B vanishes.
    """
    L, moment = 0.02, 0.02
    k = MU_0 / (4 * np.pi) * moment**2 / L**3
    N = 6 * k / L

    def determinant(phi):
        """In units of N: moment and shear, rows, of A and B, columns; φ = κL."""
        c, s = np.cos(phi), np.sin(phi)
        w, theta = np.array([c - 1, s - phi]) * L, phi * np.array([-s, c - 1])
        curvature, its_slope = -N * np.array([c, s]), N * phi / L * np.array([s, -c])  # EI y″, EI y‴
        turning = curvature * L + k * (2 * theta - 3 * w / L)
        pushing = -its_slope * L - N * theta + k * (12 * w / L**2 - 3 * theta / L)
        return turning[0] * pushing[1] - turning[1] * pushing[0]

    grid = np.linspace(0.5, 12, 1000)
    signs = np.sign([determinant(phi) for phi in grid])
    first = int(np.flatnonzero(np.diff(signs))[0])
    EI = N * L**2 / brentq(determinant, grid[first], grid[first + 1]) ** 2

    def unstable_directions(factor):
        between = FlexibleSection(length=L, radius=1e-5, youngs_modulus=factor * EI / (np.pi * 1e-5**4 / 4))
        magnet = MagnetSection(length=0, moment=moment)
        rod = Rod([magnet, between, magnet], magnet_fields=[None, None])
        state = rod.solve(leave_saddles=False, **WEIGHTLESS)
        assert state.positions[-1][:2] == pytest.approx([0, 0], abs=1e-12)
        return state.unstable_directions

    assert unstable_directions(1 + 1e-4) == 0
    assert unstable_directions(1 - 1e-4) == 2


def test_interaction_changes_the_shape_and_lowers_the_energy():
    """Two magnets side by side in a field across the rod: with interaction the equilibrium is another, still stable."""
    magnet = MagnetSection(length=4e-3, moment=0.02)
    sections, field = [soft(), magnet, soft(), magnet], UniformField([2e-3, 0, 0])
    alone, together = Rod(sections), Rod(sections, magnet_fields=[None, None])
    first, second = alone.solve(field=field, **WEIGHTLESS), together.solve(field=field, **WEIGHTLESS)
    assert second.stable and np.linalg.norm(first.positions[-1] - second.positions[-1]) > 1e-5
    start = together.solve(field=field, guess=first, **WEIGHTLESS)
    assert start.positions[-1] == pytest.approx(second.positions[-1], abs=1e-9)


def test_placed_rods_interact_alike():
    """Moving a rod with its field moves its answer: nothing of the interaction knows where the world's origin is."""
    magnet = MagnetSection(length=4e-3, moment=(0.004, 0.0, 0.02))
    sections = [soft(), magnet, soft(), magnet]
    pose = RigidTransform.from_components([0.1, -0.2, 0.3], Rotation.from_rotvec([0.4, 1.0, -0.7]))
    B = np.array([3e-3, 1e-3, 0.0])
    here = Rod(sections, magnet_fields=[None, None]).solve(field=UniformField(B), **WEIGHTLESS)
    there = Rod(sections, pose, magnet_fields=[None, None]).solve(
        field=UniformField(pose.rotation.apply(B)), **WEIGHTLESS
    )
    assert there.positions == pytest.approx(pose.apply(here.positions), abs=1e-10)


def test_a_field_for_every_magnet():
    with pytest.raises(InputError, match="2 magnets, and magnet_fields has 1"):
        magnet = MagnetSection(length=4e-3, moment=0.02)
        Rod([soft(), magnet, magnet], magnet_fields=[None])
