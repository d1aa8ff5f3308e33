"""Field models handed to other programs: C, MATLAB and Octave, magpylib, ParaView."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

_PUBLIC = {
    "c_header": "magfem.exchange.c_source",
    "write_mat": "magfem.exchange.matlab",
    "MagpylibField": "magfem.exchange.magpylib_source",
    "from_magpylib": "magfem.exchange.magpylib_source",
    "magpylib_module": "magfem.exchange.magpylib_source",
    "to_magpylib": "magfem.exchange.magpylib_source",
    "write_grid": "magfem.exchange.vtk_grid",
    "write_points": "magfem.exchange.vtk_grid",
}

__all__ = [
    "MagpylibField",
    "c_header",
    "from_magpylib",
    "magpylib_module",
    "to_magpylib",
    "write_grid",
    "write_mat",
    "write_points",
]

if TYPE_CHECKING:
    from magfem.exchange.c_source import c_header
    from magfem.exchange.magpylib_source import MagpylibField, from_magpylib, magpylib_module, to_magpylib
    from magfem.exchange.matlab import write_mat
    from magfem.exchange.vtk_grid import write_grid, write_points


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'magfem.exchange' has no attribute {name!r}")
