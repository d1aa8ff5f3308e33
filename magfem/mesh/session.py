"""One Gmsh session at a time: quiet, deterministic, closed whatever happens."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from magfem.errors import MeshError, MissingProgramError


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """The `gmsh` module with a fresh model; Gmsh's own errors leave as MeshError.

    Raises MissingProgramError when a shared library that Gmsh needs is absent.
    """
    try:
        import gmsh
    except OSError as error:
        raise MissingProgramError(
            f"Gmsh cannot start ({error}); on Debian and Ubuntu type: apt-get install libglu1-mesa libgl1 "
            "libxrender1 libxcursor1 libxft2 libxinerama1"
        ) from None
    # Without `interruptible=False` Gmsh would replace Python's Ctrl-C handling.
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)  # parallel meshing is not repeatable
        gmsh.model.add("magfem")
        yield gmsh
    except Exception as error:
        if type(error) is Exception:  # what Gmsh's API raises
            raise MeshError(f"Gmsh could not mesh the geometry: {error}") from None
        raise
    finally:
        gmsh.finalize()
