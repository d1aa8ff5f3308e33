"""Terms in model files: every kind comes back to the bit, every fault is one sentence that names what was expected."""

from __future__ import annotations

import copy
import json
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from references.jets import errors, scattered
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.errors import CardError, InputError
from magfem.fields.term_kinds import INTERIOR, NAMES, OBLATE
from magfem.fields.terms import Terms, charge_discs, closed_path, concatenate, frame_about, harmonics, loops, uniform
from magfem.fields.terms_json import terms_from_list, terms_to_list
from magfem.fitting import load_model

RNG = np.random.default_rng(1)
TILTED, CENTRE = frame_about(RNG.normal(size=3), RNG.normal(size=3)), RNG.normal(size=3) / 3
POSE = RigidTransform.from_components(RNG.normal(size=3), Rotation.from_rotvec(RNG.normal(size=3)))
MIXED = [1, 2, 5], [0, 2, 5], [0, 1, 0], RNG.normal(size=3), CENTRE, TILTED

KINDS = {
    "loop": loops(CENTRE, RNG.uniform(), RNG.normal(), TILTED),
    "harmonics": harmonics(RNG.uniform(), *MIXED),
    "interior": harmonics(RNG.uniform(), *MIXED, kind=INTERIOR) + uniform(RNG.normal(size=3)),
    "oblate": harmonics(RNG.uniform(), [0, 1, 7], [0, 0, 0], [1, 0, 1], RNG.normal(size=3), CENTRE, TILTED, OBLATE),
    "path": closed_path(RNG.normal(size=(5, 3)) / 3, RNG.normal(), CENTRE, TILTED),
    "charge_disc": charge_discs(np.array([CENTRE, -CENTRE]), 0.3, np.array([1, -1]) * RNG.normal(), TILTED),
}
POINTS = scattered(2, 40, 2.5, 5.0)


def through_a_file(terms: Terms) -> Terms:
    return terms_from_list(json.loads(json.dumps(terms_to_list(terms))))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_comes_back_to_the_bit(kind):
    terms = KINDS[kind]
    again = through_a_file(terms)
    for field in fields(Terms):
        ours, theirs = getattr(again, field.name), getattr(terms, field.name)
        assert ours.dtype == theirs.dtype and ours.shape == theirs.shape, field.name
        if not (kind == "path" and field.name == "radius"):  # a path has none
            np.testing.assert_array_equal(ours, theirs, err_msg=field.name)
    for ours, theirs in zip(again.jet(POINTS, 2), terms.jet(POINTS, 2), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert {term["kind"] for term in terms_to_list(terms)} == {kind}


def test_all_kinds_together_come_back_to_the_bit():
    together = concatenate(list(KINDS.values()))
    for ours, theirs in zip(through_a_file(together).jet(POINTS, 2), together.jet(POINTS, 2), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert set(KINDS) == set(NAMES.values())


@pytest.mark.parametrize("kind", KINDS)
def test_placed_terms_come_back_within_rounding_and_then_to_the_bit(kind):
    """A turned frame's second axis is its others' product to rounding only; what was read once is written the same."""
    placed = KINDS[kind].placed(POSE)
    first = through_a_file(placed)
    points = POSE.apply(POINTS)
    assert errors(first.jet(points, 2), placed.jet(points, 2)).max() < 1e-12
    assert terms_to_list(first) == terms_to_list(placed)
    for ours, theirs in zip(through_a_file(first).jet(points, 2), first.jet(points, 2), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("kind", ["loop", "oblate", "charge_disc"])
def test_azimuth_may_be_left_out_where_it_does_not_matter(kind):
    terms = terms_to_list(KINDS[kind])
    for term in terms:
        del term["azimuth"]
        term["direction"] = [3 * value for value in term["direction"]]  # of any length then
    assert errors(terms_from_list(terms).jet(POINTS, 2), KINDS[kind].jet(POINTS, 2)).max() < 1e-12


def test_extreme_numbers_keep_their_bits():
    values = [5e-324, 1.7976931348623157e308, -0.1, 1 / 3, np.pi * 1e-7]
    again = through_a_file(harmonics(1 / 3, [1, 2, 3, 4, 5], [0] * 5, [0] * 5, values, [1e-300, -0.0, 1e300]))
    assert again.coefficient.tobytes() == np.array(values).tobytes()
    assert again.centre.tobytes() == np.array([1e-300, -0.0, 1e300]).tobytes()


# Faults

DELETE = object()
COMMON = ["loop", "harmonics", "interior", "oblate", "path", "charge_disc"]
WITH_RADIUS = [kind for kind in COMMON if kind != "path"]
WITH_DEGREES = ["harmonics", "interior", "oblate"]
FAULTS: list[tuple[list[str], str, Any, str]] = [
    (COMMON, "kind", DELETE, "missing key 'kind'"),
    (COMMON, "kind", "helmholtz", "a kind among loop, harmonics, interior, oblate, path, charge_disc, got 'helmholtz'"),
    (COMMON, "kind", None, "a kind among"),
    (COMMON, "kind", ["loop"], "terms is not laid out as in a field model"),
    (COMMON, "centre", DELETE, "missing key 'centre'"),
    (COMMON, "centre", [0, 0], "centre and direction of three numbers"),
    (COMMON, "centre", [[0, 0, 0]], "centre and direction of three numbers"),
    (COMMON, "centre", [0, 0, "0"], "finite numbers"),
    (COMMON, "centre", [0, 0, float("nan")], "finite numbers"),
    (COMMON, "centre", None, "finite numbers"),
    (COMMON, "centre", [0, 0, True], "finite numbers"),
    (COMMON, "direction", DELETE, "missing key 'direction'"),
    (COMMON, "direction", [0, 0, 0], "centre and direction of three numbers"),
    (COMMON, "direction", [0, 0, float("inf")], "finite numbers"),
    (COMMON, "direction", [0, 0, 2], "direction and azimuth of length one and perpendicular"),
    (COMMON, "azimuth", [0, 1], "azimuth of three numbers"),
    (COMMON, "azimuth", [0, 0, 1], "direction and azimuth of length one and perpendicular"),
    (COMMON, "azimuth", "x", "finite numbers"),
    (COMMON, "coefficients", DELETE, "missing key 'coefficients'"),
    (COMMON, "coefficients", [], "a list of coefficients"),
    (COMMON, "coefficients", 1.0, "a list of coefficients"),
    (COMMON, "coefficients", [[1.0]], "a list of coefficients"),
    (COMMON, "coefficients", [float("nan")], "finite numbers"),
    (COMMON, "coefficients", ["1 A"], "finite numbers"),
    (["loop"], "coefficients", [1.0, 2.0], "one coefficient for a loop"),
    (["path"], "coefficients", [1.0, 2.0], "one coefficient for a path"),
    (["charge_disc"], "coefficients", [1.0, 2.0], "one coefficient for a charge disc"),
    (["charge_disc"], "coefficients", [1.0], "a monopole does not exist"),
    (WITH_RADIUS, "radius", DELETE, "missing key 'radius'"),
    (WITH_RADIUS, "radius", 0, "a positive radius"),
    (WITH_RADIUS, "radius", -1.0, "a positive radius"),
    (WITH_RADIUS, "radius", [1.0], "one number"),
    (WITH_RADIUS, "radius", "2 mm", "finite numbers"),
    (WITH_RADIUS, "radius", float("inf"), "finite numbers"),
    (WITH_DEGREES, "degrees", DELETE, "missing key 'degrees'"),
    (WITH_DEGREES, "degrees", 1, "terms is not laid out as in a field model"),
    (WITH_DEGREES, "degrees", [1, 2], "degrees, orders, parts and coefficients of one length"),
    (WITH_DEGREES, "degrees", [1, 2, 3.0], "whole numbers as degrees and orders"),
    (WITH_DEGREES, "degrees", [1, 2, True], "whole numbers as degrees and orders"),
    (WITH_DEGREES, "degrees", [1, 2, -3], "harmonics have degrees from 1 to 80"),
    (WITH_DEGREES, "degrees", [1, 2, 81], "harmonics have degrees from 1 to 80"),
    (WITH_DEGREES, "degrees", [1, 2, 10**30], "terms is not laid out as in a field model"),
    (["harmonics", "interior"], "degrees", [0, 2, 5], "there is no monopole"),
    (["harmonics", "interior"], "orders", DELETE, "missing key 'orders'"),
    (["harmonics", "interior"], "orders", [0, 3, 0], "orders between 0 and their degree"),
    (["harmonics", "interior"], "orders", [0, -1, 0], "orders between 0 and their degree"),
    (["harmonics", "interior"], "orders", [0, 0.5, 0], "whole numbers as degrees and orders"),
    (["oblate"], "parts", ["real", "real", "real"], "there is no monopole"),
    (["oblate"], "parts", ["cos", "real", "real"], 'parts "real" or "imaginary"'),
    (["harmonics", "interior"], "parts", ["cos", "tan", "sin"], 'parts "cos" or "sin"'),
    (["harmonics", "interior"], "parts", ["real", "cos", "cos"], 'parts "cos" or "sin"'),
    (WITH_DEGREES, "parts", DELETE, "missing key 'parts'"),
    (WITH_DEGREES, "parts", ["cos"], "degrees, orders, parts and coefficients of one length"),
    (WITH_DEGREES, "parts", [["cos"], 0, 1], "terms is not laid out as in a field model"),
    (["path"], "nodes", DELETE, "missing key 'nodes'"),
    (["path"], "nodes", [[0, 0, 0], [1, 0, 0]], "three nodes or more"),
    (["path"], "nodes", [[0, 0], [1, 0], [0, 1]], "nodes of three numbers each"),
    (["path"], "nodes", [0, 0, 0], "nodes of three numbers each"),
    (["path"], "nodes", [[0, 0, 0], [1, 0, 0], [1, 1]], "finite numbers, in lists of one length"),
    (["path"], "nodes", [[0, 0, 0], [1, 0, 0], [1, 0, 0]], "nodes that differ from their neighbours"),
    (["path"], "nodes", [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0]], "the last joins the first by itself"),
]
CASES = [(kind, key, value, message) for kinds, key, value, message in FAULTS for kind in kinds]


@pytest.fixture(scope="module")
def model_file() -> dict[str, Any]:
    """A whole model file, of the catalogue."""
    return load_model("rotor_1x3").to_dict()


def load(model_file: dict[str, Any], terms: Any, path) -> None:
    path.write_text(json.dumps({**model_file, "terms": terms}, default=lambda array: array.tolist()), encoding="utf-8")
    load_model(path)


@pytest.mark.parametrize(("kind", "key", "value", "message"), CASES)
def test_every_fault_of_a_term_is_one_sentence(kind, key, value, message, model_file, tmp_path):
    terms = copy.deepcopy(terms_to_list(KINDS[kind]))
    if value is DELETE:
        del terms[0][key]
    else:
        terms[0][key] = value
    with pytest.raises((InputError, KeyError, TypeError, ValueError, OverflowError)):
        terms_from_list(terms)
    with pytest.raises(CardError, match=message) as caught:
        load(model_file, terms, tmp_path / "model.json")
    text = str(caught.value)
    assert "\n" not in text and "model.json: terms" in text and len(text) < 400


@pytest.mark.parametrize("terms", [[], {}, None, "loop", 3, [3], [None], [[]]])
def test_what_is_no_list_of_terms_is_one_sentence(terms, model_file, tmp_path):
    with pytest.raises(CardError, match=r"a list of at least one term|terms that are tables") as caught:
        load(model_file, terms, tmp_path / "model.json")
    assert "\n" not in str(caught.value)
