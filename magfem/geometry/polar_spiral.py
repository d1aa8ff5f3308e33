"""Spirals about the origin: round ones, and along outlines that shrink from turn to turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import asinh, ceil, hypot, pi

import numpy as np

from magfem.geometry.foil_ribbon import Curved
from magfem.typing import Floats

Shape = Callable[[Floats], tuple[Floats, Floats]]
"""Distance from the middle and its derivative at angles (n,), the largest distance being 1."""


def circle(angles: Floats) -> tuple[Floats, Floats]:
    """The shape of a circle."""
    return np.ones_like(angles), np.zeros_like(angles)


@dataclass(frozen=True)
class PolarSpiral:
    """Inwards, right-handed about +z: at angle φ past `direction` its centreline is (outer − pitch φ/2π)·shape(φ) away.

    outer: m, where the shape is 1.  pitch: m, the same.  bends: how often the shape goes in and out in a turn.
    """

    outer: float
    pitch: float
    turns: float
    direction: float = 0.0
    shape: Shape = circle
    bends: int = 1

    @property
    def inner(self) -> float:
        """Where it ends, of a shape 1; m."""
        return self.outer - self.pitch * self.turns

    @property
    def length(self) -> float:
        """Of the centreline, m: Archimedes' spiral in closed form, others by quadrature to rounding."""
        if self.shape is circle:
            return archimedean_length(self.outer, self.inner, self.pitch)
        steps = ceil(self.turns * 16 * self.bends)
        nodes, weights = np.polynomial.legendre.leggauss(12)
        edges = np.linspace(0.0, 2 * pi * self.turns, steps + 1)
        half = 0.5 * np.diff(edges)[:, None]
        angles = edges[:-1, None] + half * (1 + nodes)
        speed = np.linalg.norm(self.path(angles.ravel())[1], axis=1).reshape(angles.shape)
        return float((half * speed * weights).sum())

    @property
    def samples(self) -> int:
        """Steps that see every bend."""
        return ceil(self.turns * 64 * self.bends) + 8

    def path(self, angles: Floats) -> tuple[Floats, Floats]:
        """Places (n, 2) m and their derivatives by the angle past the direction."""
        r, slope = self.shape(angles)
        scale = self.outer - self.pitch / (2 * pi) * angles
        radius = scale * r
        drift = scale * slope - self.pitch / (2 * pi) * r
        c, s = np.cos(angles + self.direction), np.sin(angles + self.direction)
        places = np.stack([radius * c, radius * s], axis=1)
        slopes = np.stack([drift * c - radius * s, drift * s + radius * c], axis=1)
        return places, slopes

    def track(self, width: float) -> Curved:
        """The track of one `width` (m)."""
        return Curved(self.path, (0.0, 2 * pi * self.turns), width, self.length, self.samples)

    def tightest(self) -> float:
        """The smallest radius of curvature, m."""
        angles = np.linspace(0.0, 2 * pi * self.turns, 4 * self.samples)
        slopes = self.path(angles)[1]
        bending = np.gradient(np.unwrap(np.arctan2(slopes[:, 1], slopes[:, 0])), angles)
        return float((np.linalg.norm(slopes, axis=1) / np.maximum(np.abs(bending), 1e-12)).min())


def archimedean_length(outer: float, inner: float, pitch: float) -> float:
    """Length (m) of r = outer − pitch φ/2π from radius `outer` to `inner`: ∫ √(r² + (pitch/2π)²) dr, over pitch/2π."""
    k = pitch / (2 * pi)

    def primitive(r: float) -> float:
        return (r * hypot(r, k) + k * k * asinh(r / k)) / (2 * k)

    return primitive(outer) - primitive(inner)


def flower(petals: int, depth: float) -> Shape:
    """The shape of a flower whose valleys are `depth` (of the tips' distance) nearer to the middle than its tips."""

    def shape(angles: Floats) -> tuple[Floats, Floats]:
        return 1 - 0.5 * depth * (1 - np.cos(petals * angles)), -0.5 * depth * petals * np.sin(petals * angles)

    return shape


def narrowing(petals: int, depth: float) -> float:
    """The smallest distance between a flower and itself a little smaller, over that at its tips: the least of
    ρ²/√(ρ² + ρ'²)."""
    angles = np.linspace(0.0, 2 * pi / petals, 2001)
    r, slope = flower(petals, depth)(angles)
    return float((r**2 / np.hypot(r, slope)).min())
