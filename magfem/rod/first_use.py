"""The first rod on a machine: its kernels are compiled in a process of their own, beside those of the field.

Numba compiles one kernel at a time in a process. The two halves know nothing of each other and share the cache, so that
two processes are ready in little more than half the time.
"""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np

from magfem.compiled import cache_folder
from magfem.fields.uniform_field import UniformField
from magfem.rod.applied_field import AppliedField, DrivenField
from magfem.rod.load_kernel import field_loads
from magfem.rod.rod import Rod
from magfem.rod.sections import FlexibleSection, MagnetSection

log = logging.getLogger("magfem")

_STATEMENT = "from magfem.rod.first_use import compile_kernels; compile_kernels()"
_PATIENCE = 120  # s: whatever is not compiled by then is compiled here

_NO_DIPOLES = (np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))

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
    log.info("first use on this machine: compiling the kernels of rods, once, about 20 s")
    command = [sys.executable, "-P", "-c", _STATEMENT]  # -P: modules of the folder we are in stay out of it
    try:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except OSError:
        return
    try:
        if isinstance(applied, DrivenField):  # another field may be of any kind, and is the user's
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
    state = rod.solve(UniformField((0.0, 0.0, 0.0)), gravity=(0, 0, 0))
    state.sensitivity("moment")
    field_loads(*_NO_DIPOLES, state.frames, np.zeros((0, 0, 3)), np.zeros((0, 0, 3, 3)), np.zeros((1, 6, 0)))
    mark = _mark()
    if mark is not None:
        mark.touch()


def _mark() -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / "rods_compiled"
