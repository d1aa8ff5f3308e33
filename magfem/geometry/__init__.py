"""Device cards and the devices they describe."""

from magfem.geometry.body import Body
from magfem.geometry.card import CardOrigin
from magfem.geometry.circuit import Circuit, CoaxialWinding, FoilTrack, Stations, SweptWinding
from magfem.geometry.conductor import Conductor
from magfem.geometry.cylinder_magnet import CylinderMagnet
from magfem.geometry.device import Device
from magfem.geometry.disc_magnet import DiscMagnet
from magfem.geometry.geometry import Coil, Geometry, Magnets, check_device
from magfem.geometry.load import geometry_from_text, load_geometry
from magfem.geometry.material import AXIAL, DIAMETRIC, PermanentMagnet
from magfem.geometry.ring_magnet import RingMagnet
from magfem.geometry.solenoid import Solenoid
from magfem.geometry.wire import Wire
from magfem.geometry.write import card_text, describe

__all__ = [
    "AXIAL",
    "DIAMETRIC",
    "Body",
    "CardOrigin",
    "Circuit",
    "CoaxialWinding",
    "Coil",
    "Conductor",
    "CylinderMagnet",
    "Device",
    "DiscMagnet",
    "FoilTrack",
    "Geometry",
    "Magnets",
    "PermanentMagnet",
    "RingMagnet",
    "Solenoid",
    "Stations",
    "SweptWinding",
    "Wire",
    "card_text",
    "check_device",
    "describe",
    "geometry_from_text",
    "load_geometry",
]
