"""What every benchmark prints: a small table, and where it ran."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter


def show(title: str, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a Markdown table."""
    cells = [[str(cell) for cell in row] for row in (header, *rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["| " + " | ".join(map(str.ljust, row, widths)) + " |" for row in cells]
    lines.insert(1, "| " + " | ".join("-" * width for width in widths) + " |")
    print(f"\n{title} ({os.cpu_count()} cores, Python {platform.python_version()})\n")
    print("\n".join(lines), flush=True)


def alternate(
    runs: Sequence[Callable[[], object]], repeats: int, clock: Callable[[], float] = perf_counter
) -> list[float]:
    """Median seconds of every run; they take turns, so that a noisy machine disturbs all alike."""
    seconds: list[list[float]] = [[] for _ in runs]
    for _ in range(repeats):
        for run, taken in zip(runs, seconds, strict=True):
            started = clock()
            run()
            taken.append(clock() - started)
    return [median(taken) for taken in seconds]
