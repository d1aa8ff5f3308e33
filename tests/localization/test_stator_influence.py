"""The stator beside the rotor: Biot–Savart written out, dipoles far away, an ellipse's angle in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from references import coil_dissertation
from references import localization_dissertation as published

from magfem import load_model
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.dipole_field import DipoleField
from magfem.localization.rotor import as_rotor
from magfem.localization.stator_influence import DISTANCES, Stator, field_comparison, pose_bias, stator_influence

COILS = ("stator_1.6x5.5_inner", "stator_1.6x5.5_outer")


@pytest.fixture(scope="module")
def coils():
    return [load_model(name) for name in COILS]


@pytest.fixture(scope="module")
def stator(coils):
    return Stator(*coils)


@pytest.fixture(scope="module")
def influence():
    return stator_influence()


def by_quadrature(model, points):
    """Biot–Savart of the model's closed paths, every straight piece by four Gauss points."""
    total = np.zeros(points.shape)
    places, weights = np.polynomial.legendre.leggauss(4)
    for term in model.terms:
        nodes = np.array(term["nodes"])
        pieces = np.roll(nodes, -1, axis=0) - nodes
        for place, weight in zip((1 + places) / 2, weights / 2, strict=True):
            away = points[:, None] - (nodes + place * pieces)
            part = np.cross(pieces, away) / np.linalg.norm(away, axis=-1, keepdims=True) ** 3
            total += MU_0 / (4 * np.pi) * term["coefficients"][0] * weight * part.sum(axis=1)
    return total


def test_beyond_its_region_a_coil_is_still_its_paths(coils):
    points = np.random.default_rng(1).normal(size=(12, 3))
    points *= np.linspace(5e-3, 40e-3, 12)[:, None] / np.linalg.norm(points, axis=1, keepdims=True)
    for coil in coils:
        expected = by_quadrature(coil, points)
        found = coil.B(points, outside="extrapolate")
        scale = np.linalg.norm(expected, axis=1, keepdims=True)
        np.testing.assert_allclose(found / scale, expected / scale, atol=1e-6)


def test_a_coil_becomes_its_dipole_far_away(coils):
    """The error falls as the distance grows: the turns at both ends run opposite ways round, an axial quadrupole."""
    directions = np.array([[1.0, 0, 0], [0, 0.7, 0.7], [0.6, 0.6, 0.6], [0, 0, 1.0]])
    for coil in coils:
        near, far = (
            np.linalg.norm(coil.B(points, outside="extrapolate") - DipoleField(coil.moment).B(points), axis=1)
            / np.linalg.norm(DipoleField(coil.moment).B(points), axis=1)
            for points in (0.04 * directions, 0.4 * directions)
        )
        assert near.max() < 0.2
        np.testing.assert_allclose(near / far, 10.0, rtol=0.1)


def test_averages_over_the_rotor_are_the_dissertation_s(stator):
    strengths = [np.linalg.norm(part) / stator.current for part in stator.inside()]
    np.testing.assert_allclose(strengths, coil_dissertation.STATOR_AVERAGES, rtol=0.05)


def test_the_rotor_is_two_orders_stronger_or_more(influence):
    """The dissertation has one to two orders; here 110 beside the stator's end at 5 mm, and 270 to 370 elsewhere."""
    ratio = influence.fields.ratio
    assert ratio.min() > 10 ** published.ORDERS_OF_STATOR[1]
    assert ratio.max() < 10 ** (published.ORDERS_OF_STATOR[1] + 1)
    along_axis = ratio[influence.fields.directions.index("along the axis")]
    assert along_axis.argmin() == 0 and along_axis[0] < 0.5 * along_axis[-1]


def test_the_greatest_field_of_a_turn(stator):
    compared = field_comparison(as_rotor("rotor_1x3"), stator, np.array([8e-3]))
    phase = np.linspace(0, 2 * np.pi, 2001)[:, None]
    inner, outer = (coil.B([[0, 8e-3, 0]], outside="extrapolate") for coil in (stator.inner, stator.outer))
    turn = np.linalg.norm(published.STATOR_CURRENT * (inner * np.cos(phase) + outer * np.sin(phase)), axis=1)
    assert compared.stator[1, 0] == pytest.approx(turn.max(), rel=1e-5)


def test_added_field_shortens_the_distance_by_its_moment(influence, coils):
    moment = as_rotor("rotor_1x3").moment
    share = published.STATOR_CURRENT * (coils[0].moment[0] + coils[1].moment[1]) / 2 / moment
    assert influence.added_moment == pytest.approx(share, rel=1e-3)
    assert influence.added.distance[-1] == pytest.approx(-share / 3, rel=0.02)
    assert np.degrees(influence.added.axis.max()) < 0.5 and influence.added.position.max() < 0.005


def test_uneven_turning_is_an_ellipse_s(influence, stator):
    """Of a field A e^{iφ} + B e^{−iφ} the angle is φ + arg(1 + (B/A) e^{−2iφ}) but for a constant: ε = |B/A|."""
    cosine, sine = (part[0] + 1j * part[1] for part in stator.inside())
    forward, backward = (cosine - 1j * sine) / 2, (cosine + 1j * sine) / 2
    assert influence.unevenness == pytest.approx(abs(backward / forward), rel=1e-6)
    strong, weak = coil_dissertation.STATOR_AVERAGES
    assert influence.unevenness > (strong - weak) / (strong + weak)  # which are not quite perpendicular besides


def test_uneven_turning_matters_more_than_the_added_field(influence):
    assert (influence.uneven.axis > 10 * influence.added.axis).all()
    assert 8 < np.degrees(influence.uneven.axis[-1]) < 13


def test_without_current_there_is_no_bias(coils):
    still = Stator(*coils, current=1e-12)
    bias = pose_bias(as_rotor("rotor_1x3"), still, np.array([6e-3, 30e-3]), 2 * np.pi * np.arange(64) / 64)
    assert np.abs(bias.position).max() < 1e-7 and bias.axis.max() < 1e-6


def test_what_cannot_be_used_is_refused():
    with pytest.raises(InputError, match="per ampere"):
        stator_influence(inner="rotor_1x3")
    with pytest.raises(InputError, match="at least 4 mm"):
        stator_influence(distances=[1e-3, 1e-2])
    with pytest.raises(InputError, match="current"):
        stator_influence(current=0.0)
    assert DISTANCES[0] == pytest.approx(5e-3) and DISTANCES[-1] == pytest.approx(40e-3)
