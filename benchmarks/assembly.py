"""Our assembly against stock scikit-fem on the same curved mesh: `python benchmarks/assembly.py`.

Both make the stiffness and the load of the ring; tests/fem/test_stiffness.py holds them equal to rounding.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import skfem
from tables import alternate, show

import magfem
from magfem.fem.stiffness import _CURVED_ORDER, assemble, reference_forms
from magfem.mesh.generate import generate

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fem.test_stiffness import scikit_basis


def main() -> None:
    geometry = magfem.load_geometry("ring_magnet_4x1.5x1")
    rows = []
    for resolution in (0.5, 1.0):
        mesh = generate(geometry, 3, resolution)
        cells = mesh.cells.shape[0]
        permeability = np.where(mesh.body >= 0, 1.05, 1.0)
        magnetisation = np.where(mesh.body[:, None] >= 0, [0.0, 0.0, 1e6], 0.0)
        given, _ = scikit_basis(mesh)  # the translation of the mesh is not timed
        energy, load = reference_forms()

        def stock(mesh=given.mesh, mu=permeability, m=magnetisation, energy=energy, load=load, order=_CURVED_ORDER):
            basis = skfem.Basis(mesh, skfem.ElementTetP2(), intorder=order)
            constant = basis.with_element(skfem.ElementTetP0())
            vector = basis.with_element(skfem.ElementVector(skfem.ElementTetP0()))
            energy.assemble(basis, mu=constant.interpolate(mu))
            load.assemble(basis, m=vector.interpolate(m.ravel()))

        def own(mesh=mesh, mu=permeability, m=magnetisation):
            assemble(mesh, mu, m)

        own()
        ours, theirs = alternate([own, stock], 5)
        rows.append([f"{resolution:g}", cells, mesh.points.shape[0], f"{ours:.2f}", f"{theirs:.2f}"])
        rows[-1].append(f"{theirs / ours:.1f}")
    header = ["resolution", "tetrahedra", "unknowns", "magfem s", "scikit-fem s", "ratio"]
    show("Assembly, curved second-order tetrahedra, median of 5", header, rows)


if __name__ == "__main__":
    main()
