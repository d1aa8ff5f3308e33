"""How long BigMag takes, with six and with fourteen coils: `python benchmarks/coil_systems.py`."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform
from tables import alternate, show

import magfem
from magfem.actuation import Target, find_currents, find_currents_and_joints, workspace_map

POINTS = np.array([[0.0, 0.0, 0.0], [0.01, 0.02, 0.005]])
JOINTS = np.array([0.3, -0.5])
MOMENT = [0.0, 0.0, 0.066]
TARGET = Target([0.01, 0, 0.005], moment=MOMENT, torque=[1e-3, 5e-4, 0], force=[0, 0, 0], within={"force": 5e-3})


def main() -> None:
    systems = [magfem.load_system(name) for name in ("bigmag", "bigmag_extended")]
    poses = RigidTransform.from_translation(POINTS)
    grid = systems[0].workspace.random_points(np.random.default_rng(1), 1000)
    rows = []
    jobs = {
        **{f"unit jets of order {k}, two points": lambda s, k=k: s.unit_jets(POINTS, JOINTS, k) for k in (0, 1, 2)},
        "their derivatives by the joints": lambda s: s.joint_jets(POINTS, currents[s.name], JOINTS, jets[s.name]),
        "B and gradient at two points, checked": lambda s: s.jet(POINTS, currents[s.name], JOINTS),
        "wrenches on two magnets": lambda s: s.wrench(MOMENT, poses, currents[s.name], JOINTS),
        "the same with all derivatives": lambda s: s.wrench_map(MOMENT, poses, currents[s.name], JOINTS),
        "currents of least norm for a torque": lambda s: find_currents(s, TARGET, JOINTS),
        "currents of least peak": lambda s: find_currents(s, TARGET, JOINTS, "least_peak"),
        "joints and currents, 16 starts": lambda s: find_currents_and_joints(s, TARGET),
        "workspace map, 1000 points": lambda s: workspace_map(s, grid, JOINTS, MOMENT),
    }
    currents = {s.name: np.linspace(-3, 5, len(s.coils)) for s in systems}
    jets = {s.name: s.unit_jets(POINTS, JOINTS, 2) for s in systems}
    for name, job in jobs.items():
        runs = [lambda s=s, job=job: job(s) for s in systems]
        alternate(runs, 2)
        rows.append([name, *map(_time, alternate(runs, 5 if "16 starts" in name or "1000" in name else 1000))])
    show("Coil systems, median", ["call", *(f"{len(s.coils)} coils" for s in systems)], rows)


def _time(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} µs" if seconds < 1e-3 else f"{seconds * 1e3:.3g} ms"


if __name__ == "__main__":
    main()
