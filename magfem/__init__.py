"""magfem: from a magnet's or a coil's geometry to a field model you may bet hardware on.

    geometry = magfem.load_geometry("ring_magnet_4x1.5x1")
    solution = magfem.solve(geometry)
    model = magfem.fit(solution)
    model.B([0, 0, 3e-3])

Everything is in SI units; points are (..., 3) arrays in m, fields (..., 3) in T. Importing is cheap: Gmsh, VTK
and the compiled kernels load on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from magfem.version import __version__

_PUBLIC = {
    "load_geometry": "magfem.geometry",
    "solve": "magfem.fem",
    "load_solution": "magfem.fem",
    "Solution": "magfem.fem",
    "fit": "magfem.fitting",
    "load_model": "magfem.fitting",
    "FieldModel": "magfem.fitting",
    "load_system": "magfem.actuation",
    "CoilSystem": "magfem.actuation",
    "exact": "magfem.closed_form",
    "validate": "magfem.fitting",
    "Field": "magfem.fields",
    "Region": "magfem.fields",
    "MagfemError": "magfem.errors",
}

__all__ = [
    "CoilSystem",
    "Field",
    "FieldModel",
    "MagfemError",
    "Region",
    "Solution",
    "__version__",
    "exact",
    "fit",
    "load_geometry",
    "load_model",
    "load_solution",
    "load_system",
    "solve",
    "validate",
]

if TYPE_CHECKING:
    from magfem.actuation import CoilSystem, load_system
    from magfem.closed_form import exact
    from magfem.errors import MagfemError
    from magfem.fem import Solution, load_solution, solve
    from magfem.fields import Field, Region
    from magfem.fitting import FieldModel, fit, load_model, validate
    from magfem.geometry import load_geometry


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'magfem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
