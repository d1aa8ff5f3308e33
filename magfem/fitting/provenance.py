"""Where a model comes from: device, solver, versions, date."""

from __future__ import annotations

import datetime
import importlib.metadata
import platform
from typing import Any

from magfem.fem.coil_solution import CoilSolution
from magfem.fem.solution import Solution, describe
from magfem.fields.field import Field
from magfem.geometry import Geometry
from magfem.version import __version__

_PACKAGES = ("numpy", "scipy", "numba", "gmsh", "scikit-fem", "pyamg")


def provenance_of(source: Field, geometry: Geometry | None, circuit: str | None = None) -> dict[str, Any]:
    """JSON-ready; `solver` and `solution` are None for a source that no finite elements have made.

    circuit: which one of a coil's the field is of.
    """
    solution = source if isinstance(source, Solution | CoilSolution) else None
    return {
        "device": None if geometry is None else describe(geometry),
        "circuit": circuit,
        "source": "finite elements" if solution else type(source).__name__,
        "solver": solution and solution.settings,
        "solution": solution and {"error": solution.error, "quantities": solution.quantities, "stats": solution.stats},
        **versions_and_date(),
    }


def versions_and_date() -> dict[str, Any]:
    """Of Python, magfem and what it stands on; today."""
    return {
        "versions": {
            "python": platform.python_version(),
            "magfem": __version__,
            **{package: _version(package) for package in _PACKAGES},
        },
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
