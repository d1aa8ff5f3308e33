"""Device cards and the devices they describe."""

from magfem.geometry.body import Body
from magfem.geometry.card import CardOrigin
from magfem.geometry.cylinder_magnet import CylinderMagnet
from magfem.geometry.geometry import Geometry
from magfem.geometry.load import load_geometry
from magfem.geometry.material import AXIAL, DIAMETRIC, PermanentMagnet
from magfem.geometry.ring_magnet import RingMagnet

__all__ = [
    "AXIAL",
    "DIAMETRIC",
    "Body",
    "CardOrigin",
    "CylinderMagnet",
    "Geometry",
    "PermanentMagnet",
    "RingMagnet",
    "load_geometry",
]
