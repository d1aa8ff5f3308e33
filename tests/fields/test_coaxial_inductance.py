"""Inductances of coaxial coils against published tables, limits, each other and the law of reciprocity."""

from __future__ import annotations

import numpy as np
import pytest
from references.coils import BROOKS, MAXWELL, NAGAOKA
from scipy.integrate import quad

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.coaxial_inductance import (
    CoaxialWinding,
    loops_mutual_inductance,
    mutual_inductance,
    nagaoka_coefficient,
    self_inductance,
    sheet_inductance,
    wire_loop_inductance,
)
from magfem.fields.loop import loop_vector_potential

USUAL = CoaxialWinding(10e-3, 15e-3, 30e-3, 100)
OTHERS = {
    "around": CoaxialWinding(16e-3, 17e-3, 20e-3, 30, 10e-3),
    "touching": CoaxialWinding(15e-3, 20e-3, 20e-3, 30, 10e-3),
    "on top": CoaxialWinding(10e-3, 15e-3, 30e-3, 100, 30e-3),
    "overlapping": CoaxialWinding(12e-3, 18e-3, 20e-3, 30, 10e-3),
    "loop": CoaxialWinding(10e-3, 10e-3, 0, 1, 40e-3),
    "sheet": CoaxialWinding(9e-3, 9e-3, 20e-3, 10),
    "disc": CoaxialWinding(2e-3, 20e-3, 0, 24, 16e-3),
    "far": CoaxialWinding(10e-3, 15e-3, 30e-3, 1, 0.3),
}


@pytest.mark.parametrize("angle", MAXWELL)
def test_loops_match_maxwells_table(angle):
    distance = 2 / np.tan(np.radians(angle))  # of two loops of radius 1
    assert np.log10(loops_mutual_inductance(1, 1, distance) / MU_0) == pytest.approx(MAXWELL[angle], abs=6e-8)


def test_loops_match_neumanns_integral():
    for a, b, z in ((1.0, 0.3, 0.2), (1.0, 1.0, 0.5), (2.0, 1.5, 0.0)):

        def neumann(phi: float, a: float = a, b: float = b, z: float = z) -> float:
            value: float = np.cos(phi) / np.sqrt(a * a + b * b + z * z - 2 * a * b * np.cos(phi))
            return value

        exact = MU_0 * a * b * quad(neumann, 0, np.pi, epsabs=0, epsrel=1e-12)[0]
        assert loops_mutual_inductance(a, b, z) == pytest.approx(exact, rel=1e-12, abs=0)


def test_loops_far_apart_and_nearly_coincident():
    far = np.array([1e3, 1e6])
    np.testing.assert_allclose(loops_mutual_inductance(1, 0.5, far), MU_0 * np.pi * 0.125 / far**3, rtol=3e-6)
    near = np.array([1e-4, 1e-8, 1e-12])
    np.testing.assert_allclose(loops_mutual_inductance(1, 1, near), MU_0 * (np.log(8 / near) - 2), rtol=1e-8)
    assert loops_mutual_inductance(1, 1, 0) == np.inf


@pytest.mark.parametrize("ratio", NAGAOKA)
def test_nagaoka_table(ratio):
    assert nagaoka_coefficient(ratio / 2, 1.0) == pytest.approx(NAGAOKA[ratio], abs=6e-7)


def test_nagaoka_limits():
    """Long: 1 − 8/(3π) R/l + ½(R/l)²; short: Rayleigh and Niven's µ0 R [ln(8R/l) − ½ + …]; smooth where they meet."""
    q = 1e-4
    assert nagaoka_coefficient(q, 1.0) == pytest.approx(1 - 8 / (3 * np.pi) * q + q**2 / 2, abs=1e-14)
    for length in (1e-3, 1e-6, 1e-9):
        assert sheet_inductance(1.0, length) == pytest.approx(
            MU_0 * (np.log(8 / length) - 0.5 + length**2 / 32 * (np.log(8 / length) + 0.25)), rel=1e-10, abs=0
        )
    lengths = 0.02 / np.sqrt(1 - 1e-4) * (1 + np.array([-2e-9, -1e-9, 1e-9, 2e-9]))
    steps = np.diff([nagaoka_coefficient(1.0, length) for length in lengths])
    assert steps[1] == pytest.approx(steps[0] + steps[2], rel=1e-2, abs=0)


@pytest.mark.parametrize(("radius", "length"), [(0.01, 0.03), (1.0, 0.01), (1.0, 100.0)])
def test_winding_of_no_thickness_is_a_sheet(radius, length):
    sheet = CoaxialWinding(radius, radius, length, 7)
    assert self_inductance(sheet) == pytest.approx(sheet_inductance(radius, length, 7), rel=1e-8, abs=0)
    # A layer of thickness t has π t/(3l) less than the sheet, in units of µ0 R.
    half = 1e-8 * min(radius, length)
    thin = CoaxialWinding(radius - half, radius + half, length, 7)
    assert self_inductance(thin) == pytest.approx(sheet_inductance(radius, length, 7), rel=1e-7, abs=0)


def test_brooks_coil():
    assert self_inductance(CoaxialWinding(1, 2, 1)) / 1.5 == pytest.approx(BROOKS, rel=3e-5)


def test_thin_ring_of_square_section():
    """µ0 R [ln(8R/g) − 2] with the square's geometric mean distance g = 0.44705 of its side."""
    side = 1e-3
    ring = CoaxialWinding(1 - side / 2, 1 + side / 2, side)
    assert self_inductance(ring) == pytest.approx(MU_0 * (np.log(8 / (0.447049 * side)) - 2), rel=2e-6)


@pytest.mark.parametrize("section", [(10e-3, 15e-3, 30e-3), (10e-3, 11e-3, 50e-3), (2e-3, 15e-3, 0.2e-3)])
def test_self_inductance_is_the_sum_over_its_parts(section):
    """L = L₁ + L₂ + 2M for two halves that touch."""
    inner, outer, length = section
    whole = self_inductance(CoaxialWinding(*section, 2))
    middle = inner + 0.4 * (outer - inner)
    one, other = CoaxialWinding(inner, middle, length, 0.8), CoaxialWinding(middle, outer, length, 1.2)
    parts = self_inductance(one) + self_inductance(other) + 2 * mutual_inductance(one, other)
    assert parts == pytest.approx(whole, rel=1e-7, abs=0)


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_mutual_inductance_is_reciprocal(other):
    assert mutual_inductance(USUAL, other) == pytest.approx(mutual_inductance(other, USUAL), rel=1e-7, abs=0)


def test_mutual_inductance_of_filaments_and_of_dipoles():
    one, other = CoaxialWinding(1, 1, 0, 3), CoaxialWinding(0.5, 0.5, 0, 5, 0.7)
    assert mutual_inductance(one, other) == pytest.approx(15 * loops_mutual_inductance(1, 0.5, 0.7), rel=1e-12, abs=0)
    area = np.pi * (10e-3**2 + 150e-6 + 15e-3**2) / 3
    far = CoaxialWinding(10e-3, 15e-3, 30e-3, 100, 50.0)
    dipoles = MU_0 * (100 * area) ** 2 / (2 * np.pi * 50.0**3)
    assert mutual_inductance(USUAL, far) == pytest.approx(dipoles, rel=1e-5, abs=0)


@pytest.mark.parametrize("ratio", [0.01, 0.05, 0.2])
def test_round_wire_matches_its_integral(ratio):
    """The mean over the disc of the flux: polar coordinates about each observer swallow the logarithm."""
    x, w = np.polynomial.legendre.leggauss(16)
    unit, weight = (x + 1) / 2, w / 2
    phi = (np.arange(24) + 0.5) * 2 * np.pi / 24
    total = 0.0
    for r, wr in zip(unit, weight, strict=True):
        for angle in phi:
            p = r * np.array([np.cos(angle), np.sin(angle)])
            turn = phi[:, None] + angle
            along = p[0] * np.cos(turn) + p[1] * np.sin(turn)
            reach = -along + np.sqrt(along**2 + 1 - r * r)
            d = reach * unit**3  # the cube grades the rule towards the observer
            source = np.stack([p[0] + d * np.cos(turn), p[1] + d * np.sin(turn)])
            m = loops_mutual_inductance(1 + ratio * source[0], 1 + ratio * p[0], ratio * (source[1] - p[1]))
            mean = (m * d * reach * 3 * unit**2 * weight).sum() * (2 * np.pi / 24) / np.pi
            total += mean * 2 * r * wr / 24
    assert wire_loop_inductance(1.0, ratio) == pytest.approx(total, rel=2e-5 + ratio**4)
    assert wire_loop_inductance(1.0, ratio) - wire_loop_inductance(1.0, ratio, "skin") == pytest.approx(
        MU_0 / 4, rel=2 * ratio
    )


def test_loop_potential_is_maxwells():
    a = loop_vector_potential([0.5, 0, 0.7], 1.0)
    assert 2 * np.pi * 0.5 * a[1] == pytest.approx(float(loops_mutual_inductance(1.0, 0.5, 0.7)), rel=1e-14, abs=0)


def test_bad_coils_are_refused():
    with pytest.raises(InputError, match=r"at most 0\.2 of the loop's radius"):
        wire_loop_inductance(1.0, 0.3)
    with pytest.raises(InputError, match="filament without a section"):
        self_inductance(CoaxialWinding(1, 1, 0))
    with pytest.raises(InputError, match="expected 0 ≤ inner_radius"):
        CoaxialWinding(2, 1, 1)
    with pytest.raises(InputError, match="both radii must be positive"):
        loops_mutual_inductance(0, 1, 1)
    with pytest.raises(InputError, match="must be positive"):
        nagaoka_coefficient(1, 0)
