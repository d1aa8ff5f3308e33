"""Poses drawn at random for studies, and the errors of found ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magfem.localization import Rotor
from magfem.scenario.angles import between
from magfem.typing import Floats, Points, Vectors


@dataclass(frozen=True, eq=False)
class DrawnPoses:
    """position (..., 3) m from the sensor, axis (..., 3), beta (...) rad, phase (...) rad."""

    position: Points
    axis: Vectors
    beta: Floats
    phase: Floats


def drawn_poses(distance: Floats, beta: Floats, generator: np.random.Generator) -> DrawnPoses:
    """Poses at `distance` (...) m, the sensor at `beta` (...) rad above or below the rotation plane, else random."""
    shape = np.broadcast_shapes(np.shape(distance), np.shape(beta))
    axis = _unit(generator.normal(size=(*shape, 3)))
    across = _unit(np.cross(axis, generator.normal(size=(*shape, 3))))
    side = generator.choice([-1.0, 1.0], size=shape)
    angle = np.broadcast_to(beta, shape)
    away = np.cos(angle)[..., None] * across + (side * np.sin(angle))[..., None] * axis  # from the rotor to the sensor
    position = -np.broadcast_to(distance, shape)[..., None] * away
    return DrawnPoses(position, axis, angle, generator.uniform(-np.pi, np.pi, size=shape))


def isoline_distance(rotor: Rotor, strength: Floats, beta: Floats) -> Floats:
    """(...) m, where the largest field during a turn is `strength` (...) T, at `beta` (...) rad above the plane.

    Fixed-point steps of the dipole's law, in which a rotor's field is very nearly.
    """
    strength, beta = np.broadcast_arrays(np.asarray(strength, dtype=float), np.asarray(beta, dtype=float))
    direction = np.stack([np.cos(beta), np.zeros(beta.shape), np.sin(beta)], axis=-1)
    r: Floats = np.cbrt(1e-7 * rotor.moment * np.sqrt(1 + 3 * np.cos(beta) ** 2) / strength)
    for _ in range(30):
        C, S, *_ = rotor.quadratures(r[..., None] * direction)
        field = np.linalg.norm(np.stack([C, S], axis=-1), ord=2, axis=(-2, -1))
        r = r * np.cbrt(field / strength)
    return r


def beta_of(position: Points, axis: Vectors) -> Floats:
    """(...) rad, 0 … π/2, of found poses."""
    towards = _unit(position)
    return np.asarray(np.arcsin(np.minimum(np.abs(np.einsum("...i,...i->...", towards, axis)), 1.0)))


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """position, distance (...) m; direction, axis, beta (...) rad."""

    position: Floats
    distance: Floats
    direction: Floats
    axis: Floats
    beta: Floats


def pose_errors(position: Points, axis: Vectors, true: DrawnPoses) -> PoseErrors:
    """What found poses (..., 3), (..., 3) are off by; an axis counts as a directed line."""
    return PoseErrors(
        position=np.linalg.norm(position - true.position, axis=-1),
        distance=np.abs(np.linalg.norm(position, axis=-1) - np.linalg.norm(true.position, axis=-1)),
        direction=between(_unit(position), _unit(true.position)),
        axis=between(axis, true.axis),
        beta=np.abs(beta_of(position, axis) - true.beta),
    )


def root_mean_square(values: Floats, axis: int | tuple[int, ...] | None = None) -> Floats:
    """Along `axis`, all of it unless stated."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=axis)))


def _unit(vectors: Vectors) -> Vectors:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
