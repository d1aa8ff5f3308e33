"""Magnets of cards as sections of a rod: lengths, moments and masses by their formulas."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import magfem
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.rod import magnet_section


def test_ring_of_the_dissertation():
    section = magnet_section("ring_magnet_4x1.5x1")
    volume = pi / 4 * (4e-3**2 - 1.5e-3**2) * 1e-3
    assert section.length == pytest.approx(1e-3, rel=1e-12)
    assert section.mass == pytest.approx(7500 * volume, rel=1e-12, abs=0)
    assert section.moment_vector == pytest.approx(np.array([0, 0, 1.35 / MU_0 * volume]), rel=1e-12, abs=0)


def test_a_model_s_moment_is_the_weaker_one_that_finite_elements_found():
    model = magfem.load_model("ring_magnet_4x1.5x1")
    section = magnet_section("ring_magnet_4x1.5x1", model=model, density=0.1, field_points=3)
    assert section.moment_vector == pytest.approx(model.moment, rel=1e-15)
    assert 0.95 < section.moment_vector[2] / magnet_section("ring_magnet_4x1.5x1").moment_vector[2] < 1
    assert section.field_points == 3


def test_blocks_and_spheres():
    assert magnet_section("block_magnet_5x5x2").length == pytest.approx(2e-3, rel=1e-9)
    assert magnet_section("sphere_magnet_5").length == pytest.approx(5e-3, rel=1e-9)


def test_coils_are_no_magnets():
    with pytest.raises(InputError, match="is not"):
        magnet_section("solenoid_24x48x60")
