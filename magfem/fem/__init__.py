"""Finite-element solutions of devices."""

from magfem.fem.solution import Solution, load_solution
from magfem.fem.solve import solve

__all__ = ["Solution", "load_solution", "solve"]
