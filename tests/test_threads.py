"""Work shared among threads."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest

from magfem.threads import in_chunks


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
