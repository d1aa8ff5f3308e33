"""How many threads: one compiled evaluation shares its points among them, small algebra takes one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from itertools import pairwise

import numpy as np
from threadpoolctl import ThreadpoolController


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


@contextmanager
def one_thread_for_algebra() -> Iterator[None]:
    """Within it, BLAS and LAPACK take one thread.

    A fit decomposes many small matrices, on which threads spend more time waiting for each other than working: with
    two of them on a busy machine of two cores more than ten times as long as one.
    """
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """The libraries loaded when they are first asked for: to look for them takes 2 ms, as long as a whole fit.

    SciPy brings its own copy of BLAS, which counts only when it has been loaded before.
    """
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


def _processors() -> int:
    """How many processors this process may use: fewer than the machine has in containers and under taskset."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
