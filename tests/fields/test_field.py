"""The interface of fields, and placed, scaled and summed fields against magpylib and against each other."""

from __future__ import annotations

from dataclasses import dataclass

import magpylib
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from magfem import threads
from magfem.closed_form import ExactField, exact
from magfem.errors import InputError, OutsideRegionError, UnitMismatchError
from magfem.fields import Evaluated, Everywhere, Field, Placed, Scaled, Shell, Summed
from magfem.fields.field import Unit
from magfem.fields.hull import CylinderHull
from magfem.fields.region import Region
from magfem.fields.terms import Terms, concatenate, harmonics, loops
from magfem.geometry import AXIAL, DIAMETRIC, CylinderMagnet, PermanentMagnet, RingMagnet
from magfem.typing import Floats, Jet, Points

HULL = CylinderHull(diameter=4e-3, length=1e-3)
SHELL = Shell(HULL, clearance=0.5e-3, extent=6e-3)
POSE = RigidTransform.from_components([5e-3, -2e-3, 1e-3], Rotation.from_rotvec([0.4, -1.3, 0.9]))
POSES = [
    POSE,
    RigidTransform.from_components([0, 0, 7e-3], Rotation.from_rotvec([0, 2.0, 0])),
]
INSIDE = np.array([0.0, 0.0, 3e-3])
OUTSIDE = np.array([0.0, 0.0, 0.1])


@dataclass(frozen=True)
class TermsField(Evaluated):
    """Terms with a region: the shape of every fitted model."""

    terms: Terms
    region: Region = SHELL
    unit: Unit = "T"

    def evaluate(self, points: Points, order: int) -> Jet:
        return self.terms.jet(points, order)


class Uniform:
    """The smallest stranger that keeps the Field protocol, made without any of our classes."""

    def __init__(self, value: tuple[float, float, float], unit: Unit = "T", scalable: bool = True) -> None:
        self.value, self.unit, self.scalable, self.region = np.array(value), unit, scalable, Everywhere()

    def B(self, points, outside="raise"):
        return self.jet(points, 0, outside)[0]

    def gradient(self, points, outside="raise"):
        return self.jet(points, 1, outside)[1]

    def hessian(self, points, outside="raise"):
        return self.jet(points, 2, outside)[2]

    def jet(self, points, order=1, outside="raise"):
        lead = np.shape(points)[:-1]
        zeros = [np.zeros((*lead, *(3,) * rank)) for rank in (2, 3)]
        return (np.broadcast_to(self.value, (*lead, 3)), *zeros[:order])


@dataclass(frozen=True)
class Background(Evaluated):
    """A uniform field whose values are a view that cannot be written to."""

    region: Region = SHELL
    unit: Unit = "T"

    def evaluate(self, points: Points, order: int) -> Jet:
        return tuple(np.broadcast_to(1.0, (len(points), *(3,) * rank)) for rank in range(1, order + 2))


def terms() -> Terms:
    rng = np.random.default_rng(1)
    centres = np.column_stack([np.zeros((4, 2)), np.linspace(-4e-4, 4e-4, 4)])
    return concatenate(
        [
            loops(centres, np.full(4, 2e-3), rng.normal(size=4) * 100),
            harmonics(2e-3, [1, 2, 3], [0, 1, 3], [False, True, False], rng.normal(size=3) * 0.1),
        ]
    )


@pytest.fixture(scope="module")
def model() -> TermsField:
    return TermsField(terms())


@pytest.fixture(scope="module")
def coil() -> TermsField:
    """Per ampere."""
    return TermsField(loops(np.zeros((1, 3)), np.array([1e-3]), np.array([10.0])), Everywhere(), "T/A")


@pytest.fixture(scope="module")
def rotor() -> ExactField:
    return exact(CylinderMagnet(diameter=1e-3, length=3e-3, material=PermanentMagnet(1.42, 1.0, DIAMETRIC)))


@pytest.fixture(scope="module")
def ring() -> ExactField:
    return exact(
        RingMagnet(outer_diameter=4e-3, inner_diameter=1.5e-3, length=1e-3, material=PermanentMagnet(1.35, 1.0, AXIAL))
    )


@pytest.fixture(scope="module")
def points() -> Points:
    """(4, 10, 3) in the shell."""
    return SHELL.layers(np.random.default_rng(2), 4, 10)


def peers(geometry: RingMagnet | CylinderMagnet, pose: RigidTransform):
    """magpylib's magnet at a pose."""
    where = {"position": pose.translation, "orientation": pose.rotation}
    polarization = geometry.material.remanence_vector
    if isinstance(geometry, CylinderMagnet):
        size = (geometry.diameter, geometry.length)
        return magpylib.magnet.Cylinder(dimension=size, polarization=polarization, **where)
    size = (geometry.inner_diameter / 2, geometry.outer_diameter / 2, geometry.length, 0, 360)
    return magpylib.magnet.CylinderSegment(dimension=size, polarization=polarization, **where)


def assert_jets_agree(ours: Jet, truth: Jet, tolerance: float = 1e-13) -> None:
    assert len(ours) == len(truth)
    for a, b in zip(ours, truth, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * np.abs(b).max())


# The interface


@pytest.mark.parametrize("lead", [(), (1,), (7,), (2, 5), (2, 0, 3), (0,)])
def test_every_leading_shape_gives_its_own(model, lead):
    given = np.broadcast_to(INSIDE, (*lead, 3))
    jet = model.jet(given, 2)
    assert [part.shape for part in jet] == [(*lead, *(3,) * rank) for rank in (1, 2, 3)]
    assert all(part.dtype == np.float64 for part in jet)
    for part, alone in zip(jet, (model.B, model.gradient, model.hessian), strict=True):
        np.testing.assert_array_equal(alone(given), part)


def test_values_do_not_depend_on_the_shape_of_the_points(model, points):
    one_by_one = np.array([[model.B(point) for point in row] for row in points])
    np.testing.assert_array_equal(model.B(points), one_by_one)
    np.testing.assert_array_equal(model.B(points[::2, ::-1]), one_by_one[::2, ::-1])  # a view that is not contiguous


@pytest.mark.parametrize(
    "given",
    [[0.0, 0.0, 0.003], (0, 0, 0.003), np.array([0, 0, 0.003], dtype=np.float64)],
    ids=["list", "tuple", "array"],
)
def test_points_may_be_any_numbers(model, given):
    np.testing.assert_array_equal(model.B(given), model.B(INSIDE))


def test_single_precision_and_integers_are_computed_in_double(model, coil):
    single = INSIDE.astype(np.float32)
    np.testing.assert_array_equal(model.B(single), model.B(single.astype(float)))
    np.testing.assert_array_equal(coil.B([1, 2, 3]), coil.B([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(coil.B(np.array([[1, 2, 3]], dtype=np.int8)), coil.B([[1.0, 2.0, 3.0]]))


def test_given_points_are_left_as_they_were(model, points):
    before = points.copy()
    model.jet(points, 2)
    np.testing.assert_array_equal(points, before)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (0.003, r"shape \(\.\.\., 3\), got \(\)"),
        ([0, 0.003], r"got \(2,\)"),
        (np.zeros((3, 2)), r"got \(3, 2\)"),
        ([], r"got \(0,\)"),
        ([[0, 0, 1], [0, 0]], "real numbers"),
        ("0 0 3 mm", "real numbers"),
        (["0", "0", "3e-3"], "real numbers"),
        (None, "real numbers"),
        ({"x": 1}, "real numbers"),
        (np.array([0, 0, 3e-3 + 1j]), "real numbers"),
        ([0, 0, np.nan], "finite"),
        ([[0, 0, 3e-3], [0, np.inf, 0]], "finite"),
    ],
)
@pytest.mark.parametrize("outside", ["raise", "nan", "extrapolate"])
def test_what_is_no_point_is_one_sentence(model, bad, message, outside):
    with pytest.raises(InputError, match=message) as caught:
        model.B(bad, outside)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", [-1, 3, "1", None])
def test_orders_that_do_not_exist_are_refused(model, order):
    with pytest.raises(InputError, match="order must be 0, 1 or 2"):
        model.jet(INSIDE, order)


def test_outside_raises_unless_asked(model):
    with pytest.raises(OutsideRegionError) as caught:
        model.B([INSIDE, OUTSIDE, -OUTSIDE])
    text = str(caught.value)
    assert text.startswith("2 of 3 points lie outside the field's region (0.5 to 6 mm")
    assert "(0, 0, 100) mm" in text and 'outside="nan" or "extrapolate"' in text
    for call in (model.gradient, model.hessian, model.jet):
        with pytest.raises(OutsideRegionError):
            call(OUTSIDE)


def test_outside_nan_marks_exactly_the_points_without_a_promise(model):
    mixed = np.array([[INSIDE, OUTSIDE], [-INSIDE, 0 * INSIDE]])
    for part, promised in zip(model.jet(mixed, 2, "nan"), model.jet(mixed[:, 0], 2), strict=True):
        np.testing.assert_array_equal(part[:, 0], promised)
        assert np.isnan(part[:, 1]).all()


def test_outside_extrapolate_gives_the_bare_terms(model):
    ours, bare = model.jet(OUTSIDE[None], 2, "extrapolate"), model.terms.jet(OUTSIDE[None], 2)
    for part, truth in zip(ours, bare, strict=True):
        np.testing.assert_array_equal(part, truth)


@pytest.mark.parametrize("points", [INSIDE, np.zeros((0, 3))], ids=["inside", "empty"])
@pytest.mark.parametrize("outside", ["NaN", "clip", None, [], True])
def test_outside_typos_are_refused_even_where_they_would_not_matter(model, points, outside):
    with pytest.raises(InputError, match='outside must be "raise", "nan" or "extrapolate", got'):
        model.B(points, outside)


def test_values_that_cannot_be_written_to_are_no_obstacle():
    np.testing.assert_array_equal(Background().B([INSIDE, OUTSIDE], "nan"), [[1, 1, 1], [np.nan] * 3])


def test_regions_answer_for_lists_and_for_no_points(model):
    for field in (model, model.at(POSE), model + model.at(POSE), Uniform((0, 0, 1))):
        assert field.region.contains(np.zeros((0, 3))).shape == (0,)
        assert bool(field.region.contains([0.0, 0.0, 3e-3])) == bool(field.region.contains(INSIDE))


@pytest.mark.parametrize("build", [lambda f: f, lambda f: f.at(POSE), lambda f: 2 * f, lambda f: f + f.at(POSE)])
def test_hessians_are_symmetric_and_gradients_too(rotor, build):
    _, gradient, hessian = build(rotor).jet(np.random.default_rng(3).uniform(0.01, 0.02, (30, 3)), 2)
    tolerance = 1e-13 * np.abs(hessian).max()
    np.testing.assert_allclose(gradient, np.swapaxes(gradient, -1, -2), atol=1e-13 * np.abs(gradient).max())
    for axes in ((0, 1, 3, 2), (0, 2, 1, 3)):
        np.testing.assert_allclose(hessian, np.transpose(hessian, axes), atol=tolerance)


# Threads


@pytest.mark.parametrize("order", [0, 1, 2])
def test_jet_of_many_points_is_that_of_its_chunks_to_the_bit(model, order):
    many = SHELL.layers(np.random.default_rng(4), 100, 200).reshape(-1, 3)
    whole = model.jet(many, order)
    chunks = [model.jet(part, order) for part in np.array_split(many, 37)]
    for rank, part in enumerate(whole):
        np.testing.assert_array_equal(part, np.concatenate([chunk[rank] for chunk in chunks]))


@pytest.mark.parametrize("count", [1, 2, 7])
def test_number_of_processors_does_not_change_a_bit(model, monkeypatch, count):
    many = SHELL.layers(np.random.default_rng(5), 100, 200).reshape(-1, 3)
    expected = model.terms.jet(many, 2)
    monkeypatch.setattr(threads.os, "cpu_count", lambda: count)
    for part, truth in zip(model.terms.jet(many, 2), expected, strict=True):
        np.testing.assert_array_equal(part, truth)


# Placed


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("name", ["ring", "rotor"])
def test_placed_magnet_matches_magpylib(name, pose, request):
    field = request.getfixturevalue(name)
    world = pose.apply(SHELL.layers(np.random.default_rng(6), 20, 10).reshape(-1, 3))
    B, gradient = field.at(pose).jet(world)
    truth = peers(field.geometry, pose).getB(world)
    assert np.max(np.linalg.norm(B - truth, axis=1) / np.linalg.norm(truth, axis=1)) < 1e-8
    slope = _differences(lambda x: peers(field.geometry, pose).getB(x), world)
    assert np.median(np.linalg.norm(gradient - slope, axis=(1, 2)) / np.linalg.norm(slope, axis=(1, 2))) < 1e-6


def _differences(B, points: Points, step: float = 1e-5) -> Floats:
    columns = [(B(points + step * axis) - B(points - step * axis)) / (2 * step) for axis in np.eye(3)]
    wide = [(B(points + 2 * step * axis) - B(points - 2 * step * axis)) / (4 * step) for axis in np.eye(3)]
    return np.stack([(4 * a - b) / 3 for a, b in zip(columns, wide, strict=True)], axis=-1)


def test_placing_a_field_places_its_derivatives(rotor):
    """Gradient and hessian of the placed field are differences of its B and gradient."""
    placed = rotor.at(POSE)
    world = POSE.apply(np.random.default_rng(7).uniform(3e-3, 6e-3, (30, 3)))
    _, gradient, hessian = placed.jet(world, 2)
    np.testing.assert_allclose(gradient, _differences(placed.B, world), atol=1e-7 * np.abs(gradient).max())
    np.testing.assert_allclose(hessian, _differences(placed.gradient, world), atol=1e-7 * np.abs(hessian).max())


def test_placing_the_field_places_the_terms(model, points):
    placed = TermsField(model.terms.placed(POSE), Everywhere())
    world = POSE.apply(points.reshape(-1, 3))
    assert_jets_agree(model.at(POSE).jet(world, 2), placed.jet(world, 2))


def test_placed_twice_is_the_composition(model, points):
    first, second = POSES
    twice, once = model.at(first).at(second), model.at(second * first)
    world = second.apply(first.apply(points.reshape(-1, 3)))
    assert_jets_agree(twice.jet(world, 2), once.jet(world, 2), 1e-12)
    around = second.apply(first.apply(np.random.default_rng(8).uniform(-8e-3, 8e-3, (500, 3))))
    np.testing.assert_array_equal(twice.region.contains(around), once.region.contains(around))


def test_region_moves_with_the_field(model):
    placed = model.at(POSE)
    assert np.isfinite(placed.B(POSE.apply(INSIDE))).all()
    with pytest.raises(OutsideRegionError, match=r"placed at \(5, -2, 1\) mm"):
        placed.B(POSE.apply(OUTSIDE))


# Scaled and summed


def test_field_per_ampere_times_current_is_in_tesla(coil):
    """And is that of magpylib's loop at this current."""
    driven = coil * 2.5
    assert (coil.unit, driven.unit, (-coil).unit, (3 * driven).unit) == ("T/A", "T", "T/A", "T")
    peer = magpylib.current.Circle(diameter=2e-3, current=25.0)
    points = np.random.default_rng(9).uniform(2e-3, 5e-3, (20, 3))
    np.testing.assert_allclose(driven.B(points), peer.getB(points), rtol=1e-8, atol=1e-13)
    for factor in (np.float64(2.5), np.float32(2.5), np.array(2.5)[()]):
        np.testing.assert_array_equal((factor * coil).B(points), driven.B(points))


def test_tesla_and_tesla_per_ampere_are_not_added(coil, rotor):
    for combine in (lambda: coil + rotor, lambda: rotor - coil, lambda: Summed((rotor, rotor, coil))):
        with pytest.raises(UnitMismatchError, match="multiply the coil's field by its current"):
            combine()
    assert (2.0 * coil + rotor).unit == "T"
    assert (coil + coil.at(POSE)).unit == "T/A"


@pytest.mark.parametrize("factor", [np.nan, np.inf, "2", None, [1.0, 2.0], np.ones(3), 1j])
def test_only_finite_numbers_scale(rotor, factor):
    with pytest.raises(InputError, match="scaled by a"):
        rotor * factor


def test_what_is_not_linear_does_not_scale(rotor):
    iron = Uniform((0, 0, 1), scalable=False)
    for combine in (
        lambda: Scaled(iron, 2.0, "T"),
        lambda: 2 * Placed(iron, POSE),
        lambda: 2 * (rotor + iron),
        lambda: rotor - iron,
        lambda: -(rotor.at(POSE) + iron),
    ):
        with pytest.raises(UnitMismatchError, match="not proportional"):
            combine()
    assert not (rotor + iron).scalable


def test_sums_and_multiples_are_those_of_their_values(model, rotor, points):
    total = 2 * model - rotor.at(POSE) + (-model)
    jets = model.jet(points, 2), rotor.at(POSE).jet(points, 2)
    assert_jets_agree(total.jet(points, 2), tuple(a - b for a, b in zip(*jets, strict=True)))


def test_sum_matches_magpylib_collection(ring, rotor):
    field = ring.at(POSES[0]) + rotor.at(POSES[1])
    both = magpylib.Collection(peers(ring.geometry, POSES[0]), peers(rotor.geometry, POSES[1]))
    points = np.random.default_rng(10).uniform(-20e-3, -10e-3, (50, 3))
    np.testing.assert_allclose(field.B(points), both.getB(points), rtol=1e-7, atol=1e-12)


def test_region_of_a_sum_is_the_intersection(model):
    total = model + 2 * model.at(POSE)
    around = np.random.default_rng(11).uniform(-8e-3, 8e-3, (500, 3))
    both = SHELL.contains(around) & SHELL.contains(POSE.inv().apply(around))
    assert 0 < both.sum() < SHELL.contains(around).sum()
    np.testing.assert_array_equal(total.region.contains(around), both)
    np.testing.assert_array_equal(np.isfinite(total.B(around, "nan")).all(axis=1), both)


def test_a_field_of_ones_own_takes_part_in_everything(model, points):
    """Any object with the protocol's members: no base class needed."""
    earth = Uniform((2e-5, 0.0, -4e-5))
    assert isinstance(earth, Field)
    for field, factor in (
        (model + earth, 1.0),
        (earth + model, 1.0),
        (model - earth, -1.0),
        (earth - (-model), 1.0),
        (Summed((earth, model)), 1.0),
        (model + Scaled(earth, 3.0, "T"), 3.0),
    ):
        np.testing.assert_allclose(field.B(points), model.B(points) + factor * earth.value, rtol=1e-12)
        np.testing.assert_array_equal(field.gradient(points), model.gradient(points))
    turned = Placed(earth, POSE).B(points)
    np.testing.assert_allclose(turned, np.broadcast_to(POSE.rotation.apply(earth.value), turned.shape), rtol=1e-12)


@pytest.mark.parametrize("other", [3, 0.0, None, "field", np.zeros(3)])
def test_only_fields_are_added(model, other):
    for combine in (lambda: model + other, lambda: other + model, lambda: model - other, lambda: other - model):
        with pytest.raises(TypeError):
            combine()


def test_a_sum_of_nothing_is_refused():
    with pytest.raises(InputError, match="at least one field"):
        Summed(())


def test_composed_models_lower_to_one_array_of_terms():
    """Placed, scaled and summed models are one flat array: the same field as term by term, by another route."""
    from magfem.fields.terms import loops

    class Loop(Evaluated):
        region, unit = Everywhere(), "T"
        lowered = loops([[0, 0, 0]], [1e-3], [5.0])

        def evaluate(self, points, order):
            return self.lowered.jet(points, order)

    class Opaque(Loop):
        lowered = None

        def evaluate(self, points, order):
            return Loop.lowered.jet(points, order)

    pose = RigidTransform.from_components([1e-3, 2e-3, 0], Rotation.from_euler("xyz", [0.3, 0.5, 0.7]))
    composed, opaque = (kind().at(pose) * 2.0 + kind() - 0.5 * kind().at(pose) for kind in (Loop, Opaque))
    assert composed.lowered.kind.size == 3 and opaque.lowered is None
    points = np.random.default_rng(0).normal(size=(50, 3)) * 5e-3
    for one, other in zip(composed.jet(points, 2), opaque.jet(points, 2), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())
