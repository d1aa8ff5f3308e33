"""Boxes, balls and polytopes: distances against brute force, offset points against distance, area and Steiner."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize, nnls
from scipy.spatial import ConvexHull
from scipy.stats import chisquare, kstest

from magfem.errors import InputError
from magfem.fields.hull import BoxHull, CylinderHull, Hull, PolytopeHull, SphereHull, hull_from_dict, hull_to_dict
from magfem.fields.region import Shell
from magfem.fields.region_json import region_from_dict, region_to_dict
from magfem.typing import Floats

BOX = BoxHull((4e-3, 1e-3, 2e-3))
PLATE = BoxHull((12e-3, 12e-3, 9e-6))
BALL = SphereHull(3e-3)
TETRAHEDRON = PolytopeHull(((1e-3, 0, 0), (3e-3, 0, 0), (1e-3, 2e-3, 0), (1e-3, 0, 1e-3)))


def sector() -> PolytopeHull:
    """The hull of a quarter of a ring, arc sampled each 5 degrees; the origin lies outside."""
    turn = np.radians(np.arange(0, 91, 5))
    arc = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    flat = np.concatenate([2e-3 * arc, 4e-3 * arc])
    return PolytopeHull(tuple((x, y, z) for x, y in flat.tolist() for z in (-0.5e-3, 0.5e-3)))


SECTOR = sector()
ALL = {"box": BOX, "plate": PLATE, "ball": BALL, "tetrahedron": TETRAHEDRON, "sector": SECTOR}
POLYTOPES = {"box": BOX, "plate": PLATE, "tetrahedron": TETRAHEDRON, "sector": SECTOR}

hulls = pytest.mark.parametrize("hull", ALL.values(), ids=ALL)
polytopes = pytest.mark.parametrize("hull", POLYTOPES.values(), ids=POLYTOPES)


def corners_of(hull: Hull) -> Floats:
    if isinstance(hull, PolytopeHull):
        return np.array(hull.vertices)
    assert isinstance(hull, BoxHull)
    return np.array(list(itertools.product((-1, 1), repeat=3))) * np.array(hull.size) / 2


def nearest_mixture(corners: Floats, point: Floats) -> float:
    """Smallest distance of `point` to Σ w_i corner_i, w ≥ 0, Σ w = 1, by non-negative least squares.

    The row that holds the sum to one weighs 1e6: it is met to 1e-12 of the distance's square.
    """
    scale = np.abs(corners - point).max()
    rows = np.concatenate([(corners - point).T / scale, np.full((1, len(corners)), 1e6)])
    weights, _ = nnls(rows, np.array([0.0, 0.0, 0.0, 1e6]))
    weights /= weights.sum()
    return float(np.linalg.norm(weights @ corners - point))


coordinate = st.floats(-1, 1).map(lambda value: round(value, 3))  # coplanar and doubled points turn up too
triple = st.tuples(coordinate, coordinate, coordinate)


@settings(max_examples=150, deadline=None)
@given(st.lists(triple, min_size=4, max_size=14), st.lists(triple, min_size=1, max_size=6), st.floats(0.01, 1e3))
def test_distance_to_a_polytope_is_the_smallest_over_its_mixtures(vertices, points, spread):
    cloud = np.array(vertices)
    if np.linalg.svd(cloud - cloud.mean(axis=0), compute_uv=False)[-1] < 1e-2:
        return
    hull = PolytopeHull(tuple(vertices))
    for point in spread * np.array(points):
        truth = nearest_mixture(cloud, point)
        assert hull.distance(point) == pytest.approx(truth, rel=1e-9, abs=1e-8)


@polytopes
def test_distance_of_scattered_points_is_the_smallest_over_mixtures(hull):
    corners = corners_of(hull)
    points = np.random.default_rng(1).uniform(-8e-3, 8e-3, (200, 3))
    truth = [nearest_mixture(corners, point) for point in points]
    np.testing.assert_allclose(hull.distance(points), truth, rtol=1e-8, atol=1e-11)


def test_distance_to_a_box_and_to_its_corners_hull_agree():
    rng = np.random.default_rng(2)
    for box in (BOX, PLATE):
        twin = PolytopeHull(tuple(map(tuple, corners_of(box).tolist())))
        for reach in (0.6e-3, 5e-3, 0.1, 100.0):
            points = rng.uniform(-reach, reach, (2000, 3))
            np.testing.assert_allclose(box.distance(points), twin.distance(points), rtol=1e-12, atol=1e-17)


def test_distance_to_a_ball_is_the_smallest_over_its_points():
    for point in np.random.default_rng(3).uniform(-3e-3, 3e-3, (20, 3)):

        def gap(q: Floats, point: Floats = point) -> float:
            on = 1.5 * q[0] * np.array([np.sin(q[1]) * np.cos(q[2]), np.sin(q[1]) * np.sin(q[2]), np.cos(q[1])])
            return float(np.sum((on - 1e3 * point) ** 2))

        start = [0.5, np.arccos(point[2] / np.linalg.norm(point)) + 0.1, np.arctan2(point[1], point[0]) + 0.1]
        found = minimize(gap, start, bounds=[(0, 1), (-1, 4), (-5, 5)], options={"ftol": 1e-15, "gtol": 1e-10})
        assert BALL.distance(point) == pytest.approx(1e-3 * np.sqrt(found.fun), abs=1e-7)


def test_distances_worked_out_by_hand():
    assert BOX.distance(np.array([5e-3, 0.5e-3, 1e-3])) == pytest.approx(3e-3)  # before a face, at a corner of it
    assert BOX.distance(np.array([2e-3, 3.5e-3, 5e-3])) == pytest.approx(5e-3)  # from an edge: 3-4-5
    assert BALL.distance(np.array([0, 0, -2.5e-3])) == pytest.approx(1e-3)
    assert TETRAHEDRON.distance(np.zeros(3)) == pytest.approx(1e-3)
    assert TETRAHEDRON.distance(np.array([1e-3, 0, 4e-3])) == pytest.approx(3e-3)  # from a corner
    assert SECTOR.distance(np.zeros(3)) == pytest.approx(np.sqrt(2) * 1e-3)  # from the chord of the inner arc
    assert SECTOR.distance(np.array([1.6e-3, 1.6e-3, 0])) == 0  # in the bore, beyond the chord


@hulls
def test_inside_and_on_the_surface_the_distance_is_zero(hull):
    surface = hull.offset_points(np.zeros(1), 500, np.random.default_rng(4))[0]
    assert np.max(hull.distance(surface)) < 1e-15 * 12
    middle = surface.mean(axis=0)
    assert np.all(hull.distance(middle + 0.999 * (surface - middle)) == 0)


@hulls
def test_distance_broadcasts_and_takes_single_no_and_undefined_points(hull):
    assert hull.distance(np.zeros((2, 5, 3))).shape == (2, 5)
    assert hull.distance(np.zeros((0, 3))).shape == (0,)
    assert hull.distance(np.full(3, 1e-3)).shape == ()
    assert np.isnan(hull.distance(np.array([np.nan, 0, 0])))
    far = hull.distance(np.array([0.0, 0.0, 1e3]))
    assert 1e3 - 5e-3 < far < 1e3


@polytopes
def test_radius_is_that_of_the_farthest_corner_from_the_origin(hull):
    assert hull.radius == pytest.approx(np.linalg.norm(corners_of(hull), axis=1).max(), rel=1e-14, abs=0)


@hulls
@pytest.mark.parametrize("draw", ["offset_points", "marked_points"])
def test_drawn_points_lie_at_their_distance(hull, draw):
    distances = np.array([1e-6, 0.5e-3, 2e-3, 50e-3])
    for count in (1, 2, 20, 400):
        points = getattr(hull, draw)(distances, count, np.random.default_rng(5))
        assert points.shape == (4, count, 3)
        expected = np.broadcast_to(distances[:, None], (4, count))
        np.testing.assert_allclose(hull.distance(points), expected, rtol=1e-9)


@polytopes
def test_shares_of_facets_edges_and_corners_are_those_of_steiners_formula(hull):
    """Area at distance d: A + d Σ length · exterior angle + 4π d²; A from Qhull, the parts told by the foot."""
    corners, distance = corners_of(hull), 1e-3
    qhull = ConvexHull(corners)
    # The middle coefficient from volumes of hulls grown by balls: V(d) = V + A d + E d²/2 + 4π d³/3, by sampling
    # is too coarse; the mean width of a polytope is instead the mean of its support function over directions.
    u = np.random.default_rng(6).normal(size=(400_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    width = np.mean((u @ corners.T).max(axis=1) + (-u @ corners.T).max(axis=1))
    edges = 4 * np.pi * width * distance
    areas = np.array([qhull.area, edges, 4 * np.pi * distance**2])

    points = hull.offset_points(np.array([distance]), 20_000, np.random.default_rng(7))[0]
    at_corner = np.abs(np.linalg.norm(points[:, None] - corners, axis=-1).min(axis=1) - distance) < 1e-9 * distance
    heights = points @ qhull.equations[:, :3].T + qhull.equations[:, 3]
    on_facet = np.abs(heights.max(axis=1) - distance) < 1e-9 * distance
    counts = [on_facet.sum(), (~on_facet & ~at_corner).sum(), at_corner.sum()]
    assert chisquare(counts, 20_000 * areas / areas.sum()).pvalue > 1e-3


@pytest.mark.parametrize("distance", [0.0, 0.4e-3, 5e-3])
def test_offset_points_of_a_box_are_uniform_over_the_area(distance):
    """By flux: the mean over the surface of any vector along the normal is its divergence by Gauss's theorem."""
    points = BOX.offset_points(np.array([distance]), 40_000, np.random.default_rng(8))[0]
    half = np.array(BOX.size) / 2
    foot = np.clip(points, -half, half)
    normal = (points - foot) / distance if distance else (np.abs(points) >= half * (1 - 1e-12)) * np.sign(points)
    (a, b, c), d = BOX.size, distance
    area = 2 * (a * b + b * c + c * a) + 2 * np.pi * d * (a + b + c) + 4 * np.pi * d**2
    volume = a * b * c + 2 * d * (a * b + b * c + c * a) + np.pi * d**2 * (a + b + c) + 4 / 3 * np.pi * d**3
    for axis in range(3):
        for power in (1, 3):
            values = points[:, axis] ** power * normal[:, axis]
            if power == 1:
                truth = volume / area
            else:  # ∫ 3 x² dV, over the body in its own frame, by a fine grid of slices
                x = np.linspace(-half[axis] - d, half[axis] + d, 20_001)
                e = np.sqrt(np.maximum(d**2 - np.maximum(np.abs(x) - half[axis], 0) ** 2, 0))
                p, q = np.delete(BOX.size, axis)
                slices = p * q + 2 * e * (p + q) + np.pi * e**2
                truth = np.trapezoid(3 * x**2 * slices, x) / area
            assert abs(values.mean() - truth) < 4 * values.std() / np.sqrt(len(values)) + 1e-6 * truth


def test_offset_points_of_a_ball_are_uniform():
    points = BALL.offset_points(np.array([1e-3]), 20_000, np.random.default_rng(9))[0]
    for axis in range(3):  # Archimedes: equal heights have equal areas
        assert kstest(points[:, axis] / 2.5e-3, "uniform", args=(-1, 2)).pvalue > 1e-3


def test_marked_points_reach_every_side_and_all_kinds_of_parts():
    """The 9 µm high walls of a plate get as many as its faces, which are a thousand times larger."""
    d = 0.1e-3
    points = PLATE.marked_points(np.full(30, d), 60, np.random.default_rng(10))
    excess = np.abs(points) - np.array(PLATE.size) / 2 > 1e-12
    beyond = excess.sum(axis=-1)
    for kind in (1, 2, 3):  # before a face, along an edge, about a corner
        assert np.all((beyond == kind).sum(axis=1) >= 19)
    on_face = beyond == 1
    for axis, sign in itertools.product(range(3), (-1, 1)):
        found = on_face & excess[..., axis] & (np.sign(points[..., axis]) == sign)
        assert np.all(found.sum(axis=1) >= 3)


def test_marked_points_of_a_sector_do_not_fall_for_the_strips_of_its_arc():
    """Its sides are two faces, two flanks, the chord's plane and one arc of 18 strips; each gets a sixth."""
    points = SECTOR.marked_points(np.full(40, 0.3e-3), 36, np.random.default_rng(11))
    on_face = (np.abs(points[..., 2]) > 0.8e-3 * (1 - 1e-9)) & (SECTOR.distance(points * [1, 1, 0]) == 0)
    assert np.all(on_face.sum(axis=1) == 4)


def test_marked_points_of_a_ball_meet_the_axes():
    points = BALL.marked_points(np.array([1e-3]), 10, np.random.default_rng(12))[0]
    cosine = np.abs(points / 2.5e-3).max(axis=-1)
    assert np.all(cosine[:6] > 1 - 1e-6)


@hulls
def test_hulls_survive_a_model_file(hull):
    twin = hull_from_dict(json.loads(json.dumps(hull_to_dict(hull))))
    assert twin == hull and hash(twin) == hash(hull)
    shell = Shell(hull, 1e-3, 2e-3)
    assert region_from_dict(json.loads(json.dumps(region_to_dict(shell)))) == shell


@hulls
def test_layers_of_a_shell_lie_in_it(hull):
    shell = Shell(hull, 0.5e-3, 4e-3)
    layers = shell.layers(np.random.default_rng(13), 16, 24)
    assert shell.contains(layers).all()
    distance = hull.distance(layers)
    np.testing.assert_allclose(distance, np.broadcast_to(distance[:, :1], distance.shape), rtol=1e-9)


def test_points_within_a_polytope_are_dropped_and_copies_are_equal():
    rng = np.random.default_rng(14)
    cloud = rng.normal(size=(200, 3))
    hull = PolytopeHull(tuple(map(tuple, cloud.tolist())))
    assert len(hull.vertices) < 100
    assert PolytopeHull(hull.vertices) == hull
    cube = list(itertools.product((-1.0, 0.0, 1.0), repeat=3))  # middles of faces and edges, and the centre
    assert set(PolytopeHull(tuple(cube)).vertices) == set(itertools.product((-1.0, 1.0), repeat=3))


def test_hulls_describe_themselves_in_millimetres():
    assert CylinderHull(4e-3, 1e-3).describe() == "cylinder, diameter 4 mm, length 1 mm"
    assert BOX.describe() == "box, 4 × 1 × 2 mm"
    assert BALL.describe() == "sphere, diameter 3 mm"
    assert TETRAHEDRON.describe() == "convex hull of 4 points, 2 × 2 × 1 mm"


FLAT = "do not lie in one plane"
BAD = [
    ({"kind": "cone"}, "unknown hull kind 'cone'; known: cylinder, box, sphere, polytope"),
    ({"kind": ["box"]}, "unknown hull kind"),
    ({"kind": "box"}, "a box hull needs size"),
    ({"kind": "box", "size": [1, 2]}, "three lengths"),
    ({"kind": "box", "size": 1}, "three lengths"),
    ({"kind": "box", "size": [1, 2, "3"]}, "finite sizes above 0"),
    ({"kind": "box", "size": [1, 2, 0]}, "finite sizes above 0"),
    ({"kind": "sphere", "diameter": float("inf")}, "finite sizes above 0"),
    ({"kind": "sphere", "diameter": 1, "length": 1}, "nothing else"),
    ({"kind": "cylinder", "diameter": True, "length": 1}, "finite sizes above 0"),
    ({"kind": "polytope", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}, FLAT),
    ({"kind": "polytope", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}, FLAT),
    ({"kind": "polytope", "vertices": [[1, 2, 3]] * 5}, FLAT),
    ({"kind": "polytope", "vertices": []}, "three finite coordinates"),
    ({"kind": "polytope", "vertices": [[0, 0], [1, 0, 0]]}, "three finite coordinates"),
    ({"kind": "polytope", "vertices": [[0, 0, None]] * 4}, "three finite coordinates"),
    ({"kind": "polytope", "vertices": "many"}, "three finite coordinates"),
]


@pytest.mark.parametrize(("data", "words"), BAD)
def test_bad_hulls_are_refused(data, words):
    with pytest.raises(InputError, match=words):
        hull_from_dict(data)
