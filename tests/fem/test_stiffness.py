"""Our assembly against stock scikit-fem, element for element."""

from __future__ import annotations

import numpy as np
import pytest
import skfem

from magfem.errors import MeshError
from magfem.fem.stiffness import _CURVED_ORDER, assemble, reference_forms
from magfem.mesh.generate import generate
from magfem.mesh.mesh import Mesh


@pytest.fixture(scope="module")
def mesh(ring):
    return generate(ring, 3, 0.5)


def scikit_basis(mesh: Mesh):
    """The same curved tetrahedra in scikit-fem, and our node number of each of its unknowns."""
    corners, numbered = np.unique(mesh.cells[:, :4], return_inverse=True)
    cells = np.ascontiguousarray(numbered.reshape(-1, 4).T)
    linear = skfem.MeshTet1(np.ascontiguousarray(mesh.points[corners].T), cells, sort_t=False)
    edges = {tuple(ends): index for index, ends in enumerate(np.sort(linear.edges, axis=0).T.tolist())}
    middle = np.empty(linear.nedges, dtype=int)
    for column, (i, j) in enumerate(((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))):
        ends = np.sort(cells[[i, j]], axis=0).T.tolist()
        middle[[edges[tuple(pair)] for pair in ends]] = mesh.cells[:, 4 + column]
    order = np.concatenate([corners, middle])
    curved = skfem.MeshTet2(np.ascontiguousarray(mesh.points[order].T), cells)
    return skfem.Basis(curved, skfem.ElementTetP2(), intorder=_CURVED_ORDER), order


def test_own_assembly_equals_stock_scikit_fem(mesh):
    rng = np.random.default_rng(0)
    permeability = 1 + rng.random(mesh.cells.shape[0])
    magnetisation = rng.normal(size=(mesh.cells.shape[0], 3))
    ours, load, volume = assemble(mesh, permeability, magnetisation)
    basis, order = scikit_basis(mesh)
    constant = basis.with_element(skfem.ElementTetP0())
    vector = basis.with_element(skfem.ElementVector(skfem.ElementTetP0()))
    energy, remanence = reference_forms()
    stock = energy.assemble(basis, mu=constant.interpolate(permeability))
    stock_load = remanence.assemble(basis, m=vector.interpolate(magnetisation.ravel()))
    dofs = np.concatenate([basis.nodal_dofs[0], basis.edge_dofs[0]])
    place = np.empty(order.size, dtype=int)
    place[order] = dofs
    difference = ours - stock[place][:, place]
    assert abs(difference).max() <= 1e-12 * abs(ours).max()
    assert np.abs(load - stock_load[place]).max() <= 1e-12 * np.abs(load).max()
    assert volume.sum() == pytest.approx(basis.dx.sum(), rel=1e-12, abs=0)


def test_constants_have_no_energy_and_linears_the_volume(mesh):
    one = np.ones(mesh.cells.shape[0])
    stiffness, _, volume = assemble(mesh, one, np.zeros((one.size, 3)))
    x = mesh.points[:, 0]
    assert np.abs(stiffness @ np.ones(x.size)).max() <= 1e-10 * abs(stiffness).max()
    assert x @ stiffness @ x == pytest.approx(volume.sum(), rel=1e-10, abs=0)  # ∫|∇x|² = ∫1


def test_inverted_elements_are_refused(mesh):
    cells = mesh.cells.copy()
    cells[0, [0, 1]] = cells[0, [1, 0]]
    broken = Mesh(mesh.points, cells, mesh.body, mesh.names, mesh.radius)
    one = np.ones(cells.shape[0])
    with pytest.raises(MeshError, match="inside out"):
        assemble(broken, one, np.zeros((one.size, 3)))
