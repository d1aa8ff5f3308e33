"""Solved devices and independent references, each made once."""

from __future__ import annotations

import numpy as np
import pytest
from references import fourier_rotor

import magfem
from magfem.fem.solution import Solution
from magfem.fem.solve_magnets import solve_once
from magfem.geometry import AXIAL, DIAMETRIC, CylinderMagnet, PermanentMagnet, RingMagnet
from magfem.typing import Floats

RING = {"outer_diameter": 4e-3, "inner_diameter": 1.5e-3, "length": 1e-3, "clearance": 0.5e-3, "extent": 6e-3}
ROTOR = {"diameter": 1e-3, "length": 3e-3, "clearance": 2e-3, "extent": 50e-3}


@pytest.fixture(scope="session")
def ring() -> RingMagnet:
    return RingMagnet(material=PermanentMagnet(1.35, 1.05, AXIAL), **RING)


@pytest.fixture(scope="session")
def rigid_ring() -> RingMagnet:
    return RingMagnet(material=PermanentMagnet(1.35, 1.0, AXIAL), **RING)


@pytest.fixture(scope="session")
def rotor() -> CylinderMagnet:
    return CylinderMagnet(material=PermanentMagnet(1.42, 1.05, DIAMETRIC), **ROTOR)


@pytest.fixture(scope="session")
def rigid_rotor() -> CylinderMagnet:
    return CylinderMagnet(material=PermanentMagnet(1.42, 1.0, DIAMETRIC), **ROTOR)


@pytest.fixture(scope="session")
def ring_2d(ring: RingMagnet) -> Solution:
    return magfem.solve(ring)


@pytest.fixture(scope="session")
def ring_3d(ring: RingMagnet) -> Solution:
    return magfem.solve(ring, dimension=3)


@pytest.fixture(scope="session")
def rotor_3d(rotor: CylinderMagnet) -> Solution:
    return magfem.solve(rotor)


@pytest.fixture(scope="session")
def rigid_ring_2d(rigid_ring: RingMagnet) -> Solution:
    return magfem.solve(rigid_ring)


@pytest.fixture(scope="session")
def rigid_ring_3d(rigid_ring: RingMagnet) -> Solution:
    return magfem.solve(rigid_ring, dimension=3)


@pytest.fixture(scope="session")
def rigid_rotor_3d(rigid_rotor: CylinderMagnet) -> Solution:
    return magfem.solve(rigid_rotor)


@pytest.fixture(scope="session")
def ring_layers(ring: RingMagnet) -> Floats:
    """Points (64, 32, 3) of the ring's region that nothing else uses."""
    return ring.region.layers(np.random.default_rng(2026), layers=64, per_layer=32)


@pytest.fixture(scope="session")
def rotor_layers(rotor: CylinderMagnet) -> Floats:
    return rotor.region.layers(np.random.default_rng(2026), layers=64, per_layer=32)


@pytest.fixture(scope="session")
def ring_truth(ring: RingMagnet, ring_layers: Floats) -> tuple[Floats, Floats]:
    """B and gradient of the ring from 48 000 fourth-order unknowns: converged to 1e-7
    (test_axisymmetric_truth_is_converged), and its moment and energy to the dual formulation's."""
    B, gradient = solve_once(ring, 2, 4.0).currents.jet(ring_layers.reshape(-1, 3), 1)
    return B.reshape(ring_layers.shape), gradient.reshape(*ring_layers.shape, 3)


@pytest.fixture(scope="session")
def rotor_truth(rotor: CylinderMagnet, rotor_layers: Floats) -> tuple[Floats, Floats]:
    """B and gradient of the rotor from its first azimuthal mode on the half plane: converged to 1e-6
    (test_fourier_truth_is_converged)."""
    return fourier_rotor.field(rotor, 2.0, rotor_layers)
