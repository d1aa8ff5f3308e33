"""The dissertation's controller and statics, against closed forms, `Rod.solve` and implicit differentiation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rod.steered_rod import stable_targets, two_magnets
from scipy.spatial.transform import Rotation

import magfem
from magfem.errors import InputError
from magfem.rod import FlexibleSection, Goal, MagnetSection, Rod
from magfem.rod.goals import goal_error
from magfem.rod.published_control import (
    PublishedController,
    axis_angle,
    informed_guess,
    truncated_inverse,
)
from magfem.rod.shooting import Shooting
from magfem.rod.shooting_kernel import integrate
from magfem.rod.state import RodState
from magfem.typing import Floats, Vectors

BIGMAG = magfem.load_system("bigmag")
GRAVITY = np.array([0.0, 0.0, -9.81])
MASS, MOMENTS = 1.47e-4, np.array([[-0.021], [0.021]])  # of the magnets of `two_magnets`
CURRENTS, JOINTS = np.array([5.0, -3.0, 4.0, 2.0, -6.0, 3.0]), np.array([0.3, -0.5])


def steer(rod: Rod, directions: Vectors, **settings: object) -> PublishedController:
    goals = [Goal(magnet=k, direction=direction) for k, direction in enumerate(directions)]
    return PublishedController(rod=rod, system=BIGMAG, goals=goals, **settings)  # type: ignore[arg-type]


# Statics


def test_a_torque_alone_bends_a_rod_into_an_arc() -> None:
    """Closed form: curvature τ/EI, no force anywhere."""
    rubber = FlexibleSection(length=0.05, radius=1e-3, youngs_modulus=5e6)
    rod = Rod([rubber, MagnetSection(length=4e-3, moment=0.01)])
    angle = 2.0
    torque = angle * rubber.stiffness[0] / rubber.length
    shape = Shooting(rod=rod, flexible_steps=64, threshold=1e-12).solve(
        np.zeros((1, 3)), np.array([[torque, 0.0, 0.0]])
    )
    assert shape.converged
    radius = rubber.length / angle
    end = np.array([0.0, -radius * (1 - np.cos(angle)), radius * np.sin(angle)])
    axis = np.array([0.0, -np.sin(angle), np.cos(angle)])
    assert np.allclose(shape.magnet_frames[0, :, 2], axis, atol=1e-9)
    assert np.allclose(shape.magnet_positions[0], end + 2e-3 * axis, atol=1e-11)
    assert np.allclose(shape.base_wrench, [0, 0, 0, torque, 0, 0], atol=1e-12)


def test_shooting_finds_the_shape_of_rod_solve_to_the_fourth_order_of_its_steps() -> None:
    """Under the wrenches that the magnets have in their equilibrium: the two methods share no line of code."""
    rod = two_magnets(elements=128)
    state = rod.solve((BIGMAG, CURRENTS, JOINTS), tolerance=1e-12)
    forces, torques = state.magnet_wrenches
    errors = []
    for steps in (3, 6, 12):
        shape = Shooting(rod=rod, flexible_steps=steps, threshold=1e-12).solve(forces - MASS * GRAVITY, torques)
        assert shape.converged
        errors.append(np.abs(shape.magnet_frames - state.magnet_frames).max())
        errors.append(np.abs(shape.magnet_positions - state.magnet_positions).max())
    ratio = np.log2(np.array(errors[:4]) / np.array(errors[2:]))
    assert np.all((ratio > 3.6) & (ratio < 4.6)), ratio
    assert np.allclose(shape.states[0, 7:10], state.internal_force[0], atol=1e-8)
    assert np.allclose(shape.states[0, 10:], state.internal_moment[0], atol=1e-9)


def test_the_length_of_the_quaternion_turns_nothing() -> None:
    """As eq. 2.3 stands, R(q) grows with |q|²."""
    part = (
        np.array([0.05]),
        np.array([20]),
        np.array([[2e3, 1e3, 3e3, 0.1, 0.1, 0.05]]),
        np.array([[0.0] * 5 + [1.0]]),
    )
    loads = (np.array([[0.0, 0.1, -0.3]]), np.zeros((1, 3)))
    shapes = []
    for size in (1.0, 2.0):
        Y = np.zeros((21, 13))
        Y[0, 3], Y[0, 4] = size * np.cos(0.3), size * np.sin(0.3)
        Y[0, 7:] = [0.01, 0.02, 0.03, 1e-3, -2e-3, 1e-3]
        integrate(*part, *loads, Y)
        shapes.append(Y)
    assert np.abs(shapes[0][-1, :3] - [0, 0, 0.05]).max() > 1e-3
    assert np.allclose(shapes[0][:, :3], shapes[1][:, :3], atol=1e-15)
    assert np.allclose(shapes[0][:, 7:], shapes[1][:, 7:], atol=1e-15)


# Maps


def test_the_map_from_currents_to_wrenches_is_that_of_dipoles() -> None:
    """∇(µ·B) and µ × B, eq. 2.13, from the whole gradient."""
    rod = two_magnets()
    points, frames = np.array([[0.0, 0.01, 0.0], [0.02, 0.0, 0.01]]), Rotation.random(2, 2).as_matrix()
    B, gradient = BIGMAG.jet(points, CURRENTS, JOINTS)
    moments = MOMENTS * frames[:, :, 2]
    wrench = steer(rod, np.eye(3)[:2]).current_to_wrench(points, frames, JOINTS) @ CURRENTS
    assert np.allclose(wrench[:, :3], np.einsum("ni,nij->nj", moments, gradient), rtol=1e-9)
    assert np.allclose(wrench[:, 3:], np.cross(moments, B), rtol=1e-9)


def test_an_axis_and_its_angle_turn_z_to_the_tangent() -> None:
    tangents = np.random.default_rng(3).normal(size=(50, 3))
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    wanted = np.random.default_rng(4).normal(size=(50, 3))
    axes, angles = axis_angle(tangents, wanted)
    assert np.allclose(Rotation.from_rotvec(axes * angles[:, None]).apply([0, 0, 1]), tangents, atol=1e-12)
    assert np.all(np.sum(axes * wanted, axis=1) >= 0)
    assert angles.min() < 0 < angles.max()


def test_the_pseudo_inverse_leaves_out_what_lies_beyond_the_condition() -> None:
    rng = np.random.default_rng(5)
    U, V = np.linalg.qr(rng.normal(size=(4, 4)))[0], np.linalg.qr(rng.normal(size=(8, 8)))[0]
    J = U * [1.0, 0.1, 2e-5, 0.5e-5] @ V[:4]
    inverse, condition = truncated_inverse(J, 1e5)
    assert condition == pytest.approx(2e5)
    assert np.allclose(inverse, V[:3].T / [1.0, 0.1, 2e-5] @ U[:, :3].T, rtol=1e-8)


# The Jacobian


def exact_rows(state: RodState, wanted_axes: Vectors) -> Floats:
    """(4, 12) of k_d·k and φ, by each magnet's shift and turn: derivatives of k = ẑ × t/|ẑ × t| and φ = arccos(ẑ·t)."""
    rows = np.zeros((4, 12))
    for m, (t, k_d) in enumerate(zip(state.magnet_frames[:, :, 2], wanted_axes, strict=True)):
        flat = np.hypot(t[0], t[1])
        k = np.array([-t[1], t[0], 0.0]) / flat
        turn = np.cross(np.eye(3), t).T  # columns: dt by a turn about x, y, z
        along = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) @ turn
        rows[2 * m, 6 * m + 3 : 6 * m + 6] = k_d @ (along - np.outer(k, k @ along)) / flat
        rows[2 * m + 1, 6 * m + 3 : 6 * m + 6] = -turn[2] / flat
    return rows


def dead_jacobian(state: RodState) -> Floats:
    """(12, 8) every magnet's shift and turn per parameter, its wrench held at the pose it has now.

    With S the rod's answer to small wrenches and K how wrenches change with the poses, S = (1 − D K)⁻¹ D for the answer
    D under dead wrenches, so that D S⁻¹ = (1 + S K)⁻¹, which also turns the exact Jacobian S W into D W.
    """
    nodes = state.loads.chain.magnet_node
    unit = np.zeros((state.loads.chain.links + 1, 6, 12))
    for m, node in enumerate(nodes):
        unit[node, :, 6 * m : 6 * m + 6] = np.eye(6)
    S = state.factored.answer(node_load=unit)[1][nodes].reshape(12, 12)  # turn before shift, torque before force
    K = np.zeros((12, 12))
    B, G, H = BIGMAG.jet(state.magnet_positions, CURRENTS, JOINTS, order=2)
    for m, mu in enumerate(MOMENTS * state.magnet_frames[:, :, 2]):
        for i, axis in enumerate(np.eye(3)):
            turned = np.cross(axis, mu)
            K[6 * m : 6 * m + 3, 6 * m + i] = np.cross(turned, B[m])
            K[6 * m + 3 : 6 * m + 6, 6 * m + i] = turned @ G[m]
            K[6 * m : 6 * m + 3, 6 * m + 3 + i] = np.cross(mu, G[m] @ axis)
            K[6 * m + 3 : 6 * m + 6, 6 * m + 3 + i] = np.einsum("i,ijk,k->j", mu, H[m], axis)
    swapped = np.concatenate([state.jacobian[:, 3:], state.jacobian[:, :3]], axis=1).reshape(12, 8)
    dead = np.linalg.solve(np.eye(12) + S @ K, swapped).reshape(2, 6, 8)
    return np.concatenate([dead[:, 3:], dead[:, :3]], axis=1).reshape(12, 8)


def test_its_jacobian_tends_to_the_exact_one_of_dead_wrenches() -> None:
    """To first order in the differences; and is not the Jacobian of the rod, whose wrenches follow its magnets."""
    rod = two_magnets(elements=64)
    state = rod.solve((BIGMAG, CURRENTS, JOINTS), tolerance=1e-12)
    wanted = np.array([[0.6, -0.5, 0.3], [0.7, 0.3, -0.4]])
    exact, errors = None, []
    for part in (1.0, 0.1, 0.01):
        controller = steer(
            rod,
            wanted,
            current_difference=0.2 * part,
            joint_difference=np.radians(2) * part,
            flexible_steps=32,
            threshold=1e-12,
        )
        now = controller.begin(CURRENTS, JOINTS)
        now = controller.advance(now, state.magnet_positions, state.magnet_frames)
        assert now.outcome == "moving" and now.jacobian is not None
        rows = exact_rows(state, controller.wanted[0])
        if exact is None:
            exact = rows @ dead_jacobian(state)
        errors.append(np.abs(now.jacobian - exact).max() / np.abs(exact).max())
    assert errors[0] < 0.1
    assert np.all(np.abs(np.log10(np.array(errors[:-1]) / errors[1:]) - 1) < 0.1), errors
    assert exact is not None
    assert np.abs(rows @ state.jacobian.reshape(12, 8) - exact).max() > 0.1 * np.abs(exact).max()


def test_informed_guesses_save_iterations() -> None:
    """As the dissertation found in simulation (2.4): 260 ms instead of 420 ms."""
    rod = two_magnets()
    state = rod.solve((BIGMAG, CURRENTS, JOINTS))
    iterations, jacobians = [], []
    for informed in (True, False):
        controller = steer(rod, np.eye(3)[:2], informed=informed)
        now = controller.begin(CURRENTS, JOINTS)
        # one step finds the shape: what is counted at the next, in the same place, are the Jacobian's eight problems
        now = controller.advance(now, state.magnet_positions, state.magnet_frames)
        now = replace(now, currents=CURRENTS, joints=JOINTS)
        now = controller.advance(now, state.magnet_positions, state.magnet_frames)
        assert now.jacobian is not None
        iterations.append(now.iterations)
        jacobians.append(now.jacobian)
    assert iterations[0] < 0.8 * iterations[1], iterations
    assert np.allclose(*jacobians, atol=1e-4)


def test_an_informed_guess_is_right_for_a_rod_that_does_not_yield() -> None:
    """Statics of a rigid body: the base carries all forces, and their moments about it."""
    rod = two_magnets(stiffness=1e5)
    shooting = Shooting(rod=rod, gravity=(0, 0, 0), threshold=1e-12)
    forces, torques = np.array([[0.01, 0.02, -0.03], [0.02, 0.0, 0.01]]), np.array([[1e-4, 0, 2e-4], [0, -1e-4, 0]])
    shape = shooting.solve(forces, torques)
    arms = np.array([[0.027, 0, 0], [0.056, 0, 0]])
    guess = informed_guess(np.zeros(6), np.concatenate([forces, torques], axis=1), arms)
    assert np.allclose(shape.base_wrench, guess, rtol=1e-4, atol=1e-8)


# The error's coordinates


def test_the_arc_cosine_has_an_infinite_slope_at_the_axis_it_is_measured_from() -> None:
    """dφ/d(ẑ·t) = −1/sin φ; what rounding leaves of the cosine decides on φ, where our error counts every bit."""
    for phi in (1e-1, 1e-2, 1e-3):
        h = 1e-3 * phi**2
        cosine = np.cos(phi) + np.array([-h, h])
        tangents = np.stack([np.sqrt(1 - cosine**2), np.zeros(2), cosine], axis=1)
        angles = axis_angle(tangents, np.array([[0.0, 1.0, 0.0]] * 2))[1]
        assert np.diff(angles)[0] / (2 * h) == pytest.approx(-1 / np.sin(phi), rel=1e-5)
    tiny = 5e-9
    frames = Rotation.from_rotvec([[0, tiny, 0]]).as_matrix()
    assert axis_angle(frames[:, :, 2], np.array([[0.0, 1.0, 0.0]]))[1][0] == 0
    size = goal_error([Goal(magnet=0, direction=(0, 0, 1))], np.zeros((1, 3)), frames).size
    assert size == pytest.approx(tiny, rel=1e-12)


def test_the_error_of_the_axis_has_no_slope_at_the_goal() -> None:
    """1 − k_d·k = 1 − cos of the angle between them: half the angle squared."""
    controller = steer(two_magnets(), np.array([[1.0, 0, 0], [1.0, 0, 0]]))
    for angle in (1e-1, 1e-2, 1e-3):
        frames = (Rotation.from_euler("z", angle) * Rotation.from_euler("y", 90, degrees=True)).as_matrix()
        error = controller.orientation_error(np.stack([frames, frames]))
        assert error == pytest.approx([angle**2 / 2, 0] * 2, rel=1e-2, abs=1e-12)


# The loop


def test_it_steers_two_magnets_in_the_plane_to_a_shape_that_exists() -> None:
    """The plant is 15 % stiffer than the model; the target is one of the plant's own shapes."""
    plant, model = two_magnets(1.15), two_magnets()
    directions = stable_targets(BIGMAG, plant, 1, seed=8, planar=True)[0]
    controller = steer(model, directions)
    now = controller.begin()
    shape = plant.solve((BIGMAG, now.currents, now.joints))
    began = goal_error(controller.goals, shape.magnet_positions, shape.magnet_frames).size
    for _ in range(100):
        now = controller.advance(now, shape.magnet_positions, shape.magnet_frames)
        if now.outcome != "moving":
            break
        assert np.abs(now.currents).max() <= 8
        shape = plant.solve((BIGMAG, now.currents, now.joints), guess=shape)
    assert began > np.radians(10)  # the way is long enough to be one
    assert now.outcome == "converged"
    reached = np.linalg.norm(np.cross(shape.magnet_frames[:, :, 2], directions), axis=1)
    assert np.degrees(np.arcsin(reached)).max() < 0.05


def test_the_integrated_term_is_let_go_where_its_error_is_small_and_currents_are_clipped() -> None:
    rod = two_magnets()
    state = rod.solve((BIGMAG, np.zeros(6), np.zeros(2)))
    first, second = state.magnet_frames[:, :, 2]
    lifted = Rotation.from_rotvec([0, -0.5, 0]).apply(second)
    near = Rotation.from_rotvec([0, -0.01, 0]).apply(first)
    controller = steer(rod, np.array([near, lifted]), proportional=50.0, integral=1.0)
    now = controller.begin()
    for count in (1, 2):
        now = controller.advance(
            replace(now, currents=np.zeros(6), joints=np.zeros(2)), state.magnet_positions, state.magnet_frames
        )
        assert np.allclose(now.summed, [0, 0, 0, -0.5 * count], atol=1e-9)
    assert np.abs(now.currents).max() == 8


def test_what_it_cannot_use_is_refused() -> None:
    rod = two_magnets()
    with pytest.raises(InputError, match="directions alone"):
        PublishedController(rod=rod, system=BIGMAG, goals=[Goal(magnet=0, position=(0, 0, 0))])
    with pytest.raises(InputError, match="one goal for a magnet"):
        PublishedController(rod=rod, system=BIGMAG, goals=[Goal(magnet=1, direction=(1, 0, 0))] * 2)
    with pytest.raises(InputError, match="even"):
        Shooting(rod=rod, rigid_steps=3)
    with pytest.raises(InputError, match="length"):
        Shooting(rod=Rod([rod.sections[0], MagnetSection(length=0.0, moment=0.01)]))
    with pytest.raises(InputError, match="magnet_fields"):
        Shooting(rod=Rod(rod.sections, magnet_fields=[None, None]))
