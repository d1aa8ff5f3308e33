"""The solid that block magnets are: a cuboid."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from magfem.fields.hull import BoxHull
from magfem.typing import ArrayLike, Booleans, Jet, Points


@dataclass(frozen=True)
class Box:
    """A cuboid with edges along x, y and z, its centre at the origin."""

    size: tuple[float, float, float]  # m

    @property
    def volume(self) -> float:
        """m³."""
        x, y, z = self.size
        return x * y * z

    @property
    def area(self) -> float:
        """All six faces, m²."""
        x, y, z = self.size
        return 2 * (x * y + y * z + z * x)

    @property
    def thickness(self) -> float:
        """The smallest of the three lengths, m."""
        return min(self.size)

    @property
    def hull(self) -> BoxHull:
        """Itself."""
        return BoxHull(self.size)

    @property
    def corners(self) -> Points:
        """(8, 3)."""
        return np.array(list(product((-0.5, 0.5), repeat=3))) * self.size

    @property
    def bulge(self) -> float:
        return 0.0

    @property
    def revolved(self) -> bool:
        return False

    def contains(self, points: Points) -> Booleans:
        """True (...) inside."""
        inside: Booleans = np.all(np.abs(points) < np.array(self.size) / 2, axis=-1)
        return inside

    def build(self, occ: Any) -> list[int]:
        """Make the solid in `gmsh.model.occ`; its volume tag."""
        return [occ.addBox(*(-length / 2 for length in self.size), *self.size)]

    def build_meridian(self, occ: Any) -> list[int]:
        raise NotImplementedError("a cuboid is no body of revolution")

    def jet(self, points: Points, magnetisation: ArrayLike, order: int) -> Jet:
        """The closed form of `magfem.fields.uniform_block`."""
        from magfem.fields.uniform_block import block_jet

        return block_jet(points, self.size, magnetisation, order)
