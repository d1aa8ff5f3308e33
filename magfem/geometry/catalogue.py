"""Where the committed cards, recipes and models live, and how a name becomes a file.

The folders `geometries`, `fits` and `reports` stand in the repository's root; a wheel carries them inside the
package. A name or path is what users type: `ring_magnet_4x1.5x1` or `./mine.toml`.
"""

from __future__ import annotations

import os
from difflib import get_close_matches
from pathlib import Path

from magfem.errors import InputError
from magfem.units import quoted

_PACKAGE = Path(__file__).parents[1]

_NOUNS = {
    ("geometries", ".toml"): "device card",
    ("geometries/systems", ".toml"): "coil system",
    ("fits", ".toml"): "fit recipe",
    ("fits", ".json"): "field model",
    ("reports", ".toml"): "recipe",
}

SIMULATED = ("scenario", "localize_and_steer", "localization_study")
"""Kinds of recipes in `reports/` that `magfem simulate` runs; the others are of reports."""


def folder(section: str) -> Path:
    """The folder of a section (`geometries`, `fits`, `reports`); it need not exist."""
    installed = _PACKAGE / "catalogue" / section
    return installed if installed.is_dir() else _PACKAGE.parent / section


def names(section: str, suffix: str) -> tuple[str, ...]:
    """The names of a section's files that end in `suffix` (".toml", ".json"), sorted, without the suffix."""
    return tuple(sorted(file.name.removesuffix(suffix) for file in folder(section).glob(f"*{suffix}")))


def is_path(name_or_path: str | os.PathLike[str], suffix: str) -> bool:
    """Whether a user means a file of their own: a Path, a separator in it, or the suffix at its end."""
    if not isinstance(name_or_path, str):
        return True
    separators = [separator for separator in (os.sep, os.altsep) if separator]
    return name_or_path.endswith(suffix) or any(separator in name_or_path for separator in separators)


def resolve(section: str, name_or_path: str | os.PathLike[str], suffix: str) -> Path:
    """The file that a user means; a path is returned as it is, whether it exists or not.

    Raises InputError, naming the nearest, when the catalogue has no such name.
    """
    if is_path(name_or_path, suffix):
        return Path(name_or_path)
    name, known = os.fspath(name_or_path), names(section, suffix)
    if name in known:
        return folder(section) / f"{name}{suffix}"
    nearest = get_close_matches(name, known, n=1, cutoff=0.0)
    advice = f"; the nearest is {quoted(nearest[0])}" if nearest else ""
    noun = _NOUNS.get((section, suffix), "file")
    raise InputError(f"unknown {noun} {quoted(name)}{advice} (`magfem list` shows all, a path ends in {suffix})")


def short_path(section: str, name_or_path: str | os.PathLike[str], suffix: str) -> str:
    """How messages and provenance name the file: a path as it was given, a name as `section/name.suffix`."""
    text = os.fspath(name_or_path)
    return text if is_path(name_or_path, suffix) else f"{section}/{text}{suffix}"
