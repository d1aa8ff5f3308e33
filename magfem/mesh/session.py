"""One Gmsh session at a time: quiet, deterministic, closed whatever happens."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from magfem.errors import MeshError, MissingProgramError

_LOCK = threading.RLock()  # Gmsh has one state for the whole process

_QUIET = {
    "General.Terminal": 0,
    "General.Verbosity": 0,
    "General.NumThreads": 1,  # parallel meshing is not repeatable
}
_CHANGED = (
    *_QUIET,
    "Mesh.Algorithm3D",
    "Mesh.MeshSizeExtendFromBoundary",
    "Mesh.MeshSizeFromCurvature",
    "Mesh.MeshSizeFromPoints",
    "Mesh.MeshSizeMax",
)
"""The options that meshing here sets: a caller's own session gets its values back."""


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """The `gmsh` module with a fresh model; Gmsh's own errors leave as MeshError.

    Other threads wait. If the caller has a Gmsh session of their own, it stays open and its models and options
    are as before. Raises MissingProgramError when a shared library that Gmsh needs is absent.
    """
    try:
        import gmsh
    except OSError as error:
        raise MissingProgramError(
            f"Gmsh cannot start ({error}); on Debian and Ubuntu type: apt-get install libglu1-mesa libgl1 "
            "libxrender1 libxcursor1 libxft2 libxinerama1"
        ) from None
    with _LOCK, _callers_session(gmsh) if gmsh.isInitialized() else _own_session(gmsh):
        try:
            for option, value in _QUIET.items():
                gmsh.option.setNumber(option, value)
            yield gmsh
        except Exception as error:
            if type(error) is Exception:  # what Gmsh's API raises
                raise MeshError(f"Gmsh could not mesh the geometry: {error}") from None
            raise


@contextmanager
def _own_session(gmsh: Any) -> Iterator[None]:
    # Without `interruptible=False` Gmsh would replace Python's Ctrl-C handling.
    gmsh.initialize(interruptible=False)
    try:
        gmsh.model.add("magfem")
        yield
    finally:
        gmsh.finalize()


@contextmanager
def _callers_session(gmsh: Any) -> Iterator[None]:
    current = gmsh.model.getCurrent()
    options = {option: gmsh.option.getNumber(option) for option in _CHANGED}
    gmsh.model.add("magfem")
    try:
        yield
    finally:
        gmsh.model.remove()
        for option, value in options.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.setCurrent(current)
