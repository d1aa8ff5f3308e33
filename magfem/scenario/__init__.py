"""Scenarios: a rod, a coil system, a plant that differs from the model, its sensing and what is wanted of it."""

from magfem.scenario.run import Run
from magfem.scenario.scenario import Scenario
from magfem.scenario.scenario_file import load_scenario
from magfem.scenario.simulate import simulate

__all__ = ["Run", "Scenario", "load_scenario", "simulate"]
