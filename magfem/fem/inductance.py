"""Inductances and flux linkages: integrals of a vector potential, or of a flux density, over a circuit's current.

L_ij = ∫ A_i·J_j dV   (both per ampere),        Φ = ∫ A·J dV = ∮ B·dS   per ampere of the circuit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magfem.errors import InputError
from magfem.fem.coil_currents import CoilCurrents
from magfem.fem.coil_solution import CoilSolution, SolvedCircuit
from magfem.fields.coaxial_inductance import CoaxialWinding, mutual_inductance, wire_loop_inductance
from magfem.fields.field import Field
from magfem.typing import Floats

_CONE = np.polynomial.legendre.leggauss(32)


def inductance_matrix(circuits: Sequence[CoilCurrents]) -> Floats:
    """Self- and mutual inductances (c, c) H. Symmetric; the mean of both directions where they are computed apart."""
    count = len(circuits)
    matrix = np.zeros((count, count))
    for j, driven in enumerate(circuits):
        places, strengths = driven.elements()
        for i, source in enumerate(circuits):
            if _coaxial(source) and _coaxial(driven):
                matrix[i, j] = _windings(source.windings, driven.windings)
            else:
                matrix[i, j] = float((source.vector_potential(places) * strengths).sum())
        matrix[j, j] -= driven.excess
    return 0.5 * (matrix + matrix.T)


def _coaxial(currents: CoilCurrents) -> bool:
    return not (currents.within.count or currents.filaments.current.size)


def _windings(first: Floats, second: Floats) -> float:
    """Of circuits that consist of coaxial windings only."""
    total = 0.0
    for a in first:
        for b in second:
            if a[0] == a[1] and a[2] == 0 and (a[:4] == b[:4]).all():  # a loop and itself
                total += a[4] * b[4] * wire_loop_inductance(float(a[0]), float(a[5]))
            else:
                total += mutual_inductance(_winding(a), _winding(b))
    return total


def _winding(row: Floats) -> CoaxialWinding:
    inner, outer, length, centre, turns, _ = (float(value) for value in row)
    return CoaxialWinding(inner, outer, length, turns, centre)


def flux_linkage(coil: CoilSolution, field: Field, apex: Floats | None = None) -> Floats:
    """Flux (c,) Wb that a field in T, of a magnet or of another coil, sends through every circuit of a coil.

    The surface is the cone of every current line over one point, `apex` (3,) m (None: the circuit's centroid), so
    that only B is needed; the field must hold on it and be free of divergence: inside a magnet as well. Positive along
    the circuit's moment. Raises OutsideRegionError where the field does not hold, InputError for a field in T/A.
    """
    if field.unit != "T":
        raise InputError("flux_linkage takes a field in T: multiply a coil's field by its current in A")
    return np.array([_flux(circuit, field, apex) for circuit in coil.circuits])


def _flux(circuit: SolvedCircuit, field: Field, apex: Floats | None) -> float:
    """∫₀¹ λ dλ Σ B(c + λ (x − c))·((x − c) × K dS): the cones' triangles, whose sides are x − c and K dS."""
    places, strengths = circuit.currents.elements()
    size = np.linalg.norm(strengths, axis=1)
    centre = (size @ places) / size.sum() if apex is None else np.asarray(apex, dtype=float)
    reach = places - centre
    area = np.cross(reach, strengths)
    total = 0.0
    for node, weight in zip(*_CONE, strict=True):
        share = 0.5 * (1 + node)
        total += 0.5 * weight * share * float((field.B(centre + share * reach) * area).sum())
    return total
