"""Magnets whose shape is an external mesh: names, units, provenance, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import meshio
import numpy as np
import pytest

from magfem.errors import CardError
from magfem.geometry import geometry_from_text, load_geometry
from magfem.geometry.write import card_text

_CARD = """
kind = "meshed_magnets"
name = "Block"
[mesh]
file = "{file}"
unit = "mm"
{more}
[bodies.{body}]
remanence = "1.3 T"
recoil_permeability = 1.05
magnetisation = [0, 0, 1]
{own}
"""

# A block of 2 × 3 × 4 mm as six tetrahedra around its diagonal (Kuhn).
_CORNERS = np.array([[x, y, z] for x in (0, 2) for y in (0, 3) for z in (0, 4)], dtype=float)
_PATHS = [(4, 2), (4, 1), (2, 4), (2, 1), (1, 4), (1, 2)]
_TETRAHEDRA = np.array([[0, a, a + b, 7] for a, b in _PATHS])

# Its surface: what only one tetrahedron has, seen from outside.
_SIDES = np.sort(_TETRAHEDRA[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
_UNIQUE, _COUNT = np.unique(_SIDES, axis=0, return_counts=True)
_TETRAHEDRA_FACES = np.array(
    [side if np.linalg.det(_CORNERS[side] - [1, 1.5, 2]) > 0 else side[::-1] for side in _UNIQUE[_COUNT == 1]]
)
_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])  # of a tetrahedron, seen from outside


@pytest.fixture
def card(tmp_path):
    """Writes mesh and card, reads the card."""

    def write(points=_CORNERS - [1, 1.5, 2], file="part.vtu", more="", body="magnet", own="", cells=None, **data):
        meshio.Mesh(points, cells or [("tetra", _TETRAHEDRA)], **data).write(tmp_path / file)
        text = _CARD.format(file=file, more=more, body=body, own=own)
        (tmp_path / "card.toml").write_text(text)
        return load_geometry(tmp_path / "card.toml")

    return write


def test_volume_area_and_moment_are_those_of_the_block(card):
    magnets = card()
    (body,) = magnets.bodies
    assert body.name == "magnet"
    assert body.volume == pytest.approx(24e-9, rel=1e-12, abs=0) and body.area == pytest.approx(52e-6, rel=1e-12, abs=0)
    assert magnets.moment == pytest.approx([0, 0, 1.3 * 24e-9 / (4e-7 * np.pi)], rel=1e-9)
    assert magnets.hull.radius == pytest.approx(np.sqrt(29) / 2 * 1e-3, rel=1e-12, abs=0)


def test_solutions_and_models_carry_the_surfaces(card, tmp_path):
    magnets = card()
    text = card_text(magnets)
    (tmp_path / "part.vtu").unlink()
    again = geometry_from_text(text, "elsewhere.toml")
    assert again == magnets and magnets.sha256 in text
    broken = text.replace('data = "', 'data = "AAAA')
    with pytest.raises(CardError, match="damaged"):
        geometry_from_text(broken, "elsewhere.toml")
    with pytest.raises(CardError, match="no such mesh file"):
        load_geometry(tmp_path / "card.toml")


def test_origin_moves_the_mesh(card):
    far = _CORNERS + np.array([100, 0, 0])
    with pytest.raises(CardError, match=r'add origin = \["101 mm", "1.5 mm", "2 mm"\]'):
        card(points=far)
    moved = card(points=far, more='origin = ["101 mm", "1.5 mm", "2 mm"]')
    assert np.allclose(moved.corners.mean(axis=0), 0, atol=1e-12)


def test_numbers_stand_for_names(card):
    ids = {"cell_data": {"material": [np.array([3, 3, 3, 0, 0, 0])]}}
    assert card(own="id = 3", **ids).volume == pytest.approx(12e-9, rel=1e-12, abs=0)
    with pytest.raises(CardError, match=r"give body 'magnet' its number.* the file has 0, 3"):
        card(**ids)
    with pytest.raises(CardError, match="no cells have the number 4"):
        card(own="id = 4", **ids)


def test_bodies_that_touch_share_their_facets(card, tmp_path):
    sets = {"cell_sets": {"north": [np.arange(3)], "south": [np.arange(3, 6)]}}
    with pytest.raises(CardError, match="did you mean 'north'"):
        card(file="part.inp", body="nort", **sets)
    with pytest.raises(CardError, match="does not say what these bodies of the file are: south"):
        card(file="part.inp", body="north", **sets)
    assert card(file="part.inp", body="north", more='ignore = ["south"]', **sets).volume == pytest.approx(
        12e-9, rel=1e-12, abs=0
    )
    text = (tmp_path / "card.toml").read_text().replace('ignore = ["south"]', "")
    text += '[bodies.south]\nremanence = "1 T"\nmagnetisation = [1, 0, 0]\n'
    (tmp_path / "card.toml").write_text(text)
    both = load_geometry(tmp_path / "card.toml")
    surfaces = both.surfaces
    shared = (surfaces.inner >= 0) & (surfaces.outer >= 0)
    assert shared.sum() == 2 and both.volume == pytest.approx(24e-9, rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("cells", "points", "message"),
    [
        ([("triangle", np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]]))], None, "not closed: 3 edges"),
        ([("hexahedron", np.arange(8)[None])], None, "found hexahedron"),
        (
            [("triangle", np.array([[0, 2, 1], [0, 1, 3], [0, 2, 3], [1, 2, 3]]))],
            np.vstack([np.zeros(3), np.eye(3)]),
            "do not all face the same way",
        ),
        (
            [("tetra", np.array([[0, 1, 2, 3], [0, 1, 2, 4]]))],
            np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.5]]),
            "cells overlap or are inside out",
        ),
        (  # a tetrahedron all inside another
            [("tetra", np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))],
            np.vstack([np.zeros((1, 3)), np.eye(3), np.full((1, 3), 0.1), 0.1 * np.eye(3) + 0.1]),
            "overlaps itself",
        ),
        (  # two apart, the second inside out
            [("triangle", np.vstack([_FACES, _FACES[:, ::-1] + 4]))],
            np.vstack([np.zeros((1, 3)), np.eye(3), np.full((1, 3), 3.0), np.eye(3) * 0.5 + 3]),
            "a sheet of it is inside out",
        ),
        (  # one tetrahedron's tip inside another
            [("tetra", np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))],
            np.vstack([np.zeros(3), np.eye(3), np.full(3, 0.2), np.eye(3) + 1]),
            "facets of 'magnet' cross",
        ),
    ],
)
def test_bad_meshes_are_one_line(card, cells, points, message):
    with pytest.raises(CardError, match=message) as error:
        card(cells=cells, points=_CORNERS if points is None else points)
    assert "\n" not in str(error.value) and "mesh.file" in str(error.value)


def test_bodies_that_touch_with_other_facets_are_refused(card, tmp_path):
    """A block on a block of half its width: no corners shared on the common face."""
    second = _CORNERS * [0.5, 1, 1] + [0.3, 0, 4]
    points = np.vstack([_CORNERS, second]) - [1, 1.5, 4]
    cells = [("tetra", np.vstack([_TETRAHEDRA, _TETRAHEDRA + 8]))]
    with pytest.raises(CardError, match="touch without sharing their corners"):
        card(points=points, cells=cells)


def test_bodies_inside_others_need_a_cavity(card, tmp_path):
    """Nested surfaces do not cross; with the cavity's own surface the outer body is hollow and all is well."""
    solid, hole = _CORNERS - [1, 1.5, 2], 0.5 * (_CORNERS - [1, 1.5, 2])
    outer, half = np.vstack([_TETRAHEDRA_FACES, _TETRAHEDRA_FACES[:, ::-1] + 8]), 0.5 * hole
    for count, cells, message in (
        (
            len(_TETRAHEDRA_FACES),
            np.vstack([_TETRAHEDRA_FACES, _TETRAHEDRA_FACES + 16]),
            "'inside' and 'magnet' overlap",
        ),
        (len(outer), np.vstack([outer, _TETRAHEDRA_FACES + 16]), None),
    ):
        owner = np.where(np.arange(len(cells)) < count, 1, 2)
        more = dict(
            points=np.vstack([solid, hole, half]),
            cells=[("triangle", cells)],
            cell_data={"body": [owner]},
            own='id = 1\n[bodies.inside]\nid = 2\nremanence = "1 T"\nmagnetisation = "axial"',
        )
        if message:
            with pytest.raises(CardError, match=message):
                card(**more)
        else:
            assert card(**more).volume == pytest.approx((24 - 3 + 24 / 64) * 1e-9, rel=1e-12, abs=0)


def test_cells_of_nodes_that_are_not_there_are_refused(card):
    cells = np.array([[0, 1, 2, 9]])
    with pytest.raises(CardError, match="nodes that the file does not have"):
        card(cells=[("tetra", cells)])


def test_programs_that_end_themselves_say_nothing(card, tmp_path, capfd):
    card()
    (tmp_path / "part.vtu").write_text("no mesh")
    with pytest.raises(CardError, match="not of the format that its name says"):
        load_geometry(tmp_path / "card.toml")
    assert capfd.readouterr() == ("", "")


def test_units_that_make_no_magnet_are_named(card, tmp_path):
    card()
    text = (tmp_path / "card.toml").read_text()
    (tmp_path / "card.toml").write_text(text.replace('"mm"', '"km"'))
    with pytest.raises(CardError, match="largest dimension is 4 km"):
        load_geometry(tmp_path / "card.toml")


def test_names_that_need_quotes_are_written_with_them(card):
    magnets = replace(card(body='"my body.1"', own="id = 1", cell_data={"body": [np.ones(6, dtype=int)]}), origin=None)
    again = geometry_from_text(card_text(magnets), "anew")
    assert again.surfaces == magnets.surfaces and again.surfaces.names == ("my body.1",)


def test_inward_triangles_are_turned(card):
    inward = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    corners = np.vstack([np.zeros(3), np.eye(3)])
    assert card(file="part.stl", cells=[("triangle", inward)], points=corners).volume == pytest.approx(
        1e-9 / 6, rel=1e-12, abs=0
    )


def test_units_are_required(card, tmp_path):
    card()
    text = (tmp_path / "card.toml").read_text()
    for change, message in (('unit = "T"', "unit must be one of length"), ("", 'missing key "unit"')):
        (tmp_path / "card.toml").write_text(text.replace('unit = "mm"', change))
        with pytest.raises(CardError, match=message):
            load_geometry(tmp_path / "card.toml")
    (tmp_path / "part.vtu").write_text("no mesh")
    (tmp_path / "card.toml").write_text(text)
    with pytest.raises(CardError, match="cannot read this mesh"):
        load_geometry(tmp_path / "card.toml")
