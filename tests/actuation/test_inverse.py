"""Currents for what is wanted: optimality conditions, linear programming duality, other solvers, limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.actuation import CoilSystem, Target, conditioning, find_currents
from magfem.actuation.inverse import METHODS
from magfem.actuation.least_distance import least_distance
from magfem.errors import InputError, OutsideRegionError
from magfem.fields.terms import uniform

JOINTS = [0.3, 0.9]
PLACE = np.array([0.01, 0.0, 0.005])
MOMENT = np.array([0.02, 0.01, 0.06])
TORQUE = np.cross(MOMENT, [0.02, -0.01, 0.015])  # which a field can make


@pytest.fixture(scope="module")
def bigmag():
    return magfem.load_system("bigmag")


@pytest.fixture(scope="module")
def extended():
    return magfem.load_system("bigmag_extended")


def wrench_rows(system, place=PLACE, moment=MOMENT):
    """Force and torque per ampere, (6, c), by calls of the public wrench."""
    pose = RigidTransform.from_translation(place)
    unit = [system.wrench(moment, pose, one, JOINTS) for one in np.eye(len(system.coils))]
    return np.array([np.concatenate(each) for each in unit]).T


def test_least_norm_is_the_pseudo_inverse_where_limits_allow(extended):
    target = Target(PLACE, moment=MOMENT, torque=TORQUE, force=[0.002, 0.001, -0.001])
    found = find_currents(extended, target, JOINTS)
    A = wrench_rows(extended)
    expected = np.linalg.pinv(A, rcond=1e-9) @ [0.002, 0.001, -0.001, *TORQUE]
    assert found.outcome == "met" and found.active == () and found.peak < 8
    np.testing.assert_allclose(found.currents, expected, atol=1e-9)
    force, torque = extended.wrench(MOMENT, RigidTransform.from_translation(PLACE), found.currents, JOINTS)
    np.testing.assert_allclose(force, [0.002, 0.001, -0.001], atol=1e-12)
    np.testing.assert_allclose(torque, TORQUE, atol=1e-13)


def test_least_norm_within_limits_is_the_least_of_all(extended):
    """The minimiser is the clipped combination of the rows (Karush, Kuhn, Tucker): x = clip(Aᵀλ, ±limit)."""
    target = Target(PLACE, field=[0.03, 0.006, -0.018])
    limits = np.linspace(1.5, 3.5, 14)
    found = find_currents(extended, target, JOINTS, limits=limits)
    assert found.met and 3 <= len(found.active) <= 10
    A = extended.unit_fields(PLACE, JOINTS)[:3]
    np.testing.assert_allclose(A @ found.currents, [0.03, 0.006, -0.018], rtol=1e-9)
    free = np.abs(found.currents) < limits * (1 - 1e-9)
    assert [coil.name for coil, here in zip(extended.coils, free, strict=True) if not here] == list(found.active)
    multipliers = np.linalg.lstsq(A[:, free].T, found.currents[free])[0]
    np.testing.assert_allclose(found.currents, np.clip(A.T @ multipliers, -limits, limits), atol=1e-8)


def test_tolerated_rows_are_used(extended):
    """Against a general solver of the same problem (SLSQP): torque exactly, each force within 5 mN."""
    target = Target(PLACE, moment=MOMENT, torque=TORQUE, force=[0, 0, 0], within={"force": 5e-3})
    found = find_currents(extended, target, JOINTS)
    A = wrench_rows(extended)
    along = np.linalg.svd(MOMENT[None])[2][1:]  # two directions across the moment
    constraints = [
        {"type": "eq", "fun": lambda x: along @ (A[3:] @ x - TORQUE) * 1e4},
        {"type": "ineq", "fun": lambda x: 1 - A[:3] @ x / 5e-3},
        {"type": "ineq", "fun": lambda x: 1 + A[:3] @ x / 5e-3},
    ]
    other = minimize(lambda x: x @ x, np.zeros(14), constraints=constraints, method="SLSQP", options={"ftol": 1e-14})
    assert found.met and found.norm == pytest.approx(np.sqrt(other.fun), rel=1e-6)
    assert np.abs(found.achieved[:3]).max() <= 5e-3 * (1 + 1e-9)
    exactly = find_currents(extended, Target(PLACE, moment=MOMENT, torque=TORQUE, force=[0, 0, 0]), JOINTS)
    assert exactly.norm > found.norm * 1.01


def test_least_peak_is_its_dual(extended):
    """min max|x| for A x = b equals max b·λ for Σ|Aᵀλ| ≤ 1 (linear programming duality)."""
    wanted = np.array([0.05, 0.01, -0.03])
    found = find_currents(extended, Target(PLACE, field=wanted), JOINTS, method="least_peak")
    A = extended.unit_fields(PLACE, JOINTS)[:3]
    signs = np.hstack([A.T, -np.eye(14)])  # Aᵀλ ≤ t and −Aᵀλ ≤ t, Σ t ≤ 1
    rows = np.vstack([signs, np.hstack([-A.T, -np.eye(14)]), np.append(np.zeros(3), np.ones(14))])
    dual = linprog(np.append(-wanted, np.zeros(14)), rows, np.append(np.zeros(28), 1.0), bounds=[(None, None)] * 17)
    assert found.met and found.peak == pytest.approx(-dual.fun, rel=1e-6)
    least_norm = find_currents(extended, Target(PLACE, field=wanted), JOINTS)
    assert found.peak < 0.95 * least_norm.peak and found.norm > least_norm.norm


def test_least_squares_obeys_its_optimality_conditions(bigmag):
    """No free current lowers the sum of squares, and those at their limits would only by going beyond."""
    wanted = np.array([0.1, 0.05, -0.1])
    found = find_currents(bigmag, Target(PLACE, field=wanted), JOINTS, method="least_squares")
    A = bigmag.unit_fields(PLACE, JOINTS)[:3]
    slope = A.T @ (A @ found.currents - wanted)
    size = np.abs(A).max() * np.abs(wanted).max()
    for coil, current, each in zip(bigmag.coils, found.currents, slope, strict=True):
        if coil.name in found.active:
            assert abs(current) == 8.0 and each * np.sign(current) < 1e-9 * size
        else:
            assert abs(each) < 1e-9 * size
    assert found.outcome == "limited" and found.active and found.converged


def test_what_any_currents_do_is_met_by_no_larger_ones(bigmag, extended):
    """Currents, places, joints and targets at random: least norm and peak never exceed their origins."""
    rng = np.random.default_rng(9)
    for k in range(80):
        system = (bigmag, extended)[k % 2]
        point, joints, moment = rng.uniform(-0.03, 0.03, 3), rng.uniform(-3, 3, 2), rng.normal(scale=0.03, size=3)
        own = np.clip(8 * rng.uniform(-1, 1, len(system.coils)) * 10 ** rng.uniform(-4, 0.3), -8, 8)
        pose = RigidTransform.from_translation(point)
        force, torque = system.wrench(moment, pose, own, joints)
        targets = [
            Target(point, field=system.B(point, own, joints)),
            Target(pose, moment=moment, torque=torque, force=force),
            Target(pose, moment=moment, torque=torque, force=force + 1e-3, within={"force": 2e-3}),
            [Target(one, field=system.B(one, own, joints)) for one in (point, -point)],
        ][k % 4]
        shortest, lowest = (find_currents(system, targets, joints, method) for method in ("least_norm", "least_peak"))
        assert shortest.met and shortest.norm <= np.linalg.norm(own) * (1 + 1e-7)
        assert lowest.met and lowest.peak <= np.abs(own).max() * (1 + 1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_what_limits_forbid_is_said(bigmag, method):
    target = Target(PLACE, field=[0.2, 0, 0])
    found = find_currents(bigmag, target, method=method)
    assert found.outcome == "limited" and not found.met and found.active
    assert np.abs(found.currents).max() <= 8
    bigmag.B(PLACE, found.currents)  # within limits, as the system itself sees it
    beyond = find_currents(bigmag, Target(PLACE, field=[0.02, 0, 0]), method=method)
    assert beyond.met
    np.testing.assert_allclose(bigmag.B(PLACE, beyond.currents), [0.02, 0, 0], atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_torque_along_the_moment_is_impossible_and_named(extended, method):
    axis = MOMENT / np.linalg.norm(MOMENT)
    found = find_currents(extended, Target(PLACE, moment=MOMENT, torque=TORQUE + 1e-4 * axis), JOINTS, method)
    assert found.outcome == "impossible" and found.conditioning.rank == found.conditioning.freedoms == 2
    np.testing.assert_allclose(np.abs(found.conditioning.lost @ axis), 1, rtol=1e-9)
    np.testing.assert_allclose(found.achieved, TORQUE, atol=1e-10)  # all that is possible


def test_poses_turn_moments(extended):
    pose = RigidTransform.from_components(PLACE, Rotation.from_euler("xyz", [0.3, 0.8, -1.1]))
    own = pose.rotation.inv().apply(MOMENT)
    one = find_currents(extended, Target(pose, moment=own, torque=TORQUE), JOINTS)
    other = find_currents(extended, Target(PLACE, moment=MOMENT, torque=TORQUE), JOINTS)
    np.testing.assert_allclose(one.currents, other.currents, rtol=1e-8)


def test_background_is_made_up_for(bigmag):
    with_background = CoilSystem("b", bigmag.coils, uniform([0.01, 0, 0]), bigmag.workspace, joints=bigmag.joints)
    found = find_currents(with_background, Target(PLACE, field=[0.01, 0, 0]))
    np.testing.assert_allclose(found.currents, 0, atol=1e-9)
    assert found.met


def test_free_components_are_free(bigmag):
    found = find_currents(bigmag, Target(PLACE, field=[None, 0.01, None], gradient=[None] * 4 + [0.1]), JOINTS)
    assert found.rows == ("field y", "gradient dBy_dz") and found.met
    B, gradient = bigmag.jet(PLACE, found.currents, JOINTS)
    assert B[1] == pytest.approx(0.01) and gradient[1, 2] == pytest.approx(0.1)


def test_eight_degrees_of_freedom_for_each_magnet(bigmag, extended):
    """Petruska & Nelson 2015: eight coils or more for a magnet, five of its wrench; two magnets need sixteen."""
    whole = [Target(place, field=np.zeros(3), gradient=np.zeros(5)) for place in (PLACE, -PLACE)]
    octomag = magfem.load_system("octomag")
    assert conditioning(octomag, Target([0, 0, 0], np.zeros(3), np.zeros(5))).rank == 8
    for system, one, two in ((bigmag, 6, 6), (extended, 8, 14)):
        single, double = conditioning(system, whole[0], JOINTS), conditioning(system, whole, JOINTS)
        assert (single.rank, single.freedoms, double.rank, double.freedoms) == (one, 8, two, 16)
        assert double.lost.shape == (16 - two, 16) and 1 < single.condition < 2 * double.condition < 1e4
    wrench = Target(PLACE, force=np.zeros(3), torque=np.zeros(3), moment=MOMENT)
    assert conditioning(extended, wrench, JOINTS).freedoms == 5


def test_singular_values_do_not_depend_on_units_of_rows(extended):
    """A moment twice as large makes twice the wrench per ampere, and nothing is harder for it."""
    one, two = (
        conditioning(extended, Target(PLACE, force=np.zeros(3), moment=factor * MOMENT), JOINTS) for factor in (1, 2)
    )
    np.testing.assert_allclose(one.singular_values, two.singular_values, rtol=1e-12)


def test_extended_arrangement_beats_an_equatorial_ring(bigmag, extended):
    """What docs/coil-systems.md says of it: medians over random places of two magnets and joints."""
    from dataclasses import replace

    angles = np.arange(8) * np.pi / 4
    ring = []
    for k, angle in enumerate(angles):
        place = 0.10215 * np.array([np.cos(angle), np.sin(angle), 0])
        pose = RigidTransform.from_components(place, Rotation.from_euler("ZY", [angle + np.pi, np.pi / 2]))
        ring.append(replace(bigmag.coils[0], name=f"x{k}", pose=pose, joint=None))
    other = replace(bigmag, coils=(*bigmag.coils, *ring))
    rng = np.random.default_rng(0)
    conditions = {"extended": [], "ring": []}
    for _ in range(60):
        middle, way, joints = rng.uniform(-0.02, 0.02, 3), rng.normal(size=3), rng.uniform(-np.pi, np.pi, 2)
        way *= 0.0175 / np.linalg.norm(way)
        pair = [Target(middle + sign * way, np.zeros(3), np.zeros(5)) for sign in (1, -1)]
        conditions["extended"].append(conditioning(extended, pair, joints).condition)
        conditions["ring"].append(conditioning(other, pair, joints).condition)
    assert np.median(conditions["extended"]) < 0.95 * np.median(conditions["ring"])


def test_least_distance_in_closed_form():
    """Σ z ≥ 1 gives 1/n each; z ≥ a gives the positive part; a box that misses a half-space gives nothing."""
    np.testing.assert_allclose(least_distance(np.ones((1, 5)), np.ones(1)), 0.2, rtol=1e-12)
    a = np.array([-1.0, 2.0, 0.5])
    np.testing.assert_allclose(least_distance(np.eye(3), a), np.maximum(a, 0), atol=1e-12)
    assert least_distance(np.vstack([np.eye(2), -np.eye(2), [[1, 1]]]), np.array([-1, -1, -1, -1, 2.1])) is None
    np.testing.assert_array_equal(least_distance(np.eye(2), -np.ones(2)), 0)
    tiny = least_distance(1e6 * np.ones((1, 4)), np.array([1e-9]))
    np.testing.assert_allclose(tiny, 2.5e-16, rtol=1e-9)


@pytest.mark.parametrize(
    ("target", "complaint"),
    [
        (lambda: Target(PLACE), "a target wants a field, a gradient, a force or a torque"),
        (lambda: Target(PLACE, torque=[0, 0, 1]), "needs the moment of the magnet"),
        (lambda: Target(PLACE, field=[1, 2]), "field must be 3 finite numbers"),
        (lambda: Target(PLACE, field=[1, 2, np.inf]), "field must be 3 finite numbers"),
        (lambda: Target(PLACE, gradient="steep"), "gradient must be 5 finite numbers"),
        (lambda: Target([PLACE, PLACE], field=[1, 2, 3]), r"at one place: a point \(3,\) m or a pose"),
        (lambda: Target(RigidTransform.from_translation([PLACE, PLACE]), field=[1, 2, 3]), "got several poses"),
        (lambda: Target(PLACE, field=[1, 2, 3], within={"B": 1}), "within is by field, gradient, force, torque"),
        (lambda: Target(PLACE, field=[1, 2, 3], within={"field": -1}), "within must be zero or positive"),
        (lambda: Target(PLACE, force=[1, 2, 3], moment=[1, 2]), "a magnet's moment is three finite numbers"),
    ],
)
def test_what_is_no_target_is_one_sentence(target, complaint):
    with pytest.raises(InputError, match=complaint):
        target()


def test_wrong_input_is_one_sentence(bigmag):
    target = Target(PLACE, field=[0, 0, 0.01])
    for arguments, complaint in (
        (([],), "give one Target or several"),
        (([1],), "give one Target or several"),
        ((target, None, "best"), "method must be one of least_norm, least_squares, least_peak"),
        ((target, None, "least_norm", [1, 2]), "limits must be positive, in A"),
        ((target, None, "least_norm", -1), "limits must be positive, in A"),
        ((target, [4.0, 0]), 'joint "gamma_bottom"'),
    ):
        with pytest.raises(InputError, match=complaint):
            find_currents(bigmag, *arguments)
    with pytest.raises(OutsideRegionError):
        find_currents(bigmag, Target([0, 0, 0.06], field=[0, 0, 0.01]))
    with pytest.raises(InputError, match="has no coils"):
        find_currents(CoilSystem("b", (), uniform([0, 0, 1])), target)
