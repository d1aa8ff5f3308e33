"""The 2D formulation on a sphere, whose reaction field is known."""

from __future__ import annotations

import numpy as np
import pytest
from fem.sphere_device import Sphere

from magfem.fem import axisymmetric
from magfem.mesh import generate as generation
from magfem.mesh.generate import generate
from magfem.mesh.sizes import Sizes, Wanted


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.2)])
def test_sphere_of_high_recoil_permeability(offset, monkeypatch):
    """B inside and outside a sphere with µ = 3, centred and off the centre of the open boundary."""
    sphere = Sphere(permeability=3.0, offset=offset)
    monkeypatch.setattr(generation, "element_sizes", lambda *_: Wanted({"magnet": Sizes(0.05, 0.05)}, 0.15))
    mesh = generate(sphere, 2)
    solved = axisymmetric.solve(mesh, np.array([3.0]), np.array([[0.0, 0.0, 1.0]]))
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(300, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    points = np.array(offset) + direction * np.where(rng.random((300, 1)) < 0.5, 0.9, 1.5) * rng.uniform(
        0.8, 1, (300, 1)
    )
    found, truth = solved.currents.jet(points, 0)[0], sphere.B(points)
    assert np.abs(found - truth).max() <= 1e-5 * np.abs(truth).max()
    for key in ("moment", "boundary_moment"):
        assert solved.quantities[key][2] == pytest.approx(sphere.moment, rel=1e-5)
