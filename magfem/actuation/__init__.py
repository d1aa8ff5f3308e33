"""Coil systems: fitted coil models in their places, from currents to the field."""

from magfem.actuation.calibration import Calibration, calibrate
from magfem.actuation.coil_system import CoilSystem, SystemCoil, SystemField
from magfem.actuation.inverse import Conditioning, CurrentSolution, conditioning, find_currents
from magfem.actuation.inverse_joints import JointSolution, find_currents_and_joints
from magfem.actuation.joints import Joint
from magfem.actuation.load import load_system
from magfem.actuation.mpem import read_mpem
from magfem.actuation.mpem_export import MpemExport, write_mpem
from magfem.actuation.target import Target
from magfem.actuation.workspace_map import WorkspaceMap, workspace_map
from magfem.actuation.wrench_map import WrenchMap

__all__ = [
    "Calibration",
    "CoilSystem",
    "Conditioning",
    "CurrentSolution",
    "Joint",
    "JointSolution",
    "MpemExport",
    "SystemCoil",
    "SystemField",
    "Target",
    "WorkspaceMap",
    "WrenchMap",
    "calibrate",
    "conditioning",
    "find_currents",
    "find_currents_and_joints",
    "load_system",
    "read_mpem",
    "workspace_map",
    "write_mpem",
]
