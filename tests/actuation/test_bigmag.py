"""BigMag: the system card against the published numbers, evaluated directly (`references/bigmag.json`, MIT).

B = +∇Ψ, Ψ = Σ_k a_k ∂^k/∂x^k (1/r) in the coil's frame, whose x is its axis; B_global = R B_local(Rᵀ(p − p₀)).
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from references import inverse_distance

import magfem
from magfem.constants import MU_0
from magfem.errors import InputError

PUBLISHED = json.loads((Path(__file__).parents[1] / "references" / "bigmag.json").read_text())


@pytest.fixture(scope="module")
def direct():
    """Per ampere, for every coil of the file: B (n, c, 3) and gradient (n, c, 3, 3) at points (n, 3)."""

    def evaluate(points):
        B, gradient = np.empty((len(points), 6, 3)), np.empty((len(points), 6, 3, 3))
        for k, coil in enumerate(PUBLISHED["coils"]):
            R, place = np.array(coil["R0"]), np.array(coil["p0_m"])
            local = (points - place) @ R
            poles = list(enumerate(PUBLISHED["coil_types"][coil["type"]]["a"], start=1))
            b = sum(a * inverse_distance.gradient(inverse_distance.along(0, n), local) for n, a in poles)
            g = sum(a * inverse_distance.second(inverse_distance.along(0, n), local) for n, a in poles)
            B[:, k], gradient[:, k] = b @ R.T, R @ g.astype(float) @ R.T
        return B, gradient

    return evaluate


@pytest.fixture(scope="module")
def bigmag():
    return magfem.load_system("bigmag")


def test_unit_fields_are_the_published_ones(bigmag, direct):
    points = bigmag.workspace.random_points(np.random.default_rng(1), 120)
    B, gradient = direct(points)
    rows = bigmag.unit_fields(points)
    expected = np.concatenate([B, gradient.reshape(*gradient.shape[:2], 9)[..., [0, 1, 2, 4, 5]]], axis=-1)
    for k in range(6):
        for part in (slice(0, 3), slice(3, 8)):
            ours, theirs = rows[:, part, k], expected[:, k, part]
            size = np.linalg.norm(theirs, axis=1, keepdims=True)
            np.testing.assert_allclose(ours / size, theirs / size, atol=1e-12)


def test_field_and_gradient_of_currents(bigmag, direct):
    rng = np.random.default_rng(2)
    points, currents = bigmag.workspace.random_points(rng, 60), rng.uniform(-8, 8, 6)
    for found in (bigmag.jet(points, currents), bigmag.at(currents).jet(points, 1)):
        for ours, parts in zip(found, direct(points), strict=True):
            expected = np.einsum("c,nc...->n...", currents, parts)
            np.testing.assert_allclose(ours, expected, atol=1e-12 * np.abs(expected).max())


def test_axes_point_into_the_workspace_in_the_files_order(bigmag):
    for coil, published in zip(bigmag.coils, PUBLISHED["coils"], strict=True):
        assert coil.name == str(published["id"])
        np.testing.assert_allclose(coil.pose.rotation.as_matrix()[:, 2], published["axis_global"], atol=1e-14)
        np.testing.assert_allclose(coil.pose.translation, published["p0_m"], atol=2e-17)
        assert coil.current_limit == PUBLISHED["limits"]["current_A_hardware"]


@pytest.mark.parametrize(("kind", "moment"), [("air", 6.4226), ("iron", 28.447)])
def test_dipole_moments_are_the_stated_ones(kind, moment):
    model = magfem.load_model(f"bigmag_{kind}")
    np.testing.assert_allclose(model.moment, [0, 0, moment], rtol=2e-5, atol=1e-12)
    a = PUBLISHED["coil_types"][kind]["a"][0]
    assert model.moment[2] == pytest.approx(4 * np.pi / MU_0 * a, rel=1e-12)


def test_workspace_is_where_all_six_models_hold(bigmag):
    """A ball of 0.11 m; the coils' own regions do not narrow it."""
    assert bigmag.region == bigmag.workspace
    assert bigmag.workspace.radius == PUBLISHED["validity"]["workspace"].startswith("sphere of 0.11 m") * 0.055
    points = bigmag.workspace.random_points(np.random.default_rng(3), 3000)
    assert all(coil.region.contains(points).all() for coil in bigmag.coils)


def test_stated_bound_follows_from_the_published_error(bigmag, direct):
    """Three times the root mean square error against the smallest field of the air-cored coil in the workspace."""
    points = bigmag.workspace.random_points(np.random.default_rng(4), 400)
    points = np.concatenate([points, [[0, 0, 0.055], [0, 0, -0.055]]])
    current = PUBLISHED["fit_current_A"]
    smallest = current * np.linalg.norm(bigmag.unit_fields(points)[:, :3, 4], axis=1).min()
    error = PUBLISHED["fit_rmse_mT_thesis"]["air_multipole_P6"] * 1e-3
    assert magfem.load_model("bigmag_air").report["bound"]["B"] == pytest.approx(3 * error / smallest, rel=0.05)


def test_eight_amperes_are_the_limit(bigmag):
    bigmag.B([0, 0, 0], [8, -8, 8, -8, 8, -8])
    with pytest.raises(InputError, match='coil "3" of BigMag, six mobile coils bears up to 8 A'):
        bigmag.B([0, 0, 0], [0, 0, 0, 8.1, 0, 0])


def test_joints_turn_the_published_way(bigmag, direct):
    """pose(γ) = Rz(γ) pose₀, γ_bottom first: coils 0, 1, 4 with it, coils 2, 3, 5 with γ_top."""
    assert [joint.name for joint in bigmag.joints] == ["gamma_bottom", "gamma_top"]
    limits = PUBLISHED["frames"]["mobility_limits_code_deg"]
    points = bigmag.workspace.random_points(np.random.default_rng(5), 40)
    angles = np.array([0.7, -1.9])
    rows = bigmag.unit_fields(points, angles)
    for joint, angle in zip(bigmag.joints, angles, strict=True):
        np.testing.assert_allclose(np.degrees(joint.limits), limits, rtol=1e-15)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        B, gradient = direct(points @ turn)
        for k, published in enumerate(PUBLISHED["coils"]):
            if published["mobility"] == joint.name:
                np.testing.assert_allclose(rows[:, :3, k], B[:, k] @ turn.T, rtol=1e-10, atol=1e-18)
                expected = (turn @ gradient[:, k] @ turn.T).reshape(-1, 9)[:, [0, 1, 2, 4, 5]]
                np.testing.assert_allclose(rows[:, 3:, k], expected, atol=1e-11 * np.abs(expected).max())


def test_extended_bigmag_is_bigmag_and_two_full_rings(bigmag):
    """Six of its coils are the published ones; four more on each joint, mirror images, at angles of a hexagon."""
    extended = magfem.load_system("bigmag_extended")
    assert len(extended.coils) == 14 and extended.joints == bigmag.joints and extended.region is extended.workspace
    for own, published in zip(extended.coils, bigmag.coils, strict=False):
        assert own.joint == published.joint and own.pose.as_matrix().tolist() == published.pose.as_matrix().tolist()
    places = np.array([coil.pose.translation for coil in extended.coils[6:]])
    axes = np.array([coil.pose.rotation.as_matrix()[:, 2] for coil in extended.coils[6:]])
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 0.10215, rtol=1e-9)
    np.testing.assert_allclose(axes, -places / 0.10215, atol=1e-10)  # towards the middle
    np.testing.assert_allclose(np.degrees(np.arctan2(places[:, 1], places[:, 0])) % 360, [60, 120, 240, 300] * 2)
    np.testing.assert_allclose(places[:4] * [1, 1, -1], places[4:])
    elevations = [
        np.degrees(np.arcsin(abs(coil["p0_m"][2]) / np.linalg.norm(coil["p0_m"]))) for coil in PUBLISHED["coils"][:4]
    ]
    np.testing.assert_allclose(np.degrees(np.arcsin(-places[0, 2] / 0.10215)), np.mean(elevations), atol=0.1)
    assert [coil.joint for coil in extended.coils[6:]] == ["gamma_bottom"] * 4 + ["gamma_top"] * 4
