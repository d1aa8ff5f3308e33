"""A rod's shape measured by cameras, simulated: what a controller gets instead of the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.rod.camera_views import fit_centreline_to_views, simulate_views
from magfem.rod.cameras import Camera
from magfem.rod.centreline import Centreline
from magfem.rod.magnet_pose import MagnetPoses, magnet_poses
from magfem.typing import ArrayLike, Floats


@dataclass(frozen=True, eq=False)
class ShapeSensor:
    """Two or more cameras about a rod.

    cameras: calibrated.  length, base, base_tangent, straight, degree: of the rod, as for `fit_centreline`.
    magnets: (m,) m, arc lengths of the magnets' middles.  points: how many pixels a picture has of the rod's axis.
    noise: px.  missing, outliers: shares, as for `simulate_views`.
    """

    cameras: tuple[Camera, ...]
    length: float
    magnets: tuple[float, ...]
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)
    base_tangent: tuple[float, float, float] | None = None
    straight: tuple[tuple[float, float], ...] = ()
    degree: int = 6
    points: int = 100
    noise: float = 0.5
    missing: float = 0.0
    outliers: float = 0.0

    def measure(
        self, shape: ArrayLike, arc_lengths: ArrayLike, generator: np.random.Generator, last: Centreline | None = None
    ) -> tuple[Centreline, MagnetPoses]:
        """Centreline and magnet poses as seen of a rod whose true axis passes (n, 3) m at increasing (n,) m.

        Between the given points the axis is taken as straight. last: the centreline measured before, from which this
        one starts: faster, and safe where a cold start is not.
        """
        place: Floats = np.asarray(shape, dtype=float)
        s = np.linspace(0.0, self.length, self.points)
        axis = np.stack([np.interp(s, np.asarray(arc_lengths, dtype=float), place[:, i]) for i in range(3)], axis=-1)
        views = simulate_views(
            self.cameras, axis, generator, noise=self.noise, missing=self.missing, outliers=self.outliers
        )
        found = fit_centreline_to_views(
            self.cameras,
            [view.pixels for view in views],
            self.length,
            self.base,
            base_tangent=self.base_tangent,
            straight=self.straight,
            degree=self.degree,
            start=last,
        )
        return found, magnet_poses(found, self.magnets)
