"""From a geometry to its solution: mesh, solve, and the error statement that comes with it."""

from __future__ import annotations

import logging
import resource
import sys
import time
from numbers import Integral, Real

import numpy as np

from magfem.constants import MU_0
from magfem.errors import ConvergenceError, InputError
from magfem.fem import axisymmetric, scalar_potential
from magfem.fem.discrete import Discrete
from magfem.fem.solution import Solution
from magfem.fields.norms import relative_errors
from magfem.geometry import Geometry, check_device
from magfem.mesh.generate import generate
from magfem.mesh.mesh import check_volumes
from magfem.typing import Floats, Points
from magfem.units import describe

log = logging.getLogger("magfem")

RESOLUTIONS = {2: (0.25, 8.0), 3: (0.5, 4.0)}
"""Smallest and largest resolution by dimension: below, walls are not resolved; above, memory runs out."""

_STATED = {2: 1.0, 3: 1.8}
"""Stated error over the difference between solutions on elements of full and of twice the size, by dimension.

With errors that fall with order p the finer one's is the difference over 2^p − 1: all of it in 3D, where rims
limit p to about 1, a third or less in 2D. What is more covers what the worst point does from one unstructured mesh
to the next; docs/accuracy.md shows the ladder of resolutions that these factors are honest on.
"""
_ROUNDING = 1e-11  # nothing is stated to be better than this


def solve(
    geometry: Geometry, dimension: int | None = None, resolution: float = 1.0, tolerance: float | None = None
) -> Solution:
    """Solve a device by finite elements.

    dimension: 3, or 2 for bodies of revolution with axial magnetisation (None: 2 wherever possible).
    resolution: factor on the fineness of the mesh; doubling it halves every element.
    tolerance: relative; refines from `resolution` until the stated error of B is below it.

    The stated error compares with a second solution on elements twice as large, over random points of the
    device's region. Raises InputError for what cannot be solved, MeshError and ConvergenceError.
    """
    check_device(geometry, "solve")
    dimension = choose_dimension(geometry, dimension)
    check_resolution(resolution, dimension)
    if tolerance is not None and not (is_number(tolerance) and 0 < tolerance < 1):
        raise InputError(f"tolerance must be a relative error between 0 and 1, got {describe(tolerance)}")
    started = time.perf_counter()
    layers = geometry.region.layers(np.random.default_rng(0), layers=32, per_layer=40)
    points = layers.reshape(-1, 3)
    coarse = None
    while True:
        fine = _discrete(geometry, dimension, resolution)  # first, so that a mesh that does not fit is refused at once
        jet = _jet(fine, points)
        if coarse is None:
            coarse = _jet(_discrete(geometry, dimension, resolution / 2), points)
        error = _stated_error(coarse, jet, layers, dimension, _misshape(geometry, fine))
        log.info("solution: %d unknowns, stated error %.1e in B, %.1e in the gradient", fine.unknowns, *error)
        if tolerance is None or error[0] <= tolerance:
            break
        if 2 * resolution > RESOLUTIONS[dimension][1]:
            raise ConvergenceError(
                f"the stated error of B is {error[0]:.1e} at resolution {resolution:g}, the finest that fits; "
                f"a tolerance of {tolerance:g} is out of reach"
            )
        resolution, coarse = 2 * resolution, jet
    return Solution(
        geometry=geometry,
        currents=fine.currents,
        mesh=fine.mesh,
        potential=fine.potential,
        flux_density=fine.flux_density,
        error={"B": error[0], "gradient": error[1], "region": geometry.region.describe()},
        quantities=fine.quantities,
        stats={
            "unknowns": fine.unknowns,
            "cells": int(fine.mesh.cells.shape[0]),
            "iterations": fine.iterations,
            "residual": fine.residual,
            "seconds": time.perf_counter() - started,
            "peak_bytes": _peak_bytes(),
        },
        settings={"dimension": dimension, "resolution": float(resolution)},
    )


def choose_dimension(geometry: Geometry, dimension: int | None) -> int:
    """The dimension that `solve` takes; InputError for one that the device cannot be solved in."""
    if dimension is None:
        return 2 if geometry.axisymmetric else 3
    if not isinstance(dimension, Integral) or dimension not in (2, 3):
        raise InputError(f"dimension must be 2 or 3, got {describe(dimension)}")
    if dimension == 2 and not geometry.axisymmetric:
        raise InputError("only bodies of revolution with axial magnetisation can be solved in dimension 2: use 3")
    return int(dimension)


def check_resolution(resolution: float, dimension: int) -> None:
    """Raise InputError unless `resolution` lies in RESOLUTIONS."""
    low, high = RESOLUTIONS[dimension]
    if not (is_number(resolution) and low <= resolution <= high):
        raise InputError(
            f"resolution must lie between {low:g} and {high:g} in dimension {dimension}, got {describe(resolution)}"
        )


def is_number(value: object) -> bool:
    """Whether a value is a real number, NumPy's included."""
    return isinstance(value, Real) and not isinstance(value, bool)


def _discrete(geometry: Geometry, dimension: int, resolution: float) -> Discrete:
    """One mesh, one solve."""
    mesh = generate(geometry, dimension, resolution)
    bodies = {body.name: body for body in geometry.bodies}
    ordered = [bodies[name] for name in mesh.names]
    permeability = np.array([body.material.recoil_permeability for body in ordered])
    magnetisation = np.array([body.material.remanence_vector for body in ordered]) / MU_0
    formulation = scalar_potential if dimension == 3 else axisymmetric
    discrete: Discrete = formulation.solve(mesh, permeability, magnetisation)
    expected = np.array([body.volume for body in ordered])
    check_volumes(discrete.volume, expected, mesh.names, tolerance=1e-3)
    return discrete


def _jet(discrete: Discrete, points: Points) -> tuple[Floats, Floats]:
    B, gradient = discrete.currents.jet(points, 1)
    return B, gradient


def _misshape(geometry: Geometry, discrete: Discrete) -> float:
    """By how much, relatively, the worst meshed body's volume differs from its closed form."""
    expected = {body.name: body.volume for body in geometry.bodies}
    pairs = zip(discrete.mesh.names, discrete.volume, strict=True)
    return max(abs(float(volume) / expected[name] - 1.0) for name, volume in pairs)


def _stated_error(
    coarse: tuple[Floats, Floats],
    fine: tuple[Floats, Floats],
    layers: Points,
    dimension: int,
    misshape: float,
) -> tuple[float, float]:
    """Stated errors of B and of the gradient, from solutions on elements of twice the size and of full size.

    The field is proportional to the magnet's volume, and tightly curved walls may be meshed alike in both, so
    that twice the volume's error is added.
    """
    stated = []
    for before, after in zip(coarse, fine, strict=True):
        shape = (*layers.shape[:2], *after.shape[1:])
        worst = float(relative_errors(before.reshape(shape), after.reshape(shape)).max())
        stated.append(max(_STATED[dimension] * worst + 2 * misshape, _ROUNDING))
    return stated[0], stated[1]


def _peak_bytes() -> int:
    """Peak memory of this process."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)
