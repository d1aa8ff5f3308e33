"""Device cards and the devices they describe."""

from magfem.geometry.block_magnet import BlockMagnet
from magfem.geometry.body import Body
from magfem.geometry.card import CardOrigin
from magfem.geometry.circuit import Circuit, CircuitPart, CoaxialWinding, FoilTrack, Stations, SweptWinding
from magfem.geometry.coil_array import CoilArray
from magfem.geometry.conductor import Conductor
from magfem.geometry.cylinder_magnet import CylinderMagnet
from magfem.geometry.cylinder_segment_magnet import CylinderSegmentMagnet
from magfem.geometry.device import Device
from magfem.geometry.disc_magnet import DiscMagnet
from magfem.geometry.foil_ribbon import check_ribbon
from magfem.geometry.geometry import Coil, Geometry, Magnets, check_device
from magfem.geometry.grades import GRADES, Grade, grade_rows
from magfem.geometry.halbach_array import HalbachArray
from magfem.geometry.halbach_ring import HalbachRing
from magfem.geometry.helmholtz_pair import HelmholtzPair
from magfem.geometry.load import geometry_from_text, load_geometry
from magfem.geometry.loop_coil import LoopCoil
from magfem.geometry.magnet_assembly import MagnetAssembly, PlacedMagnet
from magfem.geometry.magnet_stack import MagnetStack
from magfem.geometry.magnetic_solids import MagneticSolids
from magfem.geometry.material import AXIAL, DIAMETRIC, PermanentMagnet
from magfem.geometry.meander_coil import MeanderCoil
from magfem.geometry.meshed_magnets import MeshedMagnets
from magfem.geometry.part import Part
from magfem.geometry.planar_spiral_coil import PlanarSpiralCoil
from magfem.geometry.racetrack_coil import RacetrackCoil
from magfem.geometry.rectangular_coil import RectangularCoil
from magfem.geometry.ring_magnet import RingMagnet
from magfem.geometry.saddle_coil import SaddleCoil
from magfem.geometry.solenoid import Solenoid
from magfem.geometry.sphere_magnet import SphereMagnet
from magfem.geometry.stator import Stator
from magfem.geometry.wire import Wire
from magfem.geometry.write import card_text, describe

__all__ = [
    "AXIAL",
    "DIAMETRIC",
    "GRADES",
    "BlockMagnet",
    "Body",
    "CardOrigin",
    "Circuit",
    "CircuitPart",
    "CoaxialWinding",
    "Coil",
    "CoilArray",
    "Conductor",
    "CylinderMagnet",
    "CylinderSegmentMagnet",
    "Device",
    "DiscMagnet",
    "FoilTrack",
    "Geometry",
    "Grade",
    "HalbachArray",
    "HalbachRing",
    "HelmholtzPair",
    "LoopCoil",
    "MagnetAssembly",
    "MagnetStack",
    "MagneticSolids",
    "Magnets",
    "MeanderCoil",
    "MeshedMagnets",
    "Part",
    "PermanentMagnet",
    "PlacedMagnet",
    "PlanarSpiralCoil",
    "RacetrackCoil",
    "RectangularCoil",
    "RingMagnet",
    "SaddleCoil",
    "Solenoid",
    "SphereMagnet",
    "Stations",
    "Stator",
    "SweptWinding",
    "Wire",
    "card_text",
    "check_device",
    "check_ribbon",
    "describe",
    "geometry_from_text",
    "grade_rows",
    "load_geometry",
]
