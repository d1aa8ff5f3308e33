"""What every solid offers, whatever it looks like."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from magfem.fields.hull import Hull
from magfem.typing import ArrayLike, Booleans, Floats, Jet, Points

ROUND = 48
"""Corners that stand for a full circle where a polyhedron is wanted."""


class Shape(Protocol):
    """A solid in a frame of its own; lengths in m."""

    @property
    def volume(self) -> float:
        """Closed form, m³."""
        ...

    @property
    def area(self) -> float:
        """Whole surface, closed form, m²."""
        ...

    @property
    def thickness(self) -> float:
        """The smallest thickness, which a mesh must resolve, m."""
        ...

    @property
    def hull(self) -> Hull:
        """The convex hull."""
        ...

    @property
    def corners(self) -> Points:
        """Points (n, 3) of the surface whose convex hull is that of the solid, but for `bulge`."""
        ...

    @property
    def bulge(self) -> float:
        """How far the solid reaches beyond the convex hull of its `corners` at most, m."""
        ...

    @property
    def revolved(self) -> bool:
        """Whether it is a body of revolution about z."""
        ...

    def contains(self, points: Points) -> Booleans:
        """True (...) where points (..., 3) lie inside, the surface not included."""
        ...

    def build(self, occ: Any) -> list[int]:
        """Make the solid in `gmsh.model.occ`; its volume tags, not synchronised."""
        ...

    def build_meridian(self, occ: Any) -> list[int]:
        """Make the half section, x = rho and y = z, of a body of revolution; its surface tags."""
        ...

    def jet(self, points: Points, magnetisation: ArrayLike, order: int) -> Jet:
        """Closed-form field at points (n, 3) of the solid magnetised uniformly, (3,) A/m: (B, gradient[, hessian])."""
        ...


def arc(radius: float, height: float, start: float = 0.0, end: float | None = None) -> Floats:
    """Points (n, 3) on an arc about z, its ends included; a full circle without `end`."""
    if end is None:
        angle = start + 2 * np.pi * np.arange(ROUND) / ROUND
    else:
        angle = np.linspace(start, end, max(2, int(np.ceil(ROUND * (end - start) / (2 * np.pi))) + 1))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(angle.size, height)])


def sagitta(radius: float) -> float:
    """How far a circle of `radius` reaches beyond the chords between the points of `arc`."""
    return float(radius * (1 - np.cos(np.pi / ROUND)))
