"""Rods that carry magnets: their shapes in a field, how stable these are, how they are steered and seen."""

from magfem.rod.camera_views import View, fit_centreline_to_views, simulate_views
from magfem.rod.cameras import Camera, Triangulation, triangulate
from magfem.rod.centreline import Centreline
from magfem.rod.centreline_fit import fit_centreline
from magfem.rod.goals import Goal
from magfem.rod.magnet_card import magnet_section
from magfem.rod.magnet_pose import MagnetPoses, magnet_poses
from magfem.rod.planning import plan
from magfem.rod.rod import Rod
from magfem.rod.sections import CrossSection, FlexibleSection, MagnetSection
from magfem.rod.state import RodState
from magfem.rod.steering import Controller, Steering

__all__ = [
    "Camera",
    "Centreline",
    "Controller",
    "CrossSection",
    "FlexibleSection",
    "Goal",
    "MagnetPoses",
    "MagnetSection",
    "Rod",
    "RodState",
    "Steering",
    "Triangulation",
    "View",
    "fit_centreline",
    "fit_centreline_to_views",
    "magnet_poses",
    "magnet_section",
    "plan",
    "simulate_views",
    "triangulate",
]
