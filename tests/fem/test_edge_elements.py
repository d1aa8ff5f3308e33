"""The vector potential in edge elements, against stock scikit-fem, closed forms and Biot–Savart's law."""

from __future__ import annotations

import numpy as np
import pytest
from fem.ribbons import band, spiral
from scipy.special import ellipe, ellipk, j1

from magfem.constants import MU_0
from magfem.errors import InputError
from magfem.fem.edge_elements import auxiliary_space, ribbon_loads, shape_curls, solve, stiffness, winding_loads
from magfem.fem.edge_inductance import extrapolate, inductance_by_edge_elements, observed_order
from magfem.mesh.coil_in_air import AirMesh, Ribbon, Winding, ribbons_in_air, windings_in_air
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
    sizes = np.array([2.8e-3, 2.2e-3, 1.7e-3])
    meshes = [windings_in_air([[SOLENOID]], size) for size in sizes]
    values = np.array([solve(mesh, winding_loads(mesh, [[SOLENOID]])).inductance[0, 0] for mesh in meshes])
    assert (values < exact).all()  # the energy of a conforming element is a lower bound
    slope = np.polyfit(np.log(sizes), np.log(1 - values / exact), 1)[0]
    assert 1.7 < slope < 2.5
    limit, error = extrapolate(values, sizes)
    assert abs(limit - exact) < max(5e-3 * exact, error)


def test_mutual_inductance_of_windings() -> None:
    circuits = [[SOLENOID], [INNER]]
    exact = np.array([[mutual_inductance(a, b) for (b,) in circuits] for (a,) in circuits])
    sizes = np.array([2.2e-3, 1.6e-3])
    solutions = [solve(m, winding_loads(m, circuits)) for m in (windings_in_air(circuits, size) for size in sizes)]
    (coarse, fine), (p, q) = (solution.inductance for solution in solutions), sizes**2
    assert fine + (fine - coarse) * q / (p - q) == pytest.approx(exact, rel=0.02)
    last = solutions[1]
    B, volume = last.flux_density(), shape_curls(last.mesh)[1]
    inside = np.einsum("cei,dei,e->cd", B, B, volume) / MU_0
    rest = np.diag(fine - inside)  # the energy of the field outside the sphere
    assert (rest > 0).all() and (rest < 0.05 * np.diag(fine)).all()
    assert last.energy(np.array([2.0, 0.0])) == pytest.approx(2 * fine[0, 0], rel=1e-12)


def test_outer_sphere_hardly_matters() -> None:
    near, far = (windings_in_air([[SOLENOID]], 2.8e-3, ball) for ball in (1.7, 3.4))
    a, b = (solve(mesh, winding_loads(mesh, [[SOLENOID]])).inductance[0, 0] for mesh in (near, far))
    assert a == pytest.approx(b, rel=4e-3)


def test_band_converges_to_nagaokas_current_sheet() -> None:
    radius = width = 1e-3
    m = 4 * radius**2 / (4 * radius**2 + width**2)  # Lorenz's closed form of Nagaoka's coefficient
    k = np.sqrt(m)
    factor = 4 / (3 * np.pi * np.sqrt(1 - m)) * ((1 - m) / m * ellipk(m) - (1 - 2 * m) / m * ellipe(m) - k)
    exact = MU_0 * np.pi * radius**2 / width * factor
    across = np.array([2, 3, 4])
    values = []
    for count in across:
        mesh = ribbons_in_air([[band(radius, width)]], int(count))
        values.append(solve(mesh, ribbon_loads(mesh)).inductance[0, 0])
    shortfall = 1 - np.array(values) / exact
    assert (shortfall > 0).all()
    assert 1.2 < -np.polyfit(np.log(across), np.log(shortfall), 1)[0] < 2.2
    limit, _ = extrapolate(np.array(values), 1.0 / across)
    assert limit == pytest.approx(exact, rel=1e-2)


def test_current_of_a_ribbon_is_one_ampere() -> None:
    """Flux through the loops of a closed strip's edges brackets the mean, which is the inductance."""
    mesh = ribbons_in_air([[band(1e-3, 0.5e-3)]], 2)
    solution = solve(mesh, ribbon_loads(mesh))
    triangles, share = mesh.ribbons[0]
    fluxes = []
    for line in (0.0, 0.5, 1.0):
        loop = np.unique(triangles[share == line])
        x, y = mesh.points[loop, 0], mesh.points[loop, 1]
        fluxes.append(solution.flux(loop[np.argsort(np.arctan2(y, x))])[0])
    assert fluxes[0] == pytest.approx(fluxes[2], rel=0.03)
    assert (fluxes[0] + 2 * fluxes[1] + fluxes[2]) / 4 == pytest.approx(solution.inductance[0, 0], rel=0.02)


def test_small_spiral_with_return_strip_agrees_with_neumanns_integral() -> None:
    ribbon = spiral(turns=3, per_turn=90)
    found = inductance_by_edge_elements([[ribbon]])
    assert found.inductance[0, 0] == pytest.approx(neumann(ribbon, 1e-4), rel=0.02)
    assert 1.0 < found.order[0, 0] < 2.2


def neumann(ribbon: Ribbon, width: float, count: int = 3) -> float:
    """Neumann's double integral over filaments in the middle of narrower strips, each with the self term of a strip.

    The mean logarithm of the distance between points of a strip is ln w − 3/2; what the filaments make of it
    instead is taken out along the whole length.
    """
    left, right = ribbon
    d = width / count
    shares = (np.arange(count) + 0.5) / count
    lines = [_even(left * (1 - s) + right * s, 3e-5) for s in shares]
    total = 0.0
    for i, a in enumerate(lines):
        steps, middles = np.diff(a, axis=0), (a[1:] + a[:-1]) / 2
        for j, b in enumerate(lines):
            sides = np.diff(b, axis=0)
            length = np.linalg.norm(sides, axis=1)
            to = middles[:, None] - b[None, :-1]
            along = np.einsum("abi,bi->ab", to, sides / length[:, None])
            square = np.maximum(np.einsum("abi,abi->ab", to, to) - along**2, 1e-16)
            off = np.sqrt(square + (d * np.exp(-1.5)) ** 2 * (i == j))
            inner = np.arcsinh((length - along) / off) + np.arcsinh(along / off)
            total += float(np.einsum("ai,bi,ab,b->", steps, sides, inner, 1 / length, optimize=True))
    apart = np.arange(1, count)
    mean = (count * (np.log(d) - 1.5) + 2 * ((count - apart) * np.log(apart * d)).sum()) / count**2
    whole = np.linalg.norm(np.diff(left + right, axis=0), axis=1).sum() / 2
    return float(MU_0 / (4 * np.pi) * (total / count**2 + 2 * whole * (mean - np.log(width) + 1.5)))


def _even(path: Floats, spacing: float) -> Floats:
    """Points on a polygon (k, 3) at most `spacing` apart."""
    step = np.linalg.norm(np.diff(path, axis=0), axis=1)
    parts = [
        np.linspace(p, q, int(np.ceil(s / spacing)), endpoint=False)
        for p, q, s in zip(path, path[1:], step, strict=False)
    ]
    return np.concatenate([*parts, path[-1:]])


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
    left, right = spiral(turns=2)
    with pytest.raises(InputError, match="open"):
        inductance_by_edge_elements([[(left[:-1], right[:-1])]])
    with pytest.raises(InputError, match="edges would be needed"):
        inductance_by_edge_elements([[(left, right)]], resolution=40)
