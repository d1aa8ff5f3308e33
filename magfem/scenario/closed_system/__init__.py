"""The closed system of the dissertation's 6.1.5: a motor in a tube network, localized and steered by one arm."""

from magfem.scenario.closed_system.recipe import load_closed_system, read_closed_system
from magfem.scenario.closed_system.record import ClosedRun
from magfem.scenario.closed_system.run import simulate_closed_system

__all__ = ["ClosedRun", "load_closed_system", "read_closed_system", "simulate_closed_system"]
