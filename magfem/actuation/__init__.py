"""Coil systems: fitted coil models in their places, from currents to the field."""

from magfem.actuation.calibration import Calibration, calibrate
from magfem.actuation.coil_system import CoilSystem, SystemCoil, SystemField
from magfem.actuation.joints import Joint
from magfem.actuation.load import load_system
from magfem.actuation.mpem import read_mpem
from magfem.actuation.mpem_export import MpemExport, write_mpem
from magfem.actuation.wrench_map import WrenchMap

__all__ = [
    "Calibration",
    "CoilSystem",
    "Joint",
    "MpemExport",
    "SystemCoil",
    "SystemField",
    "WrenchMap",
    "calibrate",
    "load_system",
    "read_mpem",
    "write_mpem",
]
