"""Work shared among threads."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from magfem.threads import in_chunks, one_thread_for_algebra


@pytest.mark.parametrize("allowed", [{0}, {0, 1, 2}])
@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system knows no affinity")
def test_no_more_threads_than_allowed_processors(allowed, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: allowed)
    seen, threads = np.zeros(1000, dtype=int), set()

    def run(part: slice) -> None:
        threads.add(threading.get_ident())
        seen[part] += 1

    in_chunks(run, 1000, at_least=1)
    assert np.all(seen == 1) and len(threads) <= len(allowed)


def test_algebra_takes_one_thread_within_and_as_many_as_before_after():
    """Of every BLAS that is loaded, NumPy's and SciPy's own; a second time too."""
    import scipy.linalg  # noqa: F401

    def threads() -> list[int]:
        return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]

    before = threads()
    assert before
    for _ in range(2):
        with one_thread_for_algebra():
            assert set(threads()) == {1} and len(threads()) == len(before)
        assert threads() == before
