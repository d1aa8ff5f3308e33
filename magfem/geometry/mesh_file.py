"""Meshes of other programs, in any format that meshio reads: their bodies by name, as closed surfaces."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.geometry.body_surfaces import BodySurfaces, merged
from magfem.typing import Booleans, Integers, Points
from magfem.units import one_line

AIR = ("air", "vacuum", "space", "void")
"""Names, in small letters, of what is no body."""

_NUMBERS = ("gmsh:physical", "medit:ref", "netgen:index", "avsucd:material", "nastran:ref", "cell_tags", "body")
_WIDTH = {"tetra": 4, "tetra10": 10, "triangle": 3, "triangle6": 6}
# Faces of a tetrahedron seen from outside: corners, then the nodes between them (01, 12, 02, 03, 13, 23).
_FACES = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])
_TURNED = {3: [0, 2, 1], 6: [0, 2, 1, 5, 4, 3], 4: [0, 2, 1, 3], 10: [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]}


def read_bodies(
    file: Path, wanted: Mapping[str, int | None], scale: float, ignored: tuple[str, ...] = ()
) -> BodySurfaces:
    """The surfaces of the bodies `wanted` of a mesh of tetrahedra, or of closed surfaces of triangles.

    Parameters
    ----------
    file : any format that meshio reads.
    wanted : the bodies' names as the file calls them, with their number where the file has only numbers.
    scale : m per unit of the file's coordinates.
    ignored : other names that are no bodies, besides AIR.

    Raises InputError: no such file, not a mesh, other cells, names that file or card lack, surfaces that are not
    closed, bodies that overlap or are inside out.
    """
    mesh = _read(file)
    kinds = {block.type for block in mesh.cells}
    solid = bool(kinds & {"tetra", "tetra10"})
    others = kinds & ({"hexahedron", "wedge", "pyramid"} if solid else {"quad", "polygon", "hexahedron", "wedge"})
    chosen = [n for n, b in enumerate(mesh.cells) if b.type in (("tetra", "tetra10") if solid else _WIDTH)]
    if others or not chosen:
        found = ", ".join(sorted(others or kinds)) or "no cells"
        raise InputError(f"expected tetrahedra, or triangles of closed surfaces, found {found}")
    owner = _owners(mesh, chosen, wanted, ignored, 3 if solid else 2)
    names = tuple(wanted)
    quadratic = {"tetra10", "triangle6"} & {mesh.cells[n].type for n in chosen}
    if quadratic and len({mesh.cells[n].type for n in chosen}) > 1:
        raise InputError("expected cells of one kind, found straight and curved ones together")
    cells = np.concatenate([np.asarray(mesh.cells[n].data, dtype=np.int64) for n in chosen])[owner >= 0]
    if cells.min(initial=0) < 0 or cells.max(initial=-1) >= len(mesh.points):
        raise InputError(f"cells name nodes that the file does not have: it has {len(mesh.points)}")
    points, cells = merged(np.column_stack([mesh.points, np.zeros((len(mesh.points), 3))])[:, :3] * scale, cells)
    owner = owner[owner >= 0]
    if not np.isfinite(points).all():
        raise InputError("coordinates must be finite")
    if solid:
        cells = _upright(points, cells)
        local = _FACES if quadratic else _FACES[:, :3]
        facets, owner = cells[:, local].reshape(-1, local.shape[1]), np.repeat(owner, 4)
    else:
        facets = _outward(points, cells, owner)
    surfaces = _between(names, points, facets, owner)
    surfaces.check()
    surfaces.check_apart()
    surfaces.check_cover()
    return surfaces


def _read(file: Path) -> Any:
    import meshio

    if not file.is_file():
        raise InputError("no such mesh file")
    formats: tuple[str | None, ...] = ("gmsh", "ansys") if file.suffix.lower() == ".msh" else (None,)
    reason = ""
    said = io.StringIO()
    for form in formats:
        try:
            # meshio writes what it thinks to both streams and ends the program when it cannot read a file.
            with (
                warnings.catch_warnings(action="ignore"),
                contextlib.redirect_stdout(said),
                contextlib.redirect_stderr(said),
            ):
                return meshio.read(file, file_format=form)
        except (Exception, SystemExit) as error:  # its readers raise whatever they stumble over
            what = (
                "its contents are not of the format that its name says" if isinstance(error, SystemExit) else str(error)
            )
            reason = reason or one_line(" ".join(what.split()))[:80] or type(error).__name__
    raise InputError(f"meshio cannot read this mesh: {reason}")


def _owners(
    mesh: Any, chosen: list[int], wanted: Mapping[str, int | None], ignored: tuple[str, ...], dimension: int
) -> Integers:
    """Index of the body (c,) that each chosen cell belongs to, −1 for none."""
    numbers = _numbers(mesh, chosen)
    named = _named(mesh, chosen, numbers, dimension)
    count = sum(len(mesh.cells[n].data) for n in chosen)
    owner = np.full(count, -1, dtype=np.int64)
    bodies = {name: mask for name, mask in named.items() if not _is_air(name, ignored)}
    for index, (name, number) in enumerate(wanted.items()):
        if number is not None:
            if numbers is None:
                raise InputError("the file has no numbers of bodies: name them instead of giving an id")
            mask = numbers == number
            if not mask.any():
                known = ", ".join(str(n) for n in np.unique(numbers))
                raise InputError(f"no cells have the number {number} of body {name!r}; the file has {known}")
        elif name in named:
            mask = named[name]
        elif not bodies and len(wanted) == 1 and (numbers is None or len(np.unique(numbers)) == 1):
            mask = np.ones(count, dtype=bool)  # one body: whatever the file calls it
        else:
            raise InputError(_unknown(name, bodies, numbers))
        if (owner[mask] >= 0).any():
            other = list(wanted)[int(owner[mask].max())]
            raise InputError(f"bodies {other!r} and {name!r} have cells in common")
        owner[mask] = index
    _check_all_claimed(owner, bodies, numbers, wanted, ignored)
    return owner


def _check_all_claimed(
    owner: Integers,
    bodies: dict[str, Booleans],
    numbers: Integers | None,
    wanted: Mapping[str, int | None],
    ignored: tuple[str, ...],
) -> None:
    """Raise InputError when the file has a body that the card does not name."""
    left = [name for name, mask in bodies.items() if name not in wanted and mask.any() and (owner[mask] < 0).all()]
    if not bodies and numbers is not None:
        free = np.unique(numbers[owner < 0])
        left = [str(n) for n in free if n > 0 and str(n) not in ignored]
    if left:
        raise InputError(
            f"the card does not say what these bodies of the file are: {', '.join(left)}; add a table [bodies.NAME] "
            "for each, or list it under mesh.ignore"
        )


def _unknown(name: str, bodies: dict[str, Booleans], numbers: Integers | None) -> str:
    if bodies:
        nearest = get_close_matches(name, bodies, n=1)
        advice = f"did you mean {nearest[0]!r}?" if nearest else f"it has {', '.join(bodies)}"
        return f"the file has no body {name!r}; {advice}"
    if numbers is None:
        return f"the file does not say which cells are body {name!r}: it has neither names nor numbers"
    known = ", ".join(str(n) for n in np.unique(numbers))
    return f"the file has no names: give body {name!r} its number, such as id = 1; the file has {known}"


def _is_air(name: str, ignored: tuple[str, ...]) -> bool:
    return name.lower() in AIR or name in ignored


def _array(mesh: Any, chosen: list[int], key: str) -> Any:
    return np.concatenate([np.asarray(mesh.cell_data[key][n]).reshape(len(mesh.cells[n].data), -1) for n in chosen])


def _whole_numbers(mesh: Any, chosen: list[int]) -> dict[str, Integers]:
    """Cell arrays (c,) of whole numbers, by name."""
    found = {}
    for key in mesh.cell_data:
        values = _array(mesh, chosen, key)
        if values.shape[1] == 1 and values.dtype.kind in "iuf" and np.all(values == np.round(values)):
            found[key] = values[:, 0].astype(np.int64)
    return found


def _numbers(mesh: Any, chosen: list[int]) -> Integers | None:
    """The number (c,) of each cell's body: a format's own array, else the only one of whole numbers."""
    found = _whole_numbers(mesh, chosen)
    for key in _NUMBERS:
        if key in found and found[key].any():
            return found[key]
    own = [key for key in found if ":" not in key and key != "cell_ids"]
    return found[own[0]] if len(own) == 1 else None


def _named(mesh: Any, chosen: list[int], numbers: Integers | None, dimension: int) -> dict[str, Booleans]:
    """Masks (c,) over the chosen cells by name: sets, physical groups, families, or arrays of 0 and 1."""
    sizes = [len(mesh.cells[n].data) for n in chosen]
    named: dict[str, Booleans] = {}
    for name, blocks in mesh.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        masks = [np.zeros(size, dtype=bool) for size in sizes]
        for mask, n in zip(masks, chosen, strict=True):
            if n < len(blocks) and blocks[n] is not None:
                mask[np.asarray(blocks[n], dtype=np.int64)] = True
        named[name] = np.concatenate(masks)
    if "gmsh:physical" in mesh.cell_data and numbers is not None:
        for name, (number, of) in mesh.field_data.items():
            if of == dimension:
                named[name] = numbers == number
    tags = getattr(mesh, "cell_tags", None)
    if tags and "cell_tags" in mesh.cell_data:
        families = _array(mesh, chosen, "cell_tags")[:, 0]
        for number, groups in tags.items():
            for name in groups:
                named[name] = named.get(name, False) | (families == number)
    for name, values in _whole_numbers(mesh, chosen).items():
        if ":" not in name and name not in ("body", "cell_tags", "cell_ids") and set(np.unique(values)) <= {0, 1}:
            named.setdefault(name, values == 1)
    return {name: mask for name, mask in named.items() if mask.any()}


def _upright(points: Points, cells: Integers) -> Integers:
    """Tetrahedra, those that are numbered the other way round turned."""
    a, b, c, d = (points[cells[:, k]] for k in range(4))
    turned = np.einsum("ei,ei->e", np.cross(b - a, c - a), d - a) < 0
    return np.where(turned[:, None], cells[:, _TURNED[cells.shape[1]]], cells)


def _outward(points: Points, facets: Integers, owner: Integers) -> Integers:
    """Triangles of closed surfaces, those of bodies that face inwards as a whole turned: some programs do so."""
    a, b, c = (points[facets[:, k]] - points.mean(axis=0) for k in range(3))
    volume = np.bincount(owner, np.einsum("ei,ei->e", np.cross(a, b), c))
    return np.where(volume[owner, None] < 0, facets[:, _TURNED[facets.shape[1]]], facets)


def _between(names: tuple[str, ...], points: Points, facets: Integers, owner: Integers) -> BodySurfaces:
    """From oriented facets (f, 3 or 6) of the bodies' cells to those between different bodies and air."""
    key = np.sort(facets[:, :3], axis=1)
    _, same, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    if count.max() > 2:
        place = points[facets[count[same.ravel()] > 2][0][:3]].mean(axis=0)
        raise InputError("more than two cells share one facet, at ({:.4g}, {:.4g}, {:.4g}) m".format(*place))
    order = np.argsort(same.ravel(), kind="stable")
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    first = order[start]
    second = np.where(count == 2, order[np.minimum(start + 1, order.size - 1)], -1)
    inner = owner[first]
    outer = np.where(second >= 0, owner[second], -1)
    cyclic = np.take_along_axis(
        facets[:, :3], (facets[:, :3].argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1
    )  # two facets that face each other list their corners in opposite order
    double = np.flatnonzero(second >= 0)
    alike = double[cyclic[first[double], 1] == cyclic[second[double], 1]]
    if alike.size:
        place = points[facets[first[alike[0]]][:3]].mean(axis=0)
        raise InputError(
            "cells overlap or are inside out: two lie on the same side of the facet at "
            "({:.4g}, {:.4g}, {:.4g}) m".format(*place)
        )
    wanted = inner != outer
    facets, inner, outer = facets[first[wanted]], inner[wanted], outer[wanted]
    points, facets = merged(points, facets)
    if facets.shape[1] == 3:
        return BodySurfaces.flat(names, points, facets, inner, outer)
    return BodySurfaces(names, points, facets, inner, outer)
