"""Flat ribbons rolled on a cylinder about z."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from magfem.geometry.circuit import Stations
from magfem.typing import Floats

WIDEST = 0.3  # of the radius, a strand that may be taken for flat across


@dataclass(frozen=True)
class RolledRibbon:
    """A flat ribbon on a cylinder: its x goes around the z axis from +x on, its y along z, its height outwards.

    The plane z = 0 of the flat ribbon comes to lie at `radius` (m), and lengths along it stay what they were.

    Across its width the ribbon stays flat, so that its width stays what it was. Where that leaves edges outside the
    cylinder, the centreline lies as much inside as makes the mean square of the distance from the axis right: area and
    length are off by a few 1e-5 for strands of a fifth of the radius, and the error falls with the square of that.
    """

    ribbon: Callable[[float], Stations]
    radius: float

    def __call__(self, resolution: float) -> Stations:
        flat = self.ribbon(resolution)
        centre = 0.5 * (flat.left + flat.right)
        offset = 0.5 * (flat.left - flat.right)
        angle = centre[:, 0] / self.radius
        c, s = np.cos(angle), np.sin(angle)
        outward = np.stack([c, s, np.zeros_like(c)], axis=1)
        around = np.stack([-s, c, np.zeros_like(c)], axis=1)

        def turned(vectors: Floats) -> Floats:
            x, y, z = vectors.T[:, :, None]
            result: Floats = x * around + y * np.array([0.0, 0.0, 1.0]) + z * outward
            return result

        radius = self.radius + centre[:, 2]
        level = np.sqrt(radius**2 - offset[:, 0] ** 2 / 3)
        middle = level[:, None] * outward + centre[:, 1, None] * np.array([0.0, 0.0, 1.0])
        across = turned(offset)
        return Stations(middle + across, middle - across, turned(flat.normal), flat.lead)
