"""Field models at a million points, next to magpylib's closed forms: `python benchmarks/field_evaluation.py`.

magpylib gives B of the rigid magnet (recoil permeability 1), on one core and without derivatives; it is timed on
fewer points and scaled. Both take turns in one process, and processor time is counted, so that a busy machine
disturbs little. On two idle cores magfem takes half of it in wall time; magpylib all of it.
"""

from __future__ import annotations

from time import process_time
from unittest.mock import patch

import magpylib
import numpy as np
from tables import alternate, show

import magfem

POINTS, FEWER, REPEATS = 1_000_000, 50_000, 5


def ring_segment(remanence: float) -> list[object]:
    """The ring as magpylib has it."""
    return [magpylib.magnet.CylinderSegment(dimension=(0.75e-3, 2e-3, 1e-3, 0, 360), polarization=(0, 0, remanence))]


def ring_difference(remanence: float) -> list[object]:
    """The ring as a cylinder less its bore: magpylib's faster way."""
    return [
        magpylib.magnet.Cylinder(dimension=(4e-3, 1e-3), polarization=(0, 0, remanence)),
        magpylib.magnet.Cylinder(dimension=(1.5e-3, 1e-3), polarization=(0, 0, -remanence)),
    ]


def rotor(remanence: float) -> list[object]:
    return [magpylib.magnet.Cylinder(dimension=(1e-3, 3e-3), polarization=(remanence, 0, 0))]


def main() -> None:
    rows = []
    for name, remanence, peers in (
        ("ring_magnet_4x1.5x1", 1.35, {"CylinderSegment": ring_segment, "Cylinder − Cylinder": ring_difference}),
        ("rotor_1x3", 1.42, {"Cylinder": rotor}),
    ):
        model = magfem.load_model(name)
        points = model.region.layers(np.random.default_rng(0), 1000, POINTS // 1000).reshape(-1, 3)
        few = points[:: POINTS // FEWER]

        def ours(order, model=model, points=points):
            with patch("os.cpu_count", return_value=1):
                model.jet(points, order)

        sources = {label: make(remanence) for label, make in peers.items()}
        runs = [lambda order=order: ours(order) for order in range(3)]
        runs += [lambda s=s, few=few: magpylib.getB(s, few, sumup=True) for s in sources.values()]
        alternate(runs, 1)
        seconds = alternate(runs, REPEATS, process_time)
        labels = ["magfem, B", "magfem, B + gradient", "magfem, B + gradient + hessian"]
        labels += [f"magpylib {label}, B" for label in sources]
        seconds[3:] = [taken * POINTS / FEWER for taken in seconds[3:]]
        fastest = min(seconds[3:])
        for label, taken in zip(labels, seconds, strict=True):
            rows.append([name, label, f"{taken:.2f}", f"{POINTS / taken / 1e6:.2f}", f"{fastest / taken:.1f}"])
    header = ["device", "what", "CPU s per 10⁶ points", "10⁶ points per CPU s", "times magpylib's fastest"]
    show(f"Field evaluation, median of {REPEATS}", header, rows)


if __name__ == "__main__":
    main()
