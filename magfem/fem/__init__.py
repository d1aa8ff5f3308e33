"""Finite elements: devices to solutions."""

from magfem.fem.coil_solution import CoilSolution, SolvedCircuit
from magfem.fem.drive import TurningField, quadrature
from magfem.fem.edge_inductance import EdgeInductance, inductance_of_coil
from magfem.fem.inductance import flux_linkage
from magfem.fem.solution import Solution, load_solution
from magfem.fem.solve import solve

__all__ = [
    "CoilSolution",
    "EdgeInductance",
    "Solution",
    "SolvedCircuit",
    "TurningField",
    "flux_linkage",
    "inductance_of_coil",
    "load_solution",
    "quadrature",
    "solve",
]
