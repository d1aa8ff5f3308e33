"""From card to model file as whole processes: wall time and peak memory. `python benchmarks/end_to_end.py`.

Targets on 2 cores: 6 s for a body of revolution, 15 s in 3D, less than 2 GiB; the first use on a machine
compiles the kernels, which adds less than 40 s.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

from tables import show

JOBS = {
    "ring 4 × 1.5 × 1 mm, 2D": (["ring_magnet_4x1.5x1"], 6.0),
    "ring 4 × 1.5 × 1 mm, 3D": (["ring_magnet_4x1.5x1", "--dimension", "3"], 15.0),
    "rotor 1 × 3 mm, 3D": (["rotor_1x3"], 15.0),
}
REPEATS = 5


def fit(words: list[str], folder: str, cache: str | None = None) -> tuple[float, float]:
    """Wall seconds and peak MiB of one `magfem fit`."""
    environment = {key: value for key, value in os.environ.items() if cache is None or key != "NUMBA_CACHE_DIR"}
    if cache is not None:
        environment["XDG_CACHE_HOME"] = cache
    output = str(Path(folder) / "model.json")
    started = perf_counter()
    with open(os.devnull, "w") as nothing:
        process = os.posix_spawn(
            sys.executable,
            [sys.executable, "-m", "magfem", "fit", *words, "-o", output, "--quiet"],
            environment,
            file_actions=[(os.POSIX_SPAWN_DUP2, nothing.fileno(), 1)],
        )
        _, status, usage = os.wait4(process, 0)
    if os.waitstatus_to_exitcode(status):
        raise SystemExit("magfem fit failed")
    return perf_counter() - started, usage.ru_maxrss / 1024


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for words, _ in JOBS.values():
            fit(words, folder)  # kernels into their cache
        results: dict[str, list[tuple[float, float]]] = {name: [] for name in JOBS}
        for _ in range(REPEATS):
            for name, (words, _) in JOBS.items():
                results[name].append(fit(words, folder))
        rows = []
        for name, (_, target) in JOBS.items():
            seconds, memory = zip(*results[name], strict=True)
            rows.append([name, f"{median(seconds):.1f}", f"{min(seconds):.1f}–{max(seconds):.1f}", f"{target:.0f}"])
            rows[-1].append(f"{max(memory):.0f}")
        show(f"`magfem fit`, median of {REPEATS}", ["job", "seconds", "from–to", "target s", "peak MiB"], rows)
        warm = {name: median(taken for taken, _ in runs) for name, runs in results.items()}
        rows = []
        for name, (words, _) in JOBS.items():
            with tempfile.TemporaryDirectory() as cache:
                seconds, memory = fit(words, folder, cache)
            rows.append([name, f"{seconds:.1f}", f"{seconds - warm[name]:.1f}", f"{memory:.0f}"])
        show("First use, empty kernel cache, one run each", ["job", "seconds", "added", "peak MiB"], rows)


if __name__ == "__main__":
    main()
