"""The first rod on a machine: its kernels are compiled in a process of their own, beside those of the field.

Numba compiles one kernel at a time in a process. The two halves know nothing of each other and share the cache, so that
two processes are ready in little more than half the time.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from magfem.compiled import cache_folder
from magfem.rod.applied_field import AppliedField
from magfem.rod.rod import Rod
from magfem.rod.sections import FlexibleSection, MagnetSection

_STATEMENT = "from magfem.rod.first_use import compile_kernels; compile_kernels()"
_PATIENCE = 120  # s: whatever is not compiled by then is compiled here

_ready = False


def compile_beside(applied: AppliedField | None) -> None:
    """Have the rod's kernels compiled elsewhere while those of the field are compiled here, if no cache holds them."""
    global _ready
    if _ready:
        return
    _ready = True
    mark = _mark()
    if mark is None or mark.exists() or not sys.executable:
        return
    command = [sys.executable, "-c", _STATEMENT]
    try:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except OSError:
        return
    try:
        if applied is not None:
            applied.jets(np.zeros((1, 3)))
        process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        process.kill()


def compile_kernels() -> None:
    """Compile all kernels of a rod but those of fields, and leave a mark beside the cache."""
    global _ready
    _ready = True
    rod = Rod(
        [FlexibleSection(length=1.0, radius=0.1, youngs_modulus=1.0, elements=2), MagnetSection(length=0, moment=1)]
    )
    rod.solve(_NoField(), gravity=(0, 0, 0)).sensitivity("moment")
    mark = _mark()
    if mark is not None:
        mark.touch()


class _NoField:
    """Zero everywhere, without a kernel of its own."""

    def jet(self, points: np.ndarray, order: int = 1, outside: str = "raise") -> tuple[np.ndarray, ...]:
        return tuple(np.zeros((len(points), *(3,) * rank)) for rank in (1, 2, 3))[: order + 1]


def _mark() -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / "rods_compiled"
