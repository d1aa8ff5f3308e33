"""A rod in BigMag: derivatives with respect to currents and joints, and the scenario's shapes, integrated."""

from __future__ import annotations

import numpy as np
import pytest
from rod.cosserat_integration import Problem, shoot
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.errors import InputError
from magfem.rod import FlexibleSection, MagnetSection, Rod

BASE = RigidTransform.from_components([-0.0375, 0, 0], Rotation.from_euler("y", 90, degrees=True))


def manipulator(magnet_fields=None):
    """The size of the dissertation's: two magnets on silicone."""
    parts = [
        part
        for length in (0.035, 0.03)
        for part in (
            FlexibleSection(length=length, radius=1.5e-3, youngs_modulus=5.5e6, density=1040.0),
            MagnetSection(length=5e-3, moment=0.0135, mass=1e-4),
        )
    ]
    return Rod(parts, BASE, magnet_fields)


def currents_of(system, seed, most=3.0):
    return np.random.default_rng(seed).uniform(-most, most, len(system.coils))


@pytest.mark.parametrize("name", ["bigmag", "bigmag_extended"])
@pytest.mark.parametrize("interacting", [False, True])
def test_derivatives_with_respect_to_currents_and_joints(name, interacting):
    system, rod = magfem.load_system(name), manipulator([None, None] if interacting else None)
    currents, joints = currents_of(system, 2), np.array([0.3, -0.4])
    state = rod.solve((system, currents, joints), tolerance=1e-13)
    by_current, by_joint = state.sensitivity("currents"), state.sensitivity("joints")
    positions = np.concatenate([by_current.positions, by_joint.positions], axis=2)
    rotations = np.concatenate([by_current.rotations, by_joint.rotations], axis=2)
    assert by_current.parameters == tuple(coil.name for coil in system.coils)
    assert by_joint.parameters == tuple(joint.name for joint in system.joints)
    node = rod.chain.magnet_node
    assert state.jacobian[:, :3] == pytest.approx(positions[node], rel=1e-12)
    assert state.jacobian[:, 3:] == pytest.approx(rotations[node], rel=1e-12)
    parameters = np.concatenate([currents, joints])
    for column in range(parameters.size):
        step = 1e-3
        shapes = {}
        for n in (-2, -1, 1, 2):
            changed = parameters.copy()
            changed[column] += n * step
            field = (system, changed[: currents.size], changed[currents.size :])
            shapes[n] = rod.solve(field, guess=state, tolerance=1e-13)
        for exact, values in (
            (positions, {n: one.positions for n, one in shapes.items()}),
            (rotations, {n: (one.rotations * state.rotations.inv()).as_rotvec() for n, one in shapes.items()}),
        ):
            slope = (8 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12 * step)
            assert exact[..., column] == pytest.approx(slope, rel=0, abs=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("seed", range(6))
def test_shapes_in_bigmag_as_integrated(seed):
    """Tip and magnets within 0.1 µm and 1e-4 degrees of the Cosserat equations in the same field."""
    system, rod = magfem.load_system("bigmag"), manipulator()
    currents = currents_of(system, seed, 5.0)
    state = rod.solve((system, currents, None))
    field = system.at(currents)
    problem = Problem(rod, field=lambda point: field.jet(point, 1, outside="extrapolate"))
    R, p, centres = shoot(problem, state.internal_force[0], state.internal_moment[0])
    assert np.linalg.norm(state.positions[-1] - p) < 1e-7
    assert np.degrees(Rotation.from_matrix(state.frames[-1] @ R.T).magnitude()) < 1e-4
    for k, (turn, place) in enumerate(centres):
        assert np.linalg.norm(state.magnet_positions[k] - place) < 1e-7
        assert np.degrees(Rotation.from_matrix(state.magnet_frames[k] @ turn.T).magnitude()) < 1e-4


def test_driven_and_static_fields_bend_alike():
    system, rod = magfem.load_system("bigmag"), manipulator()
    currents = currents_of(system, 1)
    driven, static = rod.solve((system, currents)), rod.solve(system.at(currents))
    assert driven.positions == pytest.approx(static.positions, abs=1e-12)


def test_wrong_currents_are_said_so():
    system, rod = magfem.load_system("bigmag"), manipulator()
    with pytest.raises(InputError, match="6"):
        rod.solve((system, [1.0, 2.0], None))
    with pytest.raises(InputError, match="one set of currents"):
        rod.solve((system, np.zeros((2, 6)), None))
