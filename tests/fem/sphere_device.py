"""A uniformly magnetised sphere with recoil permeability: the one magnet whose reaction has a closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from magfem.constants import MU_0
from magfem.fields.hull import CylinderHull
from magfem.geometry import Body, PermanentMagnet
from magfem.typing import Floats


@dataclass(frozen=True)
class Sphere:
    """Radius 1 m about `offset`, in a ball that holds it; magnetisation M₀ along z with M₀ = 1 A/m."""

    permeability: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    feature_size: float = 2.0

    @property
    def hull(self) -> CylinderHull:
        return CylinderHull(2.0, 2.0)

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (Body("magnet", PermanentMagnet(1.0), 4 * np.pi / 3, 4 * np.pi),)

    def build(self, occ: Any) -> dict[str, list[int]]:
        return {"magnet": [occ.addSphere(*self.offset, 1.0)]}

    def build_meridian(self, occ: Any) -> dict[str, list[int]]:
        x, _, z = self.offset
        south, east, north = (occ.addPoint(x + a, z + b, 0) for a, b in ((0, -1), (1, 0), (0, 1)))
        centre = occ.addPoint(x, z, 0)
        arcs = [occ.addCircleArc(south, centre, east), occ.addCircleArc(east, centre, north), occ.addLine(north, south)]
        return {"magnet": [occ.addPlaneSurface([occ.addCurveLoop(arcs)])]}

    @property
    def moment(self) -> float:
        """M = M₀ + (µ − 1)H with H = −M/3 inside: M = 3M₀/(µ + 2)."""
        return 4 * np.pi / 3 * 3 / (self.permeability + 2)

    def potential(self, points: Floats) -> Floats:
        x = points - self.offset
        r = np.linalg.norm(x, axis=-1)
        return x[..., 2] / (self.permeability + 2) / np.maximum(r, 1.0) ** 3

    def B(self, points: Floats) -> Floats:
        """Outside: the dipole; inside: µ₀·2M/3."""
        x = points - self.offset
        r = np.linalg.norm(x, axis=-1, keepdims=True)
        m = np.array([0.0, 0.0, self.moment])
        dipole = 3 * x * (x @ m)[..., None] / r**5 - m / r**3
        uniform = 2 * m / 1.0**3
        return MU_0 / (4 * np.pi) * np.where(r > 1, dipole, uniform)
