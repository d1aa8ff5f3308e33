"""Laplace's form on bent lattices against stock scikit-fem, closed forms, and its invariance under bending."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from scipy.spatial.transform import Rotation
from skfem.models.poisson import laplace

from magfem.fem.lattice_form import LatticeForm
from magfem.typing import Floats


def between(ends: Floats) -> Floats:
    """Element ends with the middles between them."""
    marks = np.empty(2 * len(ends) - 1)
    marks[::2], marks[1::2] = ends, 0.5 * (ends[1:] + ends[:-1])
    return marks


MARKS = [
    between(np.array(ends)) for ends in ([0, 0.3, 1.0, 1.2, 2.5, 2.6, 4.0], [-1, -0.8, 0.1, 0.7, 1], [0, 0.2, 0.5, 0.6])
]


def strip(rows: int = 2) -> Floats:
    """An uneven plane lattice, (13, 9, 3); with three `rows` an uneven box, (13, 9, 7, 3)."""
    grid = np.stack(np.meshgrid(*MARKS[:rows], indexing="ij"), axis=-1)
    return np.pad(grid, [(0, 0)] * rows + [(0, 3 - rows)])


def as_lattice(form: LatticeForm) -> Floats:
    """The form's matrix, by the lattice's own numbering."""
    order = form.dof.ravel()
    dense: Floats = form.matrix.toarray()[np.ix_(order, order)]
    return dense


@pytest.mark.parametrize("rows", [2, 3])
def test_form_is_scikit_fems_laplace(rows):
    mesh, element = ((skfem.MeshQuad, skfem.ElementQuad2), (skfem.MeshHex, skfem.ElementHex2))[rows - 2]
    basis = skfem.Basis(mesh.init_tensor(*(marks[::2] for marks in MARKS[:rows])), element())
    stock = laplace.assemble(basis).toarray()
    place = {tuple(np.round(x, 9)): n for n, x in enumerate(basis.doflocs.T)}
    points = strip(rows)
    order = [place[tuple(np.round(x[:rows], 9))] for x in points.reshape(-1, 3)]
    difference = as_lattice(LatticeForm.of(points)) - stock[np.ix_(order, order)]
    assert np.abs(difference).max() < 1e-12 * np.abs(stock).max()


def test_moving_and_folding_change_nothing():
    points = strip()
    flat = as_lattice(LatticeForm.of(points))
    moved = Rotation.from_rotvec([0.3, -1.1, 0.7]).apply(points.reshape(-1, 3)).reshape(points.shape) + 5.0
    # Folded by 70° along the line x = 1.2, where elements end.
    beyond = np.maximum(points[..., 0] - 1.2, 0)
    angle = np.radians(70)
    folded = points + np.stack([beyond * (np.cos(angle) - 1), 0 * beyond, beyond * np.sin(angle)], axis=-1)
    for bent in (moved, folded):
        np.testing.assert_allclose(as_lattice(LatticeForm.of(bent)), flat, rtol=0, atol=1e-12 * np.abs(flat).max())


def test_rolling_changes_less_with_the_fourth_power_of_the_elements():
    """On a true cylinder it would change nothing; parabolas leave it by the fourth power of their angle."""
    changes = []
    for elements in (8, 16):
        x, y = np.meshgrid(np.linspace(0, 2, 2 * elements + 1), np.linspace(0, 1, 2 * elements // 4 + 1), indexing="ij")
        flat = np.stack([x, y, 0 * x], axis=-1)
        rolled = np.stack([np.sin(x), y, 1 - np.cos(x)], axis=-1)
        values = x**2 - x * y + y**2
        energies = [LatticeForm.of(points).energy(values) for points in (flat, rolled)]
        changes.append(np.abs(energies[1] - energies[0]).max() / energies[0].max())
    assert changes[1] < 1e-5
    assert 3.5 < np.log2(changes[0] / changes[1]) < 5.5


def test_size_counts_the_joined_ends_once():
    form = LatticeForm.of(strip())
    assert form.size == 12 * 9
    assert (form.unknown[0] == form.unknown[-1]).all()


def test_energy_of_polynomials_in_closed_form():
    points = strip()
    x, y = points[..., 0], points[..., 1]
    form = LatticeForm.of(points)
    # ∫ |∇(x y + x²)|² = ∫ (y + 2x)² + x² over 4 × [−1, 1]
    exact = 4 * 2 / 3 + 2 * (4 + 1) * 4**3 / 3
    shares = form.energy(x * y + x**2)
    assert shares.shape == (6, 4)
    assert shares.sum() == pytest.approx(exact, rel=1e-12)
    # Element (1, 2): x from 0.3 to 1, y from 0.1 to 0.7; of x alone its area.
    assert form.energy(x)[1, 2] == pytest.approx(0.7 * 0.6, rel=1e-12)


def test_least_energy_of_a_straight_strip_is_linear():
    points = strip()
    form = LatticeForm.of(points)
    across = form.minimum({0.0: form.unknown[:-1, 0], 1.0: form.unknown[:-1, -1]}, jump=0.0)
    np.testing.assert_allclose(across, 0.5 * (1 + points[..., 1]), atol=1e-12)
    along = form.minimum({}, jump=3.0)
    np.testing.assert_allclose(along - along[0, 0], 0.75 * points[..., 0], atol=1e-11)


def ring(around: int, across: int) -> Floats:
    """A flat ring of radii 1 and 3."""
    angle, rho = np.meshgrid(
        np.linspace(0, 2 * np.pi, 2 * around + 1), np.linspace(1, 3, 2 * across + 1), indexing="ij"
    )
    return np.stack([rho * np.cos(angle), rho * np.sin(angle), 0 * rho], axis=-1)


def test_ring_converges_to_its_closed_forms_from_above():
    """Across it 2π/ln(b/a), along it ln(b/a)/2π; energies of quadratic elements fall with order four."""
    excess = []
    for elements in (1, 2, 4):
        form = LatticeForm.of(ring(64, elements))
        across = form.minimum({0.0: form.unknown[:-1, 0], 1.0: form.unknown[:-1, -1]}, jump=0.0)
        along = form.minimum({}, jump=1.0)
        exact = 2 * np.pi / np.log(3)
        excess.append([form.energy(across).sum() / exact - 1, form.energy(along).sum() * exact - 1])
    excess = np.array(excess)
    assert (excess[:, 0] > 0).all()
    slopes = np.log2(excess[:-1, 0] / excess[1:, 0])
    assert (slopes > 3).all()
    assert (slopes < 5).all()
    # Along it the potential is the angle, whatever the elements: what is left is Gauss's rule on 1/ρ, of order six.
    left = np.abs(excess[:, 1])
    assert left[-1] < 1e-6
    assert (np.log2(left[:-1] / left[1:]) > 4).all()


def test_solid_ring_conducts_as_its_closed_form():
    flat = ring(48, 4)
    height = np.linspace(0, 0.5, 5)
    points = np.repeat(flat[:, :, None], 5, axis=2)
    points[..., 2] = height
    form = LatticeForm.of(points)
    conductance = form.energy(form.minimum({}, jump=1.0)).sum()
    assert conductance == pytest.approx(0.5 * np.log(3) / (2 * np.pi), rel=1e-6)
