"""Coils of the catalogue, each solved once a session."""

from __future__ import annotations

from functools import cache

import magfem
from magfem.fem.coil_solution import CoilSolution


@cache
def solved(name: str, resolution: float = 1.0, conduction: str | None = None) -> CoilSolution:
    """The solution of a card."""
    solution = magfem.solve(magfem.load_geometry(name), resolution=resolution, conduction=conduction)
    assert isinstance(solution, CoilSolution)
    return solution
