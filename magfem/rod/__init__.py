"""Rods that carry magnets: how their shapes are seen."""

from magfem.rod.camera_views import View, fit_centreline_to_views, simulate_views
from magfem.rod.cameras import Camera, Triangulation, triangulate
from magfem.rod.centreline import Centreline
from magfem.rod.centreline_fit import fit_centreline
from magfem.rod.magnet_pose import MagnetPoses, magnet_poses
from magfem.rod.shape_sensor import ShapeSensor

__all__ = [
    "Camera",
    "Centreline",
    "MagnetPoses",
    "ShapeSensor",
    "Triangulation",
    "View",
    "fit_centreline",
    "fit_centreline_to_views",
    "magnet_poses",
    "simulate_views",
    "triangulate",
]
