"""From permanent magnets to their solution: mesh, potential, bound currents."""

from __future__ import annotations

import logging
import time
from dataclasses import asdict

import numpy as np

from magfem.constants import MU_0
from magfem.fem import axisymmetric, scalar_potential
from magfem.fem.discrete import Discrete
from magfem.fem.refinement import peak_bytes, refine
from magfem.fem.solution import Solution
from magfem.geometry import Magnets
from magfem.mesh.generate import generate
from magfem.mesh.quality import quality
from magfem.typing import Jet, Points

log = logging.getLogger("magfem")

RESOLUTIONS = {2: (0.25, 8.0), 3: (0.5, 4.0)}
"""Smallest and largest resolution by dimension: below, walls are not resolved; above, memory runs out."""

_STATED = {2: 1.0, 3: 1.6}
"""Stated error over the difference between solutions on elements of full and of twice the size, by dimension.

With errors that fall with order p the finer one's is the difference over 2^p − 1: all of it in 3D, where the limits on
coarse elements leave p at about 1 below resolution 1, a third or less in 2D. What is more covers what the worst point
does from one unstructured mesh to the next; docs/accuracy.md shows the ladder of resolutions that these factors are
honest on.
"""
_ROUNDING = 1e-11  # nothing is stated to be better than this


def solve_magnets(geometry: Magnets, dimension: int, resolution: float, tolerance: float | None) -> Solution:
    """Solve permanent magnets: see `magfem.solve`."""
    started = time.perf_counter()

    def stated(difference: float, discrete: Discrete) -> float:
        # The field is proportional to the volume, which no difference of `jet` shows: twice its error is added.
        return max(_STATED[dimension] * difference + 2 * _misshape(geometry, discrete), _ROUNDING)

    def jet(discrete: Discrete, points: Points) -> Jet:
        # As if the meshes had the bodies' volume: between two of them their shapes' errors come out at any ratio.
        share = sum(body.volume for body in geometry.bodies) / discrete.volume.sum()
        return tuple(values * share for values in discrete.currents.jet(points, 1))

    refined = refine(
        solve=lambda fineness: solve_once(geometry, dimension, fineness),
        jet=jet,
        stated=stated,
        region=geometry.region,
        resolution=resolution,
        tolerance=tolerance,
        finest=RESOLUTIONS[dimension][1],
    )
    fine, error = refined.solved, refined.error
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
            "quality": asdict(quality(fine.mesh)),
            "seconds": time.perf_counter() - started,
            "peak_bytes": peak_bytes(),
        },
        settings={"dimension": dimension, "resolution": float(refined.resolution)},
    )


def solve_once(geometry: Magnets, dimension: int, resolution: float) -> Discrete:
    """One mesh, one solve."""
    mesh = generate(geometry, dimension, resolution)
    bodies = {body.name: body for body in geometry.bodies}
    ordered = [bodies[name] for name in mesh.names]
    permeability = np.array([body.material.recoil_permeability for body in ordered])
    magnetisation = np.array([body.material.remanence_vector for body in ordered]) / MU_0
    formulation = scalar_potential if dimension == 3 else axisymmetric
    discrete: Discrete = formulation.solve(mesh, permeability, magnetisation)
    log.info("solved: %d unknowns, %d iterations", discrete.unknowns, discrete.iterations)
    return discrete


def _misshape(geometry: Magnets, discrete: Discrete) -> float:
    """By how much, relatively, the worst meshed body's volume differs from its closed form."""
    expected = {body.name: body.volume for body in geometry.bodies}
    pairs = zip(discrete.mesh.names, discrete.volume, strict=True)
    return max(abs(float(volume) / expected[name] - 1.0) for name, volume in pairs)
