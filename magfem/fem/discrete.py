"""One discrete solution: what every formulation hands back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from magfem.fem.meridian_currents import MeridianCurrents
from magfem.fem.surface_currents import SurfaceCurrents
from magfem.mesh.mesh import Mesh
from magfem.typing import Floats

Currents = SurfaceCurrents | MeridianCurrents


@dataclass(frozen=True)
class Discrete:
    """Sources and numbers of one mesh, one solve."""

    mesh: Mesh
    currents: Currents
    potential: Floats
    flux_density: Floats
    volume: Floats  # (b,) m³ of every body as meshed
    quantities: dict[str, Any]
    unknowns: int
    iterations: int
    residual: float
