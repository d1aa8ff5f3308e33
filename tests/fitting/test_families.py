"""Families of models: ours and the dissertation's on the same data, against their published ballpark and symmetries."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import magfem
from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fields.norms import relative_errors
from magfem.fields.term_kinds import LOOP
from magfem.fields.terms import harmonics
from magfem.fields.terms_json import terms_from_list
from magfem.fitting.families import (
    FAMILIES,
    axial_multipole,
    body_harmonics,
    dissertation_families,
    eight_source,
    family_of,
    solid_harmonics,
    wall_and_face_loops,
)
from magfem.fitting.least_squares import solve_least_squares
from magfem.geometry import AXIAL, CylinderMagnet, PermanentMagnet
from magfem.typing import Floats, Points


def fitted(candidate, field, points: Points):
    """The candidate's terms, by plain least squares on B."""
    columns, _ = candidate.columns(points)
    solved = solve_least_squares(columns.reshape(candidate.parameters, -1).T, field.B(points).ravel())
    return candidate.with_parameters(solved.parameters)


def entries(model, family: str) -> list[dict]:
    return [entry for entry in model.report["comparison"] if entry["family"] == family]


def around_x(polar: float, distance: float, count: int = 72) -> Points:
    """Points (count, 3) on a circle about the x axis: one polar angle from x, one distance from the origin."""
    azimuth = np.arange(count) * 2 * np.pi / count
    c, s = np.cos(polar), np.sin(polar)
    return distance * np.stack([c + 0 * azimuth, s * np.cos(azimuth), s * np.sin(azimuth)], axis=-1)


def variation(B: Floats) -> float:
    """Largest over smallest |B|, less one."""
    size = np.linalg.norm(B, axis=-1)
    return float(size.max() / size.min() - 1)


# The dissertation's families on the same data


def test_axial_multipole_in_its_window_is_percents_off(ring_model):
    """Six poles in front of the ring: the dissertation's own fits are up to 20 to 24 % off in their windows."""
    whole, front = entries(ring_model, "axial_multipole")
    assert front["parameters"] == 6 and "z ≥ 1.5 mm" in front["window"]
    assert 0.01 < front["heldout"]["B"]["max"] < 0.30
    assert whole["heldout"]["B"]["max"] > 1  # all round, inside its sphere of convergence, it is no model at all


def test_eight_source_sets_are_as_good_as_published(rotor_model):
    """One set of eight misses by several percent, three stay below one."""
    one, three = entries(rotor_model, "eight_source")
    assert (one["parameters"], three["parameters"]) == (3, 9)
    assert 0.03 < one["heldout"]["B"]["max"] < 0.30
    assert three["heldout"]["B"]["max"] < 0.01


@pytest.mark.parametrize("name", ["ring", "rotor", "ring_solution", "rotor_solution"])
def test_our_model_is_better_than_each_of_them(name, request):
    model = request.getfixturevalue(f"{name}_model")
    assert len(model.report["comparison"]) == 2
    for entry in model.report["comparison"]:
        for key in ("B", "gradient"):
            assert 2 * entry["ours"][key]["max"] < entry["heldout"][key]["max"]


@pytest.mark.parametrize("name", ["ring", "rotor"])
def test_comparison_errors_are_those_of_the_listed_terms(name, request):
    """Evaluated again from the list, at fresh points against the closed form."""
    model, field, points = (request.getfixturevalue(f"{name}_{what}") for what in ("model", "field", "points"))
    entry = model.report["comparison"][-1]
    terms = terms_from_list(entry["terms"])
    counted = np.ones(points.shape[:2], dtype=bool)
    if "z ≥" in entry["window"]:
        counted = points[..., 2] >= model.region.hull.length / 2 + 2 * model.region.clearance
    errors = relative_errors(terms.jet(points.reshape(-1, 3), 0)[0].reshape(points.shape), field.B(points))
    rms = np.sqrt(np.mean(errors[counted] ** 2))
    assert rms == pytest.approx(entry["heldout"]["B"]["rms"], rel=0.35)


def test_comparison_without_room_for_its_window_is_left_out():
    """A thin region leaves no space in front beyond the window's plane."""
    disc = CylinderMagnet(
        diameter=4e-3, length=1e-3, material=PermanentMagnet(1.0, 1.0, AXIAL), clearance=1e-3, extent=1.5e-3
    )
    model = magfem.fit(magfem.exact(disc))
    assert [entry["window"] for entry in model.report["comparison"]] == ["the whole region"]


# Symmetry about the magnetisation


def test_diametric_cylinder_is_not_axisymmetric_about_its_magnetisation(rotor_field):
    """At 3.5 mm and 60° from x, |B| of the closed form depends on the azimuth about x by 48 %."""
    assert variation(rotor_field.B(around_x(np.pi / 3, 3.5e-3))) > 0.4
    assert variation(rotor_field.B(around_x(np.pi / 3, 50e-3))) < 0.01  # far away it is a dipole


def test_one_axial_multipole_about_x_is_axisymmetric(rotor, rotor_field, rotor_points):
    """The family (2.7) at the centre cannot have that dependence, whatever its coefficients."""
    terms = fitted(next(axial_multipole(rotor, rotor.region)), rotor_field, rotor_points.reshape(-1, 3))
    assert variation(terms.jet(around_x(np.pi / 3, 3.5e-3), 0)[0]) < 1e-12


def test_eight_sources_off_the_axis_have_the_rotor_s_dependence(rotor, rotor_field, rotor_points):
    """Displaced axial multipoles together are not axisymmetric about x: |B| varies by 36 % with one set,
    by 48 % with three, as the closed form does.
    """
    circle = around_x(np.pi / 3, 3.5e-3)
    truth = variation(rotor_field.B(circle))
    found = [
        variation(
            fitted(next(eight_source(rotor, rotor.region, sets)), rotor_field, rotor_points.reshape(-1, 3)).jet(
                circle, 0
            )[0]
        )
        for sets in (1, 3)
    ]
    assert 0.5 * truth < found[0] < 0.9 * truth
    assert abs(found[1] - truth) < 0.01 * truth


@pytest.mark.parametrize("sets", [1, 2, 3])
def test_eight_source_sets_are_mirror_images_of_each_other(rotor, sets):
    """(6.1–6.3): |B| is the same at the eight points (±x, ±y, ±z)."""
    candidate = next(eight_source(rotor, rotor.region, sets))
    assert candidate.terms.kind.size == 8 * sets and candidate.parameters == 3 * sets
    terms = candidate.with_parameters(np.random.default_rng(1).normal(size=candidate.parameters))
    corner = np.array([1.5e-3, 2.5e-3, 3e-3])
    signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    assert variation(terms.jet(signs * corner, 0)[0]) < 1e-12


# Candidates


@pytest.mark.parametrize("name", ["ring", "rotor", "skew"])
def test_candidates_go_from_few_parameters_to_many(name, request):
    geometry = request.getfixturevalue(name)
    sizes = [candidate.parameters for candidate in FAMILIES[family_of(geometry)](geometry, geometry.region)]
    assert len(sizes) > 3 and all(a < b for a, b in pairwise(sizes))


@pytest.mark.parametrize(("name", "family"), [("ring", "wall_and_face_loops"), ("rotor", "solid_harmonics")])
def test_columns_are_the_derivatives_by_the_parameters(name, family, request):
    """Each column is what one parameter alone gives, so the columns times parameters are the model."""
    geometry = request.getfixturevalue(name)
    assert family_of(geometry) == family
    points = geometry.region.layers(np.random.default_rng(2), 3, 5).reshape(-1, 3)
    for candidate in (
        next(FAMILIES[family](geometry, geometry.region)),
        *dissertation_families(geometry, geometry.region),
    ):
        values = np.random.default_rng(3).normal(size=candidate.parameters)
        for columns, whole in zip(
            candidate.columns(points), candidate.with_parameters(values).jet(points), strict=True
        ):
            np.testing.assert_allclose(np.tensordot(values, columns, 1), whole, atol=1e-12 * np.abs(whole).max())


def test_loops_lie_on_the_surface_where_bound_currents_flow(ring):
    """Outer wall, bore or faces, all within the magnet; the axis of all is the ring's."""
    for candidate in wall_and_face_loops(ring, ring.region):
        terms = candidate.terms
        assert np.all(terms.kind == LOOP) and np.all(terms.centre[:, :2] == 0)
        z, radius = np.abs(terms.centre[:, 2]), terms.radius
        on_wall = np.isclose(radius, ring.outer_diameter / 2) | np.isclose(radius, ring.inner_diameter / 2)
        on_face = np.isclose(z, ring.length / 2)
        assert np.all(on_wall | on_face)
        assert np.all(z <= ring.length / 2 * (1 + 1e-12))
        assert np.all((radius >= ring.inner_diameter / 2) & (radius <= ring.outer_diameter / 2))


def test_exact_multipoles_of_the_rotor_are_the_family_s_alone(rotor, rotor_field):
    """Even degrees, other orders and sines are absent from the closed form: projections on a far sphere vanish."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(600, 3))
    points *= 10 * rotor.hull.radius / np.linalg.norm(points, axis=1, keepdims=True)
    kinds = [(n, m, s) for n in range(1, 6) for m in range(n + 1) for s in (0, 1) if m or not s]
    degree, order, sine = zip(*kinds, strict=True)
    unit = [
        harmonics(rotor.hull.radius, degree, order, sine, row).jet(points, 0)[0].ravel() for row in np.eye(len(kinds))
    ]
    found = np.linalg.lstsq(np.array(unit).T, rotor_field.B(points).ravel(), rcond=None)[0]
    terms = next(
        candidate.terms for candidate in solid_harmonics(rotor, rotor.region) if candidate.terms.degree.max() == 5
    )
    used = set(zip(terms.degree.tolist(), terms.order.tolist(), terms.sine.tolist(), strict=True))
    for kind, value in zip(kinds, found, strict=True):
        # Degree n falls as 10^{-(n+2)} there: the closed form's 1e-12 leaves that many digits less.
        if kind in used:
            assert abs(value) > 1e-4
        else:
            assert abs(value) < 1e-5


def test_skew_magnets_take_both_orders(skew):
    candidate = next(solid_harmonics(skew, skew.region))
    assert sorted(zip(candidate.terms.degree.tolist(), candidate.terms.order.tolist(), strict=True)) == [
        (1, 0),
        (1, 1),
        (3, 0),
        (3, 1),
    ]


def test_families_refuse_what_they_are_not_made_for(rotor):
    with pytest.raises(InputError, match="need axial magnetisation"):
        next(wall_and_face_loops(rotor, rotor.region))


@pytest.mark.parametrize("name", ["magnet_assembly_quadrupole", "halbach_array_5", "halbach_ring_8"])
def test_harmonics_about_bodies_describe_assemblies(name):
    """Against the closed forms of rigid blocks and cylinder segments, at points that were not fitted."""
    geometry = magfem.load_geometry(name)
    field = magfem.exact(geometry)
    model = magfem.fit(field)
    assert model.report["family"] == "body_harmonics"
    points = geometry.region.layers(np.random.default_rng(5), 40, 30)
    assert relative_errors(model.B(points), field.B(points)).max() < 2e-4
    assert np.linalg.norm(model.moment - geometry.moment) <= 1e-4 * np.abs(geometry.bodies[0].volume / MU_0)


def test_many_bodies_share_one_centre():
    ring = magfem.load_geometry("halbach_ring_16")
    assert family_of(ring) == "solid_harmonics"
    with pytest.raises(InputError, match="at most 133 parts, this has 140"):
        next(body_harmonics(replace(ring, segments=140), ring.region))
