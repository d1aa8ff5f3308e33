"""Coil systems against elementary formulas and laws: loops on their axes, superposition, broadcasting, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import magfem
from magfem.actuation import CoilSystem, SystemCoil
from magfem.constants import MU_0
from magfem.errors import InputError, OutsideRegionError
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Everywhere, Intersection, Shell
from magfem.fields.terms import harmonics, loops, uniform
from magfem.fields.workspace_region import Ball, Box

RADIUS, TURNS = 0.05, 100.0


def on_axis(distance):
    """B (T/A) of the loop on its axis."""
    return MU_0 * TURNS * RADIUS**2 / 2 / (RADIUS**2 + distance**2) ** 1.5


def loop_coil(name, axis, place, limit=None, region=None):
    """A loop at `place` (m) whose normal is a coordinate axis."""
    turn = {"x": Rotation.from_euler("y", 90, degrees=True), "y": Rotation.from_euler("x", -90, degrees=True)}
    pose = RigidTransform.from_components(place, turn.get(axis, Rotation.identity()))
    return SystemCoil(name, loops(np.zeros((1, 3)), RADIUS, TURNS), region or Everywhere(), pose, limit)


@pytest.fixture(scope="module")
def three():
    """Loops 80 mm from the origin along x, y and z, facing it."""
    coils = [loop_coil(axis, axis, 0.08 * np.eye(3)[k], 5.0) for k, axis in enumerate("xyz")]
    return CoilSystem("three loops", tuple(coils), workspace=Ball((0.0, 0.0, 0.0), 0.02))


@pytest.fixture(scope="module")
def biased(three):
    """The same with a background, 1 mT along y."""
    return CoilSystem("biased", three.coils, uniform([0.0, 1e-3, 0.0]), three.workspace)


def points_in(rng, *shape):
    return rng.uniform(-0.01, 0.01, (*shape, 3))


def test_coils_in_their_places_give_the_loop_formula(three):
    currents = np.array([1.0, -2.0, 3.0])
    np.testing.assert_allclose(three.B([0, 0, 0], currents), currents * on_axis(0.08), rtol=1e-12, atol=1e-18)
    beyond = three.B([0, 0, 0.01], [0, 0, 1.0])
    np.testing.assert_allclose(beyond, [0, 0, on_axis(0.07)], rtol=1e-12, atol=1e-18)


def test_background_is_there_once_whatever_the_currents(biased, three):
    points, currents = points_in(np.random.default_rng(1), 5), [1.0, 2.0, -3.0]
    np.testing.assert_allclose(biased.B(points, np.zeros(3)), np.tile([0, 1e-3, 0], (5, 1)), atol=1e-18)
    np.testing.assert_allclose(biased.B(points, currents) - three.B(points, currents), [[0, 1e-3, 0]] * 5, atol=1e-17)
    np.testing.assert_array_equal(biased.unit_fields(points), three.unit_fields(points))
    np.testing.assert_allclose(biased.at(currents).B(points), biased.B(points, currents), rtol=1e-12)


def test_gradient_and_hessian_are_the_slopes_of_what_comes_before(biased):
    rng, h = np.random.default_rng(2), 1e-4
    points, currents = points_in(rng, 4), rng.uniform(-5, 5, 3)
    steps = h * np.eye(3)
    # Central differences of fourth order: their own error is (h/0.07)⁴ ≈ 4e-12.
    slope = lambda f: sum(w * (f(k) - f(-k)) for w, k in ((8, 1), (-1, 2))) / (12 * h)  # noqa: E731
    for name, of in (("gradient", biased.B), ("hessian", biased.gradient)):
        numeric = np.stack([slope(lambda k, e=e, of=of: of(points + k * e, currents)) for e in steps], axis=-1)
        exact = getattr(biased, name)(points, currents)
        np.testing.assert_allclose(exact, numeric, atol=2e-9 * np.abs(exact).max())


def test_unit_fields_hold_all_of_B_and_gradient(three):
    points = points_in(np.random.default_rng(3), 2, 4)
    rows = three.unit_fields(points)
    assert rows.shape == (2, 4, 8, 3)
    for k in range(3):
        field = three.at(np.eye(3)[k])
        B, gradient = field.jet(points, 1)
        Bx, By, Bz, xx, xy, xz, yy, yz = np.moveaxis(rows[..., k], -1, 0)
        np.testing.assert_allclose(np.stack([Bx, By, Bz], -1), B, rtol=1e-12, atol=1e-18)
        rebuilt = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy], -1).reshape(2, 4, 3, 3)
        np.testing.assert_allclose(rebuilt, gradient, rtol=1e-9, atol=1e-12 * np.abs(gradient).max())


def test_currents_broadcast_with_points(biased):
    rng = np.random.default_rng(4)
    points, currents = points_in(rng, 5), rng.uniform(-5, 5, (4, 1, 3))
    B, gradient = biased.jet(points, currents)
    assert B.shape == (4, 5, 3) and gradient.shape == (4, 5, 3, 3)
    for k in range(4):
        np.testing.assert_allclose(B[k], biased.B(points, currents[k, 0]), rtol=1e-13)
    own = rng.uniform(-5, 5, (5, 3))
    one_by_one = [biased.B(point, current) for point, current in zip(points, own, strict=True)]
    np.testing.assert_allclose(biased.B(points, own), one_by_one, rtol=1e-13)
    assert biased.B([0, 0, 0], own).shape == (5, 3)
    with pytest.raises(InputError, match="do not go with points"):
        biased.B(points, np.zeros((4, 3)))


def test_one_point_and_no_point(biased):
    assert biased.B([0.0, 0.0, 0.0], np.ones(3)).shape == (3,)
    assert biased.unit_fields(np.zeros(3)).shape == (8, 3)
    assert biased.B(np.empty((0, 3)), np.ones(3)).shape == (0, 3)
    assert biased.unit_fields(np.empty((2, 0, 3))).shape == (2, 0, 8, 3)


def test_field_at_currents_is_a_field(biased):
    currents = np.array([1.0, 2.0, 3.0])
    field = biased.at(currents)
    assert isinstance(field, magfem.Field) and field.unit == "T" and field.region is biased.region
    points = points_in(np.random.default_rng(5), 7)
    for ours, theirs in zip(field.jet(points, 2), biased.jet(points, currents, order=2), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-12 * np.abs(theirs).max())
    np.testing.assert_allclose((field + biased.at(-currents)).B(points), [[0, 2e-3, 0]] * 7, atol=1e-16)


# Where and how much


def test_outside_is_asked_for(three):
    outside = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.03]])
    for call in (lambda: three.B(outside, np.ones(3)), lambda: three.unit_fields(outside)):
        with pytest.raises(OutsideRegionError, match="within 20 mm of the origin"):
            call()
    with pytest.raises(OutsideRegionError):
        three.at(np.ones(3)).B(outside)
    B, gradient = three.jet(outside, np.ones((4, 1, 3)), outside="nan")
    assert np.isnan(B[:, 1]).all() and np.isnan(gradient[:, 1]).all() and np.isfinite(B[:, 0]).all()
    assert np.isnan(three.unit_fields(outside, outside="nan")[1]).all()
    further = three.B(outside, [0, 0, 1.0], outside="extrapolate")[1]
    np.testing.assert_allclose(further, [0, 0, on_axis(0.05)], rtol=1e-12, atol=1e-18)
    with pytest.raises(InputError, match="outside must be"):
        three.B([0, 0, 0], np.ones(3), outside="maybe")


def test_coils_regions_limit_the_system():
    shell = Shell(CylinderHull(0.1, 0.01), 0.02, 0.2)
    near = loop_coil("near", "z", [0, 0, 0.08], region=shell)
    far = CoilSystem("far", (near,), workspace=Ball((0.0, 0.0, 0.0), 0.03))
    assert far.region == far.workspace  # the ball surely lies in the shell: 45 to 105 mm from the coil's hull
    close = CoilSystem("close", (near,), workspace=Ball((0.0, 0.0, 0.0), 0.07))
    assert isinstance(close.region, Intersection)
    with pytest.raises(OutsideRegionError):
        close.B([0, 0, 0.065], [1.0])  # 10 mm from the hull
    assert close.B([0, 0, 0.05], [1.0])[2] > 0
    free = CoilSystem("free", (near,))
    np.testing.assert_array_equal(free.region.contains([[0, 0, 0], [0, 0, 0.065], [0, 0, -0.5]]), [True, False, False])
    assert isinstance(CoilSystem("anywhere", (loop_coil("a", "z", [0, 0, 0]),)).region, Everywhere)


def test_currents_beyond_a_limit_name_the_coil(three):
    with pytest.raises(InputError, match=r'coil "y" of three loops bears up to 5 A, got 5\.5 A'):
        three.B([0, 0, 0], [0, -5.5, 0])
    with pytest.raises(InputError, match='coil "z"'):
        three.at([0, 0, 6.0])
    with pytest.raises(InputError, match=r'coil "x".*got 7 A'):
        three.B(np.zeros((2, 3)), [[1, 0, 0], [7, 0, 0]])
    assert three.B([0, 0, 0], [5.0, -5.0, 5.0 * (1 + 1e-15)]).shape == (3,)  # on the limit, but for rounding


@pytest.mark.parametrize(
    ("currents", "complaint"),
    [
        ([1.0, 2.0], "3 coils"),
        (1.0, "3 coils"),
        ([1.0, 2.0, np.nan], "finite"),
        (["a", "b", "c"], "real numbers"),
        ([1.0, 2.0, 1j], "real numbers"),
        ([[1.0], [2.0, 3.0], []], "real numbers"),
    ],
)
def test_currents_that_are_none_are_refused(three, currents, complaint):
    for call in (three.at, lambda c: three.B([0, 0, 0], c)):
        with pytest.raises(InputError, match=complaint):
            call(currents)
    with pytest.raises(InputError, match="one current for each coil"):
        three.at(np.zeros((2, 3)))


def test_fixed_coils_have_no_joints(three):
    currents = np.ones(3)
    for none in (None, [], (), np.empty(0)):
        assert three.B([0, 0, 0], currents, none).shape == (3,)
        assert three.unit_fields([0, 0, 0], none).shape == (8, 3)
        three.at(currents, none)
    for some in ([0.0], 0.1, np.zeros(2)):
        for call in (
            lambda joints: three.gradient([0, 0, 0], currents, joints),
            lambda joints: three.unit_fields([0, 0, 0], joints),
            lambda joints: three.at(currents, joints),
        ):
            with pytest.raises(InputError, match="this system has no joints"):
                call(some)


def test_systems_that_are_none_are_refused():
    coil = SystemCoil("a", harmonics(0.1, [1], [0], [False], [1e-3]))
    with pytest.raises(InputError, match="at least one coil"):
        CoilSystem("empty", ())
    with pytest.raises(InputError, match='"a" is given twice'):
        CoilSystem("twice", (coil, coil))
    with pytest.raises(InputError, match="current_limit must be positive"):
        SystemCoil("b", coil.own_terms, current_limit=-1.0)
    with pytest.raises(InputError, match="order must be"):
        CoilSystem("one", (coil,)).jet([0, 0, 1], [1.0], order=3)


def test_workspace_may_be_a_box(three):
    boxed = CoilSystem("boxed", three.coils, workspace=Box((-0.01, -0.01, -0.02), (0.01, 0.01, 0.02)))
    assert boxed.B([0.01, -0.01, 0.02], np.ones(3)).shape == (3,)
    with pytest.raises(OutsideRegionError, match="x, y, z from -10 to 10"):
        boxed.B([0.011, 0, 0], np.ones(3))
