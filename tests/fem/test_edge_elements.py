"""The vector potential in edge elements, against stock scikit-fem, closed forms and Biot–Savart's law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j1

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fem.edge_elements import auxiliary_space, shape_curls, solve, stiffness, winding_loads
from magfem.fem.edge_inductance import extrapolate, inductance_by_edge_elements, observed_order
from magfem.mesh.coil_in_air import AirMesh, Winding, windings_in_air
from magfem.typing import Floats

SOLENOID = Winding(10e-3, 15e-3, 30e-3, 1000)
INNER = Winding(4e-3, 7e-3, 12e-3, 300, centre=10e-3)


def mutual_inductance(a: Winding, b: Winding) -> float:
    """By Hankel's transform of a loop's potential, A_φ = µ₀ a I/2 ∫ J₁(ka) J₁(kr) e^{−k|z|} dk, over both sections."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    panels = np.linspace(0.0, 2e4, 1500)
    half = np.diff(panels)[:, None] / 2
    k, w = ((panels[:-1, None] + half) + half * nodes).ravel(), (half * weights).ravel()

    def radial(winding: Winding) -> Floats:
        x, v = np.polynomial.legendre.leggauss(60)
        middle, span = (winding.outer_radius + winding.inner_radius) / 2, winding.outer_radius - winding.inner_radius
        r = middle + span / 2 * x
        return np.asarray((r * j1(np.outer(k, r))) @ (v / 2))  # mean over the thickness

    def twice(z: float) -> Floats:
        """Second antiderivative of e^{−k|z|} in z."""
        return np.asarray((np.exp(-k * abs(z)) + k * abs(z)) / k**2)

    ends = [(w.centre - w.length / 2, w.centre + w.length / 2) for w in (a, b)]
    axial = sum(
        sign * twice(za - zb)
        for sign, za, zb in (
            (1, ends[0][1], ends[1][0]),
            (1, ends[0][0], ends[1][1]),
            (-1, ends[0][1], ends[1][1]),
            (-1, ends[0][0], ends[1][0]),
        )
    )
    return float(np.pi * MU_0 * a.turns * b.turns * (w * radial(a) * radial(b)) @ axial / (a.length * b.length))


@pytest.fixture(scope="module")
def coarse() -> AirMesh:
    return windings_in_air([[SOLENOID]], 4e-3)


def test_stiffness_equals_the_stock_form(coarse: AirMesh) -> None:
    from skfem import Basis, BilinearForm, ElementTetN0, MeshTet
    from skfem.helpers import curl, dot

    basis = Basis(MeshTet(coarse.points.T, coarse.tetrahedra.T), ElementTetN0(), intorder=1)
    stock = BilinearForm(lambda u, v, w: dot(curl(u), curl(v))).assemble(basis)
    number = basis.edge_dofs[0][np.lexsort(basis.mesh.edges[::-1])]
    assert np.array_equal(np.sort(basis.mesh.edges, axis=0)[:, number].T, coarse.edges)
    difference = stock[number][:, number] - stiffness(coarse, *shape_curls(coarse))
    assert np.abs(difference.data).max(initial=0.0) < 1e-12 * np.abs(stock.data).max()


def test_loads_are_free_of_divergence(coarse: AirMesh) -> None:
    load = winding_loads(coarse, [[SOLENOID]])[0]
    out = np.bincount(coarse.edges.ravel(), (load[:, None] * [-1.0, 1.0]).ravel())
    assert np.abs(out).max() < 1e-12 * np.abs(load).max()


def test_preconditioner_is_symmetric(coarse: AirMesh) -> None:
    from magfem.fem.edge_elements import _laplacian, shape_gradients

    matrix = stiffness(coarse, *shape_curls(coarse))
    cycle = auxiliary_space(coarse, matrix, _laplacian(coarse, *shape_gradients(coarse)))
    u, v = np.random.default_rng(1).standard_normal((2, coarse.edges.shape[0]))
    assert u @ cycle(v) == pytest.approx(v @ cycle(u), rel=1e-9, abs=1e-9 * (u @ cycle(u)))


def test_thick_solenoid_converges_with_order_two() -> None:
    exact = mutual_inductance(SOLENOID, SOLENOID)
    sizes = np.array([2.8e-3, 2e-3, 1.4e-3])
    meshes = [windings_in_air([[SOLENOID]], size) for size in sizes]
    values = np.array([solve(mesh, winding_loads(mesh, [[SOLENOID]])).inductance[0, 0] for mesh in meshes])
    assert (values < exact).all()  # the energy of a conforming element is a lower bound
    slope = np.polyfit(np.log(sizes), np.log(1 - values / exact), 1)[0]
    assert 1.7 < slope < 2.5
    limit, error = extrapolate(values, sizes)
    assert abs(limit - exact) < max(5e-3 * exact, error)


def test_extrapolation_is_exact_for_its_order() -> None:
    sizes = np.array([3.0, 2.0, 1.0])
    values = 7.0 - 0.3 * sizes**2
    limit, error = extrapolate(values, sizes)
    assert limit == pytest.approx(7.0, rel=1e-12)
    assert error == pytest.approx(0.075, rel=1e-9)
    assert observed_order(values, sizes) == pytest.approx(2.0, rel=1e-9)
    assert np.isnan(observed_order(np.array([1.0, 2.0, 1.5]), sizes))


def test_what_cannot_be_meshed_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match="inner_radius must be"):
        Winding(2e-3, 1e-3, 1e-3, 10)
    with pytest.raises(InputError, match="lower the resolution"):
        inductance_by_edge_elements([[SOLENOID]], resolution=20)
    with pytest.raises(InputError, match="at least one winding"):
        inductance_by_edge_elements([[]])
