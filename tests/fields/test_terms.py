"""Terms of every kind: moments by their far fields, sums, parts and poses, blocks, threads, and Laplace's equation."""

from __future__ import annotations

from dataclasses import fields

import magpylib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from references.jets import differences, errors, relative, scattered
from scipy.spatial.transform import RigidTransform, Rotation

from magfem import threads
from magfem.errors import InputError
from magfem.fields.packing import BLOCK
from magfem.fields.term_kinds import CHARGE_DISC, HARMONIC, INTERIOR, LOOP, OBLATE, PATH
from magfem.fields.terms import (
    HIGHEST_DEGREE,
    Terms,
    charge_discs,
    closed_path,
    concatenate,
    frame_about,
    harmonics,
    loops,
    uniform,
)
from magfem.typing import Floats, Jet, Points

TILTED = frame_about(np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.4, -1.0]))
CENTRE = np.array([0.2, -0.1, 0.3])
POSE = RigidTransform.from_components([0.5, -0.2, 0.1], Rotation.from_rotvec([0.4, -1.3, 0.9]))
TRIANGLE = np.array([[1.0, 0, 0.1], [-0.3, 0.8, 0], [-0.4, -0.9, 0.2]])
OF_ALL_ORDERS = ([1, 1, 1, 2, 3, 3], [0, 1, 1, 2, 0, 1], [0, 0, 1, 1, 0, 1])

KINDS = {
    "loop": loops(CENTRE, 0.7, 3e5, TILTED),
    "zonal": harmonics(0.8, [1, 2, 5], [0, 0, 0], [0, 0, 0], [0.3, -0.2, 0.1], CENTRE, TILTED),
    "transverse": harmonics(0.8, [1, 1, 4], [1, 1, 1], [0, 1, 1], [0.3, -0.2, 0.1], CENTRE, TILTED),
    "mixed": harmonics(0.8, *OF_ALL_ORDERS, [0.3, -0.2, 0.1, 0.5, 0.2, 0.1], CENTRE, TILTED),
    "interior": harmonics(2.0, *OF_ALL_ORDERS, [0.3, -0.2, 0.1, 0.5, 0.2, 0.1], CENTRE, TILTED, INTERIOR),
    "oblate": harmonics(0.6, [0, 1, 1, 3], [0] * 4, [1, 0, 1, 0], [0.3, -0.2, 0.1, 0.2], CENTRE, TILTED, OBLATE),
    "path": closed_path(TRIANGLE, 2e5, CENTRE, TILTED),
    "charge_disc": charge_discs(CENTRE + np.outer([0.4, -0.2], TILTED[:, 2]), [0.5, 0.5], [0.8, -0.8], TILTED),
}
LOCALISED = [kind for kind in KINDS if kind != "interior"]
ALL = concatenate([*KINDS.values(), loops(np.zeros((2, 3)), [0.5, 0.9], [1e5, -2e5]), uniform([0.1, 0.2, -0.3])])


def summed(jets: list[Jet]) -> Jet:
    return tuple(sum(parts) for parts in zip(*jets, strict=True))


@pytest.fixture(scope="module")
def points() -> Points:
    """(70, 3), well off every source."""
    return scattered(1, 70, 2.5, 5.0)


# Moments


@pytest.mark.parametrize("kind", LOCALISED)
def test_moment_of_every_kind_is_that_of_its_far_field(kind):
    """magpylib's dipole at the origin: centre, next multipoles and all fall with the distance."""
    dipole, directions = magpylib.misc.Dipole(moment=KINDS[kind].moment), scattered(2, 60, 1.0, 1.0)
    near, far = (relative(KINDS[kind].jet(d * directions, 0)[0], dipole.getB(d * directions)).max() for d in (100, 1e3))
    assert far < 1e-2 and 0.9 < np.log10(near / far) < 1.1


def test_moments_add_and_far_sources_have_none():
    together = concatenate([KINDS[kind] for kind in KINDS])
    np.testing.assert_allclose(together.moment, sum(KINDS[kind].moment for kind in LOCALISED), rtol=1e-13)
    assert not KINDS["interior"].moment.any()


@pytest.mark.parametrize("kind", KINDS)
def test_moment_turns_with_the_pose(kind):
    moment = KINDS[kind].moment
    placed = KINDS[kind].placed(POSE).moment
    np.testing.assert_allclose(placed, POSE.rotation.apply(moment), rtol=0, atol=1e-13 * np.linalg.norm(moment))


# Sums, parts and poses


@pytest.mark.parametrize("kind", KINDS)
def test_a_placed_source_equals_rotated_points_and_fields(kind, points):
    """R·B(R⁻¹(x − t)), and one more R for every derivative."""
    R, terms = POSE.rotation.as_matrix(), KINDS[kind]
    B, gradient, hessian = terms.jet(points, 2)
    truth = B @ R.T, R @ gradient @ R.T, np.einsum("ia,jb,kc,nabc->nijk", R, R, R, hessian)
    assert errors(terms.placed(POSE).jet(POSE.apply(points), 2), truth).max() < 1e-11


@pytest.mark.parametrize("kind", KINDS)
def test_scaled_is_the_field_times_a_number(kind, points):
    jet = KINDS[kind].jet(points, 2)
    assert errors(KINDS[kind].scaled(-2.5).jet(points, 2), tuple(-2.5 * part for part in jet)).max() < 1e-14


def test_concatenated_is_the_sum(points):
    parts = list(KINDS.values())
    total = summed([part.jet(points, 2) for part in parts])
    assert errors(concatenate(parts).jet(points, 2), total).max() < 1e-13
    assert (
        errors(
            (parts[0] + parts[6] + parts[3]).jet(points, 2), concatenate([parts[k] for k in (0, 6, 3)]).jet(points, 2)
        ).max()
        == 0
    )


def test_order_of_sources_and_runs_of_frames_do_not_matter(points):
    """Sources in the common frame between tilted ones, frames that follow themselves: sums are turned in time."""
    shuffled = [ALL.source(k) for k in np.random.default_rng(3).permutation(ALL.kind.size)]
    again = [one.placed(POSE).placed(POSE.inv()) if k % 2 else one for k, one in enumerate(shuffled)]
    truth = ALL.jet(points, 2)
    assert errors(concatenate(shuffled).jet(points, 2), truth).max() < 1e-13
    assert errors(concatenate(again).jet(points, 2), truth).max() < 1e-12


def test_sources_taken_apart_and_joined_are_the_same_arrays():
    again = concatenate([ALL.source(k) for k in range(ALL.kind.size)])
    for field in fields(Terms):
        ours, whole = getattr(again, field.name), getattr(ALL, field.name)
        assert ours.dtype == whole.dtype, field.name
        np.testing.assert_array_equal(ours, whole, err_msg=field.name)
    assert set(ALL.kind.tolist()) == {LOOP, HARMONIC, INTERIOR, OBLATE, PATH, CHARGE_DISC}


def test_owner_names_the_source_of_every_coefficient():
    for k in range(ALL.kind.size):
        np.testing.assert_array_equal(ALL.coefficient[ALL.owner == k], ALL.source(k).coefficient)


def test_with_coefficients_is_linear_in_them(points):
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=(2, ALL.coefficient.size))
    jets = [ALL.with_coefficients(a).jet(points, 2), ALL.with_coefficients(b).jet(points, 2)]
    assert errors(ALL.with_coefficients(a + b).jet(points, 2), summed(jets)).max() < 1e-12


@pytest.mark.parametrize("order", [0, 1])
def test_sine_parts_of_order_zero_are_nothing(order, points):
    """sin 0φ; whichever way the set is evaluated."""
    for kind in (HARMONIC, INTERIOR):
        for orders in ([0, 0], [0, 2]):
            term = harmonics(1.0, [2, 2], orders, [1, 1], [5.0, 0.0], kind=kind)
            assert not any(part.any() for part in term.jet(points, order))


# Points


@pytest.mark.parametrize("count", [1, 2, 31, 32, 33, 63, 64, 65])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_points_by_blocks_are_points_one_by_one(count, order):
    assert BLOCK == 32  # else the counts above miss its boundaries
    points = scattered(5, count, 2.5, 5.0)
    alone = [ALL.jet(point[None], order) for point in points]
    single = tuple(np.concatenate(parts) for parts in zip(*alone, strict=True))
    assert errors(ALL.jet(points, order), single).max() < 1e-13


@pytest.mark.parametrize("order", [0, 1])
def test_orders_of_the_jet_agree(order, points):
    for kind in KINDS.values():
        assert errors(kind.jet(points, order), kind.jet(points, 2)[: order + 1]).max() < 1e-12


@pytest.mark.parametrize("order", [0, 1, 2])
def test_no_points_have_no_field(order):
    shapes = [part.shape for part in ALL.jet(np.empty((0, 3)), order)]
    assert shapes == [(0, 3), (0, 3, 3), (0, 3, 3, 3)][: order + 1]


def test_points_in_any_memory_order_and_views_are_taken(points):
    jet = ALL.jet(points, 2)
    for view in (np.asfortranarray(points), np.repeat(points, 2, axis=0)[::2], points[::-1][::-1]):
        for ours, truth in zip(ALL.jet(view, 2), jet, strict=True):
            np.testing.assert_array_equal(ours, truth)


@pytest.mark.parametrize("processors", [1, 2, 3, 7])
def test_number_of_threads_does_not_change_a_bit(processors, monkeypatch):
    many = scattered(6, 20_011, 2.5, 5.0)
    pieces = [ALL.jet(many[k : k + 100 * BLOCK], 2) for k in range(0, len(many), 100 * BLOCK)]  # too few for threads
    truth = tuple(np.concatenate(parts) for parts in zip(*pieces, strict=True))
    monkeypatch.setattr(threads, "_processors", lambda: processors)
    for ours, theirs in zip(ALL.jet(many, 2), truth, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("order", [0, 2])
def test_singular_points_are_not_finite_and_raise_nothing(order):
    """The wire, the centre, the rims, a node: in the frame of the source, where no rounding hides them."""
    singular = {
        "loop": (loops(np.zeros(3), 0.5, 1.0), [0.5, 0, 0]),
        "zonal": (harmonics(1.0, [2], [0], [0], 1.0), [0, 0, 0]),
        "transverse": (harmonics(1.0, [2], [1], [0], 1.0), [0, 0, 0]),
        "mixed": (harmonics(1.0, [2], [2], [0], 1.0), [0, 0, 0]),
        "oblate": (harmonics(0.5, [0, 1], [0, 0], [1, 0], 1.0, kind=OBLATE), [0, 0.5, 0]),
        "path": (closed_path(TRIANGLE), TRIANGLE[1]),
        "charge_disc": (charge_discs(np.zeros(3), 0.5, 1.0), [0, 0.5, 0]),
    }
    for name, (terms, point) in singular.items():
        for part in terms.jet(np.array([point, [3.0, 0, 0]]), order):
            assert not np.isfinite(part[0]).all() and np.isfinite(part[1]).all(), name


# Laplace

NUMBERS = st.floats(-1, 1)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
FRAMES = st.one_of(st.none(), VECTORS.filter(lambda v: np.linalg.norm(v) > 0.1).map(frame_about))
RADII = st.floats(0.2, 1.0)
VALUES = st.floats(0.1, 1.0)


@st.composite
def harmonic_sources(draw: st.DrawFn) -> Terms:
    kind = draw(st.sampled_from([HARMONIC, INTERIOR, OBLATE]))
    lowest = 0 if kind == OBLATE else 1
    degrees = draw(st.lists(st.integers(lowest, 6), min_size=1, max_size=5))
    only = draw(st.sampled_from([None, 0, 1]))  # None: mixed orders
    orders = [0 if kind == OBLATE else min(n, draw(st.integers(0, n)) if only is None else only) for n in degrees]
    parts = [1 if n == 0 else draw(st.integers(0, 1)) for n in degrees]
    radius = 5.0 if kind == INTERIOR else draw(RADII)
    values = [draw(VALUES) for _ in degrees]
    return harmonics(radius, degrees, orders, parts, values, draw(VECTORS), draw(FRAMES), kind)


@st.composite
def path_sources(draw: st.DrawFn) -> Terms:
    angles = np.arange(draw(st.integers(3, 6)))
    nodes = np.stack([np.cos(angles), np.sin(angles), [draw(NUMBERS) for _ in angles]], axis=-1)
    return closed_path(nodes, 1e6 * draw(VALUES), draw(VECTORS), draw(FRAMES))


@st.composite
def single_sources(draw: st.DrawFn) -> Terms:
    build, scale = draw(st.sampled_from([(loops, 1e6), (charge_discs, 1.0)]))
    return build(draw(VECTORS), draw(RADII), scale * draw(VALUES), draw(FRAMES))


SOURCES = st.lists(st.one_of(harmonic_sources(), path_sources(), single_sources()), min_size=1, max_size=5)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(SOURCES, st.integers(0, 2**32 - 1))
def test_any_sum_of_sources_obeys_laplace(parts, seed):
    """Away from all sources: gradient and hessian are symmetric and trace-free and what differences of B give."""
    terms = concatenate(parts)
    points, step = scattered(seed, 40, 4.5, 6.0), 0.02
    _, gradient, hessian = terms.jet(points, 2)
    assert np.array_equal(gradient, np.swapaxes(gradient, 1, 2))
    for axes in ((0, 2, 1, 3), (0, 1, 3, 2)):
        assert np.array_equal(hessian, np.transpose(hessian, axes))
    # Parts may cancel each other: the scale is theirs, and B's where a gradient is nothing but rounding.
    B_size, slope, curve = (sum(np.abs(part.jet(points, 2)[rank]).max() for part in parts) for rank in range(3))
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() <= 1e-14 * slope
    assert np.abs(np.trace(hessian, axis1=1, axis2=2)).max() <= 1e-14 * curve
    assert np.abs(differences(lambda x: terms.jet(x, 0)[0], points, step) - gradient).max() <= 1e-9 * (B_size + slope)
    assert np.abs(differences(lambda x: terms.jet(x, 1)[1], points, step) - hessian).max() <= 1e-9 * (slope + curve)


# What is no field in air


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        (harmonics(1.0, [0], [0], [0], 1.0), "there is no monopole"),
        (harmonics(1.0, [0], [0], [0], 1.0, kind=OBLATE), "there is no monopole"),
        (harmonics(1.0, [0], [0], [0], 1.0, kind=INTERIOR), "harmonics have degrees from 1"),
        (harmonics(1.0, [-1], [0], [0], 1.0), "harmonics have degrees from 1"),
        (harmonics(1.0, [-1], [0], [1], 1.0, kind=OBLATE), "harmonics have degrees from 1"),
        (harmonics(1.0, [HIGHEST_DEGREE + 1], [0], [0], 1.0), f"to {HIGHEST_DEGREE}"),
        (harmonics(1.0, [2], [3], [0], 1.0), "orders between 0 and their degree"),
        (harmonics(1.0, [2], [-1], [0], 1.0, kind=INTERIOR), "orders between 0 and their degree"),
        (harmonics(1.0, [2], [1], [0], 1.0, kind=OBLATE), "oblate sources are axial"),
        (charge_discs(np.zeros(3), 1.0, 1.0), "a monopole does not exist"),
        (closed_path(np.eye(3)[:2]), "three nodes or more"),
    ],
)
def test_what_is_no_field_is_one_sentence(terms, message):
    with pytest.raises(InputError, match=message) as caught:
        concatenate([ALL, terms]).check_sources()
    assert "\n" not in str(caught.value)


def test_every_kind_alone_and_all_together_are_fields():
    for terms in (*KINDS.values(), ALL):
        terms.check_sources()


def test_highest_degree_is_finite(points):
    """Its factorials and derivatives fit a float, for all kinds, orders and parts."""
    n = HIGHEST_DEGREE
    for kind in (HARMONIC, INTERIOR, OBLATE):
        for order in (0,) if kind == OBLATE else (0, 1, 2, n):
            terms = harmonics(3.0, [n], [order], [int(order > 0)], 1.0, kind=kind)
            assert all(np.isfinite(part).all() and part.any() for part in terms.jet(points, 2))


def test_frames_are_right_handed_and_orthonormal():
    for direction in np.concatenate([np.eye(3), -np.eye(3), scattered(7, 20, 0.1, 10.0)]):
        for azimuth in (None, np.array([0.3, 0.4, -1.1])):
            frame: Floats = frame_about(direction, azimuth)
            np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-15)
            np.testing.assert_allclose(frame[:, 2], direction / np.linalg.norm(direction), atol=1e-15)
            assert np.linalg.det(frame) > 0
            if azimuth is not None:
                assert frame[:, 0] @ azimuth > 0 and abs(frame[:, 1] @ azimuth) < 1e-14
