"""Share the points of one compiled evaluation among threads; kernels release the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np


def in_chunks(run: Callable[[slice], None], count: int, at_least: int, block: int = 1) -> None:
    """Call `run` on slices that cover range(count), in parallel when each gets `at_least` points or more.

    Slices begin at multiples of `block`. Blocks are independent of each other, so the result does not depend on the
    number of threads.
    """
    workers = max(1, min(_processors(), count // at_least))
    if workers == 1:
        run(slice(0, count))
        return
    pieces = 4 * workers  # points cost unequally: small pieces even that out
    bounds = np.linspace(0, count, pieces + 1).astype(int) // block * block
    bounds[-1] = count
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(run, (slice(a, b) for a, b in pairwise(bounds))))


def _processors() -> int:
    """How many processors this process may use: fewer than the machine has in containers and under taskset."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
