"""Meshes as files, in any format that meshio writes, chosen by the file's ending."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from magfem.errors import InputError
from magfem.mesh.mesh import Mesh
from magfem.typing import Floats

_OPTIONS: dict[str, dict[str, Any]] = {
    ".msh": {"file_format": "gmsh"},
}


def write_mesh(
    mesh: Mesh,
    path: Path,
    point_data: dict[str, Floats] | None = None,
    cell_data: dict[str, Floats] | None = None,
) -> None:
    """Write a mesh (lengths in m; `body` is −1 in air) and data on it, whole or not at all.

    Meridian meshes lie in the xy plane with x = ρ and y = z. Raises InputError for an unknown ending.
    """
    import meshio

    known = meshio.extension_to_filetypes
    if path.suffix.lower() not in known:
        raise InputError(f"cannot tell a mesh format from the ending of {path.name!r}; try .vtu, .msh or .xdmf")
    points = mesh.points if mesh.dimension == 3 else np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    kind = "tetra10" if mesh.dimension == 3 else "triangle6"
    content = meshio.Mesh(
        points,
        [(kind, mesh.cells)],
        point_data=point_data or {},
        cell_data={"body": [mesh.body.astype(np.int32)], **{k: [v] for k, v in (cell_data or {}).items()}},
    )
    if not path.parent.is_dir():
        raise InputError(f"cannot write: there is no folder {path.parent} [{path}]")
    # Formats of several files name each other, so the draft keeps the name, in a folder of its own.
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as draft:
        content.write(Path(draft) / path.name, **_OPTIONS.get(path.suffix.lower(), {}))
        for piece in sorted(Path(draft).iterdir()):
            os.replace(piece, path.parent / piece.name)
