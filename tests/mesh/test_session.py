"""Gmsh's one state, shared with other threads and with the caller's own use of it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import gmsh
import numpy as np
import pytest

from magfem.errors import MeshError
from magfem.geometry import load_geometry
from magfem.mesh import session
from magfem.mesh.generate import generate
from magfem.mesh.session import gmsh_session


@pytest.fixture(scope="module")
def ring():
    return load_geometry("ring_magnet_4x1.5x1")


@pytest.fixture
def own_session():
    """A caller's session with a model in it."""
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.option.setNumber("Mesh.Algorithm3D", 4)
    gmsh.model.add("mine")
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    yield
    gmsh.finalize()


def state():
    """What a caller sees of Gmsh."""
    options = {option: gmsh.option.getNumber(option) for option in session._CHANGED}
    return gmsh.model.list(), gmsh.model.getCurrent(), gmsh.model.getEntities(), options


def test_threads_take_turns(ring):
    alone = generate(ring, 2, 0.5)
    with ThreadPoolExecutor(3) as pool:
        meshes = list(pool.map(lambda _: generate(ring, 2, 0.5), range(3)))
    for mesh in meshes:
        assert np.array_equal(mesh.points, alone.points) and np.array_equal(mesh.cells, alone.cells)
    assert not gmsh.isInitialized()


@pytest.mark.parametrize("dimension", [2, 3])
def test_callers_session_is_as_before(ring, dimension, own_session):
    before = state()
    mesh = generate(ring, dimension, 0.5)
    assert gmsh.isInitialized() and state() == before
    assert len(mesh.cells) > 100


def test_callers_session_survives_a_failure(own_session):
    before = state()
    with pytest.raises(MeshError, match="Gmsh could not mesh the geometry"), gmsh_session() as inner:
        inner.model.occ.addSphere(0, 0, 0, -1)
    assert state() == before


def test_callers_fresh_session_stays_usable(ring):
    gmsh.initialize(interruptible=False)
    try:
        before = state()
        generate(ring, 2, 0.5)
        assert state() == before
    finally:
        gmsh.finalize()


def test_same_mesh_in_a_callers_session(ring, own_session):
    inside = generate(ring, 2, 0.5)
    gmsh.finalize()
    outside = generate(ring, 2, 0.5)
    gmsh.initialize(interruptible=False)  # for the fixture to close
    assert np.array_equal(inside.points, outside.points) and np.array_equal(inside.cells, outside.cells)


def test_a_failure_closes_the_session():
    with pytest.raises(MeshError, match="Gmsh could not mesh the geometry"), gmsh_session() as inner:
        inner.model.occ.addSphere(0, 0, 0, -1)
    assert not gmsh.isInitialized()
    with pytest.raises(ZeroDivisionError), gmsh_session():
        _ = 1 / 0
    assert not gmsh.isInitialized()
