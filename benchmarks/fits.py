"""How long fits take: `python benchmarks/fits.py`. Processor seconds of medians, on one thread where fits use one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from statistics import median
from time import perf_counter, process_time

import numpy as np
from tables import show

import magfem
from magfem.actuation.calibration import calibrate
from magfem.fields.terms import loops
from magfem.fitting import Recipe
from magfem.fitting.candidate import independent
from magfem.fitting.least_squares import solve_least_squares
from magfem.samples import Samples, SystemSamples
from magfem.threads import one_thread_for_algebra

REPEATS = 5


def timed(what: str, run: Callable[[], object], size: str, wanted: str) -> list[str]:
    """A row of the table."""
    run()
    wall, cpu = [], []
    for _ in range(REPEATS):
        started, used = perf_counter(), process_time()
        run()
        wall.append(perf_counter() - started)
        cpu.append(process_time() - used)
    return [what, size, f"{median(wall):.2f}", f"{median(cpu):.2f}", wanted]


def main() -> None:
    ring = magfem.load_geometry("ring_magnet_4x1.5x1")
    solution = magfem.solve(ring)
    rng = np.random.default_rng(0)
    points = ring.region.layers(rng, 100, 50).reshape(-1, 3)
    noisy = Samples(points, solution.B(points) + 1e-4 * rng.normal(size=points.shape), 1e-4)
    heights = 0.5e-3 * np.polynomial.legendre.leggauss(25)[0]
    centre = np.column_stack([np.zeros((50, 2)), np.tile(heights, 2)])
    fifty = independent("fifty", "", loops(centre, np.repeat([2e-3, 0.75e-3], 25), np.ones(50)))

    def bare() -> None:
        (columns,) = fifty.columns(points, 0)
        with one_thread_for_algebra():  # as all fits do
            solve_least_squares(columns.reshape(50, -1).T, noisy.B.ravel(), "evidence", most_condition=1e7)

    solenoid = magfem.load_geometry("solenoid_24x48x60")
    coil = magfem.solve(solenoid)
    front = replace(solenoid.region, clearance=5e-3, extent=125e-3, z=(30e-3, np.inf))
    system = magfem.load_system("octomag")
    places = rng.uniform(-5e-3, 5e-3, (125, 3))[rng.integers(125, size=20000)]
    currents = rng.uniform(-10, 10, (20000, 8))
    rows = SystemSamples(places, currents, system.B(places, currents) + 5e-5 * rng.normal(size=(20000, 3)), 5e-5)
    table = [
        timed("one least squares, columns and ridge included", bare, "5000 points, 50 loops", "1 s"),
        timed(
            "fit of samples, order chosen",
            lambda: magfem.fit(noisy, Recipe(geometry=ring)),
            "5000 points, 14–38 loops",
            "",
        ),
        timed("fit of a solution, order chosen", lambda: magfem.fit(solution), "4270 points, 14–26 loops", ""),
        timed(
            "family search, ring",
            lambda: magfem.fit(solution, Recipe(geometry=ring, family="search")),
            "28 candidates of 4 families",
            "10 s",
        ),
        timed(
            "family search, solenoid in front",
            lambda: magfem.fit(coil, Recipe(geometry=solenoid, region=front, family="search")),
            "candidates of 3 families",
            "10 s",
        ),
        timed("calibration of a system", lambda: calibrate(rows), "20 000 rows, 8 coils, degrees 1–6", ""),
    ]
    show(f"Fits, medians of {REPEATS}", ["job", "size", "wall s", "CPU s", "target"], table)


if __name__ == "__main__":
    main()
