"""Devices, closed forms, solutions and the models fitted to them, each made once."""

from __future__ import annotations

import magpylib
import numpy as np
import pytest

import magfem
from magfem.closed_form import ExactField
from magfem.fem import Solution
from magfem.fitting import FieldModel
from magfem.geometry import AXIAL, DIAMETRIC, CylinderMagnet, PermanentMagnet, RingMagnet
from magfem.typing import Points

RING = {"outer_diameter": 4e-3, "inner_diameter": 1.5e-3, "length": 1e-3, "clearance": 0.5e-3, "extent": 6e-3}
ROTOR = {"diameter": 1e-3, "length": 3e-3, "clearance": 2e-3, "extent": 50e-3}

# Closed forms, hence recoil permeability 1; `_peer` is the same magnet in magpylib.


@pytest.fixture(scope="session")
def ring() -> RingMagnet:
    return RingMagnet(material=PermanentMagnet(1.35, 1.0, AXIAL), **RING)


@pytest.fixture(scope="session")
def rotor() -> CylinderMagnet:
    return CylinderMagnet(material=PermanentMagnet(1.42, 1.0, DIAMETRIC), **ROTOR)


@pytest.fixture(scope="session")
def skew() -> CylinderMagnet:
    """Compact, magnetised in no special direction."""
    return CylinderMagnet(
        diameter=2e-3, length=2e-3, clearance=2e-3, extent=20e-3, material=PermanentMagnet(1.2, 1.0, (2, -1, 2))
    )


@pytest.fixture(scope="session")
def ring_field(ring: RingMagnet) -> ExactField:
    return magfem.exact(ring)


@pytest.fixture(scope="session")
def rotor_field(rotor: CylinderMagnet) -> ExactField:
    return magfem.exact(rotor)


@pytest.fixture(scope="session")
def skew_field(skew: CylinderMagnet) -> ExactField:
    return magfem.exact(skew)


@pytest.fixture(scope="session")
def ring_model(ring_field: ExactField) -> FieldModel:
    return magfem.fit(ring_field)


@pytest.fixture(scope="session")
def rotor_model(rotor_field: ExactField) -> FieldModel:
    return magfem.fit(rotor_field)


@pytest.fixture(scope="session")
def skew_model(skew_field: ExactField) -> FieldModel:
    return magfem.fit(skew_field)


@pytest.fixture(scope="session")
def ring_peer(ring: RingMagnet) -> magpylib.magnet.CylinderSegment:
    size = (ring.inner_diameter / 2, ring.outer_diameter / 2, ring.length, 0, 360)
    return magpylib.magnet.CylinderSegment(dimension=size, polarization=ring.material.remanence_vector)


@pytest.fixture(scope="session")
def rotor_peer(rotor: CylinderMagnet) -> magpylib.magnet.Cylinder:
    return magpylib.magnet.Cylinder(
        dimension=(rotor.diameter, rotor.length), polarization=rotor.material.remanence_vector
    )


@pytest.fixture(scope="session")
def skew_peer(skew: CylinderMagnet) -> magpylib.magnet.Cylinder:
    return magpylib.magnet.Cylinder(dimension=(skew.diameter, skew.length), polarization=skew.material.remanence_vector)


@pytest.fixture(scope="session")
def ring_points(ring: RingMagnet) -> Points:
    """Points (64, 32, 3) of the ring's region that nothing else uses."""
    return ring.region.layers(np.random.default_rng(2026), layers=64, per_layer=32)


@pytest.fixture(scope="session")
def rotor_points(rotor: CylinderMagnet) -> Points:
    return rotor.region.layers(np.random.default_rng(2026), layers=64, per_layer=32)


@pytest.fixture(scope="session")
def skew_points(skew: CylinderMagnet) -> Points:
    return skew.region.layers(np.random.default_rng(2026), layers=64, per_layer=32)


# Finite elements, with the catalogue's recoil permeability.


@pytest.fixture(scope="session")
def ring_solution() -> Solution:
    return magfem.solve(magfem.load_geometry("ring_magnet_4x1.5x1"))


@pytest.fixture(scope="session")
def rotor_solution() -> Solution:
    return magfem.solve(magfem.load_geometry("rotor_1x3"), resolution=0.5)


@pytest.fixture(scope="session")
def ring_solution_model(ring_solution: Solution) -> FieldModel:
    return magfem.fit(ring_solution)


@pytest.fixture(scope="session")
def rotor_solution_model(rotor_solution: Solution) -> FieldModel:
    return magfem.fit(rotor_solution)
