"""What all tests of jets share: eighth-order differences, relative errors, points, and the law every jet obeys."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from magfem.typing import Floats, Jet, Points

_CENTRAL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])  # exact for polynomials of degree 8


def differences(field: Callable[[Points], Floats], points: Points, step: float) -> Floats:
    """∂field_…/∂x_j at `points` (n, 3) by central differences of eighth order, the new index last."""
    columns = []
    for axis in step * np.eye(3):
        moved = [field(points + (k + 1) * axis) - field(points - (k + 1) * axis) for k in range(4)]
        columns.append(sum(weight * slope for weight, slope in zip(_CENTRAL, moved, strict=True)) / step)
    return np.stack(columns, axis=-1)


def relative(value: Floats, truth: Floats) -> Floats:
    """|value − truth| over |truth| (Frobenius) at every point."""
    axes = tuple(range(1, truth.ndim))
    return np.sqrt(((value - truth) ** 2).sum(axes) / (truth**2).sum(axes))


def errors(jet: Jet, truth: Jet) -> Floats:
    """Largest relative error of every part of a jet."""
    return np.array([relative(ours, theirs).max() for ours, theirs in zip(jet, truth, strict=True)])


def scattered(seed: int, count: int, nearest: float, farthest: float) -> Points:
    """Random directions (count, 3), distances `nearest` to `farthest`, evenly in their logarithm."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * np.exp(rng.uniform(np.log(nearest), np.log(farthest), (count, 1)))


def cylindrical(rho: Floats | float, z: Floats | float, azimuth: Floats | float = 0.7) -> Points:
    """Points (n, 3) from cylindrical coordinates."""
    rho, z, azimuth = np.broadcast_arrays(rho, z, azimuth)
    return np.stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z], axis=-1).reshape(-1, 3)


def assert_harmonic(field: Callable[[Points], Floats], points: Points, step: float, tolerance: float) -> None:
    """B has neither divergence nor curl, by differences of B: it does not matter how derivatives are stored."""
    slopes = differences(field, points, step)
    size = np.linalg.norm(slopes, axis=(1, 2))
    assert np.all(np.abs(np.trace(slopes, axis1=1, axis2=2)) < tolerance * size)
    assert np.all(np.linalg.norm(slopes - np.swapaxes(slopes, 1, 2), axis=(1, 2)) < tolerance * size)


def sphere(nodes: int) -> tuple[Points, Floats]:
    """A product rule on the unit sphere, exact for harmonics below degree 2·nodes: points (n, 3) and weights (n,)."""
    height, weight = np.polynomial.legendre.leggauss(nodes)
    phi = np.arange(2 * nodes) * np.pi / nodes
    rho = np.sqrt(1 - height**2)[:, None]
    points = np.stack(np.broadcast_arrays(rho * np.cos(phi), rho * np.sin(phi), height[:, None]), axis=-1)
    return points.reshape(-1, 3), np.repeat(weight * np.pi / nodes, 2 * nodes)
