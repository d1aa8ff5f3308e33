"""From a name, a system card, a system file or an MPEM file to a coil system."""

from __future__ import annotations

import os
from difflib import get_close_matches
from pathlib import Path

from magfem.actuation.coil_system import CoilSystem
from magfem.actuation.mpem import read_mpem
from magfem.actuation.system_card import read_system_card
from magfem.actuation.system_file import read_system
from magfem.errors import InputError
from magfem.geometry.catalogue import folder, is_path, names, short_path
from magfem.units import describe, quoted

SECTION = "geometries/systems"
"""The catalogue's folder of systems."""

READERS = {".toml": read_system_card, ".yaml": read_mpem, ".yml": read_mpem, ".json": read_system}
"""What reads a system's file, by its ending."""


def load_system(name_or_path: str | os.PathLike[str]) -> CoilSystem:
    """A coil system: by its name in the catalogue, by the path of its card (.toml), its file (.json) or an
    MPEM file (.yaml).

    Raises InputError for a name that the catalogue does not have, CardError (file and key) for a wrong file.
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise InputError(f'load_system takes a name or path: "bigmag", got {describe(name_or_path)}')
    if any(is_path(name_or_path, ending) for ending in READERS):
        path = Path(name_or_path)
        if path.suffix not in READERS:
            raise InputError(
                "a coil system is a card (.toml), a system file (.json) or an MPEM file (.yaml), "
                f"got {quoted(str(path))}"
            )
        return READERS[path.suffix](path, str(path))
    name, known = os.fspath(name_or_path), names(SECTION, ".toml")
    if name not in known:
        nearest = get_close_matches(name, known, n=1, cutoff=0.0)
        advice = f"; the nearest is {quoted(nearest[0])}" if nearest else ""
        raise InputError(
            f"unknown coil system {quoted(name)}{advice} "
            "(`magfem list` shows all, a path ends in .toml, .json or .yaml)"
        )
    return read_system_card(folder(SECTION) / f"{name}.toml", short_path(SECTION, name, ".toml"))
