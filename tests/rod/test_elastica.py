"""Shapes with a closed form: elasticas, arcs, helices, clothoids, and rods that shear and stretch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.special import ellipeinc, ellipkinc, fresnel

from magfem.fields import UniformField
from magfem.rod import CrossSection, FlexibleSection, MagnetSection, Rod

LENGTH, RADIUS, E = 0.1, 1e-5, 1e12  # as slender as the inextensible rod of the closed forms
EI = E * np.pi * RADIUS**4 / 4
WEIGHTLESS = dict(gravity=(0, 0, 0))


def slender(**changes):
    return FlexibleSection(**(dict(length=LENGTH, radius=RADIUS, youngs_modulus=E) | changes))


def angle(state):
    """Of the tip from the base's axis, rad."""
    return np.arccos(state.frames[-1][2, 2])


def elastica(load):
    """Tip angle, x/L across and z/L along, of a cantilever under a dead tip force across it, load = PL²/EI.

    Source: Bisshopp & Drucker, Quart. Appl. Math. 3 (1945) 272: sin θ_tip = 2k² − 1, √load = K(k) − F(φ, k),
    sin φ = 1/(k√2).
    """

    def parts(tip):
        m = (1 + np.sin(tip)) / 2
        phi = np.arcsin(1 / np.sqrt(2 * m))
        return ellipkinc(np.pi / 2, m) - ellipkinc(phi, m), ellipeinc(np.pi / 2, m) - ellipeinc(phi, m)

    a = np.sqrt(load)
    tip = brentq(lambda tip: parts(tip)[0] - a, 1e-9, np.pi / 2 - 1e-12, xtol=1e-15)
    return tip, 1 - 2 * parts(tip)[1] / a, np.sqrt(2 * np.sin(tip)) / a


@pytest.mark.parametrize("load", [1, 2, 5, 10, 20, 50])
def test_euler_elastica(load):
    state = Rod([slender()]).solve(tip_force=(load * EI / LENGTH**2, 0, 0), **WEIGHTLESS)
    tip, across, along = elastica(load)
    assert state.stable
    assert angle(state) == pytest.approx(tip, abs=1e-5)
    assert state.positions[-1] / LENGTH == pytest.approx([across, 0, along], abs=1e-5)


def test_shapes_converge_with_order_four():
    _, across, along = elastica(10.0)
    rigid = CrossSection(1e-6, EI / E, EI / E, EI / E)  # against shear and extension
    errors = []
    for elements in (8, 16, 32, 64):
        state = Rod([slender(radius=None, cross_section=rigid, elements=elements)]).solve(
            tip_force=(10 * EI / LENGTH**2, 0, 0), **WEIGHTLESS
        )
        errors.append(np.linalg.norm(state.positions[-1] / LENGTH - [across, 0, along]))
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((order > 3.7) & (order < 4.3))


@pytest.mark.parametrize("beta", [0.3, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("direction", [0.5, 1.5, 2.8])
def test_tip_magnet_in_a_uniform_field(beta, direction):
    """A pure torque bends an arc: θ = β sin(φ − θ), β = µBL/EI, φ the field's direction."""
    moment = 0.01
    B = beta * EI / (moment * LENGTH) * np.array([np.sin(direction), 0, np.cos(direction)])
    state = Rod([slender(), MagnetSection(length=0, moment=moment)]).solve(field=UniformField(B), **WEIGHTLESS)
    theta = brentq(lambda theta: theta - beta * np.sin(direction - theta), 0, np.pi, xtol=1e-15)
    assert state.stable
    assert angle(state) == pytest.approx(theta, rel=1e-8)
    assert state.positions[-1] / LENGTH == pytest.approx([(1 - np.cos(theta)) / theta, 0, np.sin(theta) / theta])


# Tip angle in degrees of a hard-magnetic cantilever, magnetised along itself, in a field across it; λ = M A B L²/EI.
# Source: the problem θ'' = −λ cos θ, θ(0) = θ'(1) = 0, of Wang, Kim, Guo & Zhao, J. Mech. Phys. Solids 142 (2020)
# 104045.
HARD_MAGNETIC = {0.1: 2.86216802, 0.5: 14.01074593, 1: 26.43351959, 2: 44.79096598, 5: 69.63546369, 10: 81.94932487}


@pytest.mark.parametrize("load", HARD_MAGNETIC)
def test_hard_magnetic_elastica(load):
    section = slender(magnetic_moment_per_length=(0, 0, 1.0))
    state = Rod([section]).solve(field=UniformField((load * EI / LENGTH**2, 0, 0)), **WEIGHTLESS)
    assert state.stable
    assert angle(state) == pytest.approx(np.radians(HARD_MAGNETIC[load]), abs=1e-5)


@pytest.mark.parametrize("load", HARD_MAGNETIC)
def test_hard_magnetic_elastica_is_eulers(load):
    """The same rod under the equivalent dead tip force MAB: the same θ'' = −λ cos θ."""
    state = Rod([slender()]).solve(tip_force=(load * EI / LENGTH**2, 0, 0), **WEIGHTLESS)
    assert np.degrees(angle(state)) == pytest.approx(HARD_MAGNETIC[load], abs=1e-5)


def test_torques_along_a_section_converge_with_order_two():
    for changes, loads in (
        (dict(magnetic_moment_per_length=(0, 0, 1.0)), dict(field=UniformField((5 * EI / LENGTH**2, 0, 0)))),
        (dict(moment_per_length=(0, 3 * EI / LENGTH**2, 2 * EI / LENGTH**2)), {}),
    ):
        tips = [
            Rod([slender(elements=n, **changes)]).solve(**loads, **WEIGHTLESS).positions[-1] for n in (16, 32, 64, 128)
        ]
        steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
        order = np.log2(steps[:-1] / steps[1:])
        assert np.all((order > 1.8) & (order < 2.2))


@pytest.mark.parametrize(("curvature", "slope", "twist"), [(8.0, 0.6, 5.0), (15.0, 1.0, -10.0), (12.0, 1.4, 0.0)])
def test_helix_under_its_end_wrench(curvature, slope, twist):
    """Any helix is an equilibrium of a straight, symmetric rod, under a wrench along its axis.

    m = EI κ b + GJ τ t in Frenet's frame; N along the axis and M about it hold it: m = M z + ρ N e_φ.  Source: Love,
    Mathematical theory of elasticity, § 270.
    """
    section = slender(youngs_modulus=1e6, radius=1e-3, poisson_ratio=0.4, elements=32)
    bending, _, torsion = section.stiffness[:3]
    section = slender(  # as stiff in bending, without shear and extension
        youngs_modulus=1e6,
        radius=None,
        elements=32,
        shear_modulus=1e6,
        cross_section=CrossSection(1e3, bending / 1e6, bending / 1e6, torsion / 1e6),
    )
    s, c = np.sin(slope), np.cos(slope)
    rho = s**2 / curvature
    M = bending * curvature * s + torsion * twist * c
    N = (-bending * curvature * c + torsion * twist * s) / rho
    turn = s * LENGTH / rho

    def pose(phi):
        """Tangent, e_φ, and place at the azimuth φ."""
        e = np.array([-np.sin(phi), np.cos(phi), 0.0])
        return s * e + [0, 0, c], e, np.array([rho * np.cos(phi), rho * np.sin(phi), phi * rho * c / s])

    tangent, _, start = pose(0.0)
    base = RigidTransform.from_components(
        start, Rotation.from_matrix(np.array([[1, 0, 0], np.cross(tangent, [1, 0, 0]), tangent]).T)
    )
    end_tangent, around, end = pose(turn)
    state = Rod([section], base).solve(
        tip_force=(0, 0, N), tip_moment=rho * N * around + [0, 0, M], leave_saddles=False, **WEIGHTLESS
    )
    assert state.positions[-1] == pytest.approx(end, abs=1e-6 * LENGTH)
    assert state.frames[-1][:, 2] == pytest.approx(end_tangent, abs=1e-5)
    _, strains = state.gauss_strains
    assert np.linalg.norm(strains[:, :2], axis=1) == pytest.approx(curvature, rel=1e-5)
    assert strains[:, 2] == pytest.approx(twist, abs=1e-5 * curvature)


def test_an_unloaded_rod_has_its_own_shape():
    """Constant curvature and strain are one screw motion, exp(L ξ); a curvature that grows is a clothoid."""
    u, v = np.array([5.0, -3.0, 12.0]), np.array([0.1, -0.2, 1.1])
    screw = np.zeros((4, 4))
    screw[:3, :3] = [[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]]
    screw[:3, 3] = v
    state = Rod([slender(intrinsic_curvature=u, intrinsic_strain=v)]).solve(**WEIGHTLESS)
    assert state.tip.as_matrix() == pytest.approx(expm(LENGTH * screw), abs=1e-12)

    rate = 400.0  # 1/m²
    bent = slender(intrinsic_curvature=lambda s: np.stack([0 * s, rate * s, 0 * s], axis=1), elements=32)
    S, C = fresnel(LENGTH * np.sqrt(rate / np.pi))
    tip = np.sqrt(np.pi / rate) * np.array([S, 0, C])
    assert Rod([bent]).solve(**WEIGHTLESS).positions[-1] == pytest.approx(tip, abs=1e-8)


def test_a_short_soft_rod_shears_and_stretches():
    """Timoshenko's beam under small loads: PL³/3EI + PL/GA across, PL/EA along, TL/GJ of twist."""
    rod = Rod([FlexibleSection(length=0.02, radius=5e-3, youngs_modulus=1e5, poisson_ratio=0.3)])
    G, A, second = 1e5 / 2.6, np.pi * 25e-6, np.pi * 5e-3**4 / 4
    force, torque = 1e-6, 1e-9
    across = rod.solve(tip_force=(force, 0, 0), tolerance=1e-13, **WEIGHTLESS).positions[-1][0]
    assert across == pytest.approx(force * (0.02**3 / (3e5 * second) + 0.02 / (G * A)), rel=1e-6)
    along = rod.solve(tip_force=(0, 0, 1.0), **WEIGHTLESS).positions[-1][2]
    assert along == pytest.approx(0.02 * (1 + 1.0 / (1e5 * A)), rel=1e-12)
    twisted = rod.solve(tip_moment=(0, 0, torque), tolerance=1e-13, **WEIGHTLESS).rotations[-1].as_rotvec()
    assert twisted == pytest.approx([0, 0, torque * 0.02 / (G * 2 * second)], rel=1e-9)


def test_cross_sections_are_those_of_textbooks():
    disc, tube = CrossSection.disc(2e-3), CrossSection.tube(1e-3, 2e-3)
    assert disc.torsion_constant == pytest.approx(np.pi / 2 * 2e-3**4)
    assert tube.second_moment_x == pytest.approx(np.pi / 64 * (4e-3**4 - 2e-3**4))
    # Timoshenko & Goodier, Theory of elasticity, § 109: J = k a b³.
    for ratio, k in ((1.0, 0.1406), (1.5, 0.196), (2.0, 0.229), (5.0, 0.291), (10.0, 0.312)):
        assert CrossSection.rectangle(ratio * 1e-3, 1e-3).torsion_constant == pytest.approx(k * ratio * 1e-12, rel=3e-3)
    flat = CrossSection.rectangle(3e-3, 1e-3)
    assert (flat.second_moment_x, flat.second_moment_y) == pytest.approx((3e-12 / 12, 27e-12 / 12))
