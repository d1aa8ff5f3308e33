"""Convex hulls of bodies: the distance that cards and regions speak of, and points at a given distance."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from magfem.errors import InputError
from magfem.typing import Floats, Integers, Points


class Hull(Protocol):
    """A convex body about the origin of its source frame."""

    @property
    def radius(self) -> float:
        """Radius of the smallest ball about the origin that holds the body, m."""
        ...

    def distance(self, points: Points) -> Floats:
        """Distance (...) m of `points` (..., 3) m to the body; zero inside."""
        ...

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        """Random points at given hull distances, uniform over each offset surface.

        `distance` (n,) m gives n surfaces; the result is (n, count, 3) m.
        """
        ...

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        """Points (n, count, 3) m at given hull distances that reach every part of each offset surface.

        Walls, faces and rims get equal shares whatever their area, axes and edges among them: fields are
        extreme there, and uniform points hardly ever meet them.
        """
        ...


@dataclass(frozen=True)
class CylinderHull:
    """A solid cylinder about the z axis: the hull of rings, cylinders, discs, solenoids."""

    diameter: float  # m
    length: float  # m

    @property
    def radius(self) -> float:
        return float(np.hypot(self.diameter, self.length) / 2)

    def distance(self, points: Points) -> Floats:
        radial = np.hypot(points[..., 0], points[..., 1]) - self.diameter / 2
        axial = np.abs(points[..., 2]) - self.length / 2
        outside: Floats = np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0))
        return outside

    def offset_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None]
        shape = (d.shape[0], count)
        # The offset surface is the wall, two faces and, along the rims, two quarters of a torus.
        radius = self.diameter / 2
        wall = 2 * np.pi * (radius + d) * self.length
        faces = 2 * np.pi * radius**2 * np.ones_like(d)
        rims = 4 * np.pi * (radius * np.pi / 2 * d + d**2)
        pick = rng.random(shape) * (wall + faces + rims)
        u = rng.random(shape)
        part = np.where(pick < wall, 0, np.where(pick < wall + faces, 1, 2))
        return self._on_part(d, part, np.where(part == 1, np.sqrt(u), u), _torus_angle(u, radius, d), rng)

    def marked_points(self, distance: Floats, count: int, rng: np.random.Generator) -> Points:
        d = np.asarray(distance, dtype=float)[:, None]
        shape = (d.shape[0], count)
        part = np.broadcast_to(np.arange(count) % 3, shape)
        u = rng.random(shape)
        # The first six go to the equator, the axis and four edges, near enough; no two draws meet exactly.
        ends = np.array([0.5, 0.0, 0.0, 1.0, 1.0, 1.0])[:count]
        u[:, :6] = np.abs(ends - 1e-4 * u[:, :6])
        return self._on_part(d, part, u, u * (np.pi / 2), rng)

    def _on_part(self, d: Floats, part: Integers, u: Floats, polar: Floats, rng: np.random.Generator) -> Points:
        """Points (n, c, 3) on wall (0), face (1), rim (2): `u` in [0, 1] along the first two, `polar` along a rim."""
        radius, half = self.diameter / 2, self.length / 2
        side = np.where(rng.random(u.shape) < 0.5, -1.0, 1.0)
        rho = np.choose(part, [radius + d + 0 * u, radius * u, radius + d * np.sin(polar)])
        z = np.choose(part, [self.length * (u - 0.5), side * (half + d), side * (half + d * np.cos(polar))])
        azimuth = rng.uniform(0, 2 * np.pi, u.shape)
        return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=-1)


def _torus_angle(u: Floats, radius: float, tube: Floats) -> Floats:
    """Polar angle in [0, π/2] whose density is proportional to radius + tube·sin: area-uniform on the rim."""
    target = u * (radius * np.pi / 2 + tube)
    angle = u * (np.pi / 2)
    for _ in range(6):  # Newton on a smooth monotone function: six steps reach rounding
        value = radius * angle + tube * (1 - np.cos(angle))
        angle = angle - (value - target) / (radius + tube * np.sin(angle))
    return np.clip(angle, 0.0, np.pi / 2)


_KINDS: dict[str, type[CylinderHull]] = {"cylinder": CylinderHull}


def hull_to_dict(hull: Hull) -> dict[str, Any]:
    """The hull as JSON-ready data (SI units)."""
    for kind, hull_class in _KINDS.items():
        if isinstance(hull, hull_class):
            return {"kind": kind, **asdict(hull)}
    raise InputError(f"hull of type {type(hull).__name__} cannot be written to a model file")


def hull_from_dict(data: dict[str, Any]) -> Hull:
    """Inverse of `hull_to_dict`."""
    values = dict(data)
    kind = values.pop("kind", None)
    if kind not in _KINDS:
        raise InputError(f"unknown hull kind {kind!r}; known: {', '.join(_KINDS)}")
    sizes = {key: float(value) for key, value in values.items()}
    if not all(0 < size < math.inf for size in sizes.values()):
        raise InputError("a hull needs finite sizes above 0")
    return _KINDS[kind](**sizes)
