"""Studies of localization: the dissertation's figures of ch. 6 remade as simulation, its numbers beside ours."""

from magfem.scenario.localization_study.recipe import load_study
from magfem.scenario.localization_study.study import Comparison, Study

__all__ = ["Comparison", "Study", "load_study"]
