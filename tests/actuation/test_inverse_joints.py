"""Joints and currents together: a scan of the joints, the published search, exact first-order conditions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import RigidTransform

import magfem
from magfem.actuation import Target, conditioning, find_currents, find_currents_and_joints
from magfem.errors import ConvergenceError, InputError, OutsideRegionError

PUBLISHED = json.loads((Path(__file__).parents[1] / "references" / "bigmag.json").read_text())
PLACE = np.array([-0.005, 0.0, 0.0])  # of the catheter's tip magnet, dissertation 3.4
MOMENT = np.array([0.06617187499999999, 0, 0])  # the published one, along the catheter
TORQUE = np.array([0.0, 1e-3, 0.5e-3])
BOX = PUBLISHED["limits"]["force_box_N"]


@pytest.fixture(scope="module")
def bigmag():
    return magfem.load_system("bigmag")


@pytest.fixture(scope="module")
def boxed():
    return Target(PLACE, moment=MOMENT, torque=TORQUE, force=[0, 0, 0], within={"force": BOX})


@pytest.fixture(scope="module")
def found(bigmag, boxed):
    return find_currents_and_joints(bigmag, boxed, starts=12, seed=3)


def test_it_is_met_within_all_limits(bigmag, found):
    pose = RigidTransform.from_translation(PLACE)
    force, torque = bigmag.wrench(MOMENT, pose, found.currents, found.joints)
    np.testing.assert_allclose(torque, TORQUE, atol=1e-12)
    assert np.abs(force).max() <= BOX * (1 + 1e-8)
    assert found.met and found.converged and found.iterations < 100


def test_no_joints_of_a_scan_do_better(bigmag, boxed, found):
    """Currents of least norm at 31 × 31 joint values: none below, and the nearest in the basin hardly above."""
    angles = np.linspace(-np.pi, np.pi, 31)
    norms = []
    for bottom in angles:
        for top in angles:
            there = find_currents(bigmag, boxed, [bottom, top])
            norms.append(there.norm if there.met else np.inf)
    assert found.norm <= min(norms) <= 1.02 * found.norm


def test_the_published_search_does_not_beat_it(bigmag, found):
    """min |I| over (γ_bottom, γ_top, f), I by pseudo-inverse: rewritten with NumPy and differences.

    Not from the published zeros: all six coils lie in one plane there, the map is singular, and no slope exists.
    """
    assert conditioning(bigmag, Target(PLACE, moment=MOMENT, torque=TORQUE, force=np.zeros(3))).rank < 5

    def currents(u):
        rows = bigmag.unit_fields(PLACE, u[:2])
        x, y, z = MOMENT
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        M = np.array([[x, y, z, 0, 0], [0, x, 0, y, z], [-z, 0, x, -z, y]])
        return np.linalg.pinv(np.vstack([cross @ rows[:3], M @ rows[3:]]), rcond=1e-10) @ [*TORQUE, *(u[2:] * BOX)]

    bounds = [(-np.pi, np.pi)] * 2 + [(-1, 1)] * 3
    start = [1.2, -1.2, 0, 0, 0]
    other = minimize(lambda u: np.linalg.norm(currents(u)), start, bounds=bounds, method="SLSQP")
    assert other.success
    pose = RigidTransform.from_translation(PLACE)
    torque = bigmag.wrench(MOMENT, pose, currents(other.x), other.x[:2])[1]
    np.testing.assert_allclose(torque, TORQUE, atol=1e-9)  # the rewritten one does what it should
    assert found.norm <= other.fun * (1 + 1e-6)
    own = find_currents(bigmag, Target(PLACE, moment=MOMENT, torque=TORQUE, force=other.x[2:] * BOX), other.x[:2])
    np.testing.assert_allclose(own.currents, currents(other.x), atol=1e-6)


def test_it_is_stationary(bigmag, boxed, found):
    """The least norm does not change, to first order, with the joints: differences of `find_currents`."""
    step = 1e-4
    for axis in np.eye(2):
        ends = [find_currents(bigmag, boxed, found.joints + sign * step * axis).norm for sign in (1, -1)]
        assert abs(ends[0] - ends[1]) / (2 * step) < 1e-3 * found.norm
        assert min(ends) >= found.norm * (1 - 1e-8)


def test_it_is_the_same_for_the_same_seed(bigmag, boxed, found):
    again = find_currents_and_joints(bigmag, boxed, starts=12, seed=3)
    np.testing.assert_array_equal(again.currents, found.currents)
    np.testing.assert_array_equal(again.starts, found.starts)
    assert found.starts.shape == found.ends.shape == (12, 2) and not found.starts[0].any()
    assert np.nanmin(found.norms) == pytest.approx(found.norm, rel=1e-6)


def test_a_symmetry_of_the_machine(bigmag):
    """A wanted field turned about z is had with all joints turned, at the same currents' norm."""
    angle = 0.6
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    field = np.array([0.02, 0.0, 0.01])
    one = find_currents_and_joints(bigmag, Target([0, 0, 0], field=field, gradient=[0.1] + [None] * 4), starts=6)
    B, gradient = bigmag.jet([0, 0, 0], one.currents, one.joints)
    moved = (turn @ gradient @ turn.T).ravel()
    other = find_currents(
        bigmag,
        Target([0, 0, 0], field=turn @ B, gradient=moved[[0, 1, 2, 4, 5]]),
        (one.joints + angle + np.pi) % (2 * np.pi) - np.pi,
    )
    assert other.met and other.norm <= one.norm * (1 + 1e-9)


def test_what_cannot_be_met_is_as_near_as_found(bigmag):
    """The misses are no larger than the best of a scan."""
    target = Target(PLACE, field=[0.03, 0.01, 0.02], gradient=[0.5, 0, 0, 0, 0])
    found = find_currents_and_joints(bigmag, target, starts=4)
    assert found.outcome == "impossible" and np.isnan(found.norms).all()
    angles = np.linspace(-np.pi, np.pi, 13)
    scan = [find_currents(bigmag, target, [a, b]).residual for a in angles for b in angles]
    assert found.residual < 1.1 * min(scan)


def test_wrong_input_is_one_sentence(bigmag, boxed):
    with pytest.raises(InputError, match="has no joints: find_currents"):
        find_currents_and_joints(magfem.load_system("octomag"), Target([0, 0, 0], field=[0, 0, 0.01]))
    with pytest.raises(InputError, match="starts and iterations must be 1 or more"):
        find_currents_and_joints(bigmag, boxed, starts=0)
    with pytest.raises(InputError, match="method must be"):
        find_currents_and_joints(bigmag, boxed, method="best")
    with pytest.raises(OutsideRegionError):
        find_currents_and_joints(bigmag, Target([0, 0, 0.06], field=[0, 0, 0.01]))
    with pytest.raises(ConvergenceError, match=r"no search of 2 for the joints of BigMag.* within 1 iterations"):
        find_currents_and_joints(bigmag, boxed, starts=2, iterations=1)
    assert not find_currents_and_joints(bigmag, boxed, starts=2, iterations=1, strict=False).converged
