"""Laws that every equilibrium obeys, and the Hessian's factors against one assembled by differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.fields import DipoleField, UniformField
from magfem.rod import FlexibleSection, MagnetSection, Rod
from magfem.rod.applied_field import applied_field
from magfem.rod.factored import factored, shape_of
from magfem.rod.interaction import interaction_of
from magfem.rod.loads import Loads

GRAVITY = np.array([1.0, -2.0, -9.0])
FIELD = DipoleField([0.0, 40.0, 20.0]).at(RigidTransform.from_translation([0.02, -0.09, 0.05]))
MAGNET = MagnetSection(length=5e-3, moment=(0.003, -0.004, 0.0135), mass=1e-4, field_points=3)


def flexible(length=0.03, **changes):
    given = dict(length=length, radius=1.5e-3, youngs_modulus=5.5e6, density=1040.0, poisson_ratio=0.4)
    return FlexibleSection(**(given | changes))


def test_forces_and_moments_balance_at_every_cross_section():
    """What a cross-section carries is all that acts beyond it: weight integrated along the shape, field, tip."""
    rod, force, moment = Rod([flexible(), MAGNET, flexible(0.04), MAGNET]), np.array([2e-3, 1e-3, 0]), np.zeros(3)
    state = rod.solve(field=FIELD, gravity=GRAVITY, tip_force=force)
    p, s = state.positions, state.arc_lengths
    area, half = np.pi * 1.5e-3**2, MAGNET.length / 2
    magnets = []
    for centre, frame in zip(state.magnet_positions, state.magnet_frames, strict=True):
        pull, turn = MAGNET.mass * GRAVITY, np.zeros(3)
        for x, w in zip(*np.polynomial.legendre.leggauss(3), strict=True):
            arm, mu = half * x * frame[:, 2], w / 2 * frame @ MAGNET.moment_vector
            B, gradient = FIELD.jet(centre + arm, 1)
            pull, turn = pull + gradient.T @ mu, turn + np.cross(mu, B) + np.cross(arm, gradient.T @ mu)
        magnets.append((centre, pull, turn))
    ends = np.cumsum([0, 0.03, 0.005, 0.04, 0.005])
    for k, here in enumerate(p):
        N, M = force.copy(), np.cross(p[-1] - here, force) + moment
        for (centre, pull, turn), middle in zip(magnets, (ends[1] + half, ends[3] + half), strict=True):
            if middle >= s[k] - 1e-12:
                N, M = N + pull, M + turn + np.cross(centre - here, pull)
        for begin, end in ((ends[0], ends[1]), (ends[2], ends[3])):
            mine = np.flatnonzero((s > begin - 1e-12) & (s < end + 1e-12))
            start = max(begin, s[k])
            if start < end:
                line = CubicSpline(s[mine], p[mine])
                weight = 1040 * area * GRAVITY
                N = N + (end - start) * weight
                M = M + np.cross(line.integrate(start, end) - (end - start) * here, weight)
        # What acts on the cross-section itself counts with its own share of the weight, half an element's; and its
        # moment, by the trapezoid rule that ends there, with an error of h²/12 times the weight per length.
        slack = 1040 * area * np.linalg.norm(GRAVITY) * np.diff(s).max() / 2
        assert np.linalg.norm(state.internal_force[k] - N) <= slack * (1 + 1e-9)
        assert np.linalg.norm(state.internal_moment[k] - M) <= slack * np.diff(s).max() / 6 * (1 + 1e-3)
    assert state.internal_force[0] == pytest.approx(N0(rod, magnets, force, area), rel=1e-12)
    forces, torques = state.magnet_wrenches
    assert forces == pytest.approx(np.array([one[1] for one in magnets]), rel=1e-12)
    assert torques == pytest.approx(np.array([one[2] for one in magnets]), rel=1e-9, abs=1e-15)


def N0(rod, magnets, force, area):
    """All forces on the rod."""
    return force + sum(one[1] for one in magnets) + 1040 * area * 0.07 * GRAVITY


def loads_of(name, chain, rod):
    """Loads with a potential, and without."""
    tip = dict(tip_force=np.array([0.02, -0.01, 0.03]))
    moments = np.array([one.moment_vector for one in rod.magnets])
    kinds = {
        "weight and tip": dict(gravity=50 * GRAVITY, **tip),
        "field": dict(applied=applied_field(100 * FIELD)),
        "among themselves": dict(interaction=interaction_of([None, None], 20 * moments)),
        "all": dict(
            applied=applied_field(100 * FIELD),
            gravity=GRAVITY,
            interaction=interaction_of([None, FIELD], moments),
            **tip,
        ),
        "dead moment": dict(tip_moment=np.array([4e-4, -3e-4, 5e-4]), **tip),
        "follower": dict(tip_moment=np.array([4e-4, -3e-4, 5e-4]), follower=True, **tip),
    }
    return Loads(chain, **kinds[name])


CONSERVATIVE = ("weight and tip", "field", "among themselves", "all")
SECTIONS = [
    flexible(elements=3, force_per_length=(0.3, 0.2, -0.4), intrinsic_strain=(0.05, 0.1, 0.9)),
    MAGNET,
    flexible(elements=4, magnetic_moment_per_length=(0.1, 0.0, 0.5)),
    MAGNET,
]


class Landscape:
    """Energy, gradient and Hessian of a rod in the twists of its flexible links, in units of the elastic energy."""

    def __init__(self, name, seed, sections=SECTIONS):
        self.rod = Rod(sections)
        self.chain = self.rod.chain
        self.loads = loads_of(name, self.chain, self.rod)
        pose = Rotation.from_rotvec([0.3, -0.2, 0.5])
        self.base = pose.as_matrix(), np.array([0.01, 0.02, -0.01])
        self.flexible = self.chain.flexible
        rng = np.random.default_rng(seed)
        self.scale = np.sqrt(1 / (self.chain.stiffness[self.flexible] / self.chain.length[self.flexible, None]))
        self.scale = np.concatenate([self.scale, self.scale], axis=1).ravel()
        shift = np.tile([0.2, 0.2, 0.2, 1e-3, 1e-3, 1e-3], 2) * rng.normal(size=(self.flexible.sum(), 12))
        self.x = (self.chain.rest[self.flexible] + shift).ravel()

    def twist(self, x):
        twist = np.zeros((self.chain.links, 12))
        twist[self.flexible] = x.reshape(-1, 12)
        return twist

    def energy(self, x):
        shape = shape_of(self.chain, self.twist(x), *self.base)
        return shape.elastic_energy + self.loads.act(shape.R, shape.p).energy

    def factored(self, x):
        shape = shape_of(self.chain, self.twist(x), *self.base)
        return factored(self.chain, shape, self.loads.act(shape.R, shape.p), self.loads.coupled)

    def gradient(self, x):
        return self.factored(x).gradient[self.flexible].ravel()

    def hessian(self, step=1e-5):
        columns = []
        for k, size in enumerate(self.scale * step * np.sqrt(self.chain.bending_scale)):
            e = np.zeros(self.x.size)
            e[k] = size
            columns.append((self.gradient(self.x + e) - self.gradient(self.x - e)) / (2 * size))
        return np.array(columns).T


@pytest.mark.parametrize("name", CONSERVATIVE)
def test_the_gradient_is_the_energys(name):
    land = Landscape(name, 1)
    exact, step = land.gradient(land.x), 1e-4
    for k, size in enumerate(land.scale * step * np.sqrt(land.chain.bending_scale)):
        e = np.zeros(land.x.size)
        e[k] = size
        difference = (land.energy(land.x + e) - land.energy(land.x - e)) / (2 * size)
        assert difference * land.scale[k] == pytest.approx(
            exact[k] * land.scale[k], abs=1e-7 * np.abs(exact * land.scale).max()
        )


@pytest.mark.parametrize("name", (*CONSERVATIVE, "dead moment", "follower"))
@pytest.mark.parametrize("seed", range(3))
def test_factors_solve_and_count_as_the_assembled_hessian(name, seed):
    """Newton's steps by NumPy's solver, eigenvalues by NumPy's, of the symmetric part and of the overdamped rod."""
    land = Landscape(name, seed)
    H, system = land.hessian(), land.factored(land.x)
    scaled = H * np.outer(land.scale, land.scale)
    if name in CONSERVATIVE:
        assert np.abs(scaled - scaled.T).max() < 1e-5 * np.abs(scaled).max()
    values = np.linalg.eigvalsh(0.5 * (scaled + scaled.T))
    assert np.abs(values).min() > 1e-6
    assert system.negative == np.count_nonzero(values < 0)
    elastic = np.kron(np.eye(len(scaled) // 12), np.kron([[7 / 4, 1 / 4], [1 / 4, 7 / 4]], np.eye(6)))
    creeping = np.linalg.eigvals(np.linalg.solve(elastic, scaled))  # of the overdamped rod
    assert system.unstable_directions == np.count_nonzero(creeping.real < 0)

    load = np.random.default_rng(seed).normal(size=land.x.size) / land.scale
    twist_load = land.twist(load)
    one, _ = system.step(twist_load)
    many, _ = system.answer(np.stack([twist_load, -2 * twist_load], axis=2))
    ours = one[land.flexible].ravel() / land.scale
    expected = np.linalg.solve(scaled, load * land.scale)
    assert ours == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    assert many[..., 0] == pytest.approx(one, rel=1e-9, abs=1e-12 * np.abs(one).max())
    assert many[..., 1] == pytest.approx(-2 * one, rel=1e-9, abs=1e-12 * np.abs(one).max())


def test_strong_loads_have_many_unstable_directions():
    """That the count above was of something."""
    counts = [land.factored(land.x).negative for land in (Landscape("field", seed) for seed in range(3))]
    assert max(counts) >= 2


def test_a_guess_leads_to_the_same_shape_in_fewer_steps():
    rod = Rod([flexible(), MAGNET, flexible(0.04), MAGNET])
    first = rod.solve(field=FIELD, gravity=GRAVITY)
    near = 1.02 * FIELD
    cold, warm = rod.solve(field=near, gravity=GRAVITY), rod.solve(field=near, gravity=GRAVITY, guess=first)
    assert warm.iterations < cold.iterations
    assert warm.positions == pytest.approx(cold.positions, abs=1e-10)


def test_a_rod_without_loads_keeps_its_shape():
    state = Rod([flexible(), MAGNET]).solve(gravity=(0, 0, 0))
    assert state.iterations == 0 and state.energy == 0.0
    assert state.positions[-1] == pytest.approx([0, 0, 0.035], abs=1e-15)


def test_a_turn_that_nothing_resists_is_no_instability():
    """A round rod buckled under a force along its axis may point anywhere about it: one eigenvalue is zero."""
    for radius, stiff in ((1e-3, 1e6), (1e-5, 1e12), (5e-3, 1e6)):
        section = FlexibleSection(length=0.1, radius=radius, youngs_modulus=stiff)
        critical = np.pi**2 / 4 * section.stiffness[0] / 0.1**2
        for load in (1.02, 1.5, 2.0, 3.0, 4.0, 9.0, 20.0, 50.0):
            state = Rod([section]).solve(gravity=(0, 0, 0), tip_force=(0, 0, -load * critical))
            assert state.stable and state.unstable_directions == 0
            assert np.hypot(*state.positions[-1][:2]) > 5e-3


def test_a_uniform_field_along_a_magnet_does_nothing():
    uniform = UniformField([0.0, 0.0, 5e-3])
    rod = Rod([flexible(), MagnetSection(length=5e-3, moment=0.0135)])
    state = rod.solve(field=uniform, gravity=(0, 0, 0))
    forces, torques = state.magnet_wrenches
    assert np.abs(forces).max() == 0.0 and np.abs(torques).max() < 1e-18
