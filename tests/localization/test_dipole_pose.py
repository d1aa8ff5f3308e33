"""Closed-form poses, held against the dipole's field written out and against a numerical search."""

from __future__ import annotations

import numpy as np
import pytest
from localization.dipole_field import dipole_samples, pose_at
from scipy.optimize import minimize

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.localization import dipole_poses
from magfem.typing import Floats, Vectors

MOMENT = 2.6e-3


def quadratures(position: Vectors, axis: Vectors, phase: float = 0.0) -> tuple[Vectors, Vectors]:
    """C and S from the field at two quarters of a turn."""
    B = dipole_samples(position, axis, np.array([0.0, 0.25]), moment=MOMENT, phase=phase)
    return B[0], B[1]


@pytest.mark.parametrize("degrees", [5.0, 25.0, 45.0, 75.0, 85.0, -40.0])
def test_the_true_pose_is_among_four(degrees: float) -> None:
    """Without noise, to ten digits, for both signs of β."""
    generator = np.random.default_rng(int(abs(degrees)))
    for distance in (5e-3, 20e-3, 0.2):
        position, axis = pose_at(np.radians(degrees), distance, generator)
        found = dipole_poses(*quadratures(position, axis, 0.7), MOMENT)
        off = np.linalg.norm(found.position - position, axis=-1) / distance + np.linalg.norm(found.axis - axis, axis=-1)
        assert off.min() < 1e-10
        assert found.beta == pytest.approx(np.radians(abs(degrees)), abs=1e-10)
        assert not found.clamped


def test_all_four_make_the_same_field() -> None:
    position, axis = pose_at(0.6, 0.03, np.random.default_rng(1))
    C, S = quadratures(position, axis, 0.3)
    found = dipole_poses(C, S, MOMENT)
    for place, frame in zip(found.position, found.frame, strict=True):
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) == pytest.approx(1.0)
        r = -place
        d = np.linalg.norm(r)
        for m, B in ((MOMENT * frame[:, 0], C), (MOMENT * frame[:, 1], S)):
            expected = MU_0 / (4 * np.pi) * (3 * r * (m @ r) / d**5 - m / d**3)
            np.testing.assert_allclose(expected, B, atol=1e-12 * np.linalg.norm(C))


def test_singular_values_are_as_stated() -> None:
    """s₂ = µ₀ m/(4π r³) and s₁/s₂ = √(1 + 3 cos²β), by an SVD."""
    beta, r = 0.9, 0.025
    position, axis = pose_at(beta, r, np.random.default_rng(2))
    s1, s2 = np.linalg.svd(np.stack(quadratures(position, axis), axis=1))[1]
    assert s2 == pytest.approx(MU_0 * MOMENT / (4 * np.pi * r**3), rel=1e-12)
    assert s1 / s2 == pytest.approx(np.sqrt(1 + 3 * np.cos(beta) ** 2), rel=1e-12)
    assert dipole_poses(*quadratures(position, axis), MOMENT).ratio == pytest.approx(s1 / s2, rel=1e-12)


def test_beyond_two_it_is_still_the_most_likely() -> None:
    """No dipole makes a ratio of 2.3; none is nearer to it than the one found, by a search over all poses."""
    rng = np.random.default_rng(4)
    U, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    C, S = 2.3e-5 * U[:, 0], 1e-5 * U[:, 1]
    found = dipole_poses(C, S, MOMENT)
    assert found.clamped and found.beta == 0.0

    def misfit(place: Floats, frame: Floats) -> float:
        d = np.linalg.norm(place)
        parts = [
            MU_0 / (4 * np.pi) * MOMENT * (3 * place * (frame[:, k] @ place) / d**5 - frame[:, k] / d**3) - B
            for k, B in ((0, C), (1, S))
        ]
        return float(np.sum(np.square(parts))) * 1e10

    ours = misfit(found.position[0], found.frame[0])

    def objective(x: Floats) -> float:
        from scipy.spatial.transform import Rotation

        return misfit(0.03 * x[:3], Rotation.from_rotvec(x[3:]).as_matrix())

    best = min(minimize(objective, rng.normal(size=6), method="BFGS", options={"gtol": 1e-10}).fun for _ in range(12))
    assert ours == pytest.approx(best, rel=1e-6)


def test_batches_are_each_alone() -> None:
    rng = np.random.default_rng(6)
    C, S = rng.normal(size=(2, 4, 5, 3))
    together = dipole_poses(C, S, MOMENT)
    assert together.position.shape == (4, 5, 4, 3) and together.frame.shape == (4, 5, 4, 3, 3)
    alone = dipole_poses(C[2, 3], S[2, 3], MOMENT)
    np.testing.assert_allclose(together.position[2, 3], alone.position, rtol=1e-12)


def test_what_does_not_turn_is_told() -> None:
    C = np.array([1e-5, 2e-5, 0.0])
    with pytest.raises(InputError, match="does not turn"):
        dipole_poses(C, 2 * C, MOMENT)
    with pytest.raises(InputError, match="does not turn"):
        dipole_poses(np.zeros(3), np.zeros(3), MOMENT)
    with pytest.raises(InputError, match="finite"):
        dipole_poses(C, [np.nan, 0, 0], MOMENT)
