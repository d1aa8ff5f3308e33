"""Inductance of coils from edge elements on three meshes, extrapolated to elements of no size."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.optimize import brentq

from magfem.errors import InputError
from magfem.fem.edge_elements import EdgeSolution, ribbon_loads, solve, winding_loads
from magfem.geometry import CircuitPart, CoaxialWinding, Coil, FoilTrack
from magfem.mesh.coil_in_air import (
    Ribbon,
    Winding,
    ribbon_widths,
    ribbons_in_air,
    windings_in_air,
    windings_size,
)
from magfem.typing import Floats, Integers
from magfem.units import quoted

log = logging.getLogger("magfem")

ORDER = 2.0
"""The energy of lowest-order edge elements errs by the square of the field's error, which is of first order.

Along the edges of a sheet the field grows like the logarithm of the distance, and the error like h² log(w/h) for
strips of width w: with one to three elements across that looks like an order of 1.2 to 1.4, and is fitted.
"""

_WINDING_SIZES = (2.0, 2**0.5, 1.0)  # over the finest
_RIBBON_ELEMENTS = (1, 2, 3)  # across a strip


@dataclass(frozen=True)
class EdgeInductance:
    """Inductance matrix (c, c) H of circuits, extrapolated from three meshes.

    From windings with the expected order 2, from ribbons with the one that the trace of the three matrices shows,
    between 1 and 2.
    error: (c, c) H, an estimate: the largest of a quarter of the extrapolation's step, what the coarsest mesh
    changes in it (windings) and what order 2 would (ribbons).
    order: (c, c), as the three meshes show it; NaN where their values do not approach a limit.
    values: (3, c, c) H on each mesh, coarsest first.  sizes: (3,) m.  edges, iterations: (3,).  seconds: of all.
    """

    inductance: Floats
    error: Floats
    order: Floats
    values: Floats
    sizes: Floats
    edges: Integers
    iterations: Integers
    seconds: float


def inductance_by_edge_elements(
    circuits: Sequence[Sequence[Winding]] | Sequence[Sequence[Ribbon]], resolution: float = 1.0
) -> EdgeInductance:
    """Inductance matrix of circuits, each a sequence of coaxial windings, or each of closed ribbons, in series.

    `resolution` 2 halves the elements of windings; ribbons have 1, 2 and 3 elements across, times `resolution`.
    Raises InputError for what cannot be meshed within memory, MeshError, ConvergenceError.
    """
    parts = [part for circuit in circuits for part in circuit]
    if not parts or not all(len(circuit) for circuit in circuits):
        raise InputError("inductance by edge elements: every circuit needs at least one winding or ribbon")
    if not resolution > 0:
        raise InputError(f"inductance by edge elements: resolution must be positive, got {resolution:g}")
    solid = [isinstance(part, Winding) for part in parts]
    if any(solid) and not all(solid):
        raise InputError("inductance by edge elements: windings and ribbons cannot be meshed together")
    start = time.perf_counter()
    if all(solid):
        solids = cast(Sequence[Sequence[Winding]], circuits)
        finest = windings_size(solids) / resolution
        levels = [_of_windings(solids, finest * factor) for factor in _WINDING_SIZES]
    else:
        ribbons = cast(Sequence[Sequence[Ribbon]], circuits)
        widest = max(float(ribbon_widths(ribbon).max()) for circuit in ribbons for ribbon in circuit)
        across = [max(1, round(count * resolution)) for count in _RIBBON_ELEMENTS]
        if len(set(across)) < len(across):
            raise InputError(
                f"inductance by edge elements: resolution must be at least 1 for ribbons, got {resolution:g}"
            )
        levels = [_of_ribbons(ribbons, count, widest / count) for count in across]
    values, sizes, edges, iterations = (np.array(column) for column in zip(*levels, strict=True))
    if all(solid):
        inductance, error = extrapolate(values, sizes)
    else:
        seen = observed_order(np.trace(values, axis1=1, axis2=2), sizes)
        inductance, _ = extrapolate(values, sizes, ORDER if np.isnan(seen) else float(np.clip(seen, 1.0, ORDER)))
        step = np.abs(inductance - values[2]) / 4
        error = np.maximum(np.abs(inductance - extrapolate(values, sizes)[0]), step)
    order = np.vectorize(observed_order, signature="(n),(n)->()")(np.moveaxis(values, 0, -1), sizes)
    return EdgeInductance(inductance, error, order, values, sizes, edges, iterations, time.perf_counter() - start)


def inductance_of_coil(coil: Coil, circuits: Sequence[str] | None = None, resolution: float = 1.0) -> EdgeInductance:
    """Inductance matrix of a coil's circuits (None: all), by edge elements: the route that `solve` does not take.

    Foil counts as a sheet without thickness. Raises InputError for coils that are neither all of foil nor all of
    coaxial windings, and as `inductance_by_edge_elements`.
    """
    known = {circuit.name: circuit for circuit in coil.circuits}
    for name in circuits or ():
        if name not in known:
            raise InputError(f"{coil.name} has no circuit {quoted(name)}; it has {', '.join(map(quoted, known))}")
    chosen = [known[name] for name in circuits or known]
    parts = [part for circuit in chosen for part in circuit.parts]
    if all(isinstance(part, CoaxialWinding) for part in parts):
        return inductance_by_edge_elements(
            [[_winding(part) for part in circuit.parts] for circuit in chosen], resolution
        )
    if not all(isinstance(part, FoilTrack) for part in parts):
        raise InputError(f"{coil.name}: edge elements serve coils of foil and coils of coaxial windings only")
    return inductance_by_edge_elements([[_ribbon(part) for part in circuit.parts] for circuit in chosen], resolution)


def _winding(part: CircuitPart) -> Winding:
    assert isinstance(part, CoaxialWinding)
    return Winding(part.inner_radius, part.outer_radius, part.length, part.turns, part.centre)


def _ribbon(part: CircuitPart) -> Ribbon:
    assert isinstance(part, FoilTrack)
    stations = part.stations(1.0)
    return stations.left, stations.right


Level = tuple[Floats, float, int, int]  # inductance, size, edges, iterations


def _of_windings(circuits: Sequence[Sequence[Winding]], size: float) -> Level:
    mesh = windings_in_air(circuits, size)
    return _level(solve(mesh, winding_loads(mesh, circuits)), size)


def _of_ribbons(circuits: Sequence[Sequence[Ribbon]], across: int, size: float) -> Level:
    mesh = ribbons_in_air(circuits, across)
    return _level(solve(mesh, ribbon_loads(mesh)), size)


def _level(solution: EdgeSolution, size: float) -> Level:
    edges = solution.mesh.edges.shape[0]
    log.info("edge elements: %d edges, %d iterations", edges, solution.iterations)
    return solution.inductance, size, edges, solution.iterations


def extrapolate(values: Floats, sizes: Floats, order: float = ORDER) -> tuple[Floats, Floats]:
    """Limit (...) of values (3, ...) at decreasing element sizes (3,), and an estimate (...) of its error.

    Richardson's: value(h) = limit + c h^order, from the last two; the estimate is the larger of the difference to
    that from the first two and a quarter of the last step.
    """
    powers = sizes**order
    first, last = (
        values[n + 1] + (values[n + 1] - values[n]) * powers[n + 1] / (powers[n] - powers[n + 1]) for n in (0, 1)
    )
    return last, np.maximum(np.abs(last - first), np.abs(last - values[2]) / 4)


def observed_order(values: Floats, sizes: Floats) -> float:
    """The order p for which value(h) = limit + c h^p fits three values (3,) at sizes (3,); NaN where none in 0.1–8."""
    first, last = values[0] - values[1], values[1] - values[2]
    if first * last <= 0:
        return float("nan")

    def mismatch(p: float) -> float:
        h = sizes**p
        return float((h[0] - h[1]) / (h[1] - h[2]) - first / last)

    low, high = 0.1, 8.0
    if mismatch(low) * mismatch(high) > 0:
        return float("nan")
    return float(brentq(mismatch, low, high))
