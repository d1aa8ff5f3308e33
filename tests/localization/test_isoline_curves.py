"""Curves of the isoline functions: differences of closed forms, and what the dissertation reads off them."""

from __future__ import annotations

import numpy as np
import pytest
from references import localization_dissertation as published

from magfem.fields.dipole_field import DipoleField
from magfem.localization.isoline_curves import curves, dipole_curves
from magfem.localization.isolines import isoline_functions

DIPOLE = DipoleField([2.6e-3, 0, 0])
QUARTER = np.radians(np.arange(1.0, 90.0))


@pytest.fixture(scope="module", params=["eccentric", "polar"])
def rotor(request):
    return curves("rotor_1x3", request.param)


def test_a_dipole_s_slopes_are_differences_of_its_functions():
    theta, step = np.radians(np.array([5.0, 40.0, 70.0, 110.0, 200.0, 300.0])), 1e-6
    here, after, before = dipole_curves(theta), dipole_curves(theta + step), dipole_curves(theta - step)
    np.testing.assert_allclose(here.ratio_slope, (after.ratio - before.ratio) / (2 * step), atol=1e-8)
    np.testing.assert_allclose(here.angle_slope, (after.angle - before.angle) / (2 * step), atol=1e-8)
    np.testing.assert_allclose(here.ratio, np.sqrt(1 + 3 * np.cos(theta) ** 2), rtol=1e-14)


def test_the_eccentric_slopes_carry_the_change_of_angle():
    functions, step = isoline_functions(DIPOLE), 1e-6
    here, after, before = (curves(functions, beta=QUARTER + shift).dipole for shift in (0.0, step, -step))
    np.testing.assert_allclose(here.ratio_slope, (after.ratio - before.ratio) / (2 * step), atol=1e-8)
    np.testing.assert_allclose(here.angle_slope, (after.angle - before.angle) / (2 * step), atol=1e-8)


def test_sensitivities_are_changes_of_angles_with_the_ratio():
    """β and α looked up at two ratios a little apart, by inverting √(1 + 3 cos²θ)."""

    def looked_up(ratio):
        theta = np.arccos(np.sqrt((ratio**2 - 1) / 3))
        return theta, np.arctan2(2 * np.cos(theta), np.sin(theta))

    ratio, step = np.array([1.1, 1.5, 1.9]), 1e-6
    found = dipole_curves(looked_up(ratio)[0])
    for sensitivity, after, before in zip(
        (found.beta_sensitivity, found.angle_sensitivity), looked_up(ratio + step), looked_up(ratio - step), strict=True
    ):
        np.testing.assert_allclose(sensitivity, (after - before) / (2 * step), rtol=1e-7)


def test_sensitivity_has_no_bound_where_the_ratio_has_no_slope():
    assert np.abs(dipole_curves([0.0]).beta_sensitivity[0]) == np.inf
    assert np.abs(dipole_curves([np.radians(0.01)]).beta_sensitivity[0]) > 1e3


def test_the_angle_mitigates_below_60_degrees():
    """|dα/dβ| ≤ 1 up to 60° by the text, of a dipole up to 57.7° of the eccentric and 54.7° of the polar angle."""
    for parametrisation, limit in (("eccentric", 57.7), ("polar", np.degrees(np.arccos(3**-0.5)))):
        beta = np.radians(np.arange(1.0, 90.0, 0.05))
        slope = np.abs(curves(DIPOLE, parametrisation, beta=beta).dipole.angle_slope)
        assert np.degrees(beta[np.argmax(slope > 1)]) == pytest.approx(limit, abs=0.3)
        assert limit == pytest.approx(published.ANGLE_SLOPE_BELOW_ONE, abs=6)


def test_fitted_slopes_wave_about_the_closed_form(rotor):
    """Fig. S6.8d: the sum of cosines has a corner to follow. The slopes' means over a wave, 20°, are the dipole's."""
    beta = np.degrees(rotor.beta)
    middle = (beta > 10) & (beta < 70)
    np.testing.assert_allclose(rotor.fitted.ratio_slope[middle], rotor.dipole.ratio_slope[middle], atol=0.05)
    off = (rotor.fitted.angle_slope - rotor.dipole.angle_slope)[middle]
    assert 0.02 < np.abs(off).max() < 0.25
    assert abs(off.mean()) < 0.03
    assert np.count_nonzero(np.diff(np.sign(off))) >= 5


def test_curves_are_the_functions_and_the_field(rotor):
    np.testing.assert_allclose(rotor.distance, rotor.field_distance, rtol=0.035)
    np.testing.assert_allclose(rotor.fitted.ratio, rotor.field_ratio, atol=1e-4)
    assert np.degrees(np.abs(rotor.fitted.angle - rotor.field_angle)).max() < 2.5
    assert rotor.distance.shape == (5, 720)
    falling = np.diff(rotor.distance, axis=0)
    assert (falling < 0).all()  # stronger isolines lie nearer
