"""What of a turning field varies once per turn, held against a Fourier transform of the whole field turned."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.errors import InputError, UnitMismatchError
from magfem.fields import DipoleField, Field, UniformField
from magfem.localization import as_rotor
from magfem.typing import Floats, Vectors


def first_harmonic(field: Field, axis: Vectors, points: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine parts (n, 3) at `points`, of `field` turned right-handed about `axis` in 720 steps."""
    angles = 2 * np.pi * np.arange(720) / 720
    turns = Rotation.from_rotvec(angles[:, None] * axis)
    B = np.stack(
        [field.at(RigidTransform.from_rotation(turn)).B(points, outside="extrapolate") for turn in turns]
    )  # (720, n, 3)
    return 2 * np.einsum("k,kni->ni", np.cos(angles), B) / 720, 2 * np.einsum("k,kni->ni", np.sin(angles), B) / 720


POINTS = 4e-3 * np.array([[1.0, 0.2, 0.5], [-0.3, 0.9, 0.8], [0.1, -0.2, 1.3], [0.8, 0.9, -0.4]])


@pytest.mark.parametrize("name", ["rotor_1x3", "rotor_1x3_dissertation"])
def test_quadratures_are_the_first_harmonic(name: str) -> None:
    model = magfem.load_model(name)
    rotor = as_rotor(name)
    C, S, *_ = rotor.quadratures(POINTS)
    expected = first_harmonic(model, np.array([0.0, 0.0, 1.0]), POINTS)
    size = np.abs(expected[0]).max()
    np.testing.assert_allclose(C, expected[0], atol=1e-10 * size)
    np.testing.assert_allclose(S, expected[1], atol=1e-10 * size)
    assert rotor.moment == pytest.approx(np.linalg.norm(model.moment))
    assert rotor.along == pytest.approx(0.0, abs=1e-12)


def test_a_tilted_moment_counts_with_its_part_across() -> None:
    """m sin(tilt), and only that part of the field turns; near the magnet to all orders."""
    model = magfem.load_model("rotor_1x3")
    tilt = np.radians(70)
    axis = np.array([np.cos(tilt), 0.0, np.sin(tilt)])  # 70° from the moment, which is along x
    rotor = as_rotor(model, rotation_axis=axis)
    m = np.linalg.norm(model.moment)
    assert rotor.moment == pytest.approx(m * np.sin(tilt))
    assert rotor.along == pytest.approx(m * np.cos(tilt))
    frame = np.stack([np.cross(axis, [0.0, 0, 0]), np.zeros(3), axis], axis=1)
    frame[:, 0] = np.array([1.0, 0, 0]) - axis[0] * axis
    frame[:, 0] /= np.linalg.norm(frame[:, 0])
    frame[:, 1] = np.cross(axis, frame[:, 0])
    C, S, *_ = rotor.quadratures(POINTS)
    expected = first_harmonic(model, axis, POINTS @ frame.T)  # rotor's frame to the model's
    size = np.abs(C).max()
    np.testing.assert_allclose(C @ frame.T, expected[0], atol=1e-9 * size)
    np.testing.assert_allclose(S @ frame.T, expected[1], atol=1e-9 * size)


def test_gradients_are_those_of_the_quadratures() -> None:
    rotor = as_rotor("rotor_1x3")
    *_, dC, dS = rotor.quadratures(POINTS)
    h = 1e-7
    for k in range(3):
        step = h * np.eye(3)[k]
        ahead, behind = rotor.quadratures(POINTS + step), rotor.quadratures(POINTS - step)
        for gradient, a, b in ((dC, ahead[0], behind[0]), (dS, ahead[1], behind[1])):
            np.testing.assert_allclose(gradient[..., k], (a - b) / (2 * h), rtol=1e-6, atol=1e-6 * np.abs(dC).max())


def test_a_dipole_is_its_own_turning_part() -> None:
    rotor = as_rotor(DipoleField([0.0, 2e-3, 0.0]))
    assert rotor.moment == pytest.approx(2e-3)
    C, S, *_ = rotor.quadratures(np.array([0.03, 0.0, 0.0]))
    np.testing.assert_allclose(C, [1e-7 * 2 * 2e-3 / 0.03**3, 0, 0], rtol=1e-9, atol=1e-20)  # along the moment: 2 k m
    np.testing.assert_allclose(S, [0, -1e-7 * 2e-3 / 0.03**3, 0], rtol=1e-9, atol=1e-20)


def test_what_is_no_rotor_is_told() -> None:
    with pytest.raises(InputError, match="along the rotation axis"):
        as_rotor(DipoleField([0.0, 0.0, 1e-3]))
    with pytest.raises(InputError, match="field model or its name"):
        as_rotor(3.0)  # type: ignore[arg-type]
    with pytest.raises((InputError, UnitMismatchError), match="must be in T"):
        as_rotor("stator_1.6x5.5_inner")
    with pytest.raises(InputError, match="three numbers"):
        as_rotor("rotor_1x3", rotation_axis=[0, 0, 0])
    with pytest.raises(InputError, match="moment"):
        as_rotor(UniformField([1e-3, 0, 0]))
    with pytest.raises(InputError, match="unknown field model"):
        as_rotor("rotor_that_is_not_there")
