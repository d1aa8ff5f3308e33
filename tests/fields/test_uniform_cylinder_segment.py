"""The segment against magpylib, the exact ring, a volume of dipoles, differences, and the laws of magnetostatics."""

from __future__ import annotations

from itertools import pairwise

import magpylib
import numpy as np
import pytest
from scipy.spatial import KDTree

from magfem.constants import MU_0
from magfem.fields.uniform_cylinder import cylinder_jet, ring_jet
from magfem.fields.uniform_cylinder_segment import cylinder_segment_jet
from magfem.typing import Floats, Points

UNIT = 1e-3  # m
M = 1e6 * np.array([0.48, -0.6, 0.64])  # A/m
SEGMENTS = {  # inner and outer radius, length, in units; start and end, rad
    "ordinary": (1.0, 2.0, 1.5, 0.3, 1.9),
    "wedge": (0.0, 2.0, 1.5, -1.0, 0.5),
    "wedge beyond a half turn": (0.0, 1.0, 1.0, 1.0, 5.5),
    "thin shell": (1.9, 2.0, 0.1, 0.0, 5.0),
    "rod": (1.0, 2.0, 8.0, 2.0, 3.0),
}

segments = pytest.mark.parametrize("segment", SEGMENTS.values(), ids=SEGMENTS)


def metres(segment: tuple[float, ...]) -> tuple[float, ...]:
    inner, outer, length, start, end = segment
    return inner * UNIT, outer * UNIT, length * UNIT, start, end


def surface_distance(points: Points, segment: tuple[float, ...]) -> Floats:
    """Distance (n,) to the surface, from a dense cloud on it, near enough to leave points out by."""
    inner, outer, length, start, end = metres(segment)
    rho, phi, z = np.linspace(inner, outer, 40), np.linspace(start, end, 500), np.linspace(-1, 1, 200) * length / 2
    grids = [
        np.meshgrid([inner, outer], phi, z),
        np.meshgrid(rho, [start, end], z),
        np.meshgrid(rho, phi, [-length / 2, length / 2]),
    ]
    r, angle, height = (np.concatenate([grid[i].ravel() for grid in grids]) for i in range(3))
    cloud = np.stack([r * np.cos(angle), r * np.sin(angle), height], axis=-1)
    distance: Floats = KDTree(cloud).query(points)[0]
    return distance


def scattered(segment: tuple[float, ...], count: int, clear: float, rng: np.random.Generator) -> Points:
    """Half inside, half anywhere about; `clear` (units) off the surface."""
    inner, outer, length, start, end = metres(segment)
    rho = rng.uniform(inner, outer, count // 2)
    phi = rng.uniform(start, end, count // 2)
    within = np.stack([rho * np.cos(phi), rho * np.sin(phi), rng.uniform(-0.5, 0.5, count // 2) * length], axis=-1)
    about = rng.uniform(-2, 2, (count // 2, 3)) * [outer, outer, length]
    points = np.concatenate([within, about])
    return points[surface_distance(points, segment) > clear * UNIT]


def relative(value: Floats, truth: Floats) -> Floats:
    flat, size = (value - truth).reshape(len(truth), -1), truth.reshape(len(truth), -1)
    return np.linalg.norm(flat, axis=1) / np.linalg.norm(size, axis=1)


@segments
def test_B_matches_magpylib(segment):
    points = scattered(segment, 400, 0.02, np.random.default_rng(1))
    inner, outer, length, start, end = metres(segment)
    peer = magpylib.magnet.CylinderSegment(
        dimension=(inner, outer, length, np.degrees(start), np.degrees(end)), magnetization=M
    )
    (b,) = cylinder_segment_jet(points, *metres(segment), M, order=0)
    # magpylib loses digits here and there; its median does not.
    error = relative(b, peer.getB(points))
    assert np.max(error) < 1e-6
    assert np.median(error) < 1e-9


@segments
@pytest.mark.parametrize("reach", [0.3, 1.0, 10.0, 100.0])
def test_segment_is_a_volume_of_dipoles(segment, reach):
    """Outside, at distances of `reach` sizes, with all derivatives, by Gauss–Legendre over the volume."""
    inner, outer, length, start, end = metres(segment)
    (t, w), (turn, share) = (np.polynomial.legendre.leggauss(n) for n in (20, 120))
    size = np.hypot(2 * outer, length)
    points = np.random.default_rng(2).normal(size=(8, 3))
    points *= (size / 2 + reach * size) / np.linalg.norm(points, axis=1, keepdims=True)
    edges = ((inner, outer), (start, end), (-length / 2, length / 2))
    places = ((a + b) / 2 + (b - a) / 2 * nodes for (a, b), nodes in zip(edges, (t, turn, t), strict=True))
    rho, phi, z = np.meshgrid(*places, indexing="ij")
    weights = np.einsum("i,j,k", w, share, w) * rho * np.prod([(b - a) / 2 for a, b in edges])
    source = np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=-1).reshape(-1, 3)
    jet = [np.zeros((8, *(3,) * n)) for n in (1, 2, 3)]
    unit = np.eye(3)
    for i, point in enumerate(points):
        d = point - source
        r = np.linalg.norm(d, axis=1)
        strength = MU_0 / (4 * np.pi) * weights.ravel()
        md = d @ M
        # B = 3 d (m·d)/r⁵ − m/r³ and its derivatives by the product rule.
        jet[0][i] = np.einsum("n,ni->i", strength * 3 * md / r**5, d) - M * np.sum(strength / r**3)
        three = np.einsum("n,ni->i", strength * 3 / r**5, d)
        jet[1][i] = (
            np.einsum("i,j->ij", three, M)
            + np.einsum("i,j->ij", M, three)
            + unit * np.sum(strength * 3 * md / r**5)
            - np.einsum("n,ni,nj->ij", strength * 15 * md / r**7, d, d)
        )
        outer_md = np.einsum("n,ni->i", strength * 15 * md / r**7, d)
        dd = np.einsum("n,ni,nj->ij", strength * 15 / r**7, d, d)
        sym = np.einsum("ij,k->ijk", unit * np.sum(strength * 3 / r**5) - dd, M)
        jet[2][i] = sym + np.einsum("ijk->ikj", sym) + np.einsum("ijk->kji", sym)
        one = np.einsum("i,jk->ijk", outer_md, unit)
        jet[2][i] -= one + np.einsum("ijk->jik", one) + np.einsum("ijk->kji", one)
        jet[2][i] += np.einsum("n,ni,nj,nk->ijk", strength * 105 * md / r**9, d, d, d)
    for value, truth in zip(cylinder_segment_jet(points, *metres(segment), M, order=2), jet, strict=True):
        assert np.max(relative(value, truth)) < 1e-11


@pytest.mark.parametrize("inner", [1.0, 0.0])
@pytest.mark.parametrize("cuts", [(-1.0, 0.3, 2.0, 4.0, 2 * np.pi - 1), (0.1, 2 * np.pi + 0.1)], ids=["cut", "whole"])
@pytest.mark.parametrize(
    ("distance", "tolerances"),
    [(1e-2, (1e-12, 1e-11, 1e-9)), (1e-3, (1e-12, 1e-10, 1e-7)), (0.3, (1e-13, 1e-12, 1e-11))],
)
def test_segments_of_a_whole_ring_sum_to_it(inner, cuts, distance, tolerances):
    """At `distance` (units) from the walls and the faces, inside and outside; off the cuts, whose parts cancel."""
    rng = np.random.default_rng(3)
    phi = (rng.choice([0.9, 3.0, 5.0], 60) + rng.uniform(-0.2, 0.2, 60)) % (2 * np.pi)
    side = rng.choice([-1.0, 1.0], 60) * distance
    walls = [(2 + side, rng.uniform(-0.6, 0.6, 60)), (rng.uniform(1.2, 1.8, 60), 0.75 + side)]
    if inner:
        walls.append((inner + side, rng.uniform(-0.6, 0.6, 60)))
    rho, z = (np.concatenate(values) for values in zip(*walls, strict=True))
    phi = np.tile(phi, len(walls))
    points = UNIT * np.stack([rho * np.cos(phi), rho * np.sin(phi), z], axis=-1)
    total = [0.0, 0.0, 0.0]
    for start, end in pairwise(cuts):
        part = cylinder_segment_jet(points, inner * UNIT, 2 * UNIT, 1.5 * UNIT, start, end, M, order=2)
        total = [one + other for one, other in zip(total, part, strict=True)]
    if inner:
        truth = ring_jet(points, inner * UNIT, 2 * UNIT, 1.5 * UNIT, M, order=2)
    else:
        truth = cylinder_jet(points, 2 * UNIT, 1.5 * UNIT, M, order=2)
    for value, exact, tolerance in zip(total, truth, tolerances, strict=True):
        assert np.max(relative(value, exact)) < tolerance


@segments
@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_match_central_differences(segment, order):
    points = scattered(segment, 120, 0.03, np.random.default_rng(4))
    exact = cylinder_segment_jet(points, *metres(segment), M, order)[order]

    def difference(step: float) -> Floats:
        ahead, behind = (
            cylinder_segment_jet(points + sign * step * np.eye(3)[:, None], *metres(segment), M, order - 1)[order - 1]
            for sign in (1, -1)
        )
        return np.moveaxis((ahead - behind) / (2 * step), 0, -1)

    h = 0.002 * UNIT
    coarse, fine = (np.linalg.norm(difference(step) - exact) for step in (h, h / 2))
    assert 3.7 < coarse / fine < 4.3
    extrapolated = (4 * difference(h / 2) - difference(h)) / 3
    assert np.linalg.norm(extrapolated - exact) < 1e-5 * np.linalg.norm(exact)


@segments
def test_field_is_irrotational(segment):
    """By components it is free of divergence; free of curl only if charges and currents are all there."""
    points = scattered(segment, 200, 0.02, np.random.default_rng(5))
    _, gradient, hessian = cylinder_segment_jet(points, *metres(segment), M, order=2)
    for tensor, tolerance in ((gradient, 1e-10), (hessian, 1e-8)):
        assert np.max(relative(np.swapaxes(tensor, 1, 2), tensor)) < tolerance
        assert np.max(np.abs(np.trace(tensor, axis1=1, axis2=2))) < tolerance * np.abs(tensor).max()


@segments
def test_normal_B_and_tangential_H_are_continuous(segment):
    inner, outer, length, start, end = metres(segment)
    rho, phi = 0.3 * inner + 0.7 * outer, 0.4 * start + 0.6 * end
    radial = [np.array([np.cos(a), np.sin(a), 0.0]) for a in (phi, start, end)]
    along = [np.array([-np.sin(a), np.cos(a), 0.0]) for a in (start, end)]
    up = np.array([0, 0, 0.2 * length])
    places = [
        (outer * radial[0] + up, radial[0]),
        (rho * radial[1] + up, -along[0]),
        (rho * radial[2] + up, along[1]),
        (rho * radial[0] + up / 0.4, np.array([0.0, 0, 1])),
    ]
    if inner:
        places.append((inner * radial[0] + up, -radial[0]))
    step = 1e-7 * UNIT
    for place, normal in places:
        within, without = (
            cylinder_segment_jet(place + side * step * normal, *metres(segment), M, order=0)[0] for side in (-1, 1)
        )
        jump = (without - within) / MU_0
        np.testing.assert_allclose(jump, -(M - normal * (normal @ M)), atol=1e-4 * np.linalg.norm(M))
        (on,) = cylinder_segment_jet(place, *metres(segment), M, order=0)  # the surface belongs to the magnet
        np.testing.assert_allclose(on, within, atol=1e-4 * MU_0 * np.linalg.norm(M))


@segments
def test_edges_and_the_axis_are_finite(segment):
    inner, outer, length, start, end = metres(segment)
    corners = [
        [r * np.cos(a), r * np.sin(a), z]
        for r in (inner, (inner + outer) / 2, outer)
        for a in (start, (start + end) / 2, end)
        for z in (-length / 2, 0, length / 2, length)
    ]
    for value in cylinder_segment_jet(np.array(corners), *metres(segment), M, order=2):
        assert np.all(np.isfinite(value))


def test_turning_by_whole_turns_changes_nothing():
    points = scattered(SEGMENTS["ordinary"], 100, 0.02, np.random.default_rng(6))
    inner, outer, length, start, end = metres(SEGMENTS["ordinary"])
    first = cylinder_segment_jet(points, inner, outer, length, start, end, M, order=1)
    for turns in (-3, 1):
        shift = 2 * np.pi * turns
        other = cylinder_segment_jet(points, inner, outer, length, start + shift, end + shift, M, order=1)
        for one, two in zip(first, other, strict=True):
            assert np.max(relative(one, two)) < 1e-10


def test_shapes_broadcast():
    for shape in ((), (0,), (1,), (2, 3)):
        jet = cylinder_segment_jet(np.full((*shape, 3), 1e-3), *metres(SEGMENTS["ordinary"]), M, order=2)
        assert [value.shape for value in jet] == [(*shape, *(3,) * n) for n in (1, 2, 3)]
