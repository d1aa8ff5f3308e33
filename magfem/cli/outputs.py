"""Where results go, checked before the long computation starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from magfem.errors import InputError
from magfem.files import check_folder


def output_file(text: str, endings: Sequence[str]) -> Path:
    """The file that a user wants written.

    Raises InputError when it is a directory, its folder is missing, or its ending is not among `endings`.
    """
    path = Path(text)
    if path.is_dir():
        raise InputError(f"expected a file to write, got a directory [{text}]")
    if path.suffix.lower() not in endings:
        raise InputError(f"expected a file that ends in {' or '.join(endings)} [{text}]")
    _check_parent(path, text)
    return path


def output_folder(text: str, owned: frozenset[str]) -> Path:
    """The folder that a user wants made or replaced.

    Raises InputError when it is a file, its own folder is missing, or it holds anything but `owned`: what a
    former run wrote may go, other files may not.
    """
    path = Path(text).resolve()
    if path.exists() and not path.is_dir():
        raise InputError(f"expected a folder to write, got a file [{text}]")
    _check_parent(path, text)
    if Path.cwd().is_relative_to(path):
        raise InputError(f"the current folder cannot be replaced: name a new one [{text}]")
    check_folder(Path(text), owned)
    return path


def _check_parent(path: Path, text: str) -> None:
    if not path.parent.is_dir():
        raise InputError(f"cannot write: there is no folder {path.parent} [{text}]")
