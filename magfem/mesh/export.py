"""Meshes as files, in any format that meshio writes and reads back, chosen by the file's ending.

Formats differ in what they hold. Curved cells go to those without them as straight ones, with a line in the log.
The bodies' names are kept as physical groups (Gmsh), element sets (Abaqus), groups (MED) or, in formats that know
only numbers, as one array of 0 and 1 per body; what keeps none of these gets the bodies' numbers alone.
"""

from __future__ import annotations

import importlib.util
import logging
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from magfem.errors import InputError
from magfem.mesh.mesh import Mesh
from magfem.typing import Floats, Integers

log = logging.getLogger("magfem")

Array: TypeAlias = np.ndarray[Any, Any]  # data on cells or points, of any type

AIR = "air"
"""What cells outside all bodies are called where a name is needed."""

_CORNERS = {"tetra10": ("tetra", 4), "triangle6": ("triangle", 3), "quad8": ("quad", 4), "quad9": ("quad", 4)}
_ALL = frozenset({"tetra", "tetra10", "triangle", "triangle6", "quad"})
_STRAIGHT = frozenset({"tetra", "triangle", "quad"})
_SURFACES = frozenset({"triangle", "quad"})


@dataclass(frozen=True)
class Format:
    """What files of one ending hold. name: meshio's.  cells: kinds that survive writing and reading.

    numbers: the integer array that the format keeps anyway (0 in air, else 1 and up); empty when it has none.
    names: how bodies' names are kept: "groups", "sets", "families", "arrays"; empty: not at all.
    data: whether other data on cells and points is kept.  module: a package that must be there.
    """

    name: str
    cells: frozenset[str]
    numbers: str = ""
    names: str = ""
    data: bool = False
    module: str = ""


_EXODUS = Format("exodus", _ALL, module="netCDF4")
_NASTRAN = Format("nastran", _ALL, numbers="nastran:ref")
_PERMAS = Format("permas", _STRAIGHT)
_TETGEN = Format("tetgen", frozenset({"tetra"}), numbers="tetgen:ref")

FORMATS: dict[str, Format] = {
    ".msh": Format("gmsh22", _ALL, numbers="gmsh:physical", names="groups", data=True),
    ".vtu": Format("vtu", _ALL, names="arrays", data=True),
    ".vtk": Format("vtk", _ALL, names="arrays", data=True),
    ".xdmf": Format("xdmf", _ALL, names="arrays", data=True),
    ".xmf": Format("xdmf", _ALL, names="arrays", data=True),
    ".hmf": Format("hmf", _ALL, names="arrays", data=True),
    ".med": Format("med", _ALL, names="families", data=True),
    ".inp": Format("abaqus", _ALL, names="sets"),
    ".mdpa": Format("mdpa", _ALL),
    ".bdf": _NASTRAN,
    ".fem": _NASTRAN,
    ".nas": _NASTRAN,
    ".vol": Format("netgen", _ALL, numbers="netgen:index"),
    ".vol.gz": Format("netgen", _ALL, numbers="netgen:index"),
    ".avs": Format("avsucd", _STRAIGHT, numbers="avsucd:material"),
    ".mesh": Format("medit", _STRAIGHT, numbers="medit:ref"),
    ".meshb": Format("medit", _STRAIGHT, numbers="medit:ref"),
    ".dat": Format("tecplot", _STRAIGHT, names="arrays"),
    ".tec": Format("tecplot", _STRAIGHT, names="arrays"),
    ".post": _PERMAS,
    ".post.gz": _PERMAS,
    ".dato": _PERMAS,
    ".dato.gz": _PERMAS,
    ".f3grid": Format("flac3d", frozenset({"tetra"})),
    ".su2": Format("su2", frozenset({"tetra"})),
    ".cgns": Format("cgns", frozenset({"tetra"})),
    ".ele": _TETGEN,
    ".node": _TETGEN,
    ".h5m": Format("h5m", frozenset({"tetra", "triangle"})),
    ".ply": Format("ply", _SURFACES),
    ".obj": Format("obj", _SURFACES),
    ".stl": Format("stl", frozenset({"triangle"})),
    ".off": Format("off", frozenset({"triangle"})),
    ".e": _EXODUS,
    ".exo": _EXODUS,
    ".ex2": _EXODUS,
}
"""What meshio writes so that it can be read again. Its .xml (DOLFIN), .svg, .ugrid and .wkt are not among them."""


def format_of(path: Path, kinds: frozenset[str]) -> Format:
    """The format of a file to write, chosen by its ending; `kinds` are the cells that it must hold, curved or not.

    Raises InputError, which names formats that do, when the ending is unknown or its format cannot hold them.
    """
    ending = ending_of(path)
    corners = {_CORNERS.get(kind, (kind, 0))[0] for kind in kinds}
    able = [known for known, form in FORMATS.items() if not form.module and corners <= form.cells and kinds <= _ALL]
    advice = f"formats that do: {', '.join(able[:6])}"
    if ending not in FORMATS:
        import meshio

        if ending in meshio.extension_to_filetypes:
            raise InputError(f"files that end in {ending} cannot be read back with this mesh; {advice} [{path}]")
        raise InputError(f"cannot tell a mesh format from the ending of {path.name!r}; try .vtu, .msh or .xdmf")
    form = FORMATS[ending]
    if form.module and importlib.util.find_spec(form.module) is None:
        raise InputError(f"files that end in {ending} need the Python package {form.module}; {advice} without [{path}]")
    if not corners <= form.cells:
        missing = ", ".join(sorted(corners - form.cells))
        raise InputError(f"files that end in {ending} do not hold {missing} cells; {advice} [{path}]")
    return form


def ending_of(path: Path) -> str:
    """The ending of a mesh file in small letters: `.msh`, or two together such as `.vol.gz`."""
    double = "".join(path.suffixes[-2:]).lower()
    return double if double in FORMATS else path.suffix.lower()


def write_mesh(
    mesh: Mesh,
    path: Path,
    point_data: dict[str, Floats] | None = None,
    cell_data: dict[str, Floats] | None = None,
) -> None:
    """Write a mesh (lengths in m; `body` is −1 in air) and data on it, whole or not at all.

    Meridian meshes lie in the xy plane with x = ρ and y = z. Raises InputError for an ending whose format cannot
    hold the mesh.
    """
    points = mesh.points if mesh.dimension == 3 else np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    kind = "tetra10" if mesh.dimension == 3 else "triangle6"
    data = {key: {kind: values} for key, values in (cell_data or {}).items()}
    write_cells(path, points, {kind: mesh.cells}, {kind: mesh.body}, mesh.names, data, point_data)


def write_cells(
    path: Path,
    points: Floats,
    cells: Mapping[str, Integers],
    body: Mapping[str, Integers] | None = None,
    names: tuple[str, ...] = (),
    cell_data: Mapping[str, Mapping[str, Array]] | None = None,
    point_data: Mapping[str, Array] | None = None,
) -> None:
    """Write cells of any kinds, whole or not at all; the format follows from the ending of `path`.

    Parameters
    ----------
    points : (n, 3) m.
    cells : (c, k) nodes by meshio's kind: "tetra10", "tetra", "triangle6", "triangle", "quad".
    body : (c,) index into `names` by kind, −1 in air; None: there are no bodies.
    cell_data : (c, …) arrays by name and kind.
    point_data : (n, …) arrays by name.

    Raises InputError when the format cannot hold the cells, or there is no such folder.
    """
    import meshio

    form = format_of(path, frozenset(cells))
    if not path.parent.is_dir():
        raise InputError(f"cannot write: there is no folder {path.parent} [{path}]")
    kinds = list(cells)
    blocks = {kind: np.asarray(cells[kind]) for kind in kinds}
    arrays = {key: [np.asarray(values[kind]) for kind in kinds] for key, values in (cell_data or {}).items()}
    on_points = {key: np.asarray(values) for key, values in (point_data or {}).items()}
    numbers = None if body is None else [np.asarray(body[kind], dtype=np.int64) for kind in kinds]
    if any(kind not in form.cells for kind in kinds):
        points, blocks, on_points = _straight(points, blocks, form.cells, on_points)
        log.warning("%s: this format has no curved cells, straight ones are written", path.name)
    if not form.data:
        dropped = [*arrays, *on_points]
        arrays, on_points = {}, {}
        if dropped:
            log.warning("%s: this format keeps no data, left out: %s", path.name, ", ".join(dropped))
    content = meshio.Mesh(points, list(blocks.items()), point_data=on_points)
    if numbers is not None:
        _name_bodies(content, form, numbers, names, arrays)
    content.cell_data.update(arrays)
    # Formats of several files name each other, so the draft keeps the name, in a folder of its own.
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as draft:
        content.write(Path(draft) / path.name, file_format=form.name)
        for piece in sorted(Path(draft).iterdir()):
            os.replace(piece, path.parent / piece.name)


def _straight(
    points: Floats, blocks: dict[str, Integers], held: frozenset[str], on_points: dict[str, Array]
) -> tuple[Floats, dict[str, Integers], dict[str, Array]]:
    """Curved cells by their corners, and only the nodes that are left."""
    short: dict[str, Integers] = {}
    for kind, nodes in blocks.items():
        plain, corners = (kind, nodes.shape[1]) if kind in held else _CORNERS[kind]
        if plain in short:
            raise InputError(f"{kind} and {plain} cells cannot be written together in a format without curved cells")
        short[plain] = nodes[:, :corners]
    used = np.unique(np.concatenate([nodes.ravel() for nodes in short.values()]))
    number = np.full(len(points), -1, dtype=np.int64)
    number[used] = np.arange(used.size)
    return (
        points[used],
        {kind: number[nodes] for kind, nodes in short.items()},
        {key: values[used] for key, values in on_points.items()},
    )


def _name_bodies(
    content: Any, form: Format, numbers: list[Integers], names: tuple[str, ...], arrays: dict[str, list[Array]]
) -> None:
    """Put the bodies' numbers and names into `content` and `arrays`, in the way that the format keeps them."""
    dimension = 3 if any(block.type.startswith("tetra") for block in content.cells) else 2
    if form.numbers:
        arrays[form.numbers] = [block + 1 for block in numbers]
    if form.data or form.names == "arrays":
        arrays["body"] = [block.astype(np.int32) for block in numbers]
    called = {-1: AIR, **dict(enumerate(names))}
    present = {index: name for index, name in called.items() if any((block == index).any() for block in numbers)}
    if form.names == "groups":
        # Gmsh counts groups from 1 and takes 0 for none: air comes after the bodies.
        arrays[form.numbers] = [np.where(block < 0, len(names), block) + 1 for block in numbers]
        arrays["gmsh:geometrical"] = arrays[form.numbers]
        for index, name in present.items():
            content.field_data[name] = np.array([(len(names) if index < 0 else index) + 1, dimension])
    elif form.names == "sets":
        for index, name in present.items():
            content.cell_sets[name] = [np.flatnonzero(block == index) for block in numbers]
    elif form.names == "families":
        arrays["cell_tags"] = [-(block + 1) for block in numbers]  # families of cells are negative, 0 is none
        content.cell_tags = {-(index + 1): [name] for index, name in present.items() if index >= 0}
        content.point_tags = {}
    elif form.names == "arrays":
        for index, name in present.items():
            if index >= 0 and name not in arrays:
                arrays[name] = [(block == index).astype(np.int32) for block in numbers]
